"""Where modes of vibration cross into growth along a path of steady states.

The growth rate is a largest real part and so has corners where one mode takes over from another;
each mode by itself is smooth. So modes are followed one by one: at every place of the path each
eigenvalue is known with its derivative, and is matched with that at the next place of which it is
the continuation. Between two places the cubic through both says whether the real part comes near
zero. How far the two ends' straight extrapolations disagree in the middle, an error of third order
where the cubic's is of fourth, bounds what the cubic may be wrong by; where zero is within that
bound the interval is halved. An unstable window narrower than a step is therefore found from the
slopes at its ends; one that leaves no trace in them would need a mode that bends more sharply
than anything in the shape of the cable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dgeev
from scipy.optimize import brentq, linear_sum_assignment

from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.rightmost import corrected
from ctcbs_ros.solver.stability import FUNCTIONS, vibration_matrix
from ctcbs_ros.solver.steady_state import SteadyState

StateAt = Callable[[float], SteadyState | None]

# Modes are followed a little beyond the band, so that none is lost at its edge.
_WIDER, _EDGE = 1.25, 1.1
_DIFFERENCE = 1e-4  # of the interval
_DEEPEST = 12
_MOST_FUNCTIONS = 40
_SETTLED = 1e-6
_LOCATED = 1e-12
# A mode that decays faster is not about to grow, and its derivative not worth the computing.
_FAR = 0.5
# Intervals by which more functions may move a crossing.
_FARTHEST = 4.0
# A mode slower than this is looked for among all: Newton's method wants a guess good to a tenth.
_SLOW = 0.05


@dataclass(frozen=True)
class Crossing:
    """A mode's real part going through zero.

    Attributes
    ----------
    place : float
        On the path.
    state : SteadyState
    frequency : float
        |Im| of the mode; 0 for a real one.
    grows : bool
        Whether the mode grows beyond it.
    functions : int
        Functions a coordinate it was located with.
    """

    place: float
    state: SteadyState
    frequency: float
    grows: bool
    functions: int


@dataclass(frozen=True)
class _Spectrum:
    place: float
    values: np.ndarray
    slopes: np.ndarray
    band: float
    functions: int


def crossings(
    state_at: StateAt, places: Sequence[float], functions: Sequence[int]
) -> list[Crossing]:
    """Every place of a path where a mode in the band begins or ceases to grow.

    Parameters
    ----------
    state_at : callable
        The steady state at a place, or None where there is none; smooth in between.
    places : sequence of float
        Rising; the path is looked at here, and in between where it has to be.
    functions : sequence of int
        Functions a coordinate on the look-out at each place; a crossing is located with as many
        as it needs.

    Returns
    -------
    list of Crossing
        In the order of the path.
    """
    with one_blas_thread():
        spectra = [
            _spectrum(state_at, place, nearby - place, n)
            for place, nearby, n in zip(
                places, [*places[1:], places[-2]], functions, strict=True
            )
        ]
        brackets = [
            bracket
            for a, b in pairwise(spectra)
            if a is not None and b is not None
            for bracket in _brackets(state_at, a, b, 0)
        ]
        found = [_located(state_at, *bracket) for bracket in brackets]
    return sorted((c for c in found if c is not None), key=lambda c: c.place)


def slow_modes(state: SteadyState, functions: int) -> np.ndarray:
    """Eigenvalues with Im >= 0 up to a little beyond the band, one of each pair."""
    real, imag, _, _, info = dgeev(
        vibration_matrix(state, functions), compute_vl=0, compute_vr=0, overwrite_a=1
    )
    if info != 0:
        raise ArithmeticError(f"no eigenvalues with {functions} functions (LAPACK info {info})")
    kept = (imag >= 0.0) & (imag <= _WIDER * state.parameters.band)
    return real[kept] + 1j * imag[kept]


def _spectrum(state_at: StateAt, place, towards, functions) -> _Spectrum | None:
    """Modes and their derivatives along the path, by a small step `towards` the next place."""
    step = _DIFFERENCE * towards
    here, there = state_at(place), state_at(place + step)
    if here is None or there is None:
        return None
    values = slow_modes(here, functions)
    if not values.size:
        return None
    slopes = np.zeros(len(values), complex)
    near = np.flatnonzero(values.real > -_FAR)
    matrix = vibration_matrix(there, functions)
    moved = [corrected(matrix, v) if v.imag > _SLOW else None for v in values[near]]
    if None not in moved:
        slopes[near] = (np.array(moved) - values[near]) / step
    else:
        moved = slow_modes(there, functions)
        rows, columns = linear_sum_assignment(np.abs(values[:, None] - moved[None, :]))
        slopes[rows] = (moved[columns] - values[rows]) / step
    return _Spectrum(place, values, slopes, here.parameters.band, functions)


def _brackets(state_at: StateAt, a: _Spectrum, b: _Spectrum, depth):
    """(left, right, mode at left, at right, functions) of every crossing in an interval."""
    width, functions = b.place - a.place, max(a.functions, b.functions)
    found, doubtful = [], False
    ahead, back = a.values + 0.5 * width * a.slopes, b.values - 0.5 * width * b.slopes
    rows, columns = linear_sum_assignment(np.abs(ahead[:, None] - back[None, :]))
    edge = _EDGE * min(a.band, b.band)
    for i, j in zip(rows, columns, strict=True):
        if min(a.values[i].imag, b.values[j].imag) > edge:
            continue
        error = abs(ahead[i] - back[j])
        x = np.linspace(0.0, 1.0, 17)
        start, end = a.values[i].real, b.values[j].real
        cubic = (
            (1.0 + 2.0 * x) * (1.0 - x) ** 2 * start
            + x * (1.0 - x) ** 2 * width * a.slopes[i].real
            + x * x * (3.0 - 2.0 * x) * end
            - x * x * (1.0 - x) * width * b.slopes[j].real
        )
        if cubic.max() + error < 0.0 or cubic.min() - error > 0.0:
            continue
        if start * end < 0.0 and error < 0.2 * (abs(start) + abs(end)) and error < 0.1:
            found.append((a.place, b.place, a.values[i], b.values[j], functions))
        else:
            doubtful = True
            if depth == _DEEPEST and start * end < 0.0:
                found.append((a.place, b.place, a.values[i], b.values[j], functions))
    for spectrum, matched in ((a, rows), (b, columns)):
        # A mode without a partner: two real ones have met, or one has passed the edge.
        for k in set(range(len(spectrum.values))) - set(matched.tolist()):
            reach = abs(spectrum.slopes[k].real) * width
            near = spectrum.values[k].real + reach > 0.0 and spectrum.values[k].imag < edge
            doubtful = doubtful or near
    if not doubtful or depth == _DEEPEST:
        return found
    middle = 0.5 * (a.place + b.place)
    between = _spectrum(state_at, middle, 0.5 * width, functions)
    if between is None:
        return found
    return [
        *_brackets(state_at, a, between, depth + 1),
        *_brackets(state_at, between, b, depth + 1),
    ]


def _located(state_at: StateAt, left, right, first, last, functions) -> Crossing | None:
    """The crossing in a bracket, with so many functions that more do not move it."""
    width = right - left
    place, mode, low, high = None, None, left, right
    for n in (functions, *(m for m in FUNCTIONS if functions < m <= _MOST_FUNCTIONS)):
        before = place

        def guess(s, known=(place, mode)):
            if known[0] is None:
                return first + (s - left) / width * (last - first)
            return known[1] + (s - known[0]) / width * (last - first)

        if before is not None:
            bracket = _around(state_at, before, width, guess, n)
            if bracket is None:
                # With more functions there is no crossing here.
                return None
            low, high = bracket
        found = _root(state_at, low, high, guess, n)
        if found is None:
            return None
        place, mode = found
        if before is not None and abs(place - before) < _SETTLED * width:
            break
    state = state_at(place)
    if state is None or abs(mode.imag) > state.parameters.band:
        return None
    return Crossing(float(place), state, float(abs(mode.imag)), bool(first.real < 0.0), n)


def _around(state_at: StateAt, place, width, guess, functions):
    """Two places about a former crossing between which there is one with these functions."""
    reach = 0.02 * width
    while reach < _FARTHEST * width:
        ends = place - reach, place + reach
        states = [state_at(end) for end in ends]
        if None in states:
            return None
        modes_there = [
            _nearest(state, functions, guess(end))
            for state, end in zip(states, ends, strict=True)
        ]
        if modes_there[0].real * modes_there[1].real < 0.0:
            return ends
        reach *= 2.0
    return None


def _nearest(state: SteadyState, functions: int, guess: complex) -> complex:
    """The mode nearest to a guess."""
    if guess.imag > _SLOW:
        mode = corrected(vibration_matrix(state, functions), guess)
        if mode is not None:
            return mode
    values = slow_modes(state, functions)
    return complex(values[np.argmin(np.abs(values - guess))])


def _root(state_at: StateAt, low, high, guess, functions):
    """Place and mode where the real part of the mode that is guessed is zero; or None."""
    seen = {}

    def real_part(place):
        state = state_at(place)
        if state is None:
            raise ArithmeticError
        seen[place] = _nearest(state, functions, guess(place))
        return seen[place].real

    try:
        place = brentq(real_part, low, high, xtol=_LOCATED * max(abs(low), abs(high), 1e-3))
    except (ArithmeticError, ValueError):
        return None
    return place, seen[min(seen, key=lambda s: abs(s - place))]
