"""Hopf curves: where a pair of complex eigenvalues crosses into growth, in (omega, cable drag).

On the surface of steady states h = 0 over (ln omega, ln d_n, ln x_d) the real part of one pair is
a smooth function as long as the pair stays apart from others; h = Re lambda = 0 is a curve, and is
followed by arc length through folds and turning points until it leaves the range, closes, or its
frequency falls to zero (where it ends on a fold curve).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ctcbs_ros.kernels import fold_curve as kernel
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import FUNCTIONS, eigenvalues, vibration_matrix
from ctcbs_ros.solver.steady_state import TOLERANCE, describe
from ctcbs_ros.solver.surface import (
    DRAG_RANGE,
    OMEGA_RANGE,
    Surface,
    branches_from_above,
    checked_box,
)

# Functions a coordinate: on the look-out, and at least along the curve.
_SCAN_FUNCTIONS, _FEWEST = 8, 12
_RESOLVED = 5e-5  # change of the growth rate along a curve that more functions may still bring
_FARTHEST = 0.03  # |d eigenvalue| between neighbours of a curve that still is the same pair
_DIFFERENCE = 1e-4
_LEAST_FREQUENCY = 0.02
_MOST_POINTS = 1000
_LARGEST_STEP, _SMALLEST_STEP = 0.1, 1e-4
_CONVERGED = 1e-9


@dataclass(frozen=True)
class HopfCurve:
    """A curve of Hopf points in (omega, cable drag), at fixed length, end mass and drag ratio.

    Attributes
    ----------
    omega, cable_drag, end_mass_radius : (n,) ndarray
        Along the curve.
    frequency : (n,) ndarray
        |Im lambda| of the pair, per radian of orbit, in the rotating frame.
    leading : (n,) bool ndarray
        Whether every other mode in the band decays: there the state's stability changes.
    functions : int
        Functions a coordinate it was computed with.
    closed : bool
    """

    omega: np.ndarray
    cable_drag: np.ndarray
    end_mass_radius: np.ndarray
    frequency: np.ndarray
    leading: np.ndarray
    functions: int
    closed: bool


@dataclass(frozen=True)
class _Point:
    """A point of the curve: z, its pair, the gradients of h and of lambda by z."""

    z: np.ndarray
    pair: complex
    gradient: np.ndarray
    slopes: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        direction = np.cross(self.gradient, self.slopes.real)
        return direction / np.linalg.norm(direction)


def hopf_curves(
    parameters: Parameters,
    omega_range: tuple[float, float] = OMEGA_RANGE,
    drag_range: tuple[float, float] = DRAG_RANGE,
) -> tuple[HopfCurve, ...]:
    """Hopf curves in a range of omega and cable drag.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_range, drag_range : tuple of 2 floats

    Returns
    -------
    tuple of HopfCurve
        That of the largest drag first; empty where nothing flutters.

    Raises
    ------
    InputError
        If a range is empty or not positive.

    Notes
    -----
    A curve is met where it bounds the stable states (`leading`) on one of a set of drags,
    neighbours 1.6 times apart; from there it is followed wherever it goes.
    """
    low, high = checked_box(omega_range, drag_range)
    # Matrices this small only lose by a second thread.
    with one_blas_thread():
        found = _all_curves(Surface(parameters), low, high)
    return tuple(sorted(found, key=lambda curve: -curve.cable_drag.max()))


def _all_curves(surface: Surface, low, high) -> list[HopfCurve]:
    found: list[tuple[np.ndarray, np.ndarray, HopfCurve]] = []
    for seed, pair in _seeds(surface, low, high):
        start = _corrected(surface, seed, pair, _FEWEST)
        if start is None or not _inside(start.z, low, high):
            continue
        if any(_on(line, pairs, start) for line, pairs, _ in found):
            continue
        functions = _FEWEST
        while True:
            points, closed = _follow(surface, start, functions, low, high)
            more = _more_functions(surface, points, functions)
            if more is None:
                break
            functions = more
            start = _corrected(surface, start.z, start.pair, functions)
            if start is None or not _inside(start.z, low, high):
                points = []
                break
        if len(points) > 1:
            line = np.array([p.z for p in points])
            pairs = np.array([p.pair for p in points])
            found.append((line, pairs, _curve(surface, line, pairs, functions, closed)))
    return [curve for *_, curve in found]


def _seeds(surface: Surface, low, high):
    """Rough points (z, pair) between which a state gains or loses stability by flutter."""
    for delta, branches in branches_from_above(surface, low, high):
        for points in branches:
            before = None
            for tau, u in points[:, :2]:
                z = np.array([tau, delta, u])
                worst = _worst(surface, z)
                if worst is not None and before is not None and worst.real * before[1].real < 0.0:
                    pair = min(worst, before[1], key=lambda mode: abs(mode.real))
                    if pair.imag > _LEAST_FREQUENCY:
                        share = before[1].real / (before[1].real - worst.real)
                        yield before[0] + share * (z - before[0]), pair
                before = None if worst is None else (z, worst)


def _worst(surface: Surface, z) -> complex | None:
    """The least damped mode in the band, or None where there is none."""
    found = _eigenvalues(surface, z, _SCAN_FUNCTIONS)
    if found is None:
        return None
    values = found[0][(found[0].imag >= 0.0) & (found[0].imag <= found[1])]
    return complex(values[np.argmax(values.real)]) if values.size else None


def _more_functions(surface: Surface, points, functions: int) -> int | None:
    """How many functions the curve needs where it has too few; None where it has enough."""
    more = next((n for n in FUNCTIONS if n > functions), None)
    if more is None:
        return None
    for point in (points[0], points[len(points) // 2], points[-1]):
        mode = _mode(surface, point.z, more, point.pair)
        if mode is None or abs(mode[0].real - point.pair.real) > _RESOLVED:
            return more
    return None


def _eigenvalues(surface: Surface, z, functions: int):
    """All eigenvalues at z, and the band; None where the cable cannot be integrated."""
    parameters = surface.at(z[0], z[1])
    state = describe(parameters, float(z[2]))
    if state is None:
        return None
    return eigenvalues(state, functions), parameters.band


def _mode(surface: Surface, z, functions: int, near: complex):
    """The mode nearest to one known, by inverse iteration: lambda, right and left vector."""
    state = describe(surface.at(z[0], z[1]), float(z[2]))
    if state is None:
        return None
    matrix = vibration_matrix(state, functions)
    # Shifted a little aside: the matrix must not be singular where the guess is exact.
    factors = lu_factor(matrix - (near + 1e-7) * np.eye(len(matrix)), check_finite=False)
    right = left = np.ones(len(matrix), complex)
    value = near
    for _ in range(30):
        right = lu_solve(factors, right, check_finite=False)
        left = lu_solve(factors, left, trans=2, check_finite=False)
        right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
        before, value = value, left.conj() @ matrix @ right / (left.conj() @ right)
        if abs(value - before) < 1e-12 * max(abs(value), 1.0):
            break
    return complex(value), right, left


def _level(surface: Surface, z):
    out = np.empty(4)
    status = kernel.surface(*surface.arguments, z, TOLERANCE, *surface.work, out)
    return (out[0], out[1:]) if status == OK else None


def _linearised(surface: Surface, z, pair: complex, functions: int) -> _Point | None:
    """A point with its gradients: of h analytic, of the eigenvalue by its vectors.

    d lambda = y* dA x / (y* x), with the right and left eigenvectors x and y; dA is a difference.
    """
    level, mode = _level(surface, z), _mode(surface, z, functions, pair)
    if level is None or mode is None:
        return None
    value, right, left = mode
    slopes = np.empty(3, complex)
    for j in range(3):
        sides = []
        for shift in (-_DIFFERENCE, _DIFFERENCE):
            shifted = z.copy()
            shifted[j] += shift
            state = describe(surface.at(shifted[0], shifted[1]), float(shifted[2]))
            if state is None:
                return None
            sides.append(left.conj() @ vibration_matrix(state, functions) @ right)
        slopes[j] = (sides[1] - sides[0]) / (2.0 * _DIFFERENCE) / (left.conj() @ right)
    return _Point(z, value, level[1], slopes)


def _corrected(surface: Surface, z, pair: complex, functions: int) -> _Point | None:
    """Newton's method for h = Re lambda = 0 at this drag, from a guess."""
    z, near, free = np.array(z, float), pair, [0, 2]
    for _ in range(15):
        point = _linearised(surface, z, near, functions)
        if point is None:
            return None
        h, _ = _level(surface, z)
        matrix = np.array([point.gradient[free], point.slopes.real[free]])
        step = np.zeros(3)
        step[free] = -np.linalg.pinv(matrix) @ np.array([h, point.pair.real])
        size = float(np.linalg.norm(step))
        if size < 1e-6:
            return point
        step *= min(1.0, 0.1 / size)
        z = z + step
        near = point.pair + point.slopes @ step
    return None


def _stepped(surface: Surface, point: _Point, step: float, functions: int) -> _Point | None:
    """The next point of the curve: predicted along the tangent, corrected by chord steps."""
    inverse = np.linalg.pinv(np.array([point.gradient, point.slopes.real]))
    z = point.z + step * point.tangent
    near = point.pair + point.slopes @ (z - point.z)
    predicted = near
    moved = 0.0
    for _ in range(8):
        level, mode = _level(surface, z), _mode(surface, z, functions, near)
        if level is None or mode is None or abs(mode[0] - near) > _FARTHEST:
            return None
        pair = mode[0]
        change = -inverse @ np.array([level[0], pair.real])
        size = float(np.linalg.norm(change))
        moved += size
        if moved > 0.3 * abs(step):
            return None
        near = pair + point.slopes @ change
        z = z + change
        if size < _CONVERGED:
            break
    else:
        return None
    new = _linearised(surface, z, near, functions)
    return new if new is not None and abs(new.pair - predicted) < _FARTHEST else None


def _inside(z, low, high) -> bool:
    return bool(np.all(z[:2] >= low - 1e-9) and np.all(z[:2] <= high + 1e-9))


def _follow(surface: Surface, start: _Point, functions: int, low, high):
    """The curve both ways from a point, and whether it is closed."""
    halves = []
    for direction in (-1.0, 1.0):
        points, step, travelled = [start], 0.02, 0.0
        while len(points) < _MOST_POINTS and step >= _SMALLEST_STEP:
            now = points[-1]
            # The cross product keeps its sense along the curve.
            new = _stepped(surface, now, direction * step, functions)
            turn = 1.0 if new is None else 1.0 - float(new.tangent @ now.tangent)
            if turn > 0.05:
                step *= 0.5
                continue
            if new.pair.imag < _LEAST_FREQUENCY or new.pair.imag > surface.at(*new.z[:2]).band:
                break
            travelled += step
            if not _inside(new.z, low, high):
                edge = _on_edge(surface, now, new, functions, low, high)
                points += [edge] if edge is not None else []
                break
            points.append(new)
            home = np.linalg.norm(new.z - start.z) < 0.7 * step
            if travelled > 4.0 * step and home and new.tangent @ start.tangent > 0.5:
                return [*points, start], True
            if turn < 0.01:
                step = min(1.5 * step, _LARGEST_STEP)
        halves.append(points)
    return halves[0][:0:-1] + halves[1], False


def _on_edge(surface, now: _Point, new: _Point, functions, low, high) -> _Point | None:
    """The point between two where the curve leaves the range."""
    shares = [
        ((edge - now.z[j]) / (new.z[j] - now.z[j]), j, edge)
        for j in range(2)
        for edge in (low[j], high[j])
        if (now.z[j] - edge) * (new.z[j] - edge) < 0.0
    ]
    if not shares:
        return None
    share, axis, edge = min(shares)
    free = [j for j in range(3) if j != axis]
    z = now.z + share * (new.z - now.z)
    z[axis] = edge
    near = now.pair + share * (new.pair - now.pair)
    matrix = np.array([new.gradient, new.slopes.real])[:, free]
    for _ in range(8):
        level, mode = _level(surface, z), _mode(surface, z, functions, near)
        if level is None or mode is None:
            return None
        pair = mode[0]
        change = np.linalg.solve(matrix, -np.array([level[0], pair.real]))
        z[free] += change
        if np.abs(change).max() < _CONVERGED:
            return _Point(z, pair, new.gradient, new.slopes)
    return None


def _on(line, pairs, point: _Point) -> bool:
    """Whether a curve passes through a point with the same pair."""
    gap = np.linalg.norm(line - point.z, axis=1)
    i = int(np.argmin(gap))
    around = line[max(i - 1, 0) : i + 2]
    for a, b in pairwise(around):
        along = b - a
        share = float(np.clip((point.z - a) @ along / max(along @ along, 1e-300), 0.0, 1.0))
        near = np.linalg.norm(a + share * along - point.z) < 0.1 * np.linalg.norm(along) + 1e-3
        if near and abs(pairs[i] - point.pair) < 3.0 * _FARTHEST:
            return True
    return False


def _curve(surface: Surface, line, pairs, functions, closed) -> HopfCurve:
    leading = np.empty(len(line), bool)
    for i, (z, pair) in enumerate(zip(line, pairs, strict=True)):
        values, band = _eigenvalues(surface, z, functions)
        values = values[(values.imag >= 0.0) & (values.imag <= band)]
        others = np.delete(values, np.argmin(np.abs(values - pair)))
        leading[i] = bool(np.all(others.real < 0.0))
    omega, drag, radius = np.exp(line.T)
    return HopfCurve(omega, drag, radius, pairs.imag.copy(), leading, functions, closed)
