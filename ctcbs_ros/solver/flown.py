"""Which branch is flown: where a jump lands, and what straight flight leads to."""

from collections.abc import Generator
from dataclasses import dataclass
from math import log

from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.branches import BEYOND, Fold, beyond, trace
from ctcbs_ros.solver.family import RADIUS_AT_SPEED, Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states

# How far inside the present radius (in ln) the branch from straight flight is followed.
_INWARD = log(4.0)
# Radii closer than this (in ln) may be one state, found in two ways.
_SAME_STATE = 1e-3
_MOST_JUMPS = 5


def landing(
    parameters: Parameters, fold: Fold, family: Family, direction: int
) -> SteadyState | None:
    """The stable state that remains just beyond a fold, the nearest in ln(radius) if several.

    Parameters
    ----------
    parameters : Parameters
        At tau = 0.
    fold : Fold
    family : Family
    direction : int
        The way tau goes through the fold.

    Returns
    -------
    SteadyState or None
        None where no state beyond the fold is stable.

    Notes
    -----
    A steady-state rule: which of several stable states a real jump reaches is decided by the
    transient, which is not computed here.
    """
    return drained(landing_search(parameters, fold, family, direction))


def landing_search(
    parameters: Parameters, fold: Fold, family: Family, direction: int
) -> Generator[None, None, SteadyState | None]:
    """`landing` piece by piece."""
    there = beyond(parameters, fold, family, direction)
    left = steady_states(there).states
    for state in sorted(
        left, key=lambda s: abs(log(s.end_mass_radius / fold.end_mass_radius))
    ):
        yield
        if stability(state).stable:
            return state
    return None


@dataclass(frozen=True)
class FlownBranch:
    """The state reached by tightening the circle at constant speed from straight flight.

    Attributes
    ----------
    end_mass_radius : float
        Of the state expected to be flown; nan if a jump on the way lands nowhere stable.
    connected : tuple of float
        All states of the branch connected to a -> infinity, in the order in which it meets them.
    jumps : int
        Number of folds passed on the way, each with a jump.
    """

    end_mass_radius: float
    connected: tuple[float, ...]
    jumps: int


def branch_from_straight_flight(parameters: Parameters) -> FlownBranch:
    """Follow the branch connected to an infinite tow radius, at this speed and cable length.

    Parameters
    ----------
    parameters : Parameters
        At the present radius.

    Returns
    -------
    FlownBranch
    """
    far = _far_away(parameters)
    start = RADIUS_AT_SPEED.at(parameters, far)
    states = steady_states(start).states
    if len(states) != 1:
        return FlownBranch(float("nan"), (), 0)
    state, connected = states[0], None
    for jumps in range(_MOST_JUMPS):
        path = trace(
            start, state.end_mass_radius, RADIUS_AT_SPEED, -1, (-far - _INWARD, 0.05), target=-far
        )
        if connected is None:
            connected = path.crossings
        if path.ahead is None:
            flown = path.crossings[0] if path.crossings else float("nan")
            return FlownBranch(flown, connected, jumps)
        state = landing(start, path.ahead, RADIUS_AT_SPEED, -1)
        if state is None:
            return FlownBranch(float("nan"), connected, jumps + 1)
        far += path.ahead.tau - BEYOND
        if far <= 0.0:
            return FlownBranch(state.end_mass_radius, connected, jumps + 1)
        start = state.parameters
    return FlownBranch(float("nan"), connected, _MOST_JUMPS)


def _far_away(parameters: Parameters) -> float:
    """tau of a tow radius so large that the cable is towed almost straight behind."""
    return log(max(parameters.length / 0.02, parameters.omega**2 / 0.02**2, 2.0))


def match(states, end_mass_radius: float) -> int | None:
    """Index of the state nearest to an end-mass radius; None if none is within 0.1 %."""
    far = [abs(log(state.end_mass_radius / end_mass_radius)) for state in states]
    nearest = min(range(len(far)), key=far.__getitem__, default=None)
    return nearest if nearest is not None and far[nearest] < _SAME_STATE else None
