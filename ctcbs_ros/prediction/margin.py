"""The margin of the state flown, converged at a fraction of its cost.

Two things about a margin change slowly from orbit to orbit. The difference between the converged
value and that of fewer functions: it is kept while the flight changes by a few percent. And the
modes themselves: near an orbit where their derivatives are known they are had by them.
"""

from dataclasses import replace
from functools import lru_cache
from math import inf, log

import numpy as np

from ctcbs_ros.prediction.jumps import is_elsewhere, is_on_another_branch
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, Family
from ctcbs_ros.solver.mode_sensitivity import Modes, modes
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import FUNCTIONS, Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState

# A change of the flight (in ln) after which the converged margin is computed again.
_RECHECK = 0.05
# A change of frequency, per radian of orbit, that may mean another mode.
_OTHER_MODE = 0.05

# A growth rate by its derivatives is off by about the distance (in ln) squared: it is believed up
# to this distance, and while that is at most this part of the growth rate, or nothing.
_FARTHEST = 0.03
_ERROR = 0.003
_NOTHING = 1e-5
# Beside a fold, and where two modes meet, a mode is a square root of the distance: believed while
# less than this part changes of the slope, which is 0 at a fold, and the mode moves by less than
# this part of its size and of the gap to other modes.
_LARGEST_CHANGE = 0.1
# Samples that the flight must take to leave that reach, for derivatives to be worth their cost.
_WORTH = 5.0
# A change (in ln) that is along none of the families, such as that of the cable's length.
_OTHER_CHANGE = 1e-4

AIR_DENSITY = Family("air density", cable_drag=1.0, end_mass_drag=1.0)
# By whether the steady state stretches; if not, the vibration's elasticity is a given number.
_FAMILIES = {
    True: (RADIUS_AT_SPEED, ANGULAR_RATE, AIR_DENSITY),
    False: (replace(RADIUS_AT_SPEED, elasticity=0.0), ANGULAR_RATE, AIR_DENSITY),
}


class MarginFollower:
    """Stability of a state from orbit to orbit.

    Attributes
    ----------
    renewed : bool
        Whether the derivatives were computed at the last update.
    """

    def __init__(self):
        self.renewed = False
        self.reset()

    def reset(self) -> None:
        """Forget the state: the next one is computed in full."""
        self._checked_at: SteadyState | None = None
        self._known: tuple[SteadyState, Modes] | None = None
        self._before: SteadyState | None = None
        self._fewer = 0

    def update(self, state: SteadyState, may_renew: bool = True) -> Stability:
        """Stability of a state, within 0.5 % of the converged one.

        Parameters
        ----------
        state : SteadyState
        may_renew : bool
            Whether this is the time for computing derivatives, if they are due; it need not be
            that for all states of an orbit at once.

        Returns
        -------
        Stability
        """
        self.renewed = False
        if self._checked_at is None or is_elsewhere(self._checked_at, state, _RECHECK):
            return self._check(state)
        now = self._with_fewer(state, may_renew)
        if abs(now[1] - self._coarse[1]) > _OTHER_MODE:
            return self._check(state)
        frequency = max(self._full.frequency + (now[1] - self._coarse[1]), 0.0)
        return replace(
            self._full,
            growth_rate=self._full.growth_rate + (now[0] - self._coarse[0]),
            frequency=frequency,
            band=max(state.parameters.band, frequency),
        )

    def _check(self, state: SteadyState) -> Stability:
        self._checked_at = state
        self._full = stability(state)
        fewer = FUNCTIONS[max(FUNCTIONS.index(self._full.functions) - 1, 0)]
        if fewer != self._fewer:
            self._known = None
        self._fewer = fewer
        self._coarse = self._with_fewer(state, False)
        return self._full

    def _with_fewer(self, state: SteadyState, may_renew: bool) -> tuple[float, float]:
        """Growth rate and frequency in the smaller number of functions."""
        found = None if self._known is None else _by_derivatives(*self._known, state)
        before, self._before = self._before, state
        if found is not None:
            return found
        # Derivatives cost as much as four values: they pay where the flight stays near by.
        if may_renew and before is not None and self._stays_near(before, state):
            self.renewed = True
            known = modes(state, self._fewer, _FAMILIES[state.parameters.elastic])
            if known is not None:
                self._known = state, known
                return _by_derivatives(state, known, state)
        now = stability(state, functions=(self._fewer,))
        return now.growth_rate, now.frequency

    def _stays_near(self, before: SteadyState, state: SteadyState) -> bool:
        change = _along_families(before, state)
        reach_squared = _reach_squared(self._full.growth_rate)
        return change is not None and _WORTH**2 * change[1] < reach_squared


def _by_derivatives(
    there: SteadyState, known: Modes, state: SteadyState
) -> tuple[float, float] | None:
    """Growth rate and frequency of a state's least damped mode, by the modes known at another.

    None where that is too far away.
    """
    change = _along_families(there, state)
    if change is None or is_on_another_branch(there, state):
        return None
    if abs(state.slope / there.slope - 1.0) > _LARGEST_CHANGE:
        return None
    tau, squared = change
    by_change = known.derivatives @ tau
    values = known.eigenvalues + by_change
    frequency = np.abs(values.imag)
    band = max(state.parameters.band, frequency.min())
    growth = np.where(frequency <= band, values.real, -inf)
    least = int(np.argmax(growth))
    if squared > _reach_squared(growth[least]):
        return None
    moved = np.abs(by_change)
    doubtful = moved > _LARGEST_CHANGE * np.minimum(known.gaps, np.abs(known.eigenvalues))
    if np.any(doubtful & (values.real + moved >= growth[least])):
        return None
    return float(growth[least]), float(frequency[least])


def _reach_squared(growth_rate: float) -> float:
    """Square of the distance to which derivatives are good enough for a growth rate."""
    return min(max(_ERROR * abs(growth_rate), _NOTHING), _FARTHEST**2)


def _along_families(there: SteadyState, state: SteadyState) -> tuple[np.ndarray, float] | None:
    """The tau of each family that lead from one state's flight to another's.

    Returns
    -------
    tau : (3,) ndarray
    squared : float
        Square of the distance, of all that changes, in ln.
    Or None where something else changes than what the families change.
    """
    start, end = there.parameters, state.parameters
    before, after = _logs(start), _logs(end)
    along, to_tau = _basis(start.elastic, tuple(value is not None for value in before))
    change = np.array(
        [0.0 if None in (a, b) else b - a for a, b in zip(before, after, strict=True)]
    )
    tau = to_tau @ change
    other = np.abs(change - along @ tau).max()
    # Weights without the air's buoyancy follow the masses.
    other = max(
        other,
        abs(end.density - start.density),
        abs(end.end_weight / end.end_mass - start.end_weight / start.end_mass),
    )
    return None if other > _OTHER_CHANGE else (tau, float(change @ change))


def _logs(p: Parameters) -> list[float | None]:
    """Logarithms of what families change; None for what is nothing or infinite and stays so."""
    values = (
        p.omega, p.length, p.end_mass, p.cable_drag, p.end_mass_drag, p.gamma, p.damping
    )  # fmt: skip
    return [log(value) if 0.0 < value < inf else None for value in values]


@lru_cache(maxsize=8)
def _basis(elastic: bool, changing: tuple[bool, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Changes of `_logs` by the tau of each family, (7, 3), and back, (3, 7)."""
    along = np.array(
        [
            (f.omega, f.length, f.mass, f.cable_drag, f.end_mass_drag, f.elasticity, f.rate)
            for f in _FAMILIES[elastic]
        ]
    ).T
    along[~np.array(changing)] = 0.0
    return along, np.linalg.pinv(along)
