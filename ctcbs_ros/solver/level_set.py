"""All curves of steady states in a strip of one varying parameter, as one function's level set.

The states are h(tau, u) = 0 (`ctcbs_ros.kernels.continuation`). All of them are found on a set of
cuts tau = const, and each that no curve found so far passes through is traced both ways, through
all its folds, until it leaves the strip or closes.

A closed curve between two cuts surrounds an extremum of h, and its states are born in pairs where
an extremum of h over u crosses zero. So between two cuts another is made wherever an extremum that
has not crossed zero could do so by its height and slope, until that is settled.
"""

from math import exp, log

import numpy as np

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.extrema import local_extrema
from ctcbs_ros.kernels.search import MAX_STEPS, all_roots
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SCAN_TOLERANCE, correct_state

CUTS = 17
_MOST_POINTS = 4000
_MOST_ROOTS = 64
_MOST_EXTREMA = 32
# Halvings of the distance between two cuts: a closed curve shorter than 1/64 of it is left.
_HALVINGS = 6
# An extremum may approach zero this many times faster than its slope at the cut says.
_CAUTION = 2.0
# Points put between two of a trace, to tell whether it passes through a state.
_BETWEEN = 8


def curves(
    parameters: Parameters, family: Family, tau_low: float, tau_high: float,
    cuts: int = CUTS, tolerance: float = 1e-9,
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
        Cuts on which all states are found, at least.
    tolerance : float
        Of the integration.

    Returns
    -------
    list of (n, 4) ndarray
        tau, u = ln(end-mass radius), and the gradient (dh/du, dh/dtau) there, along each curve. A
        closed curve ends with the point it begins with.
    """
    found: list[np.ndarray] = []
    lines: list[np.ndarray] = []

    def look(tau):
        for u in states_at(parameters, family, tau):
            if any(passes(line, tau, u) for line in lines):
                continue
            points = whole(parameters, family, tau, u, tau_low, tau_high, tolerance)
            if len(points) > 1 and not any(_same(line, points) for line in lines):
                found.append(points)
                lines.append(dense(points))

    places = [float(tau) for tau in np.linspace(tau_low, tau_high, cuts)]
    for tau in (places[0], places[-1], *places[1:-1]):
        look(tau)
    unborn = [_unborn(parameters, family, tau) for tau in places]
    stack = [(places[i], unborn[i], places[i + 1], unborn[i + 1], 0) for i in range(cuts - 1)]
    while stack:
        left, at_left, right, at_right, depth = stack.pop()
        if depth == _HALVINGS or not _may_cross(at_left, at_right, right - left):
            continue
        middle = 0.5 * (left + right)
        look(middle)
        at_middle = _unborn(parameters, family, middle)
        stack += [
            (left, at_left, middle, at_middle, depth + 1),
            (middle, at_middle, right, at_right, depth + 1),
        ]
    return found


def _unborn(parameters, family, tau) -> np.ndarray:
    """Extrema of h over u that have not crossed zero: rows (u, distance to zero, its slope)."""
    rows = np.empty((_MOST_EXTREMA, 4))
    count = local_extrema(
        parameters.theta(), family.exponents(), parameters.length, family.length, tau,
        SCAN_TOLERANCE, rows,
    )
    rows = rows[:count]
    # A maximum below zero or a minimum above: -h kind is its distance to zero.
    distance = -rows[:, 1] * rows[:, 3]
    slope = -rows[:, 2] * rows[:, 3]
    waiting = distance > 0.0
    return np.column_stack([rows[waiting, 0], distance[waiting], slope[waiting], rows[waiting, 3]])


def _may_cross(at_left, at_right, width) -> bool:
    """Whether an extremum waiting on both sides of an interval could be beyond zero inside it.

    One that waits on one side alone has crossed: its states are found on the other side.
    """
    for u, distance, slope, kind in at_left:
        same = at_right[at_right[:, 3] == kind]
        if not len(same):
            continue
        _, other, back, _ = same[np.argmin(np.abs(same[:, 0] - u))]
        fall = max(-slope, 0.0) + max(back, 0.0)
        # Falling from both sides it gets no deeper than where both tangents meet.
        if slope < 0.0 < back and min(distance, other) < 0.5 * _CAUTION * fall * width:
            return True
    return False


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
            part = _cut(parameters, family, part, tau_low, tau_high, tolerance)
        if status == continuation.CLOSED:
            return np.vstack([part, part[:1]])
        halves.append(part)
    points = np.vstack([halves[0][:0:-1], halves[1]])
    # A curve that starts at the edge of the strip has its first point twice.
    moved = np.hypot(*np.diff(points[:, :2], axis=0).T) > 1e-9
    return points[np.concatenate([[True], moved])]


def _cut(parameters, family, points, tau_low, tau_high, tolerance) -> np.ndarray:
    """Move the last point of a trace, which lies outside the strip, onto its edge."""
    if len(points) < 2:
        return points[:0]
    edge = tau_low if points[-1, 0] < tau_low else tau_high
    share = (edge - points[-2, 0]) / (points[-1, 0] - points[-2, 0])
    guess = points[-2, 1] + share * (points[-1, 1] - points[-2, 1])
    there = family.at(parameters, edge)
    state = correct_state(there, exp(guess))
    if state is None:
        return points[:-1]
    u = log(state.end_mass_radius)
    # Between the edge and the point outside, an event may lie that is not in the strip.
    _, h_u, h_tau, status = continuation.level(
        there.theta(), family.exponents(), there.length, family.length, 0.0, u, tolerance,
        np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1),
    )
    if status != OK:
        return points[:-1]
    return np.vstack([points[:-1], (edge, u, h_u, h_tau)])


def dense(points: np.ndarray) -> np.ndarray:
    """A trace with points put between by cubics through its points and tangents, (m, 2)."""
    place, gradient = points[:, :2], points[:, 2:]
    tangent = np.column_stack([gradient[:, 0], -gradient[:, 1]])
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    chord = np.diff(place, axis=0)
    size = np.linalg.norm(chord, axis=1)[:, None]
    start = tangent[:-1] * np.sign(np.sum(tangent[:-1] * chord, axis=1))[:, None] * size
    end = tangent[1:] * np.sign(np.sum(tangent[1:] * chord, axis=1))[:, None] * size
    x = (np.arange(_BETWEEN) / _BETWEEN)[:, None, None]
    between = (
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * place[:-1] + x * (1.0 - x) ** 2 * start
        + x * x * (3.0 - 2.0 * x) * place[1:] - x * x * (1.0 - x) * end
    )
    return np.vstack([between.transpose(1, 0, 2).reshape(-1, 2), place[-1:]])


def passes(line: np.ndarray, tau: float, u: float) -> bool:
    """Whether a curve, as `dense` gives it, goes through (tau, u)."""
    a, along = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.sum(along * along, axis=1), 1e-300)
    gap = np.array([tau, u]) - a
    share = np.clip(np.sum(gap * along, axis=1) / square, 0.0, 1.0)
    away = np.linalg.norm(gap - share[:, None] * along, axis=1)
    # Steps of a trace turn by less than 12 degrees, the parts of one by 1.5.
    return bool(np.any(away < 0.02 * np.sqrt(square) + 1e-6))


def _same(line: np.ndarray, points: np.ndarray) -> bool:
    """Whether a curve just traced is one known already.

    Where a curve bends sharply the cubics of `dense` can miss a state on it, which is then traced
    anew; but they do not miss half of its points.
    """
    met = sum(passes(line, *point) for point in points[:, :2])
    return 2 * met > len(points)
