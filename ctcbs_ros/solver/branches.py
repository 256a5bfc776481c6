"""Branches of steady states along a family: traced through their folds, and where they end."""

from collections.abc import Generator
from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from ctcbs_ros.kernels import continuation
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import TOLERANCE, SteadyState, correct_state

_MOST_POINTS = 2000
_TRACE_TOLERANCE = 1e-8
# A search for the end of a branch pauses after this many points.
_PIECE = 20
# A state is looked for this far (in ln) beyond a fold, where the pair that merged is gone.
BEYOND = 1e-4


@dataclass(frozen=True)
class Fold:
    """A fold on a family: tau, and the end-mass radius (over the tow radius there)."""

    tau: float
    end_mass_radius: float


@dataclass(frozen=True)
class Path:
    """A stretch of a branch, traced from a state at tau = 0.

    Attributes
    ----------
    tau : (n,) ndarray
    end_mass_radius : (n,) ndarray
        Over the tow radius at each tau.
    folds : tuple of Fold
        In the order of the trace.
    crossings : tuple of float
        End-mass radii where the path meets tau = `target`, in the order of the trace.
    ahead : Fold or None
        The first fold, where the path meets it before it meets tau = `target`.
    status : int
        Of `ctcbs_ros.kernels.continuation.trace`.
    """

    tau: np.ndarray
    end_mass_radius: np.ndarray
    folds: tuple[Fold, ...]
    crossings: tuple[float, ...]
    ahead: Fold | None
    status: int


def trace(
    parameters: Parameters,
    end_mass_radius: float,
    family: Family,
    direction: int,
    tau_range: tuple[float, float],
    target: float | None = None,
    tolerance: float = _TRACE_TOLERANCE,
    most_points: int = _MOST_POINTS,
) -> Path:
    """Trace a branch through all its folds until it leaves the range of tau.

    Parameters
    ----------
    parameters : Parameters
        At tau = 0.
    end_mass_radius : float
        A steady state there.
    family : Family
    direction : int
        +1 or -1: the way tau goes first.
    tau_range : tuple of 2 floats
    target : float, optional
        tau at which the crossings are wanted.
    tolerance : float
        Local error of the integrations; the points' own error is about as large.
    most_points : int, optional
        Points after which the trace stops, its status FULL.

    Returns
    -------
    Path
    """
    points, line, at_fold, status = traced(
        parameters, log(end_mass_radius), family, direction, tau_range, tolerance, most_points
    )
    folds = tuple(Fold(float(line[k, 0]), exp(line[k, 1])) for k in at_fold)
    crossings = ()
    ahead = folds[0] if folds else None
    if target is not None:
        side = line[:, 0] - target
        meets = np.flatnonzero(side[:-1] * side[1:] < 0.0)
        there = family.at(parameters, target)
        crossings = tuple(_crossing(there, target, line[k : k + 2]) for k in meets)
        if folds and meets.size and meets[0] < at_fold[0]:
            ahead = None
    return Path(points[:, 0], np.exp(points[:, 1]), folds, crossings, ahead, status)


def traced(
    parameters: Parameters, u: float, family: Family, direction: int,
    tau_range: tuple[float, float], tolerance: float = _TRACE_TOLERANCE,
    most_points: int = _MOST_POINTS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """The points of a trace, and the same with its folds among them; arguments as of `trace`.

    Returns
    -------
    points : (n, 4) ndarray
        tau, u = ln(end-mass radius), dh/du and dh/dtau.
    line : (n + f, 2) ndarray
        tau and u, with those of the folds in their places.
    at_fold : (f,) ndarray of int
        Indices in `line` of the folds in range.
    status : int
        Of `ctcbs_ros.kernels.continuation.trace`.
    """
    theta, exponents = parameters.theta(), family.exponents()
    points = np.empty((most_points, 4))
    status, count = continuation.trace(
        theta, exponents, parameters.length, family.length, u, float(direction), *tau_range,
        tolerance, points,
    )
    points = points[:count]
    places, turns = [], []
    for i in np.flatnonzero(points[:-1, 2] * points[1:, 2] < 0.0):
        tau, u, good = continuation.fold(
            theta, exponents, parameters.length, family.length, TOLERANCE, points[i : i + 2]
        )
        if good:
            places.append(i + 1)
            turns.append((tau, u))
    # The folds take their places among the points: the path may meet the target just before one.
    places = np.array(places, int)
    line = np.insert(points[:, :2], places, np.array(turns).reshape(-1, 2), axis=0)
    at_fold = places + np.arange(places.size)
    at_fold = at_fold[(line[at_fold, 0] >= tau_range[0]) & (line[at_fold, 0] <= tau_range[1])]
    return points, line, at_fold, status


def _crossing(there: Parameters, target: float, chord: np.ndarray) -> float:
    """End-mass radius where a path meets tau = target between two points (tau, u)."""
    share = (target - chord[0, 0]) / (chord[1, 0] - chord[0, 0])
    rise = chord[1, 1] - chord[0, 1]
    guess = exp(chord[0, 1] + share * rise)
    # The chord's error can exceed the distance by which states are told apart.
    state = correct_state(there, guess, abs(rise) + 1e-3)
    return guess if state is None else state.end_mass_radius


def branch_end(state: SteadyState, family: Family, direction: int, reach: float) -> Fold | None:
    """The fold in which the branch of a state ends when tau goes one way; None within `reach`.

    Parameters
    ----------
    state : SteadyState
    family : Family
    direction : int
        +1 for rising tau, -1 for falling.
    reach : float
        How far to look, in tau.
    """
    return drained(branch_end_search(state, family, direction, reach))


def branch_end_search(
    state: SteadyState, family: Family, direction: int, reach: float
) -> Generator[None, None, Fold | None]:
    """`branch_end` piece by piece, for a caller who has other things to do in between."""
    parameters, radius, passed = state.parameters, state.end_mass_radius, 0.0
    while True:
        left = reach - passed
        tau_range = (-left, 1e-6) if direction < 0 else (-1e-6, left)
        path = trace(parameters, radius, family, direction, tau_range, most_points=_PIECE)
        if path.folds:
            return replace(path.folds[0], tau=path.folds[0].tau + direction * passed)
        if path.status != continuation.FULL:
            return None
        tau, radius = float(path.tau[-1]), float(path.end_mass_radius[-1])
        parameters, passed = family.at(parameters, tau), passed + direction * tau
        yield


@dataclass(frozen=True)
class BranchEnd:
    """An end of a branch: the fold, the family it lies on, and which way tau goes to it."""

    fold: Fold
    family: Family
    direction: int


def branch_ends(state: SteadyState) -> tuple[BranchEnd, ...]:
    """All ends of a state's branch in angular rate and in radius, both ways.

    Folds are looked for from omega 0.02 to 4 or to 2.5 times the present rate, whichever is more,
    and from a quarter of the present radius to 50 times it.
    """
    return drained(branch_ends_search(state))


def branch_ends_search(state: SteadyState) -> Generator[None, None, tuple[BranchEnd, ...]]:
    """`branch_ends` piece by piece."""
    ends = []
    for family in (ANGULAR_RATE, RADIUS_AT_SPEED):
        for direction, how_far in zip((-1, 1), reach(state.parameters, family), strict=True):
            fold = yield from branch_end_search(state, family, direction, how_far)
            if fold is not None:
                ends.append(BranchEnd(fold, family, direction))
            yield
    return tuple(ends)


def reach(parameters: Parameters, family: Family) -> tuple[float, float]:
    """How far down and up in tau the ends of a branch are looked for, see `branch_ends`."""
    if family is RADIUS_AT_SPEED:
        return log(4.0), log(50.0)
    omega = parameters.omega
    return max(log(omega / 0.02), 0.1), max(log(4.0 / omega), log(2.5))


def beyond(parameters: Parameters, fold: Fold, family: Family, direction: int) -> Parameters:
    """The parameters just beyond a fold, where the pair of states that merged is gone."""
    return family.at(parameters, fold.tau + direction * BEYOND)
