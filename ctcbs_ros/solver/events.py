"""Folds and extrema on a traced branch: zeros of one component of h's gradient along it.

Between two neighbours of a trace a zero shows as a change of sign. Two zeros between them do not;
but then the component comes near zero at one of the neighbours and turns back, and wherever a
parabola through three points says that it might touch, its extremum is looked for.
"""

import itertools

import numpy as np
from scipy.optimize import minimize_scalar

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import TOLERANCE

# Columns of a trace: dh/du vanishes at a fold, dh/dtau at an extremum of the end-mass radius.
FOLDS, EXTREMA = 2, 3
# The component (a cosine) may turn back from zero unseen only where it is smaller than this.
_SMALL = 0.3


class Line:
    """A traced branch as a smooth curve over its index; `at` gives the point at a place."""

    def __init__(self, parameters: Parameters, family: Family, rows: np.ndarray):
        self.rows = rows
        self.arguments = (
            parameters.theta(), family.exponents(), parameters.length, family.length
        )
        self.work = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)

    def at(self, place: float) -> np.ndarray | None:
        """(tau, u, dh/du, dh/dtau) on the branch; None where it is not met."""
        i = min(max(int(place), 0), len(self.rows) - 2)
        tau, u = self.rows[i, :2] + (place - i) * (self.rows[i + 1, :2] - self.rows[i, :2])
        tau, u, h_u, h_tau, _, good = continuation.project(
            *self.arguments, tau, u, TOLERANCE, *self.work
        )
        return np.array([tau, u, h_u, h_tau]) if good else None


def zeros(line: Line, column: int) -> list[tuple[float, float, float, bool]]:
    """Every zero of a component of the gradient.

    Parameters
    ----------
    line : Line
    column : int
        FOLDS or EXTREMA.

    Returns
    -------
    list of (place, tau, u, minimum)
        In the order of the branch; place is that of the point before. `minimum` tells whether u,
        as a function of tau, is least there (where the component is dh/dtau).
    """
    rows = line.rows
    cosine = rows[:, column] / np.hypot(rows[:, 2], rows[:, 3])
    places = np.arange(len(rows), dtype=float)
    for i in _turns_back(rows, cosine):
        found = minimize_scalar(
            lambda s: _size(line, s, column) * np.sign(cosine[i]),  # noqa: B023
            bounds=(i - 1.0, i + 1.0), method="bounded", options={"xatol": 1e-4, "maxiter": 40},
        )
        if found.fun < 0.0:
            places = np.append(places, found.x)
    ends = [(s, rows[int(s)] if s == int(s) else line.at(s)) for s in np.sort(places)]
    zeros_found = []
    for (s, a), (_, b) in itertools.pairwise(ends):
        if a is None or b is None or not a[column] * b[column] < 0.0:
            continue
        tau, u, good = continuation.zero_between(
            *line.arguments, TOLERANCE, np.ascontiguousarray([a, b]), column
        )
        if good:
            # d u/d tau = -h_tau/h_u goes from minus to plus with rising tau at a minimum.
            falls = -a[3] * np.sign(a[2]) * np.sign(b[0] - a[0]) < 0.0
            zeros_found.append((float(s), float(tau), float(u), bool(falls)))
    return zeros_found


def _turns_back(rows, cosine):
    """Points where a component is nearest to zero without crossing it, and may do so beside."""
    step = np.linalg.norm(np.diff(rows[:, :2], axis=0), axis=1)
    for i in range(1, len(rows) - 1):
        a, b, c = np.abs(cosine[i - 1 : i + 2])
        signs = np.sign(cosine[i - 1 : i + 2])
        if b > _SMALL or b > a or b > c or signs[0] != signs[1] or signs[1] != signs[2]:
            continue
        left, right = step[i - 1], step[i]
        slope_left, slope_right = (b - a) / left, (c - b) / right
        bend = (slope_right - slope_left) / (0.5 * (left + right))
        slope = (slope_left * right + slope_right * left) / (left + right)
        least = b - 0.5 * slope**2 / bend if bend > 0.0 else b
        if least < 0.5 * b or b < 0.02:
            yield i


def _size(line: Line, place: float, column: int) -> float:
    found = line.at(place)
    return 1.0 if found is None else found[column] / np.hypot(found[2], found[3])
