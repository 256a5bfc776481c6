"""How the modes of vibration change with the flight: first derivatives of eigenvalues.

For a simple eigenvalue with right and left vectors v and w, d lambda = w* dA v / w* v.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgeev

from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.stability import vibration_matrix
from ctcbs_ros.solver.steady_state import SteadyState, correct_state

# Half the difference of tau over which dA is taken. In a stiff cable dA has a large part of second
# order, which only a central difference is free of.
_STEP = 1e-4
# Modes up to this much beyond the band are kept: they may come into it.
_BESIDE_BAND = 1.2


@dataclass(frozen=True)
class Modes:
    """The slow modes of a steady state and their derivatives along families.

    Attributes
    ----------
    eigenvalues : (k,) complex ndarray
        Per radian of orbit; one of each conjugate pair.
    derivatives : (k, f) complex ndarray
        By the tau of each family.
    gaps : (k,) ndarray
        Distance of each to the nearest other eigenvalue: a change of that size can be anything.
    """

    eigenvalues: np.ndarray
    derivatives: np.ndarray
    gaps: np.ndarray


def modes(state: SteadyState, functions: int, families: tuple[Family, ...]) -> Modes | None:
    """The modes in the band and a little beyond, with their derivatives.

    Parameters
    ----------
    state : SteadyState
    functions : int
        Galerkin functions a coordinate.
    families : tuple of f Family

    Returns
    -------
    Modes or None
        None where there are no derivatives: beside a fold, or where two modes coincide.
    """
    real, imag, left, right, info = _all_modes(vibration_matrix(state, functions))
    if info != 0:
        return None
    widest = _BESIDE_BAND * max(state.parameters.band, np.abs(imag).min())
    (kept,) = np.nonzero((imag >= 0.0) & (imag <= widest))
    v, w = _vectors(right, imag, kept), _vectors(left, imag, kept)
    by_tau = np.empty((kept.size, len(families)), complex)
    for column, family in zip(by_tau.T, families, strict=True):
        ends = [
            correct_state(family.at(state.parameters, tau), state.end_mass_radius)
            for tau in (_STEP, -_STEP)
        ]
        if None in ends:
            return None
        above, below = (vibration_matrix(end, functions) for end in ends)
        column[:] = np.sum(w.conj() * ((above - below) @ v), axis=0) / (2.0 * _STEP)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_tau /= np.sum(w.conj() * v, axis=0)[:, None]
    if not np.all(np.isfinite(by_tau)):
        return None
    values = real + 1j * imag
    apart = np.abs(values[kept, None] - values)
    apart[np.arange(kept.size), kept] = np.inf
    return Modes(values[kept], by_tau, apart.min(axis=1))


def _all_modes(a: np.ndarray):
    with one_blas_thread():
        return dgeev(a, overwrite_a=1)


def _vectors(packed: np.ndarray, imag: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Complex eigenvectors; LAPACK packs a pair into two columns, real and imaginary part."""
    vectors = packed[:, kept].astype(complex)
    pairs = imag[kept] > 0.0
    vectors[:, pairs] += 1j * packed[:, kept[pairs] + 1]
    return vectors
