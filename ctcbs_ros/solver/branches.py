"""Branches of steady states: where one ends in a fold, what lies beyond, which one is flown.

A branch is followed along a `Family`, a one-parameter change of the flight that is a power law in
every non-dimensional parameter; tau is the logarithm of what varies. Two families are what a pilot
can do: change the angular rate at this radius, change the radius at this speed.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from math import exp, inf, log

import numpy as np

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.trajectory import D_N, N_THETA, OMEGA, D, G, M, W
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import (
    TOLERANCE,
    SteadyState,
    correct_state,
    steady_states,
)

_MOST_POINTS = 2000
_TRACE_TOLERANCE = 1e-8
# A search for the end of a branch pauses after this many points.
_PIECE = 20
# A state is looked for this far (in ln) beyond a fold, where the pair that merged is gone.
_BEYOND = 1e-4
# How far inside the present radius (in ln) the branch from straight flight is followed.
_INWARD = log(4.0)
# Radii closer than this (in ln) may be one state, found in two ways.
_SAME_STATE = 1e-3
_MOST_JUMPS = 5


@dataclass(frozen=True)
class Family:
    """Exponents of the parameters along a family.

    `elasticity` is that of the vibration, too; `rate`, that of Omega, scales the damping.
    """

    name: str
    omega: float = 0.0
    length: float = 0.0
    mass: float = 0.0
    cable_drag: float = 0.0
    end_mass_drag: float = 0.0
    elasticity: float = 0.0
    rate: float = 0.0

    def exponents(self) -> np.ndarray:
        """Exponents in the order of the kernels' theta, (8,)."""
        e = np.zeros(N_THETA)
        e[OMEGA] = self.omega
        e[M] = e[W] = self.mass
        e[D_N] = self.cable_drag
        e[D] = self.end_mass_drag
        e[G] = -self.elasticity
        return e

    def at(self, parameters: Parameters, tau: float) -> Parameters:
        """The parameters at tau; tau = 0 gives `parameters` themselves."""
        return replace(
            parameters,
            omega=parameters.omega * exp(self.omega * tau),
            length=parameters.length * exp(self.length * tau),
            end_mass=parameters.end_mass * exp(self.mass * tau),
            end_weight=parameters.end_weight * exp(self.mass * tau),
            cable_drag=parameters.cable_drag * exp(self.cable_drag * tau),
            drag_ratio=parameters.drag_ratio * exp((self.end_mass_drag - self.cable_drag) * tau),
            elasticity=parameters.elasticity * exp(self.elasticity * tau),
            vibration_elasticity=parameters.vibration_elasticity * exp(self.elasticity * tau),
            # The time constant of the line does not change, its product with Omega does.
            damping=parameters.damping * exp(self.rate * tau),
        )


# Angular rate (or speed) at fixed tow radius: omega = Omega sqrt(a / g).
ANGULAR_RATE = Family("angular_rate", omega=1.0, rate=1.0)
# Tow radius at fixed speed: lengths, masses and gamma are in units of a, d_n is proportional to a.
RADIUS_AT_SPEED = Family(
    "radius", omega=-0.5, length=-1.0, mass=-1.0, cable_drag=1.0, elasticity=-1.0, rate=-1.0
)


def family_between(start: Parameters, end: Parameters) -> tuple[Family, float]:
    """The family that leads from one parameter point to another, and the tau of the other.

    Air buoyancy of the cable (`density`) stays that of the start: it is no power law, and changes
    by parts in a thousand.
    """
    def ratio(name):
        before, after = getattr(start, name), getattr(end, name)
        # What is nothing or infinite (no drag, no stretch) is no power law, and stays.
        return log(after / before) if 0.0 < before < inf and 0.0 < after < inf else 0.0

    changes = {
        "omega": ratio("omega"),
        "length": ratio("length"),
        "mass": ratio("end_mass"),
        "cable_drag": ratio("cable_drag"),
        "end_mass_drag": ratio("end_mass_drag"),
        "elasticity": ratio("gamma") if start.elastic == end.elastic else 0.0,
        "rate": ratio("damping"),
    }
    distance = max(sum(change**2 for change in changes.values()) ** 0.5, 1e-12)
    scaled = {name: change / distance for name, change in changes.items()}
    return Family("between", **scaled), distance


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
    theta, exponents = parameters.theta(), family.exponents()
    points = np.empty((most_points, 4))
    status, count = continuation.trace(
        theta, exponents, parameters.length, family.length, log(end_mass_radius),
        float(direction), tau_range[0], tau_range[1], tolerance, points,
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


def drained(search: Generator):
    """What a search returns, once it has been run through."""
    while True:
        try:
            next(search)
        except StopIteration as found:
            return found.value


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
    omega = state.parameters.omega
    slowest = max(log(omega / 0.02), 0.1)
    fastest = max(log(4.0 / omega), log(2.5))
    ends = []
    for family, direction, reach in (
        (ANGULAR_RATE, -1, slowest),
        (ANGULAR_RATE, 1, fastest),
        (RADIUS_AT_SPEED, -1, log(4.0)),
        (RADIUS_AT_SPEED, 1, log(50.0)),
    ):
        fold = yield from branch_end_search(state, family, direction, reach)
        if fold is not None:
            ends.append(BranchEnd(fold, family, direction))
        yield
    return tuple(ends)


def beyond(parameters: Parameters, fold: Fold, family: Family, direction: int) -> Parameters:
    """The parameters just beyond a fold, where the pair of states that merged is gone."""
    return family.at(parameters, fold.tau + direction * _BEYOND)


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
    left = [s for s in steady_states(there).states if s.slope > 0.0]
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
        far += path.ahead.tau - _BEYOND
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
