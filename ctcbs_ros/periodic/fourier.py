"""Functions of time that repeat every turn, by their values or by their orders.

Trigonometric polynomials, by their values at an odd number of times evenly spread over a turn.
"""

from functools import lru_cache
from math import pi

import numpy as np


@lru_cache(maxsize=32)
def times(count: int) -> np.ndarray:
    """An odd number of times evenly spread over a turn, the first 0."""
    return 2.0 * pi * np.arange(count) / count


@lru_cache(maxsize=32)
def derivative(count: int) -> np.ndarray:
    """Matrix of d/dt on values at `times(count)`, exact for its trigonometric polynomials."""
    k = np.arange(count)
    apart = k[:, None] - k[None, :]
    with np.errstate(divide="ignore"):
        d = 0.5 * (-1.0) ** apart / np.sin(pi * apart / count)
    np.fill_diagonal(d, 0.0)
    return d


def fourier(values: np.ndarray) -> np.ndarray:
    """Complex coefficients of orders 0 .. (k-1)/2 from values at `times(k)`, along axis 0.

    The function is Re(sum c_j e^(i j t)).
    """
    c = np.fft.rfft(values, axis=0) / values.shape[0]
    c[1:] *= 2.0
    return c


def at_times(coefficients: np.ndarray, when, order: int = 0) -> np.ndarray:
    """The function of `fourier`'s coefficients, or a derivative of it, at any times."""
    j = np.arange(coefficients.shape[0])
    waves = np.exp(1j * np.multiply.outer(np.asarray(when, float), j)) * (1j * j) ** order
    return np.tensordot(waves, coefficients, axes=1).real


def resampled(values: np.ndarray, count: int) -> np.ndarray:
    """The same trigonometric polynomial at another number of times, along axis 0."""
    if count == values.shape[0]:
        return values
    return at_times(fourier(values), times(count))
