"""Stability of a steady state: the least damped mode in the band, by Galerkin's method.

Beyond a fold, where the slope of the tow-circle condition is negative, one real mode grows for
certain (docs/theory.md). Only a cable that stretches in its vibration but not in its steady state,
the thesis's, can vibrate as if it did not; that mode is therefore computed as stiff as at rest.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dgeev

from ctcbs_ros.kernels.galerkin import assemble, slow_wave_phase
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.rightmost import Rightmost, corrected, rightmost, tail
from ctcbs_ros.solver.steady_state import SteadyState, cable_states

# Numbers of functions tried, each half again as many as the one before.
FUNCTIONS = (8, 12, 18, 27, 40, 60)
# The margin is converged to 1 %, or to this where it is close to zero.
RELATIVE, ABSOLUTE = 0.01, 1e-5
# The most that a resolved mode has in the highest third of the functions. One that has more may
# agree by chance, hence must agree better; overdamped axial waves, as short as one likes, do.
_TAIL = 0.013
_UNRESOLVED = 1e-4
# Functions a coordinate for each radian that the phase of a slow wave turns along the cable: with
# less than that two numbers of functions can agree by chance on a mode that neither resolves. How
# seldom they still do: test_chance_agreement_is_rare_where_little_tension_meets_much_drag.
_FUNCTIONS_A_RADIAN = 2.7
_SLOW_WAVE = 0.3  # |lambda| of that wave, per radian of orbit
# Points along the cable that its phase is summed at: those of 12 functions.
_WAVE_POINTS = 32
# Below this a mode does not oscillate: the loss it leads to is a divergence.
_REAL = 1e-6
# gamma of a cable that does not stretch: below 1e-4 at the tensions of all of Table 2.1.
_RIGID = 1e8
STABLE, FLUTTER, DIVERGENCE = "stable", "flutter", "divergence"


@dataclass(frozen=True)
class Stability:
    """The least damped mode in the band, per radian of orbit.

    Attributes
    ----------
    growth_rate : float
        Largest real part of the eigenvalues with |Im| <= band; negative is stable. Beyond a fold
        it is that of the divergence at least, and never negative.
    frequency : float
        |Im| of that mode, in the rotating frame.
    band : float
    functions : int
        Functions a coordinate that the result was computed with.
    converged : bool
        Whether half again as many functions changed the growth rate by less than 1 %, or 0.01 %
        where the mode has much in the highest functions. Of a single number of functions, whether
        it has little in them.
    beyond_fold : bool
        Whether the tow-circle condition falls with the end-mass radius: between two folds.
    """

    growth_rate: float
    frequency: float
    band: float
    functions: int
    converged: bool
    beyond_fold: bool = False

    @property
    def margin(self) -> float:
        """Decay rate of the least damped mode."""
        return -self.growth_rate

    @property
    def stable(self) -> bool:
        """Whether every small disturbance in the band decays."""
        return self.growth_rate < 0.0

    @property
    def nearest_loss(self) -> str:
        """How stability is lost, or would be first: "divergence" or "flutter".

        Beyond a fold it is lost to divergence, whatever else may grow.
        """
        return DIVERGENCE if self.beyond_fold or self.frequency < _REAL else FLUTTER

    @property
    def verdict(self) -> str:
        """Either "stable", or how stability is lost."""
        return STABLE if self.stable else self.nearest_loss


@lru_cache(maxsize=16)
def _quadrature(points):
    """Gauss-Legendre nodes and weights on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(points)
    return 0.5 * (x + 1.0), 0.5 * w


def vibration_matrix(state: SteadyState, functions: int) -> np.ndarray:
    """First-order matrix of the vibration in n functions a coordinate, (6 n, 6 n).

    Parameters
    ----------
    state : SteadyState
    functions : int
    """
    with one_blas_thread():
        return _matrix(state, functions)


def _matrix(state: SteadyState, functions: int) -> np.ndarray:
    p = state.parameters
    nodes, weights, states = _shape(p, state.end_mass_radius, 2 * functions + 8)
    return assemble(
        p.theta(state.end_mass_radius), p.length, p.gamma, p.elastic, p.damping,
        functions, nodes, weights, states,
    )


@lru_cache(maxsize=2)
def _shape(p: Parameters, end_mass_radius: float, points: int) -> tuple[np.ndarray, ...]:
    """Arc lengths and weights of a quadrature along the cable, and its states there, (n, 6)."""
    x, w = _quadrature(points)
    nodes = x * p.length
    # 1e-8 is far below the 1 % asked of the margin, and cheaper than the steady state's own.
    states = cable_states(p, end_mass_radius, nodes, 1e-8)
    return nodes, w * p.length, np.ascontiguousarray(states)


def eigenvalues(state: SteadyState, functions: int) -> np.ndarray:
    """All 6 n eigenvalues of the vibration in n functions a coordinate, per radian of orbit.

    Parameters
    ----------
    state : SteadyState
    functions : int

    Returns
    -------
    (6 n,) complex ndarray
    """
    with one_blas_thread():
        return _all_eigenvalues(_matrix(state, functions))


def _all_eigenvalues(a: np.ndarray) -> np.ndarray:
    real, imag, _, _, info = dgeev(a, compute_vl=0, compute_vr=0, overwrite_a=1)
    if info != 0:
        raise ArithmeticError(f"no eigenvalues with {len(a) // 6} functions (LAPACK info {info})")
    return real + 1j * imag


def stability(state: SteadyState, band: float | None = None, functions=FUNCTIONS) -> Stability:
    """Growth rate and frequency of the least damped mode, converged to 1 %.

    Parameters
    ----------
    state : SteadyState
    band : float, optional
        Largest |Im lambda| per radian that counts; by default `Parameters.band`. Where no mode is
        that slow, it is widened to the slowest one.
    functions : sequence of int
        Numbers of functions to try, until two in succession agree on a mode they resolve.

    Returns
    -------
    Stability

    References
    ----------
    Thesis, Chapter 4 and Appendices A and B, with the errata of docs/thesis.md.
    """
    band = state.parameters.band if band is None else band
    with one_blas_thread():
        found = _of_modes(state, band, functions)
        return found if state.slope > 0.0 else _beyond_fold(state, found)


def _of_modes(state: SteadyState, band: float, functions) -> Stability:
    """That of the modes in the band, whatever side of a fold the state is on."""
    before, modes = None, None
    first = first_resolving(state, functions)
    for i, n in enumerate(functions[first:], first):
        a = _matrix(state, n)
        worst, modes, share = _least_damped(a, band, modes)
        resolved = share < _TAIL
        if i == first > 0:
            before = _coarser(a, functions[i - 1], worst, band, modes)
        if before is None:
            converged = resolved and len(functions) == 1
        else:
            converged = _agree(before, worst, RELATIVE if resolved else _UNRESOLVED)
        if converged:
            break
        before = worst
    growth, frequency = worst.real, abs(worst.imag)
    return Stability(growth, frequency, max(band, frequency), n, converged)


def _beyond_fold(state: SteadyState, found: Stability) -> Stability:
    """The stability of a state that diverges, from that of the modes found."""
    divergence = 0.0
    if not state.parameters.elastic:
        p = replace(state.parameters, vibration_elasticity=_RIGID)
        values = _all_eigenvalues(_matrix(replace(state, parameters=p), found.functions))
        divergence = max(values.real[values.imag == 0.0], default=0.0)
    if found.growth_rate < divergence:
        found = replace(found, growth_rate=float(divergence), frequency=0.0)
    return replace(found, growth_rate=max(found.growth_rate, 0.0), beyond_fold=True)


def first_resolving(state: SteadyState, functions) -> int:
    """Index of the first number of functions, but the very first, that resolves slow waves."""
    if len(functions) == 1:
        return 0
    needed = _FUNCTIONS_A_RADIAN * _slow_wave_phase(state)
    enough = [i for i, n in enumerate(functions) if i > 0 and n >= needed]
    return enough[0] if enough else len(functions) - 1


def _slow_wave_phase(state: SteadyState) -> float:
    """Phase [rad] by which a slow transverse wave turns from one end of the cable to the other.

    The wave number of the damped string is sqrt((|lambda|^2 + d_n |v_n| |lambda|) omega^2 / p):
    where little tension meets much drag, modes are short.
    """
    p = state.parameters
    _, weights, states = _shape(p, state.end_mass_radius, _WAVE_POINTS)
    return slow_wave_phase(states, weights, p.omega, p.cable_drag, p.elasticity, _SLOW_WAVE)


def _agree(before: complex, now: complex, relative: float = RELATIVE) -> bool:
    """Whether a mode has converged: its growth rate, and its frequency to 1 % of both together.

    Two growth rates alone are alike by chance where a pair of modes is about to become real.
    """
    return (
        abs(now.real - before.real) <= max(relative * abs(now.real), ABSOLUTE)
        and abs(abs(now.imag) - abs(before.imag)) <= max(RELATIVE * abs(now), ABSOLUTE)
    )  # fmt: skip


def _coarser(a, functions: int, worst: complex, band: float, modes) -> complex | None:
    """The mode with fewer functions, from the matrix of more; None if it differs for certain.

    Where the mode itself has moved too far, another that stands where it was is chance.
    """
    n = len(a) // 6
    parts = a.reshape(2, 3, n, 2, 3, n)[:, :, :functions, :, :, :functions]
    fewer = np.ascontiguousarray(parts).reshape(6 * functions, 6 * functions)
    same = corrected(fewer, worst, 1e-7)
    if same is not None and not _agree(same, worst):
        return None
    return _least_damped(fewer, band, modes).value


def _least_damped(a: np.ndarray, band: float, modes: int | None) -> Rightmost:
    """The eigenvalue of largest real part in the band, and what helps to find it again."""
    found = rightmost(a, band, modes)
    if found is not None:
        return found
    values = _all_eigenvalues(a)
    # On a slow orbit even the pendulum may swing faster than the band: then it is what counts.
    slowest = np.abs(values.imag).min()
    values = values[np.abs(values.imag) <= max(band, slowest)]
    worst = complex(values[np.argmax(values.real)])
    return Rightmost(worst, None, tail(a, worst))
