"""The largest drag at which a growth rate is zero, whatever state the rate is of.

The rate is a function of drag alone, negative above. It is sampled from above with few functions,
looked at more closely where it comes near zero in between, and its first zero is located with as
many functions as it needs. That may be a jump of the rate.
"""

from math import exp, inf, log

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ctcbs_ros.solver.stability import FUNCTIONS
from ctcbs_ros.solver.surface import DRAG_RANGE, DRAG_STEP, falling

# ln d_n at which a rate is sampled, from above.
SAMPLED: tuple[float, ...] = tuple(falling(*np.log(DRAG_RANGE)).tolist())
_LOCATED = 1e-10  # ln d_n, in the functions used
# A largest growth rate between two drags is looked for where it is nearer to zero than this.
_NEAR = 0.05
# A change of ln d_n by more functions that is small enough.
_SETTLED = 1e-3
# How far above a zero the whole branch is looked at again, and how often.
_BEYOND = 1e-5
_MOST_RIVALS = 5


def first_zero_from_above(growth, drags, rough: int) -> float | None:
    """The largest drag at which a growth rate, negative above, is zero.

    Parameters
    ----------
    growth : callable
        (ln d_n, functions, near) -> the growth rate in so many functions a coordinate, and its
        place; near the place of another drag, or anywhere where that is None.
    drags : iterable of float
        ln d_n from above, at which the rate is sampled.
    rough : int
        Functions for the samples.

    Returns
    -------
    float or None
        None where the rate is negative at every drag; inf where it is not at the largest.
    """
    seen: list[tuple[float, float, np.ndarray | None]] = []
    for delta in drags:
        seen.append((delta, *growth(delta, rough, None)))
        zero = None
        if seen[-1][1] >= 0.0:
            if len(seen) == 1:
                return inf
            zero = _zero(growth, *seen[-1], seen[-2][0])
        else:
            peak = _peak(growth, seen[-3:], rough)
            if peak is not None and peak[1] >= 0.0:
                zero = _zero(growth, *peak, seen[-3][0])
        # None where more functions say that it decays.
        if zero is not None:
            return zero
    return None


def _peak(growth, three, functions):
    """The largest rate near the middle of three drags, where that is the highest and near zero."""
    if len(three) < 3:
        return None
    (high, a, _), (_, b, near), (low, c, _) = three
    if not (a < b > c and b > -_NEAR):
        return None
    found = minimize_scalar(
        lambda delta: -max(growth(delta, functions, near)[0], -1.0),
        bounds=(low, high), method="bounded", options={"xatol": 1e-3, "maxiter": 15},
    )
    return float(found.x), -float(found.fun), near


def _zero(growth, below: float, rate: float, near, above: float) -> float | None:
    """The largest drag between two at which the rate is zero, with enough functions."""
    delta, tried = None, FUNCTIONS[1:]
    for _ in range(_MOST_RIVALS):
        found = _zero_near(growth, below, near, above, tried)
        if found is None:
            break
        delta, functions = found
        if near is None:
            break
        # Another mode, or another place, may be ahead of the one that was followed.
        below, tried = delta + _BEYOND, tuple(n for n in FUNCTIONS if n >= functions)
        rate, near = growth(below, functions, None)
        if rate < 0.0:
            break
    return None if delta is None else exp(delta)


def _zero_near(growth, below: float, near, above: float, tried) -> tuple[float, int] | None:
    """The zero of the rate that is followed from a place at the lower drag, and with how many."""
    place, found = [near], None

    def followed(delta, functions):
        rate, where = growth(delta, functions, place[0])
        if np.isfinite(rate):
            place[0] = where
        return max(rate, -1.0)

    low, high = below, above
    for functions in tried:
        if followed(low, functions) < 0.0 or followed(high, functions) >= 0.0:
            low, high = below, above
        while followed(high, functions) >= 0.0 and high < log(DRAG_RANGE[1]):
            # Fewer functions said that it decays here.
            high += log(DRAG_STEP)
        try:
            new = float(brentq(followed, low, high, args=(functions,), xtol=_LOCATED))
        except ValueError:
            break
        settled = found is not None and abs(new - found[0]) < _SETTLED
        found, low, high = (new, functions), max(new - 0.01, below), min(new + 0.01, above)
        if settled:
            break
    return found
