"""Newton's method for a periodic motion at a fixed number of elements and of times.

Collocation in time, finite elements along the cable. A step is shortened until the same matrix has
less to correct after it (Deuflhard, Newton Methods for Nonlinear Problems, 3.3), and a
factorisation serves as long as that falls fast.
"""

from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np

from ctcbs_ros.periodic.elements import DEGREE, Elements, elements
from ctcbs_ros.periodic.factors import Factors, Storage
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
    factors : Factors, optional
        The last one's, to begin with nearby.
    """

    values: np.ndarray
    least_tension: float
    steps: int
    factors: Factors | None = field(default=None, repr=False, compare=False)


def newton(
    parameters: Parameters, path: TowPath, guess: np.ndarray, factors: Factors | None = None
) -> Solved | None:
    """Correct a guess of the motion; None where that leads nowhere.

    Parameters
    ----------
    parameters : Parameters
    path : TowPath
    guess : (k, 3, n) ndarray
        Coefficients of the functions of `elements` at k times, k odd.
    factors : Factors, optional
        Of a motion nearby with as many times and elements: tried before any are made.
    """
    with one_blas_thread():
        return drained(newton_steps(parameters, path, guess, factors))


def newton_steps(
    p: Parameters, path: TowPath, guess: np.ndarray, factors: Factors | None = None,
    storage: Storage | None = None,
) -> Generator[float, None, Solved | None]:  # fmt: skip
    """As `newton`, piece by piece: yields the work of each, an element's factors or a correction.

    Work is counted in factorisations of an element at a hundred times, so that a search may be
    shared out by a measure that is the same each time it is run. Factors are made in `storage`,
    where there is one.
    """
    count, _, n = guess.shape
    by_element, by_correction = work(count), _CORRECTION * work(count) * n / DEGREE
    e = elements(p.length, n // DEGREE)
    when, first = times(count), derivative(count)
    _, velocity, acceleration = path.motion(when)
    velocity = velocity - [path.air_velocity, 0.0, 0.0]
    c = guess.copy()

    def corrected(factors, c):
        residual, least = _assembled(p, e, velocity, acceleration, first, c)
        change = -factors.solved(residual)
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

    if factors is not None and not factors.lost:
        c, least, done = yield from polished(factors, c, _FAR, *corrected(factors, c))
        if done:
            return Solved(c, least, 0, factors)
    for step in range(1, _MOST_STEPS + 1):
        residual, least = _assembled(p, e, velocity, acceleration, first, c)
        derivatives = _derivatives(p, e, velocity, first, c)
        factors = Factors(storage)
        for made in factors.made(e, p.end_mass, first, derivatives):
            if not made:
                return None
            yield by_element
        change = -factors.solved(residual)
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


def _at_points(e: Elements, velocity, first, c):
    """Slope, velocity through the air and rate of the slope, (k, count, q, 3) each."""
    here, moving = e.spread(c), e.spread(np.tensordot(first, c, 1))
    v = _values(moving, e.value) + velocity[:, None, None, :]
    return _values(here, e.slope), v, _values(moving, e.slope)


def _values(coefficients, basis):
    return np.moveaxis(coefficients @ basis, 1, -1)  # (k, count, q, 3)


def _assembled(p, e: Elements, velocity, acceleration, first, c):
    """Residual, (k, 3, n), and the least tension."""
    rate = np.tensordot(first, c, 1)
    again = np.tensordot(first, rate, 1)
    local = forces(p, *_at_points(e, velocity, first, c), False)
    inertia = _values(e.spread(again), e.value) + acceleration[:, None, None, :]
    inertia[..., 2] += p.density / p.omega**2
    by_element = (e.value * e.weights) @ (inertia + local.drag)
    by_element += (e.slope * e.weights) @ local.pull
    residual = np.zeros((c.shape[0], e.functions + 1, 3))
    for f in range(DEGREE + 1):
        residual[:, f : f + e.functions : DEGREE][:, : e.count] += by_element[:, :, f]
    ball, _ = end_drag(p, velocity + rate[:, :, 0])
    residual[:, 0] += p.end_mass * (again[:, :, 0] + acceleration) + ball
    residual[:, 0, 2] += p.end_weight / p.omega**2
    return np.moveaxis(residual[:, :-1], 1, 2), local.least_tension


def _derivatives(p, e: Elements, velocity, first, c):
    """Damping and stiffness of one element after the other, (k, f, 3, f, 3) each."""
    k, f = c.shape[0], DEGREE + 1
    points = _at_points(e, velocity, first, c)

    def pairs(test, shape, field):
        products = (test[:, None] * shape[None, :] * e.weights).reshape(f * f, -1)
        blocks = products @ field.reshape(k, -1, 9)
        return np.moveaxis(blocks.reshape(k, f, f, 3, 3), 2, 3)

    for i in range(e.count):
        local = forces(p, *(a[:, i] for a in points))
        damping = pairs(e.value, e.value, local.drag_by_v)
        if p.damping:
            damping += pairs(e.slope, e.slope, local.pull_by_rate)
        if i == 0:
            damping[:, 0, :, 0, :] += end_drag(p, velocity + (first @ c[:, :, 0]))[1]
        stiffness = pairs(e.value, e.slope, local.drag_by_slope)
        stiffness += pairs(e.slope, e.slope, local.pull_by_slope)
        yield damping, stiffness
