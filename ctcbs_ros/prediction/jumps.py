"""The nearest ends of the tracked branch, kept up to date from one orbit to the next."""

from dataclasses import dataclass, replace
from math import exp, expm1, isnan, log, nan

from ctcbs_ros.kernels.continuation import correct_fold
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.solver.branches import (
    ANGULAR_RATE,
    RADIUS_AT_SPEED,
    BranchEnd,
    Fold,
    beyond,
    branch_ends,
    family_between,
    landing,
)
from ctcbs_ros.solver.steady_state import TOLERANCE, SteadyState, correct_state

# A change of the flight (in ln) after which the branch is traced anew rather than corrected.
_RETRACE = 0.02
# A change of the end-mass radius (in ln) that may mean another branch.
_OTHER_BRANCH = 0.1


@dataclass(frozen=True)
class _End:
    end: BranchEnd
    landing_radius: float  # over the tow radius at the fold


class JumpFinder:
    """Nearest folds of a branch in angular rate and in radius, both ways."""

    def __init__(self):
        self._traced_at: SteadyState | None = None
        self._ends: list[_End] = []

    def reset(self) -> None:
        """Forget the branch (it was lost, or the end mass jumped)."""
        self._traced_at = None

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
        if self._traced_at is None or is_elsewhere(self._traced_at, state):
            self._retrace(state)
        ends = []
        for end in self._ends:
            corrected = self._corrected(end, state)
            if corrected is None:
                self._retrace(state)
                ends = self._ends
                break
            ends.append(corrected)
        return {
            family.name: self._nearest([e for e in ends if e.end.family is family])
            for family in (ANGULAR_RATE, RADIUS_AT_SPEED)
        }

    def _retrace(self, state: SteadyState) -> None:
        self._traced_at = state
        self._ends = []
        for end in branch_ends(state):
            after = landing(state.parameters, end.fold, end.family, end.direction)
            self._ends.append(_End(end, nan if after is None else after.end_mass_radius))

    def _corrected(self, known: _End, state: SteadyState) -> _End | None:
        """The same fold at the present parameters; None if it is not found near by."""
        p, before, end = state.parameters, self._traced_at.parameters, known.end
        # The fold itself moves little in absolute terms: its tau shifts by what has been flown.
        if end.family is ANGULAR_RATE:
            flown = log(p.omega / before.omega)
        else:
            flown = log(before.length / p.length)
        tau, u, good = correct_fold(
            p.theta(), end.family.exponents(), p.length, end.family.length,
            end.fold.tau - flown, log(end.fold.end_mass_radius), TOLERANCE,
        )
        if not good or tau * end.direction < 0.0:
            return None
        end = replace(end, fold=Fold(tau, exp(u)))
        if isnan(known.landing_radius):
            return _End(end, nan)
        there = beyond(p, end.fold, end.family, end.direction)
        after = correct_state(there, known.landing_radius, _OTHER_BRANCH)
        return None if after is None else _End(end, after.end_mass_radius)

    @staticmethod
    def _nearest(ends: list[_End]) -> Jump | None:
        if not ends:
            return None
        nearest = min(ends, key=lambda e: abs(e.end.fold.tau))
        tau = nearest.end.fold.tau
        tow_radius = exp(tau) if nearest.end.family is RADIUS_AT_SPEED else 1.0
        return Jump(exp(tau), expm1(tau), nearest.landing_radius * tow_radius)


def is_elsewhere(traced: SteadyState, state: SteadyState, reach: float = _RETRACE) -> bool:
    """Whether a state is far from one known before, by the flight (in ln) or by its branch."""
    return (
        family_between(traced.parameters, state.parameters)[1] > reach
        or abs(log(state.end_mass_radius / traced.end_mass_radius)) > _OTHER_BRANCH
        or (state.slope > 0.0) != (traced.slope > 0.0)
    )
