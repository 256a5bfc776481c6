"""The cable in elements of equal length, each with polynomials of one degree.

An element has a hat function for either end and integrated Legendre polynomials that vanish at
both. Functions are numbered from the end mass up: an element's lower hat, then its inner ones; the
tow point's is left out, since the cable is described relative to it.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

# Degree of the polynomials. Measured on the design example: docs/theory.md.
DEGREE = 4


@dataclass(frozen=True)
class Elements:
    """Functions of one element, the same in all, at the points of a quadrature.

    Attributes
    ----------
    count : int
    nodes : (count, q) ndarray
        Arc lengths of the points.
    weights : (q,) ndarray
    value, slope : (degree + 1, q) ndarrays
        The lower hat, the inner functions, the upper hat.
    """

    count: int
    nodes: np.ndarray
    weights: np.ndarray
    value: np.ndarray
    slope: np.ndarray

    @property
    def functions(self) -> int:
        """Functions a coordinate."""
        return self.count * DEGREE

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Coefficients by element, (..., count, degree + 1) from (..., functions)."""
        padded = np.concatenate([values, np.zeros((*values.shape[:-1], 1))], axis=-1)
        first = DEGREE * np.arange(self.count)[:, None]
        return padded[..., first + np.arange(DEGREE + 1)]


def shape_functions(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The functions of an element and their derivatives at x in [-1, 1], (degree + 1, k) each."""
    legendre = [np.polynomial.legendre.Legendre.basis(k)(x) for k in range(DEGREE + 1)]
    value, slope = [0.5 * (1.0 - x)], [np.full_like(x, -0.5)]
    for k in range(2, DEGREE + 1):
        scale = np.sqrt((2 * k - 1) / 2.0)
        value.append(scale * (legendre[k] - legendre[k - 2]) / (2 * k - 1))
        slope.append(scale * legendre[k - 1])
    value.append(0.5 * (1.0 + x))
    slope.append(np.full_like(x, 0.5))
    return np.array(value), np.array(slope)


@lru_cache(maxsize=16)
def elements(length: float, count: int) -> Elements:
    """A cable of a length in a number of elements."""
    x, w = np.polynomial.legendre.leggauss(DEGREE + 4)
    h = length / count
    value, slope = shape_functions(x)
    nodes = h * (np.arange(count)[:, None] + 0.5 * (x + 1.0))
    return Elements(count, nodes, 0.5 * h * w, value, slope * (2.0 / h))


def at_arc_lengths(values: np.ndarray, length: float, arc_lengths, order: int = 0) -> np.ndarray:
    """The sum of the functions, or its derivative, at k arc lengths: (..., k) from (..., n)."""
    count = values.shape[-1] // DEGREE
    place = np.clip(np.asarray(arc_lengths, float) * count / length, 0.0, count)
    at = np.minimum(place.astype(int), count - 1)
    basis = shape_functions(2.0 * (place - at) - 1.0)[order]
    scale = (2.0 * count / length) ** order
    return scale * np.einsum("...kf,fk->...k", elements(length, count).spread(values)[..., at, :],
                             basis)  # fmt: skip


def interpolated(function, length: float, count: int) -> np.ndarray:
    """Coefficients of a function of arc length that vanishes at the tow point, (..., n).

    It is met at the ends of the elements, and as well as possible inside.

    Parameters
    ----------
    function : callable
        Of (k,) arc lengths, giving (..., k).
    """
    e = elements(length, count)
    ends = function(length / count * np.arange(count + 1))
    inside = function(e.nodes.ravel())
    inside = inside.reshape(*inside.shape[:-1], count, -1)
    hats = np.stack([ends[..., :-1], ends[..., 1:]], axis=-1)
    left = inside - hats @ e.value[[0, -1]]
    inner = e.value[1:-1]
    gram = (inner * e.weights) @ inner.T
    bubbles = np.linalg.solve(gram, inner * e.weights)
    found = np.concatenate([hats[..., :1], left @ bubbles.T], axis=-1)
    return found.reshape(*found.shape[:-2], count * DEGREE)
