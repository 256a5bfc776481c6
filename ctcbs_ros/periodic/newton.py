"""Newton's method for a periodic motion at a fixed number of elements and of times.

Collocation in time, finite elements along the cable. The elements are eliminated one after the
other from the end mass up, each with all times at once, so that the work is in proportion to their
number. A step is shortened until the same matrix has less to correct after it (Deuflhard, Newton
Methods for Nonlinear Problems, 3.3), and a factorisation serves as long as that falls fast.
"""

from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ctcbs_ros.kernels.cable_waves import element_matrix
from ctcbs_ros.periodic.elements import DEGREE, Elements, elements
from ctcbs_ros.periodic.forces import end_drag, forces
from ctcbs_ros.periodic.fourier import derivative, times
from ctcbs_ros.periodic.tow_path import TowPath
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.parameters import Parameters

# Longest last correction of any coefficient [a]; what is left is shorter still.
_TOLERANCE = 1e-9
# Where stiffness leaves no more digits: shorter than this, and no longer falling.
_ROUNDING = 1e-7
# A factorisation is kept while each correction is shorter than the one before by this.
_CONTRACTION = 0.2
# Longest correction made with a matrix from elsewhere, times `_CONTRACTION` [a].
_FAR = 0.5
# Longest correction made at once [a], and the least share of one that is tried.
_LONGEST, _LEAST_SHARE = 1.0, 0.05
_MOST_STEPS = 16
# Work of a correction, as a share of that of the factors, both for an element.
_CORRECTION = 0.1


def work(count: int) -> float:
    """Work of factorising an element at a number of times, that at a hundred times being 1.

    As measured from 7 to 49 times it goes by the square: the matrices are small.
    """
    return 1e-4 * count**2


@dataclass(frozen=True)
class Solved:
    """What Newton's method has found.

    Attributes
    ----------
    values : (k, 3, n) ndarray
    least_tension : float
    steps : int
        Matrices factorised.
    factors : list
        The last one's, to begin with nearby.
    """

    values: np.ndarray
    least_tension: float
    steps: int
    factors: list = field(default_factory=list, repr=False, compare=False)


def newton(
    parameters: Parameters, path: TowPath, guess: np.ndarray, factors: list | None = None
) -> Solved | None:
    """Correct a guess of the motion; None where that leads nowhere.

    Parameters
    ----------
    parameters : Parameters
    path : TowPath
    guess : (k, 3, n) ndarray
        Coefficients of the functions of `elements` at k times, k odd.
    factors : list, optional
        Of a motion nearby with as many times and elements: tried before any are made.
    """
    with one_blas_thread():
        return drained(newton_steps(parameters, path, guess, factors))


def newton_steps(
    p: Parameters, path: TowPath, guess: np.ndarray, factors: list | None = None
) -> Generator[float, None, Solved | None]:
    """As `newton`, piece by piece: yields the work of each, an element's factors or a correction.

    Work is counted in factorisations of an element at a hundred times, so that a search may be
    shared out by a measure that is the same each time it is run.
    """
    count, _, n = guess.shape
    by_element, by_correction = work(count), _CORRECTION * work(count) * n / DEGREE
    e = elements(p.length, n // DEGREE)
    when, first = times(count), derivative(count)
    _, velocity, acceleration = path.motion(when)
    velocity = velocity - [path.air_velocity, 0.0, 0.0]
    c = guess.copy()

    def corrected(factors, c):
        residual, _, _, least = _assembled(p, e, velocity, acceleration, first, c, False)
        change = -_substituted(factors, residual)
        return change, float(np.abs(change).max()), least

    def polished(factors, c, size, change, left, least):
        """Corrections with one matrix for as long as they fall fast; whether to the end."""
        yield by_correction
        while left < _CONTRACTION * size:
            c = c + change
            if left < _TOLERANCE:
                return c, least, True
            size = left
            change, left, least = corrected(factors, c)
            yield by_correction
        return c, least, False

    if factors:
        c, least, done = yield from polished(factors, c, _FAR, *corrected(factors, c))
        if done:
            return Solved(c, least, 0, factors)
    for step in range(1, _MOST_STEPS + 1):
        residual, damping, stiffness, least = _assembled(
            p, e, velocity, acceleration, first, c, True
        )
        factors = []
        for factored in _eliminated(e, p.end_mass, first, damping, stiffness):
            if factored is None:
                return None
            factors.append(factored)
            yield by_element
        change = -_substituted(factors, residual)
        size = float(np.abs(change).max())
        share = min(1.0, _LONGEST / size) if size > 0.0 else 1.0
        while True:
            again, left, least = corrected(factors, c + share * change)
            yield by_correction
            if left <= (1.0 - 0.25 * share) * size:
                break
            if size < _ROUNDING:
                return Solved(c, least, step, factors)
            share *= 0.5
            if not share >= _LEAST_SHARE:
                return None
        c = c + share * change
        if share == 1.0:
            c, least, done = yield from polished(factors, c, size, again, left, least)
            if done:
                return Solved(c, least, step, factors)
    return None


def _assembled(p, e: Elements, velocity, acceleration, first, c, wanted):
    """Residual (k, 3, n), and by element damping and stiffness (k, count, f, 3, f, 3)."""
    k = c.shape[0]
    rate = np.tensordot(first, c, 1)
    again = np.tensordot(first, rate, 1)
    here, moving, pushed = e.spread(c), e.spread(rate), e.spread(again)

    def at_points(coefficients, basis):
        return np.moveaxis(coefficients @ basis, 1, -1)  # (k, count, q, 3)

    v = at_points(moving, e.value) + velocity[:, None, None, :]
    local = forces(p, at_points(here, e.slope), v, at_points(moving, e.slope), wanted)
    ball, by_ball = end_drag(p, velocity + rate[:, :, 0])
    weighed = e.value * e.weights
    inertia = at_points(pushed, e.value) + acceleration[:, None, None, :]
    inertia[..., 2] += p.density / p.omega**2
    by_element = weighed @ (inertia + local.drag) + (e.slope * e.weights) @ local.pull
    residual = np.zeros((k, e.functions + 1, 3))
    for f in range(DEGREE + 1):
        residual[:, f : f + e.functions : DEGREE][:, : e.count] += by_element[:, :, f]
    residual[:, 0] += p.end_mass * (again[:, :, 0] + acceleration) + ball
    residual[:, 0, 2] += p.end_weight / p.omega**2
    residual = np.moveaxis(residual[:, :-1], 1, 2)
    if not wanted:
        return residual, None, None, local.least_tension

    def pairs(test, shape, field):
        products = (test[:, None] * shape[None, :] * e.weights).reshape(-1, e.weights.size)
        blocks = products @ field.reshape(k, e.count, -1, 9)
        blocks = blocks.reshape(k, e.count, DEGREE + 1, DEGREE + 1, 3, 3)
        return np.moveaxis(blocks, 3, 4)

    damping = pairs(e.value, e.value, local.drag_by_v)
    if p.damping:
        damping = damping + pairs(e.slope, e.slope, local.pull_by_rate)
    damping[:, 0, 0, :, 0, :] += by_ball
    stiffness = pairs(e.value, e.slope, local.drag_by_slope)
    stiffness = stiffness + pairs(e.slope, e.slope, local.pull_by_slope)
    return residual, damping, stiffness, local.least_tension


def _eliminated(e: Elements, end_mass, first, damping, stiffness):
    """Factors of the whole matrix, element by element; None for one that is singular."""
    second = first @ first
    k = first.shape[0]
    own, size = 3 * k * DEGREE, 3 * k * (DEGREE + 1)
    carried = None
    for i in range(e.count):
        mass = (e.value * e.weights) @ e.value.T
        if i == 0:
            mass[0, 0] += end_mass
        matrix = np.empty((size, size))
        element_matrix(first, second, mass, damping[:, i], stiffness[:, i], matrix)
        matrix = matrix.T
        if carried is not None:
            matrix[: 3 * k, : 3 * k] += carried
        lu, pivots, info = dgetrf(matrix[:own, :own])
        if info != 0:
            yield None
            return
        if i == e.count - 1:
            yield lu, pivots, None, None
            return
        below = matrix[own:, :own]
        beside, _ = dgetrs(lu, pivots, matrix[:own, own:])
        carried = matrix[own:, own:] - below @ beside
        yield lu, pivots, below, beside


def _substituted(factors, residual: np.ndarray) -> np.ndarray:
    """The solution for a right-hand side (k, 3, n), in that shape."""
    k, _, n = residual.shape
    # Functions, coordinates, times: as the matrices have them.
    right = np.ascontiguousarray(np.moveaxis(residual, 0, 2).swapaxes(0, 1)).reshape(n, 3 * k)
    right = right.reshape(len(factors), -1).copy()
    for i, (lu, pivots, below, _) in enumerate(factors):
        right[i], _ = dgetrs(lu, pivots, right[i])
        if below is not None:
            right[i + 1, : 3 * k] -= below @ right[i]
    for i in range(len(factors) - 2, -1, -1):
        right[i] -= factors[i][3] @ right[i + 1, : 3 * k]
    return np.moveaxis(right.reshape(n, 3, k), 2, 0).swapaxes(1, 2).copy()
