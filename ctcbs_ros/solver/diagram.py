"""Bifurcation diagrams: every branch in one varying parameter, and the events on it.

The states are the level set of one smooth function (`ctcbs_ros.kernels.continuation`). Every
branch in the range is met by finding all states on a set of cuts and tracing those that no branch
found so far passes through; an event is a zero of a smooth function along a branch.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import exp, log

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels import continuation
from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.level_set import curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import TOLERANCE, SteadyState, correct_state

_SMALLEST_OMEGA = 0.02

VARIED = {
    "omega": Family("omega", omega=1.0),
    "length": Family("length", length=1.0),
    "end_mass": Family("end_mass", mass=1.0),
    "cable_drag": Family("cable_drag", cable_drag=1.0, end_mass_drag=1.0),
    "drag_ratio": Family("drag_ratio", end_mass_drag=1.0),
}


@dataclass(frozen=True)
class DiagramPoint:
    """A state on a branch: the varied value, omega, end-mass radius, growth rate and frequency."""

    value: float
    omega: float
    end_mass_radius: float
    growth_rate: float
    frequency: float

    @property
    def stable(self) -> bool:
        """Whether every small disturbance in the band decays."""
        return self.growth_rate < 0.0


@dataclass(frozen=True)
class Event:
    """A fold, a Hopf point or an extremum: the varied value, omega, end-mass radius, frequency."""

    value: float
    omega: float
    end_mass_radius: float
    frequency: float = 0.0


@dataclass(frozen=True)
class DiagramBranch:
    """A branch within the range.

    Attributes
    ----------
    points : tuple of DiagramPoint
        Along the branch.
    folds, hopf, minima, maxima : tuple of Event
        Minima and maxima are those of the end-mass radius against the varied value.
    connected_to_zero : bool
        Whether the branch, followed in omega, leads to the state at omega -> 0.
    """

    points: tuple[DiagramPoint, ...]
    folds: tuple[Event, ...]
    hopf: tuple[Event, ...]
    minima: tuple[Event, ...]
    maxima: tuple[Event, ...]
    connected_to_zero: bool


def diagram(
    parameters: Parameters, family: Family, value: float, low: float, high: float,
    with_stability: bool = True,
) -> tuple[DiagramBranch, ...]:
    """All branches of a range of one parameter.

    Parameters
    ----------
    parameters : Parameters
        At `value` of the varied parameter.
    family : Family
        What varies.
    value, low, high : float
        The varied parameter: at `parameters`, and its range.
    with_stability : bool
        Growth rates and Hopf points are left out without it (nan).

    Returns
    -------
    tuple of DiagramBranch
        Those connected to omega -> 0 first.

    Raises
    ------
    InputError
        If the range is empty or not positive.
    """
    if not 0.0 < low < high < np.inf:
        raise InputError(f"range: {low:g} to {high:g} is not allowed, 0 < from < to is needed")
    tau_low, tau_high = log(low / value), log(high / value)
    traces = curves(parameters, family, tau_low, tau_high)
    branches = [
        _branch(parameters, family, value, points, with_stability)
        for points in traces
    ]
    return tuple(sorted(branches, key=lambda b: not b.connected_to_zero))


def first_minimum(branches) -> Event | None:
    """The first minimum of the end-mass radius on the branches connected to omega -> 0."""
    minima = [e for b in branches if b.connected_to_zero for e in b.minima]
    return min(minima, key=lambda e: e.value, default=None)


def _branch(parameters, family, value, points, with_stability) -> DiagramBranch:
    described = [
        _describe(parameters, family, value, tau, u, with_stability) for tau, u in points[:, :2]
    ]
    kept = [(row, d) for row, d in zip(points, described, strict=True) if d is not None]
    states = tuple(d for _, d in kept)
    rows = np.array([row for row, _ in kept])
    folds = _events(parameters, family, value, rows, 2)
    extrema = _events(parameters, family, value, rows, 3)
    minima, maxima = [], []
    for event, index in extrema:
        # d u/d tau = -h_tau/h_u goes from minus to plus with rising tau at a minimum.
        falls = -rows[index, 3] / rows[index, 2] * (rows[index + 1, 0] - rows[index, 0]) < 0.0
        (minima if falls else maxima).append(event)
    hopf = _hopf(parameters, family, value, rows, states) if with_stability else ()
    return DiagramBranch(
        states, tuple(e for e, _ in folds), hopf, tuple(minima), tuple(maxima),
        _connected(parameters, family, rows[len(rows) // 2]),
    )


def _state(parameters, family, tau, u) -> SteadyState | None:
    return correct_state(family.at(parameters, float(tau)), exp(u), max_step=0.05)


def _describe(parameters, family, value, tau, u, with_stability) -> DiagramPoint | None:
    state = _state(parameters, family, tau, u)
    if state is None:
        # At a fold Newton's method in u alone stalls; the trace's own point stands.
        return DiagramPoint(
            value * exp(tau), family.at(parameters, float(tau)).omega, exp(u), float("nan"), 0.0
        )
    growth, frequency = float("nan"), 0.0
    if with_stability:
        damping = stability(state)
        growth, frequency = damping.growth_rate, damping.frequency
    return DiagramPoint(
        value * exp(tau), state.parameters.omega, state.end_mass_radius, growth, frequency
    )


def _events(parameters, family, value, rows, column) -> list[tuple[Event, int]]:
    """Zeros of one component of the gradient along a branch, each with the index before it."""
    found = []
    for i in np.flatnonzero(rows[:-1, column] * rows[1:, column] < 0.0):
        tau, u, good = continuation.zero_between(
            parameters.theta(), family.exponents(), parameters.length, family.length, TOLERANCE,
            np.ascontiguousarray(rows[i : i + 2]), column,
        )
        if good:
            omega = family.at(parameters, tau).omega
            found.append((Event(value * exp(tau), omega, exp(u)), int(i)))
    return found


def _hopf(parameters, family, value, rows, states) -> tuple[Event, ...]:
    """Points where a pair of complex eigenvalues crosses the imaginary axis."""
    found = []
    for i, (a, b) in enumerate(pairwise(states)):
        if not (a.growth_rate * b.growth_rate < 0.0) or rows[i, 2] * rows[i + 1, 2] < 0.0:
            continue
        functions = None
        low, high = 0.0, 1.0
        g_low, g_high = a.growth_rate, b.growth_rate
        damping, state = None, None
        for _ in range(60):
            share = (low * g_high - high * g_low) / (g_high - g_low)
            share = min(max(share, low + 0.05 * (high - low)), high - 0.05 * (high - low))
            tau, u = rows[i, :2] + share * (rows[i + 1, :2] - rows[i, :2])
            state = _state(parameters, family, tau, u)
            if state is None:
                break
            damping = stability(state) if functions is None else stability(
                state, functions=(functions,)
            )
            # One number of functions for all: two numbers' growth rates differ by more than 1e-9.
            functions = functions or damping.functions
            if abs(damping.growth_rate) < 1e-12 or high - low < 1e-11:
                break
            if damping.growth_rate * g_low > 0.0:
                low, g_low = share, damping.growth_rate
            else:
                high, g_high = share, damping.growth_rate
        if state is not None and damping.frequency > 1e-6:
            found.append(
                Event(value * exp(tau), state.parameters.omega, state.end_mass_radius,
                      damping.frequency)
            )
    return tuple(found)


def _connected(parameters, family, row) -> bool:
    """Whether a state, followed in omega through all folds, leads to omega -> 0."""
    state = _state(parameters, family, row[0], row[1])
    if state is None:
        return False
    down = log(_SMALLEST_OMEGA / state.parameters.omega)
    if down >= 0.0:
        return True
    for direction in (-1, 1):
        path = trace(
            state.parameters, state.end_mass_radius, ANGULAR_RATE, direction,
            (down, max(log(6.0 / state.parameters.omega), 0.1)),
        )
        if path.tau.size and path.tau[-1] < down:
            return True
    return False
