"""Factors of Newton's matrix for a periodic motion, and the memory that they are kept in.

The elements are eliminated one after the other from the end mass up, each with all times at once,
so that the work is in proportion to their number.
"""

from collections.abc import Generator, Iterable
from mmap import mmap

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ctcbs_ros.kernels.cable_waves import element_matrix
from ctcbs_ros.periodic.elements import DEGREE, Elements
from ctcbs_ros.solver.blas import one_blas_thread

# Unknowns of an element at one time: those that are eliminated, and those of its upper end.
_OWN, _END = 3 * DEGREE, 3


def bytes_needed(count: int, parts: int) -> int:
    """Memory for the factors of a matrix at a number of times in a number of elements."""
    elements = _OWN * (parts * (_OWN + 2 * _END) - 2 * _END)
    return 8 * count**2 * (elements + (_OWN + _END) ** 2)


class Storage:
    """Memory for the factors of one matrix at a time, used again and again.

    Matrices of many megabytes, made and dropped for hours among all else, leave holes in a
    process's memory that it does not get rid of.

    Parameters
    ----------
    size : int
        Bytes, all of them resident from the beginning on. What does not fit gets memory of its
        own.
    most_times : int
        The linear algebra's own memory for so many is made resident as well.
    """

    def __init__(self, size: int, most_times: int):
        # Mapped, not from the heap: what is given back of that size makes the C library keep all
        # that is smaller to itself from then on.
        self._memory = np.frombuffer(mmap(-1, size))
        self._memory[:] = 0.0  # a page is only there when it has been written to
        self.clear()
        own, end = _OWN * most_times, _END * most_times
        lu, below, beside = self.array(own, own), self.array(end, own), self.array(own, end)
        np.fill_diagonal(lu, 1.0)
        with one_blas_thread():
            lu, pivots, _ = dgetrf(lu, overwrite_a=1)
            below @ dgetrs(lu, pivots, beside, overwrite_b=1)[0]
        self.clear()

    def clear(self) -> None:
        """Use the memory for other factors; those held so far are lost."""
        self._used = 0
        self.held: Factors | None = None

    def array(self, rows: int, columns: int) -> np.ndarray:
        """A piece of it that nothing else uses, column by column as LAPACK has it."""
        needed = rows * columns
        if self._used + needed > self._memory.size:
            return np.empty((rows, columns), order="F")
        piece = self._memory[self._used : self._used + needed]
        self._used += needed
        return piece.reshape((rows, columns), order="F")


class Factors:
    """Factors of one matrix.

    Parameters
    ----------
    storage : Storage, optional
        Where they are kept, until others are.
    """

    def __init__(self, storage: Storage | None = None):
        self._storage = storage
        self._elements: list = []

    @property
    def lost(self) -> bool:
        """Whether their memory holds others by now."""
        return self._storage is not None and self._storage.held is not self

    def made(
        self, e: Elements, end_mass: float, first: np.ndarray, derivatives: Iterable
    ) -> Generator[bool, None, None]:
        """Make them, element by element; yields whether there is one, not for a singular matrix.

        Parameters
        ----------
        e : Elements
        end_mass : float
        first : (k, k) ndarray
            The derivative in time.
        derivatives : iterable of (damping, stiffness)
            Of one element after the other, (k, f, 3, f, 3) ndarrays.
        """
        if self._storage is not None:
            self._storage.clear()
        array = _fresh if self._storage is None else self._storage.array
        second = first @ first
        k = first.shape[0]
        own, end = _OWN * k, _END * k
        matrix, carried = array(own + end, own + end), None
        for i, (damping, stiffness) in enumerate(derivatives):
            mass = (e.value * e.weights) @ e.value.T
            if i == 0:
                mass[0, 0] += end_mass
            element_matrix(first, second, mass, damping, stiffness, matrix.T)
            if carried is not None:
                matrix[:end, :end] += carried
            lu = array(own, own)
            lu[...] = matrix[:own, :own]
            lu, pivots, info = dgetrf(lu, overwrite_a=1)
            if info != 0:
                yield False
                return
            below = beside = None
            if i < e.count - 1:
                below, beside = array(end, own), array(own, end)
                below[...], beside[...] = matrix[own:, :own], matrix[:own, own:]
                beside, _ = dgetrs(lu, pivots, beside, overwrite_b=1)
                carried = matrix[own:, own:] - below @ beside
            self._elements.append((lu, pivots, below, beside))
            if i == e.count - 1 and self._storage is not None:
                self._storage.held = self
            yield True

    def solved(self, residual: np.ndarray) -> np.ndarray:
        """The solution for a right-hand side (k, 3, n), in that shape."""
        factors = self._elements
        k, _, n = residual.shape
        # Functions, coordinates, times: as the matrices have them.
        right = np.ascontiguousarray(np.moveaxis(residual, 0, 2).swapaxes(0, 1))
        right = right.reshape(len(factors), -1).copy()
        for i, (lu, pivots, below, _) in enumerate(factors):
            right[i], _ = dgetrs(lu, pivots, right[i])
            if below is not None:
                right[i + 1, : _END * k] -= below @ right[i]
        for i in range(len(factors) - 2, -1, -1):
            right[i] -= factors[i][3] @ right[i + 1, : _END * k]
        return np.moveaxis(right.reshape(n, 3, k), 2, 0).swapaxes(1, 2).copy()


def _fresh(rows: int, columns: int) -> np.ndarray:
    return np.empty((rows, columns), order="F")
