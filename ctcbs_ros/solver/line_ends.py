"""Where the branches of all states on a line end, each branch traced once.

On a line of points that one family connects, many states lie on one branch. It is traced from end
to end; between two folds it is a stretch on which tau only rises or falls, and every state on a
stretch ends in the same folds.
"""

from itertools import pairwise
from math import exp, log
from typing import NamedTuple

import numpy as np

from ctcbs_ros.kernels.continuation import LEFT_RANGE
from ctcbs_ros.solver.branches import branch_end, reach, traced
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.steady_state import SteadyState, correct_state

# Radii (in ln) of a state on a stretch and of the one it is; states of a pair that merges differ
# by more, or in the sign of their slope.
_SAME_STATE = 1e-6


def line_ends(
    states: list[tuple[SteadyState, ...]], family: Family, taus: np.ndarray
) -> list[np.ndarray]:
    """Nearest folds below and above of all states on a line.

    Parameters
    ----------
    states : list of k tuples of SteadyState
        All states of every point.
    family : Family
        Through all points.
    taus : (k,) ndarray
        Rising, of the points.

    Returns
    -------
    list of k (n, 2) ndarrays
        tau of the fold in which each state's branch ends with falling and with rising tau, less
        that of the state; nan where `branch_end` finds none within `reach`.
    """
    ends = [np.full((len(there), 2), np.nan) for there in states]
    reaches = [reach(there[0].parameters, family) if there else (0.0, 0.0) for there in states]
    low = min(tau - r[0] for tau, r in zip(taus, reaches, strict=True))
    high = max(tau + r[1] for tau, r in zip(taus, reaches, strict=True))
    left = {(k, i) for k, there in enumerate(states) for i in range(len(there))}
    while left:
        k, i = min(left)
        for stretch in _stretches(states[k][i], family, float(taus[k]), low, high):
            _take(stretch, states, family, taus, left, ends)
        if (k, i) in left:
            left.remove((k, i))
            for column, direction in enumerate((-1, 1)):
                fold = branch_end(states[k][i], family, direction, reaches[k][column])
                ends[k][i, column] = np.nan if fold is None else fold.tau
    for there, (down, up) in zip(ends, reaches, strict=True):
        there[(there[:, 0] < -down) | np.isnan(there[:, 0]), 0] = np.nan
        there[(there[:, 1] > up) | np.isnan(there[:, 1]), 1] = np.nan
    return ends


class _Stretch(NamedTuple):
    """A part of a branch on which tau rises: tau and u, which ends are folds, sign of dh/du."""

    line: np.ndarray
    folds: tuple[bool, bool]
    sign: float


def _stretches(state: SteadyState, family: Family, tau: float, low: float, high: float):
    """The whole branch of a state, fold to fold; empty where the trace is lost or closed."""
    line, folds = np.empty((0, 2)), np.empty(0, int)
    u = log(state.end_mass_radius)
    for direction in (-1, 1):
        _, half, at_fold, status = traced(
            state.parameters, u, family, direction, (low - tau, high - tau)
        )
        if status != LEFT_RANGE:
            return []
        if direction < 0:
            line, folds = half[:0:-1], len(half) - 1 - at_fold[::-1]
        else:
            folds = np.concatenate([folds, len(line) + at_fold])
            line = np.vstack([line, half])
    line[:, 0] += tau
    sign = np.sign(state.slope) * (-1.0) ** np.count_nonzero(folds < len(line) - len(half))
    cuts = [0, *folds.tolist(), len(line) - 1]
    stretches = []
    for n, (a, b) in enumerate(pairwise(cuts)):
        way = 1 if line[b, 0] > line[a, 0] else -1
        ends = (n > 0, n < len(cuts) - 2)
        stretches.append(_Stretch(line[a : b + 1][::way], ends[::way], sign * (-1.0) ** n))
    return stretches


def _take(stretch: _Stretch, states, family, taus, left, ends) -> None:
    """Give the ends of a stretch to all states on it."""
    tau, u = stretch.line.T
    for k in np.flatnonzero((taus >= tau[0]) & (taus <= tau[-1])):
        candidates = [
            i for i, state in enumerate(states[k])
            if (k, i) in left and state.slope * stretch.sign > 0.0
        ]  # fmt: skip
        if not candidates:
            continue
        m = min(max(int(np.searchsorted(tau, taus[k])), 1), tau.size - 1)
        rise = u[m] - u[m - 1]
        guess = u[m - 1] + rise * (taus[k] - tau[m - 1]) / (tau[m] - tau[m - 1])
        found = correct_state(states[k][0].parameters, exp(guess), abs(rise) + 1e-3)
        if found is None or found.slope * stretch.sign < 0.0:
            continue
        for i in candidates:
            if abs(log(found.end_mass_radius / states[k][i].end_mass_radius)) < _SAME_STATE:
                left.remove((k, i))
                ends[k][i] = [
                    end - taus[k] if is_fold else np.nan
                    for end, is_fold in zip(tau[[0, -1]], stretch.folds, strict=True)
                ]
