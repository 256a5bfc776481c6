"""Fold curves: the folds of steady states in (omega, cable drag), followed through their cusps.

They are curves h = h_u = 0 on the `surface` of states. Every one that crosses one of a set of
drags is met by finding all branches there (isolated ones included), every one that has a cusp by
looking for cusps near the steepest places of those branches; each is then followed by arc length
until it leaves the range.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from ctcbs_ros.kernels import fold_curve as kernel
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.surface import (
    DRAG_RANGE,
    OMEGA_RANGE,
    LocusPoint,
    Surface,
    branches_from_above,
    checked_box,
    point,
)

# Branches steeper than this (cosine of the gradient with the u axis) may be near a cusp.
_STEEP = 0.5


@dataclass(frozen=True)
class FoldCurve:
    """A curve of folds in (omega, cable drag), at fixed length, end mass and drag ratio.

    Attributes
    ----------
    omega, cable_drag, end_mass_radius : (n,) ndarray
        Along the curve.
    cusps : tuple of LocusPoint
        Where two folds merge, in the order of the curve.
    branch_points : tuple of LocusPoint
        Where, as drag changes, an isolated branch is born, vanishes or joins another branch.
    closed : bool
        Whether the curve is closed (its last point is its first).
    """

    omega: np.ndarray
    cable_drag: np.ndarray
    end_mass_radius: np.ndarray
    cusps: tuple[LocusPoint, ...]
    branch_points: tuple[LocusPoint, ...]
    closed: bool


def fold_curves(
    parameters: Parameters,
    omega_range: tuple[float, float] = OMEGA_RANGE,
    drag_range: tuple[float, float] = DRAG_RANGE,
) -> tuple[FoldCurve, ...]:
    """All fold curves in a range of omega and cable drag.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter; its drag ratio, length, end mass and elasticity are
        those of the curves.
    omega_range, drag_range : tuple of 2 floats

    Returns
    -------
    tuple of FoldCurve
        That of the largest drag first; empty where nothing folds.

    Raises
    ------
    InputError
        If a range is empty or not positive.
    """
    low, high = checked_box(omega_range, drag_range)
    surface = Surface(parameters)
    lines: list[np.ndarray] = []
    found = []
    for seed in _seeds(surface, low, high):
        if any(near(line, seed) for line in lines):
            continue
        curve, line = curve_through(surface, seed, low, high)
        if curve is not None:
            lines.append(line)
            found.append(curve)
    return tuple(sorted(found, key=lambda curve: -curve.cable_drag.max()))


def _seeds(surface: Surface, low, high):
    """Points on fold curves: the folds at a set of drags, and the cusps."""
    cusps: list[np.ndarray] = []
    for delta, branches in branches_from_above(surface, low, high):
        for points in branches:
            yield from folds_on(surface, delta, points, low, high)
            yield from add_cusps(surface, delta, points, low, high, cusps)


def folds_on(surface: Surface, delta: float, points, low, high):
    """The folds (tau, delta, u) of a branch traced at a drag, within the range."""
    c = points[:, 2] / np.hypot(points[:, 2], points[:, 3])
    for i in np.flatnonzero(c[:-1] * c[1:] < 0.0):
        share = c[i] / (c[i] - c[i + 1])
        tau, u = points[i, :2] + share * (points[i + 1, :2] - points[i, :2])
        z = surface.fold_with((tau, delta, u), 1)
        if z is not None and low[0] <= z[0] <= high[0] and surface.means_something(z):
            yield z


def add_cusps(surface: Surface, delta: float, points, low, high, known: list[np.ndarray]):
    """Add to those known the cusps near the steepest places of a branch; the new ones."""
    new = []
    c = points[:, 2] / np.hypot(points[:, 2], points[:, 3])
    for i in steepest(c):
        z = surface.cusp((points[i, 0], delta, points[i, 1]))
        inside = z is not None and np.all(z[:2] >= low) and np.all(z[:2] <= high)
        if not inside or any(np.abs(z - other).max() < 1e-5 for other in known):
            continue
        if surface.means_something(z):
            known.append(z)
            new.append(z)
    return new


def steepest(c: np.ndarray) -> np.ndarray:
    """Indices along a branch where it comes nearest to a fold, or is furthest beyond one.

    c : (n,) cosine of the gradient with the u axis, 0 at a fold.
    """
    inner, left, right = c[1:-1], c[:-2], c[2:]
    extreme = ((inner - left) * (right - inner) <= 0.0) & (np.abs(inner) < _STEEP)
    return np.flatnonzero(extreme) + 1


def curve_through(surface: Surface, seed, low, high):
    """The fold curve through a point within a box, and its line for `near`; (None, None) if lost.

    low, high : (2,) ln omega, ln d_n
    """
    points, closed = _follow(surface, seed, low, high)
    if len(points) < 2:
        return None, None
    return _curve(surface, points, closed), _dense(points[:, :3])


def _follow(surface: Surface, seed, low, high) -> tuple[np.ndarray, bool]:
    """The fold curve through a point, both ways: (n, 5), and whether it is closed."""
    halves = []
    for direction in (-1.0, 1.0):
        status, part = surface.trace(seed, direction, low, high)
        if status == kernel.CLOSED:
            return np.vstack([part, part[:1]]), True
        if status == kernel.LEFT_RANGE:
            part = _onto_edge(surface, part, low, high)
        halves.append(part)
    return np.vstack([halves[0][:0:-1], halves[1]]), False


def _onto_edge(surface: Surface, points, low, high) -> np.ndarray:
    """Move the last point, which lies outside the range, onto its edge."""
    if len(points) < 2:
        return points
    before, last = points[-2], points[-1].copy()
    shares = []
    for axis in range(2):
        for edge in (low[axis], high[axis]):
            if (before[axis] - edge) * (last[axis] - edge) < 0.0:
                share = (edge - before[axis]) / (last[axis] - before[axis])
                shares.append((share, axis, edge))
    if not shares:
        return points[:-1]
    share, axis, edge = min(shares)
    guess = before[:3] + share * (last[:3] - before[:3])
    guess[axis] = edge
    z = surface.fold_with(guess, axis)
    if z is None or np.abs(z - guess).max() > 0.2:
        return points[:-1]
    last[:3] = z
    last[3:] = before[3:] + share * (last[3:] - before[3:])
    return np.vstack([points[:-1], last])


def _dense(points) -> np.ndarray:
    """A curve with its steps cut to a tenth by a cubic spline through its points, (m, 3)."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    kept = np.concatenate([[True], np.diff(way) > 0.0])
    way, points = way[kept], points[kept]
    if len(way) < 4:
        return points
    fine = np.interp(np.linspace(0, len(way) - 1, 10 * len(way)), np.arange(len(way)), way)
    return CubicSpline(way, points)(fine)


def near(line: np.ndarray, z) -> bool:
    """Whether a curve passes through z."""
    i = int(np.argmin(np.linalg.norm(line - z, axis=1)))
    around = line[max(i - 1, 0) : i + 2]
    step = np.linalg.norm(np.diff(around, axis=0), axis=1).max() if len(around) > 1 else 0.0
    return bool(np.linalg.norm(line[i] - z) < 0.6 * step + 1e-4)


def _curve(surface: Surface, points, closed) -> FoldCurve:
    cusps, crossings = [], []
    for i in np.flatnonzero(points[:-1, 3] * points[1:, 3] < 0.0):
        z = surface.cusp(_between(points, i, 3))
        if z is not None:
            cusps.append(point(z))
    for i in np.flatnonzero(points[:-1, 4] * points[1:, 4] < 0.0):
        z = _branch_point(surface, points[i, :3], points[i + 1, :3])
        if z is not None:
            crossings.append(point(z))
    omega, drag, radius = np.exp(points[:, :3].T)
    return FoldCurve(omega, drag, radius, tuple(cusps), tuple(crossings), closed)


def _between(points, i, column) -> np.ndarray:
    share = points[i, column] / (points[i, column] - points[i + 1, column])
    return points[i, :3] + share * (points[i + 1, :3] - points[i, :3])


def _branch_point(surface: Surface, first, last):
    """The point of a fold curve between two of its points where h_tau = 0, or None."""
    def h_tau(share):
        found = surface.fold(first + share * (last - first))
        if found is None:
            raise ArithmeticError
        return found[1][0, 0]

    try:
        share = brentq(h_tau, 0.0, 1.0, xtol=1e-11)
    except (ArithmeticError, ValueError):
        return None
    return surface.fold(first + share * (last - first))[0]
