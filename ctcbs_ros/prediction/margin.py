"""The margins of the states of an orbit, each computed in full and kept while nothing moves.

A margin costs more than all the rest of an update. The modes are smooth functions of the flight
and of the end-mass radius, at a fold too, so that one computed in full holds nearby: its error per
radian of orbit is once or twice the distance in ln, a tenth of a percent for the state flown. The
number of functions that resolves them holds further.
"""

from math import inf, log
from typing import NamedTuple

from ctcbs_ros.prediction.jumps import is_on_another_branch
from ctcbs_ros.solver.family import family_between
from ctcbs_ros.solver.stability import Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState

# A change (in ln) of the flight or of the end-mass radius after which a margin is computed anew,
# and one after which it cannot wait where another one has been computed for the same orbit.
_NEARBY = 0.001
_AT_ONCE = 0.003
# The same for the number of functions, which is then sought anew.
_SAME_FUNCTIONS = 0.02


class _Known(NamedTuple):
    state: SteadyState
    stability: Stability
    resolved: SteadyState  # where as many functions were found to be enough


class Margins:
    """Stability of the states of an orbit, from orbit to orbit."""

    def __init__(self):
        self._known: list[_Known] = []

    def reset(self) -> None:
        """Forget all states: the next ones are computed in full."""
        self._known.clear()

    def update(self, states: tuple[SteadyState, ...]) -> tuple[Stability, ...]:
        """Stability of each state.

        Parameters
        ----------
        states : tuple of SteadyState
            The one flown first.

        Returns
        -------
        tuple of Stability
        """
        del self._known[len(states) :]
        computed = False
        for i, state in enumerate(states):
            known = self._known[i] if i < len(self._known) else None
            moved = inf if known is None else _moved(known.state, state)
            if moved > (_AT_ONCE if computed else _NEARBY):
                self._known[i : i + 1] = [_computed(state, known)]
                computed = True
        return tuple(known.stability for known in self._known)


def _computed(state: SteadyState, known: _Known | None) -> _Known:
    if (
        known is not None
        and known.stability.converged
        and _moved(known.resolved, state) <= _SAME_FUNCTIONS
    ):
        found = stability(state, functions=(known.stability.functions,))
        if found.converged:
            return _Known(state, found, known.resolved)
    return _Known(state, stability(state), state)


def _moved(known: SteadyState, state: SteadyState) -> float:
    """Change from one state to another, in ln; infinite where they are on different branches."""
    if is_on_another_branch(known, state):
        return inf
    radius = abs(log(state.end_mass_radius / known.end_mass_radius))
    return max(family_between(known.parameters, state.parameters)[1], radius)
