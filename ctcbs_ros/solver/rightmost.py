"""The rightmost mode in the band, and proof that it is, without computing all eigenvalues.

Of the 6 n eigenvalues of the vibration's first-order matrix A, one counts. All that could are
inside a disk of the complex plane:

* none lies in the band further right than X, because there the symmetric part of the quadratic
  form lambda^2 + lambda C + K is positive definite;
* with S = (A - sigma)^-1, sigma amid the disk, the subspace that S^8 leaves of a few functions
  (subspace iteration) holds every mode inside a circle whose radius the norm of the rest of S^8
  bounds. The eigenvalues of S in that subspace are a small problem.

The mode found is then corrected in the quadratic form itself by Newton's method. Wherever any of
this is in doubt there is no answer, and all eigenvalues have to be computed.

References: Saad, Numerical Methods for Large Eigenvalue Problems, chapters 5 and 8; Tisseur and
Meerbergen, The quadratic eigenvalue problem, SIAM Review 43 (2001).
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import (
    dgeev,
    dgeqrf,
    dgetrf,
    dgetri,
    dorgqr,
    dpotrf,
    zgetrf,
    zgetrs,
)

# Dimension of the subspace to begin with, which holds the modes of nine flights in ten; by how
# much it grows where it is too small, and by how much it exceeds a number of modes known.
_DIMENSION, _GROWTH, _SPARE = 18, 12, 6
# Radius of the circle that surely holds the modes, over that which has to: of a mode on the edge a
# sixth, 1.25^-8, is outside the subspace, and its value there is not its own.
_SURE = 1.25
# A mode may be this much (relatively) further right than the subspace says. Those in doubt are
# all corrected, and a correction by more is not believed.
_DOUBT = 1e-3
_CORRECTED = 1e-12
_MOST_CORRECTIONS = 6


class Rightmost(NamedTuple):
    """The eigenvalue, its imaginary part not negative, and how many are in the disk.

    Of its (left) eigenvector, the share in the highest third of the functions.
    """

    value: complex
    modes: int | None
    tail: float


def rightmost(a: np.ndarray, band: float, modes: int | None = None) -> Rightmost | None:
    """Eigenvalue of largest real part among those with |Im| <= band.

    Parameters
    ----------
    a : (6 n, 6 n) ndarray
        First-order matrix of the vibration, of `ctcbs_ros.kernels.galerkin`.
    band : float
    modes : int, optional
        How many modes there are in the disk, as found with fewer functions: only speed depends on
        it.

    Returns
    -------
    Rightmost or None
        None where it is in doubt.
    """
    stiffness, damping = _quadratic_form(a)
    half = len(stiffness)
    # Coriolis forces add 2 |Im| at most, the centrifugal one takes 1 from the stiffness.
    right = band + 1.2
    if not _none_beyond(stiffness, damping, band, right):
        return None
    sigma = 0.5 * right
    inverse = _shifted_inverse(stiffness, damping, sigma)
    if inverse is None:
        return None
    power = np.empty_like(inverse)
    np.matmul(inverse[:half], inverse, out=power[:half])
    # The lower half of S is sigma times the upper one, and (1 0).
    np.multiply(power[:half], sigma, out=power[half:])
    power[half:] += inverse[:half]
    power = power @ power
    power = power @ power
    least = _DIMENSION if modes is None else min(modes + _SPARE, half)
    for dimension in (*range(least, half, _GROWTH), half):
        basis = _orthonormal(power[:, _lowest_functions(half, dimension)])
        values = _eigenvalues(basis.T @ (inverse @ basis))
        if values is None or np.any(values == 0.0):
            return None
        values = sigma + 1.0 / values
        # An eigenvector v of S with eigenvalue mu is outside the subspace by at most
        # |rest v| / |mu|^8: modes inside this radius have their place in it.
        rest = power - basis @ (basis.T @ power)
        radius = np.linalg.norm(rest) ** -0.125
        # What appears further right belongs to no mode: a subspace has more values than modes.
        possible = values[(np.abs(values - sigma) < radius) & (values.real <= right)]
        possible = possible[(possible.imag >= 0.0) & (possible.imag <= band * (1.0 + _DOUBT))]
        if possible.size == 0:
            continue
        if radius <= _SURE * _needed(band, right, sigma, possible.real.max()):
            continue
        found = _best(stiffness, damping, possible, band)
        if found is None:
            continue
        value, vector = found
        needed = _needed(band, right, sigma, value.real)
        if radius > _SURE * needed:
            modes = int(np.count_nonzero(np.abs(values - sigma) < needed))
            return Rightmost(value, modes, _tail(vector))
    return None


def _needed(band, right, sigma, growth) -> float:
    """Radius of the disk about sigma that holds the band between a growth rate and `right`."""
    return float(np.hypot(band, max(right - sigma, sigma - growth)))


def corrected(a: np.ndarray, value: complex, error: float = _CORRECTED) -> complex | None:
    """The eigenvalue nearly equal to one known, to a relative error.

    None if there is none within a tenth of it.
    """
    found = _corrected(*_quadratic_form(a), value, 0.1, error)
    return None if found is None else found[0]


def tail(a: np.ndarray, value: complex) -> float:
    """Share (of its length) that an eigenvalue's left eigenvector has in the highest functions.

    In the highest third of them, in displacements; 1 where it is not an eigenvalue.
    """
    found = _corrected(*_quadratic_form(a), value, _DOUBT)
    return 1.0 if found is None else _tail(found[1])


def _tail(vector) -> float:
    share = np.abs(vector.reshape(3, -1)) ** 2
    return float(np.sqrt(share[:, -(share.shape[1] // 3) :].sum() / share.sum()))


def _quadratic_form(a) -> tuple[np.ndarray, np.ndarray]:
    """K and C of lambda^2 + lambda C + K."""
    half = len(a) // 2
    return -a[half:, :half], -a[half:, half:]


def _none_beyond(stiffness, damping, band, right) -> bool:
    """Whether no eigenvalue with |Im| <= band has a real part above `right`.

    With lambda = a + i b, v its eigenvector of unit length and the damping's symmetric part
    positive (drag, line damping), its skew part that of the Coriolis force, the real part of
    v* (lambda^2 + lambda C + K) v is at least a^2 - b^2 - 2 |b| + v* (a C_s + K_s) v, which
    grows with a.
    """
    form = right * damping
    form += stiffness
    form = form + form.T
    form.flat[:: len(form) + 1] += 2.0 * (right * right - band * band - 2.0 * band)
    return dpotrf(form.T, overwrite_a=1, clean=0)[1] == 0


def _shifted_inverse(stiffness, damping, sigma) -> np.ndarray | None:
    """The inverse of A - sigma, by way of the quadratic form at sigma; None if it is singular."""
    half = len(stiffness)
    form = stiffness + sigma * damping
    form.flat[:: half + 1] += sigma * sigma
    factors, pivots, info = dgetrf(form.T, overwrite_a=1)
    if info != 0:
        return None
    form = dgetri(factors, pivots, overwrite_lu=1)[0].T
    inverse = np.empty((2 * half, 2 * half))
    np.negative(form, out=inverse[:half, half:])
    np.matmul(inverse[:half, half:], damping, out=inverse[:half, :half])
    inverse[:half, :half] -= sigma * form
    np.multiply(inverse[:half], sigma, out=inverse[half:])
    inverse.flat[2 * half * half :: 2 * half + 1] += 1.0
    return inverse


@lru_cache(maxsize=32)
def _lowest_functions(half, dimension) -> np.ndarray:
    """Indices of the lowest functions in each coordinate, as displacements and as rates."""
    function, which = np.divmod(np.arange(dimension), 6)
    coordinate, is_rate = np.divmod(which, 2)
    return is_rate * half + coordinate * (half // 3) + function


def _orthonormal(block) -> np.ndarray:
    factored, tau, _, _ = dgeqrf(block)
    return dorgqr(factored, tau, overwrite_a=1)[0]


def _eigenvalues(matrix) -> np.ndarray | None:
    real, imag, _, _, info = dgeev(matrix, compute_vl=0, compute_vr=0)
    return real + 1j * imag if info == 0 else None


def _best(stiffness, damping, values, band) -> tuple[complex, np.ndarray] | None:
    """The rightmost of approximate eigenvalues in the band, corrected, with its left eigenvector.

    None if in doubt.
    """
    best = None
    for count, value in enumerate(values[np.argsort(-values.real)]):
        if best is not None and value.real < best[0].real - _DOUBT * abs(value):
            break
        found = _corrected(stiffness, damping, complex(value), _DOUBT)
        if found is None or count == _MOST_CORRECTIONS:
            return None
        exact, vector = found
        if abs(exact.imag) <= band and (best is None or exact.real > best[0].real):
            best = complex(exact.real, abs(exact.imag)), vector
    return best


def _corrected(
    stiffness, damping, value, trust, error=_CORRECTED
) -> tuple[complex, np.ndarray] | None:
    """Newton's method for an eigenvalue of lambda^2 + lambda C + K, by inverse iteration.

    With its left eigenvector, because LAPACK takes rows for columns; None if it goes further than
    `trust` (relatively).
    """
    allowed = trust * abs(value) + 1e-6
    start = value
    stiffness, damping = stiffness.T, damping.T
    vector = np.ones(len(stiffness), complex)
    for _ in range(4):
        form = damping * value
        form += stiffness
        form.T.flat[:: len(form) + 1] += value * value
        factors, pivots, info = zgetrf(form, overwrite_a=1)
        if info > 0:
            return value, vector
        # The first pass only turns the vector into the eigenvector.
        for _ in range(2):
            vector /= np.linalg.norm(vector)
            image = (damping @ vector.view(float).reshape(-1, 2)).view(complex)[:, 0]
            image += 2.0 * value * vector
            before, (vector, _) = vector, zgetrs(factors, pivots, image, overwrite_b=1)
        step = 1.0 / np.vdot(before, vector)
        if not abs(value - step - start) <= allowed:
            return None
        value -= step
        # The next step would be about the square of this one.
        if abs(step) ** 2 <= error * max(abs(value), 1.0):
            return value, vector
    return None
