"""Stability of a periodic motion: Floquet exponents of the modes that no wind shows in the band.

The linearised motion is integrated over one turn in the rotating frame, where without wind its
matrix is constant and the exponents are the eigenvalues of `ctcbs_ros.solver.stability`. The
cable's tension is the one that the motion needs (`ctcbs_ros.periodic.tension`): so a motion in the
few orders that make up its place has its exponents as well.
"""

from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import NamedTuple

import numpy as np

from ctcbs_ros.kernels.galerkin import basis
from ctcbs_ros.periodic.forces import end_drag, forces
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.tension import under_tension
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.stability import ABSOLUTE, FUNCTIONS, RELATIVE

# Steps a turn of the integration, doubled until the growth rate is converged.
_STEPS = (16, 32, 64, 128, 256)
# Work of a step's map and of the modes of a turn, in that of `newton.work`, with a hundred
# functions a coordinate: it goes by the cube.
_STEP_WORK, _MODES_WORK = 14.0, 60.0
# Work of the steps done at once, at most: by themselves they are short.
_AT_ONCE = 0.2
# k x r turns (x, y, z) into (-y, x, 0).
_SPIN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Floquet:
    """The least damped mode in the band, per radian of orbit.

    Attributes
    ----------
    growth_rate : float
        Largest real part of the exponents that count; negative is stable.
    frequency : float
        Of that mode, in the rotating frame: root mean square over the turn, its growth aside.
    band : float
        Largest frequency that counts.
    functions : int
        Functions a coordinate.
    converged : bool
        Whether it is within 1 % of that with fewer functions, and with twice as many steps.
    diverges : bool
        Whether a disturbance in that mode keeps its sign from turn to turn.
    """

    growth_rate: float
    frequency: float
    band: float
    functions: int
    converged: bool
    diverges: bool = False

    @property
    def stable(self) -> bool:
        """Whether every small disturbance in the band decays."""
        return self.growth_rate < 0.0


def floquet(motion: PeriodicMotion, functions: int = FUNCTIONS[0], band: float | None = None):
    """Growth rate of the least damped mode in the band, converged to 1 %.

    Parameters
    ----------
    motion : PeriodicMotion
    functions : int
        Functions a coordinate to begin with, and compare with fewer: those that the steady state
        needs.
    band : float, optional
        By default `Parameters.band`.

    Returns
    -------
    Floquet

    Notes
    -----
    An exponent is known only up to multiples of i, one for each turn, so |Im| does not say which
    modes count. The frequency of a mode does: with u e^(-Re(lambda) t) = q(t), which repeats but
    for a phase, it is the root of the mean of |q'|^2 over that of |q|^2. Without wind q is
    e^(i Im(lambda) t) times a constant, and the frequency |Im(lambda)|; with wind it changes
    continuously, also where two exponents meet on the real axis or half way between its copies.
    """
    with one_blas_thread():
        return drained(floquet_search(motion, functions, band))


def floquet_search(
    motion: PeriodicMotion, functions: int = FUNCTIONS[0], band: float | None = None,
    most_functions: int = FUNCTIONS[-1], most_steps: int = _STEPS[-1], relative: float = RELATIVE,
) -> Generator[float, None, Floquet]:
    """As `floquet`, piece by piece and with no more than so many functions and steps.

    `relative` is what counts as converged instead of 1 %.

    Yields the work of each piece in the unit of `ctcbs_ros.periodic.newton.work`.
    """  # fmt: skip
    band = motion.parameters.band if band is None else band
    fewer = [n for n in FUNCTIONS if n < functions]
    counts = [*fewer[-1:], functions]
    counts += [n for n in FUNCTIONS if functions < n <= most_functions]
    allowed = [steps for steps in _STEPS if steps <= most_steps]
    before, steps = None, 0
    for n in counts:
        found, steps, good = yield from _converged_steps(motion, n, band, allowed, steps, relative)
        if before is not None and n >= functions and _agree(before, found.growth_rate, relative):
            return Floquet(found.growth_rate, found.frequency, band, n, good, found.diverges)
        before = found.growth_rate
    return Floquet(found.growth_rate, found.frequency, band, n, False, found.diverges)


def _agree(before: float, growth: float, relative: float) -> bool:
    return abs(growth - before) <= max(relative * abs(growth), ABSOLUTE)


def _converged_steps(motion, n: int, band: float, allowed: list[int], first: int, relative):
    """The least damped mode, the index of the steps needed, and whether they sufficed."""
    before = yield from least_damped_search(motion, n, band, allowed[first])
    for i in range(first + 1, len(allowed)):
        found = yield from least_damped_search(motion, n, band, allowed[i])
        if _agree(before.growth_rate, found.growth_rate, relative):
            return found, i - 1, True
        before = found
    return before, len(allowed) - 1, False


class Mode(NamedTuple):
    """Growth rate and frequency of a mode, and whether it keeps its sign from turn to turn."""

    growth_rate: float
    frequency: float
    diverges: bool


def least_damped_search(
    motion: PeriodicMotion, n: int, band: float, steps: int
) -> Generator[float, None, Mode]:
    """The least damped mode in the band, piece by piece; see `exponents_and_frequencies`."""
    exponents, frequencies = yield from exponents_search(motion, n, steps)
    # On a slow orbit even the pendulum may swing faster than the band: then it is what counts.
    inside = np.flatnonzero(frequencies <= max(band, frequencies.min() * (1.0 + 1e-9)))
    worst = inside[np.argmax(exponents[inside].real)]
    exponent = exponents[worst]
    return Mode(float(exponent.real), float(frequencies[worst]), bool(exponent.imag == 0.0))


def exponents_and_frequencies(motion: PeriodicMotion, n: int, steps: int):
    """All 6 n Floquet exponents and their frequencies in the rotating frame, (6 n,) each.

    Parameters
    ----------
    motion : PeriodicMotion
    n : int
        Functions a coordinate.
    steps : int
        Of the integration over a turn, by Radau's method of order 5. It damps what is too fast for
        the steps, as a method without damping at infinity would not: that would show as growth.
    """
    return drained(exponents_search(motion, n, steps))


def exponents_search(
    motion: PeriodicMotion, n: int, steps: int
) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
    """As `exponents_and_frequencies`, piece by piece."""
    maps, turn = [], np.eye(6 * n)
    share = (n / 100.0) ** 3
    at_once = max(1, int(_AT_ONCE / (_STEP_WORK * share)))
    for first in range(0, steps, at_once):
        some = _step_maps(motion, n, steps, range(first, min(first + at_once, steps)))
        for step in some:
            turn = step @ turn
        maps += some
        yield _STEP_WORK * share * len(some)
    multipliers, modes = np.linalg.eig(turn)
    yield _MODES_WORK * share
    exponents = np.log(np.maximum(np.abs(multipliers), 1e-300)) + 1j * np.angle(multipliers)
    exponents = exponents / (2.0 * pi)
    growth = exponents.real
    fast, size = np.zeros(6 * n), np.zeros(6 * n)
    modes = modes.astype(complex)
    with np.errstate(all="ignore"):
        for step in maps:
            place, rate = modes[: 3 * n], modes[3 * n :]
            fast += (np.abs(rate - growth * place) ** 2).sum(axis=0)
            size += (np.abs(place) ** 2).sum(axis=0)
            # What decays within a step leaves nothing but rounding.
            modes = step @ modes * np.exp(-np.maximum(growth, -100.0) * 2.0 * pi / steps)
        frequencies = np.sqrt(fast / np.maximum(size, 1e-300))
    # What overflows within a turn grows beyond all bounds, and counts.
    return exponents, np.where(np.isfinite(frequencies), frequencies, 0.0)


def _step_maps(motion: PeriodicMotion, n: int, steps: int, some) -> list[np.ndarray]:
    """What some of so many steps make of place and rate in the rotating frame, (6 n, 6 n) each."""
    a, nodes = _radau(3)
    h = 2.0 * pi / steps
    when = h * (np.array(some)[:, None] + nodes)
    damping, stiffness = _linearised(motion, n, when.ravel())
    p, s = 3 * n, nodes.size
    damping = damping.reshape(len(some), s, p, p)
    stiffness = stiffness.reshape(len(some), s, p, p)
    twice = a @ a
    maps = []
    for c, k in zip(damping, stiffness, strict=True):
        # For the accelerations at the stages, of which the rates are a, the places twice the sums.
        left = h * a[:, None, :, None] * c[:, :, None, :]
        left = left + h * h * twice[:, None, :, None] * k[:, :, None, :]
        left = left.reshape(s * p, s * p)
        left[np.diag_indices(s * p)] += 1.0
        right = np.concatenate([-k, -c - h * nodes[:, None, None] * k], axis=2)
        pushed = np.linalg.solve(left, right.reshape(s * p, 2 * p)).reshape(s, p, 2 * p)
        step = np.eye(2 * p)
        step[:p, p:] += h * np.eye(p)
        step[:p] += h * h * np.tensordot(twice[-1], pushed, 1)
        step[p:] += h * np.tensordot(a[-1], pushed, 1)
        maps.append(step)
    return maps


def _linearised(motion: PeriodicMotion, n: int, when):
    """Damping and stiffness of small motions in the rotating frame at k times, (k, 3 n, 3 n)."""
    p = motion.parameters
    f = _functions(n, p.length, p.end_mass)
    slope, through, opening = under_tension(motion, f.weights.size, when)
    local = forces(p, _back(slope, when), _back(through, when), _back(opening, when))
    end = motion.end_mass_velocity(when) - [motion.path.air_velocity, 0.0, 0.0]
    _, by_ball = end_drag(p, _back(end, when))

    def pairs(test, shape, field):
        products = (test[:, None] * shape[None, :] * f.weights).reshape(n * n, -1)
        blocks = products @ field.reshape(when.size, f.weights.size, 9)
        blocks = np.moveaxis(blocks.reshape(when.size, n, n, 3, 3), 3, 2)
        return blocks.reshape(when.size, 3 * n, 3 * n)

    damping = pairs(f.value, f.value, local.drag_by_v)
    if p.damping:
        damping += pairs(f.slope, f.slope, local.pull_by_rate)
    ends = np.outer(f.at_end, f.at_end)
    damping += np.einsum("rs,kab->krasb", ends, by_ball).reshape(damping.shape)
    stiffness = pairs(f.value, f.slope, local.drag_by_slope)
    stiffness += pairs(f.slope, f.slope, local.pull_by_slope)
    spin = np.kron(np.eye(n), _SPIN)
    return damping + 2.0 * spin, stiffness + damping @ spin + spin @ spin


def _back(vectors: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Vectors (k, ..., 3) at k times, turned back by the angle of a mean turn."""
    flat = vectors[..., 0] + 1j * vectors[..., 1]
    flat = flat * np.exp(-1j * when).reshape(-1, *[1] * (flat.ndim - 1))
    return np.stack([flat.real, flat.imag, vectors[..., 2]], axis=-1)


@dataclass(frozen=True)
class _Functions:
    """n functions over the whole cable, orthonormal in the mass form: those of the vibration."""

    weights: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    at_end: np.ndarray


@lru_cache(maxsize=4)
def _functions(n: int, length: float, end_mass: float) -> _Functions:
    x, w = np.polynomial.legendre.leggauss(2 * n + 8)
    nodes, weights = 0.5 * (x + 1.0) * length, 0.5 * w * length
    # The end mass's place is one more, without weight.
    places = np.append(nodes, 0.0)
    value, slope = np.empty((n, places.size)), np.empty((n, places.size))
    basis(n, length, places, value, slope)
    mass = (value[:, :-1] * weights) @ value[:, :-1].T
    mass += end_mass * np.outer(value[:, -1], value[:, -1])
    lower = np.linalg.cholesky(mass)
    value, slope = np.linalg.solve(lower, value), np.linalg.solve(lower, slope)
    return _Functions(weights, value[:, :-1], slope[:, :-1], value[:, -1])


@lru_cache(maxsize=4)
def _radau(stages: int) -> tuple[np.ndarray, np.ndarray]:
    """Radau's method IIA: the matrix, whose last row has the weights, and the nodes."""
    legendre = np.polynomial.legendre.Legendre
    nodes = 0.5 * (np.sort((legendre.basis(stages) - legendre.basis(stages - 1)).roots()) + 1.0)
    powers = np.arange(stages)
    integrals = nodes[:, None] ** (powers + 1) / (powers + 1)
    return integrals @ np.linalg.inv(nodes[:, None] ** powers), nodes
