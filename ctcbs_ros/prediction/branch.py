"""Which steady state is flown: acquisition, tracking through the history flown, jumps.

Which of several states an end mass is on depends on how it got there. The tracker follows the
state continuously from one orbit to the next; where its branch ends in a fold on the way, the end
mass jumps, and the tracker goes on with the state it lands on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import log

from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.family import family_between
from ctcbs_ros.solver.flown import (
    FlownBranch,
    branch_from_straight_flight,
    landing,
    match,
)
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState, correct_state, steady_states

MAIN, ISOLATED = "main", "isolated"
TABLE_AND_NEWTON = "table and Newton"
CONTINUATION = "continuation"
FULL_SOLVE = "full solve"
# With one state on hand, a change of ln(radius) up to this is the same state without a doubt.
_SAME = 0.05
_MOST_JUMPS = 5
# A change of the flight (in ln) too small to trace, and one after which a branch is named anew.
_STANDING = 1e-6
_RENAME = 0.1


@dataclass(frozen=True)
class Tracked:
    """The state flown, and what else there is.

    Attributes
    ----------
    state : SteadyState or None
        None where there is no solution; then `reason` says why.
    branch : str
        "main": the one met first by tightening from straight flight at this speed; "main, beyond n
        folds": the same curve further on; "isolated": not connected to straight flight.
    others : tuple of SteadyState
    method : str
        "table and Newton", "continuation" or "full solve".
    jumps : int
        Jumps on the way from the orbit before.
    reason : str
    """

    state: SteadyState | None
    branch: str
    others: tuple[SteadyState, ...]
    method: str
    jumps: int
    reason: str = ""


class BranchTracker:
    """Follows the end mass's state from orbit to orbit."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the history: the next orbit is a first acquisition."""
        self._state: SteadyState | None = None
        self._branch = MAIN
        self._count = 0
        self._named_at: Parameters | None = None
        self._straight: tuple[Parameters, FlownBranch] | None = None

    def update(self, parameters: Parameters, guesses: Sequence[float] | None) -> Tracked:
        """Find the state flown at the present parameters.

        Parameters
        ----------
        parameters : Parameters
        guesses : sequence of float, optional
            End-mass radii of all states from the table; None where it does not cover the point.

        Returns
        -------
        Tracked
        """
        states, method, reason = _all_states(parameters, guesses)
        if not states:
            self.reset()
            return Tracked(None, "", (), method, 0, reason)
        jumps = 0
        chosen = None
        if self._state is None:
            chosen = self._acquire(parameters, states)
        else:
            before = self._state.end_mass_radius
            if len(states) == 1 and abs(log(states[0].end_mass_radius / before)) < _SAME:
                chosen = 0
            else:
                followed, jumps = follow(self._state, parameters)
                if method == TABLE_AND_NEWTON and len(states) > 1:
                    method = CONTINUATION
                chosen = None if followed is None else match(states, followed.end_mass_radius)
                if chosen is None:
                    full = steady_states(parameters)
                    states, reason, method = full.states, full.reason, FULL_SOLVE
                    if followed is not None:
                        chosen = match(states, followed.end_mass_radius)
                    if chosen is None and states:
                        chosen = self._acquire(parameters, states)
        if chosen is None:
            self.reset()
            return Tracked(None, "", (), method, jumps, reason or "the branch was lost")
        if len(states) == 1:
            self._branch = MAIN
        elif jumps or len(states) != self._count or self._far_from_named(parameters):
            self._name(parameters, states, chosen)
        self._count = len(states)
        self._state = states[chosen]
        others = tuple(s for i, s in enumerate(states) if i != chosen)
        return Tracked(self._state, self._branch, others, method, jumps, reason)

    def _acquire(self, parameters: Parameters, states) -> int:
        """First acquisition: the branch connected to straight flight at this speed and length."""
        if len(states) == 1:
            return 0
        flown = self._from_straight_flight(parameters)
        chosen = match(states, flown.end_mass_radius)
        if chosen is None:
            # Nothing stable leads here from straight flight: the least radius that does not
            # diverge is the design state.
            chosen = next((i for i, state in enumerate(states) if state.slope > 0.0), 0)
        return chosen

    def _from_straight_flight(self, parameters: Parameters) -> FlownBranch:
        """`branch_from_straight_flight`, once for one orbit."""
        if self._straight is None or self._straight[0] != parameters:
            self._straight = parameters, branch_from_straight_flight(parameters)
        return self._straight[1]

    def _far_from_named(self, parameters: Parameters) -> bool:
        return self._named_at is None or family_between(self._named_at, parameters)[1] > _RENAME

    def _name(self, parameters: Parameters, states, chosen: int) -> None:
        self._named_at = parameters
        connected = self._from_straight_flight(parameters).connected
        flown = states[chosen : chosen + 1]
        folds = next((i for i, r in enumerate(connected) if match(flown, r) == 0), None)
        if folds is None:
            self._branch = ISOLATED
        else:
            self._branch = MAIN if folds == 0 else f"{MAIN}, beyond {folds} folds"


def follow(state: SteadyState, target: Parameters) -> tuple[SteadyState | None, int]:
    """Follow a state to other parameters, jumping where its branch ends on the way.

    Returns
    -------
    state : SteadyState or None
        None where a jump lands nowhere stable or the trace is lost.
    jumps : int
    """
    for jumps in range(_MOST_JUMPS):
        family, distance = family_between(state.parameters, target)
        if distance < _STANDING:
            return correct_state(target, state.end_mass_radius), jumps
        path = trace(
            state.parameters, state.end_mass_radius, family, 1, (-1e-3, distance), target=distance
        )
        if path.ahead is not None:
            state = landing(state.parameters, path.ahead, family, 1)
            if state is None:
                return None, jumps + 1
            continue
        if not path.crossings:
            return None, jumps
        return correct_state(target, path.crossings[0]), jumps
    return None, _MOST_JUMPS


def _all_states(parameters: Parameters, guesses: Sequence[float] | None):
    """All states, their method, and the reason if some are missing."""
    if guesses:
        corrected = [correct_state(parameters, guess) for guess in guesses]
        if all(state is not None for state in corrected):
            radii = [state.end_mass_radius for state in corrected]
            if all(b > a * (1.0 + 1e-6) for a, b in pairwise(radii)):
                return tuple(corrected), TABLE_AND_NEWTON, ""
    full = steady_states(parameters)
    return full.states, FULL_SOLVE, full.reason
