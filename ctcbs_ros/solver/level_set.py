"""All curves of steady states in a strip of one varying parameter, as one function's level set.

The states are h(tau, u) = 0 (`ctcbs_ros.kernels.continuation`). All of them are found on a set of
cuts tau = const, and each that no curve found so far passes through is traced both ways, through
all its folds, until it leaves the strip or closes.
"""

from math import exp, log

import numpy as np

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import all_roots
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SCAN_TOLERANCE, correct_state

_MOST_POINTS = 4000
_MOST_ROOTS = 64


def curves(
    parameters: Parameters, family: Family, tau_low: float, tau_high: float,
    cuts: int = 61, tolerance: float = 1e-9,
) -> list[np.ndarray]:
    """Every curve of steady states in a strip.

    Parameters
    ----------
    parameters : Parameters
        At tau = 0.
    family : Family
        What varies.
    tau_low, tau_high : float
    cuts : int
        Cuts on which all states are found.
    tolerance : float
        Of the integration.

    Returns
    -------
    list of (n, 4) ndarray
        tau, u = ln(end-mass radius), and the gradient (dh/du, dh/dtau) there, along each curve. A
        closed curve ends with the point it begins with.
    """
    found: list[np.ndarray] = []
    for tau in np.linspace(tau_low, tau_high, cuts):
        for u in states_at(parameters, family, float(tau)):
            if not any(passes(points, tau, u) for points in found):
                points = whole(parameters, family, float(tau), u, tau_low, tau_high, tolerance)
                if len(points):
                    found.append(points)
    return found


def states_at(parameters: Parameters, family: Family, tau: float) -> np.ndarray:
    """ln(end-mass radius) of all states on one cut, slack ones included."""
    there = family.at(parameters, tau)
    roots = np.empty(_MOST_ROOTS)
    count, _, _ = all_roots(there.theta(), there.length, SCAN_TOLERANCE, 1e-9, roots)
    return roots[:count]


def whole(
    parameters: Parameters, family: Family, tau: float, u: float, tau_low: float,
    tau_high: float, tolerance: float,
) -> np.ndarray:
    """The curve through a state, traced both ways and cut at the edges of the strip: (n, 4)."""
    start = family.at(parameters, tau)
    halves = []
    for direction in (-1.0, 1.0):
        points = np.empty((_MOST_POINTS, 4))
        status, count = continuation.trace(
            start.theta(), family.exponents(), start.length, family.length, u, direction,
            tau_low - tau, tau_high - tau, tolerance, points,
        )
        part = points[:count].copy()
        part[:, 0] += tau
        if status == continuation.LEFT_RANGE:
            part = _cut(parameters, family, part, tau_low, tau_high)
        if status == continuation.CLOSED:
            return np.vstack([part, part[:1]])
        halves.append(part)
    points = np.vstack([halves[0][:0:-1], halves[1]])
    # A curve that starts at the edge of the strip has its first point twice.
    moved = np.hypot(*np.diff(points[:, :2], axis=0).T) > 1e-9
    return points[np.concatenate([[True], moved])]


def _cut(parameters, family, points, tau_low, tau_high) -> np.ndarray:
    """Move the last point of a trace, which lies outside the strip, onto its edge."""
    if len(points) < 2:
        return points[:0]
    edge = tau_low if points[-1, 0] < tau_low else tau_high
    share = (edge - points[-2, 0]) / (points[-1, 0] - points[-2, 0])
    guess = points[-2, 1] + share * (points[-1, 1] - points[-2, 1])
    state = correct_state(family.at(parameters, edge), exp(guess))
    if state is None:
        return points[:-1]
    last = points[-1].copy()
    last[:2] = edge, log(state.end_mass_radius)
    return np.vstack([points[:-1], last])


def passes(points: np.ndarray, tau: float, u: float) -> bool:
    """Whether a traced curve goes through (tau, u)."""
    t = points[:, 0]
    inside = (np.minimum(t[:-1], t[1:]) <= tau + 1e-9) & (np.maximum(t[:-1], t[1:]) >= tau - 1e-9)
    for i in np.flatnonzero(inside):
        run = t[i + 1] - t[i]
        share = 0.5 if run == 0.0 else min(max((tau - t[i]) / run, 0.0), 1.0)
        near = points[i, 1] + share * (points[i + 1, 1] - points[i, 1])
        # The chord is this far from the curve at most: steps turn by less than 12 degrees.
        sag = 0.06 * np.hypot(run, points[i + 1, 1] - points[i, 1]) + 1e-6
        steep = abs(points[i, 3]) > 3.0 * abs(points[i, 2])
        if abs(near - u) < (4.0 if steep else 1.0) * sag:
            return True
    return False
