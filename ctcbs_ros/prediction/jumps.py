"""The nearest ends of the tracked branch, kept up to date from one orbit to the next.

Ends that are known are corrected at every orbit. Whether there are others by now is searched for
anew after every small change of the flight, a piece of the search an orbit.
"""

from collections.abc import Generator
from dataclasses import dataclass
from math import exp, expm1, isnan, log, nan

from ctcbs_ros.pieces import drained
from ctcbs_ros.prediction.fold import KnownFold, follow_fold, known_fold
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.solver.branches import beyond, branch_ends_search
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, family_between
from ctcbs_ros.solver.flown import landing_search
from ctcbs_ros.solver.steady_state import SteadyState, correct_state

# A change of the flight (in ln) after which the ends are searched for anew, piece by piece, and
# one after which that cannot wait.
_SEARCH_ANEW = 0.02
_SEARCH_AT_ONCE = 0.2
# A change of the end-mass radius (in ln) that may mean another branch.
_OTHER_BRANCH = 0.1


@dataclass(frozen=True)
class _End:
    known: KnownFold
    direction: int
    landing_radius: float  # over the tow radius at the fold; nan where nothing stable is left


class JumpFinder:
    """Nearest folds of a branch in angular rate and in radius, both ways."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the branch (it was lost, or the end mass jumped)."""
        self._searched_at: SteadyState | None = None
        self._before: SteadyState | None = None
        self._ends: list[_End] = []
        self._search: Generator | None = None
        self._search_from: SteadyState | None = None

    def update(self, state: SteadyState, may_end: bool = True) -> dict[str, Jump | None]:
        """Nearest jump in angular rate and in radius, each relative to the present value.

        Parameters
        ----------
        state : SteadyState
        may_end : bool
            False where the table knows that no branch ends anywhere near.

        Returns
        -------
        dict
            "angular_rate" and "radius": Jump with `at` and `landing_radius` in present units
            (at: over the present value; landing_radius: over the present tow radius), or None.
        """
        if not may_end:
            self.reset()
            return {"angular_rate": None, "radius": None}
        known = (
            self._before is not None
            and not is_on_another_branch(self._before, state)
            and _moved(self._searched_at, state) < _SEARCH_AT_ONCE
        )
        followed = _followed(self._ends, state) if known else None
        self._before = state
        if followed is None:
            self._search_at_once(state)
        else:
            self._ends = followed
            self._search_on(state)
        return {
            family.name: _nearest([e for e in self._ends if e.known.family is family])
            for family in (ANGULAR_RATE, RADIUS_AT_SPEED)
        }

    def _search_at_once(self, state: SteadyState) -> None:
        self._search = None
        self._searched_at, self._ends = state, drained(_ends_search(state))

    def _search_on(self, state: SteadyState) -> None:
        """One more piece of a search, where one is due."""
        if self._search is None:
            if _moved(self._searched_at, state) > _SEARCH_ANEW:
                self._search, self._search_from = _ends_search(state), state
            return
        try:
            next(self._search)
        except StopIteration as found:
            self._search = None
            followed = _followed(found.value, state)
            if followed is None:
                self._search_at_once(state)
            else:
                self._searched_at, self._ends = self._search_from, followed


def _ends_search(state: SteadyState) -> Generator[None, None, list[_End]]:
    """All ends of a state's branch and where the end mass lands beyond them, piece by piece."""
    p, found = state.parameters, []
    for end in (yield from branch_ends_search(state)):
        after = yield from landing_search(p, end.fold, end.family, end.direction)
        yield
        known = known_fold(p, end.family, end.fold)
        if known is not None:
            radius = nan if after is None else after.end_mass_radius
            found.append(_End(known, end.direction, radius))
    return found


def _followed(ends: list[_End], state: SteadyState) -> list[_End] | None:
    """The same ends at the present flight; None where one is not found any more."""
    p, found = state.parameters, []
    for end in ends:
        known = follow_fold(end.known, p)
        if known is None or known.fold.tau * end.direction < 0.0:
            return None
        radius = end.landing_radius
        if not isnan(radius):
            there = beyond(p, known.fold, known.family, end.direction)
            after = correct_state(there, radius, _OTHER_BRANCH)
            if after is None:
                return None
            radius = after.end_mass_radius
        found.append(_End(known, end.direction, radius))
    return found


def _nearest(ends: list[_End]) -> Jump | None:
    if not ends:
        return None
    nearest = min(ends, key=lambda e: abs(e.known.fold.tau))
    tau = nearest.known.fold.tau
    tow_radius = exp(tau) if nearest.known.family is RADIUS_AT_SPEED else 1.0
    return Jump(exp(tau), expm1(tau), nearest.landing_radius * tow_radius)


def is_elsewhere(known: SteadyState, state: SteadyState, reach: float) -> bool:
    """Whether a state is far from one known before, by the flight (in ln) or by its branch."""
    return _moved(known, state) > reach or is_on_another_branch(known, state)


def _moved(known: SteadyState, state: SteadyState) -> float:
    """Change of the flight (in ln) from one state to another."""
    return family_between(known.parameters, state.parameters)[1]


def is_on_another_branch(known: SteadyState, state: SteadyState) -> bool:
    """Whether two states of nearly the same flight look like those of different branches."""
    return (
        abs(log(state.end_mass_radius / known.end_mass_radius)) > _OTHER_BRANCH
        or (state.slope > 0.0) != (known.slope > 0.0)
    )
