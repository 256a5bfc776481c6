"""Least cable drag for unique and for stable solutions (thesis Chapters 3 and 4).

Drag varies at a fixed drag ratio. "Stable" is asked twice: of the state at the first minimum of
the end-mass radius, as the thesis does, and of every state of the branch connected to omega -> 0
up to a limit of omega. Either way a growth rate is a function of drag alone, and its first zero
from above is the answer.
"""

from dataclasses import dataclass, replace
from math import exp, inf, isfinite, log

from ctcbs_ros.solver.cusp import OMEGA_MAX, least_unique_drag
from ctcbs_ros.solver.first_minimum import FirstMinimum
from ctcbs_ros.solver.main_branch import largest_growth
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import FUNCTIONS, stability
from ctcbs_ros.solver.stability_loss import SAMPLED, first_zero_from_above

# How far above a drag, in its logarithm, it is asked what there is just above it.
_ABOVE = 1e-3


@dataclass(frozen=True)
class CriticalDrag:
    """Least cable drag above which solutions are unique and stable.

    None where none is needed: the condition holds at every drag in `DRAG_RANGE`. inf where none
    suffices: it fails at the largest.

    Attributes
    ----------
    unique : float or None
        Every omega up to the limit has one state.
    stable : float or None
        The state at the first minimum of the end-mass radius is stable (thesis Fig. 4.2): that of
        least omega on the branch connected to omega -> 0 or, where it has none, the one followed
        from larger drag onto the branch that has parted from it.
    stable_everywhere : float or None
        Every state on the branch connected to omega -> 0 is stable, up to the limit of omega; None
        also where it was not asked for.
    minimum_ends : bool
        Just above `stable` the end-mass radius has no minimum at all: it is where the minimum
        ceases, not where it becomes stable.
    """

    unique: float | None
    stable: float | None
    stable_everywhere: float | None
    minimum_ends: bool = False

    @property
    def required(self) -> float | None:
        """The larger of `unique` and `stable`."""
        known = [d for d in (self.unique, self.stable) if d is not None]
        return max(known, default=None)


def critical_drag(
    parameters: Parameters, omega_max: float = OMEGA_MAX, everywhere: bool = False
) -> CriticalDrag:
    """Least cable drag for unique and for stable solutions at a fixed drag ratio.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float
        Limit of omega for `unique` and `stable_everywhere`; the first minimum counts wherever it
        is.
    everywhere : bool
        `stable_everywhere` costs more than the others and is left out (None) without this.

    Returns
    -------
    CriticalDrag
    """
    minimum = FirstMinimum(parameters)
    stable = _least_stable_drag(minimum)
    return CriticalDrag(
        least_unique_drag(parameters, omega_max),
        stable,
        least_drag_stable_everywhere(parameters, omega_max) if everywhere else None,
        stable is not None and isfinite(stable) and minimum.at(log(stable) + _ABOVE) is None,
    )


def least_stable_drag(parameters: Parameters) -> float | None:
    """Least drag above which the state at the first minimum of the radius is stable.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.

    Returns
    -------
    float or None
        None where it is stable at every drag, inf where it is not at the largest.

    Notes
    -----
    The largest drag at which it is not. The first minimum is that of least omega on the branch
    connected to omega -> 0; where that has none up to omega 30, the one that is followed from
    larger drag onto the branch that has parted from it. Without either nothing is unstable.
    """
    return _least_stable_drag(FirstMinimum(parameters))


def _least_stable_drag(minimum: FirstMinimum) -> float | None:
    def growth(delta, functions, near):
        state = minimum.at(delta)
        if state is None:
            return -inf, None
        return stability(state, functions=(functions,)).growth_rate, None

    return first_zero_from_above(growth, minimum.drags(SAMPLED), FUNCTIONS[1])


def least_drag_stable_everywhere(
    parameters: Parameters, omega_max: float = OMEGA_MAX
) -> float | None:
    """Least drag above which the branch connected to omega -> 0 is all stable; None, inf as above.
    """
    def growth(delta, functions, near):
        there = replace(parameters, cable_drag=exp(delta))
        return largest_growth(there, omega_max, functions, near)

    return first_zero_from_above(growth, SAMPLED, FUNCTIONS[0])
