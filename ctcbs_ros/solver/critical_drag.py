"""Least cable drag for unique and for stable solutions (thesis Chapters 3 and 4).

Drag varies at a fixed drag ratio. "Stable" is asked twice: of the state at the first minimum of
the end-mass radius, as the thesis does, and of every state of the branch connected to omega -> 0
up to a limit of omega. Either way a growth rate is a function of drag alone: it is sampled from
above, looked at more closely where it comes near zero in between, and its first zero is located.
That may be a jump, where with falling drag another minimum is born and becomes the first.
"""

from dataclasses import dataclass
from math import exp, inf, log

import numpy as np
from scipy.optimize import brentq, minimize_scalar, root

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.cusp import OMEGA_MAX, least_unique_drag
from ctcbs_ros.solver.family import ANGULAR_RATE
from ctcbs_ros.solver.fold_curve import DRAG, DRAG_RANGE, falling
from ctcbs_ros.solver.level_set import states_at, whole
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import FUNCTIONS, stability
from ctcbs_ros.solver.steady_state import TOLERANCE, SteadyState, correct_state, describe

# First minima of the end-mass radius lie at up to omega 8 within most of Table 2.1; over drag they
# are followed to where no orbit is flown any more.
_FASTEST_MINIMUM = 10.0
_FASTEST_FOLLOWED = 30.0
_SLOWEST = 0.02
_RATIO = 1.6
# Ratio of drags at which a minimum is followed from one to the next.
_FOLLOWED = 1.04
# Two minima at one drag are the same one if ln omega differs by less than this.
_SAME = 1e-4
# How closely in ln d_n a jump from one minimum to another is located, and how many between two
# drags.
_JUMP = 1e-6
_NARROW = 0.004
_MOST_JUMPS = 4
# Step in ln omega of a difference of dh/d ln omega.
_APART = 1e-4
_SCAN = 1e-7
_LOCATED = 1e-10  # ln d_n, in the functions used
# A largest growth rate between two drags is looked for where it is nearer to zero than this.
_NEAR = 0.05
# How far from a place (in ln omega, ln radius) its continuation at another drag is looked for.
_ABOUT = 0.4
# A change of ln d_n by more functions that is small enough.
_SETTLED = 1e-3
# How far above a zero the whole branch is looked at again, and how often.
_BEYOND = 1e-5
_MOST_RIVALS = 5


@dataclass(frozen=True)
class CriticalDrag:
    """Least cable drag above which solutions are unique and stable; None if there is none.

    Attributes
    ----------
    unique : float or None
        Every omega up to the limit has one state.
    stable : float or None
        The state at the first minimum of the end-mass radius is stable (thesis Fig. 4.2): that of
        least omega on the branch connected to omega -> 0 or, where it has none, the one followed
        from larger drag onto the branch that has parted from it.
    stable_everywhere : float or None
        Every state on the branch connected to omega -> 0 is stable, up to the limit of omega; None
        also where it was not asked for.
    """

    unique: float | None
    stable: float | None
    stable_everywhere: float | None

    @property
    def required(self) -> float | None:
        """The larger of `unique` and `stable`."""
        known = [d for d in (self.unique, self.stable) if d is not None]
        return max(known, default=None)


def critical_drag(
    parameters: Parameters, omega_max: float = OMEGA_MAX, everywhere: bool = False
) -> CriticalDrag:
    """Least cable drag for unique and for stable solutions at a fixed drag ratio.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float
        Limit of omega for `unique` and `stable_everywhere`; the first minimum counts wherever it
        is.
    everywhere : bool
        `stable_everywhere` costs more than the others and is left out (None) without this.

    Returns
    -------
    CriticalDrag
        A value is None where the condition holds for every drag in `DRAG_RANGE`, or fails at its
        upper end.
    """
    return CriticalDrag(
        least_unique_drag(parameters, omega_max),
        least_stable_drag(parameters),
        least_drag_stable_everywhere(parameters, omega_max) if everywhere else None,
    )


def least_stable_drag(parameters: Parameters) -> float | None:
    """Least drag above which the state at the first minimum of the radius is stable, or None.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.

    Returns
    -------
    float or None

    Notes
    -----
    The largest drag at which it is not. The first minimum is that of least omega on the branch
    connected to omega -> 0; where that has none up to omega 30, the one that is followed from
    larger drag onto the branch that has parted from it. Without either nothing is unstable.
    """
    minimum = _FirstMinimum(parameters)

    def growth(delta, functions, near):
        state = minimum.at(delta)
        return (-inf if state is None else _growth(state, functions)), None

    return _first_zero_from_above(growth, minimum.drags(), FUNCTIONS[1])


def least_drag_stable_everywhere(
    parameters: Parameters, omega_max: float = OMEGA_MAX
) -> float | None:
    """Least drag above which the branch connected to omega -> 0 is all stable, or None."""
    def growth(delta, functions, near):
        return largest_growth(with_drag(parameters, exp(delta)), omega_max, functions, near)

    drags = (float(delta) for delta in falling(*np.log(DRAG_RANGE), _RATIO))
    return _first_zero_from_above(growth, drags, FUNCTIONS[0])


def with_drag(parameters: Parameters, drag: float) -> Parameters:
    """The same drag ratio at another cable drag."""
    return DRAG.at(parameters, log(drag / parameters.cable_drag))


def main_branch(
    parameters: Parameters, omega_max: float, tolerance: float = 1e-9
) -> np.ndarray:
    """The branch connected to omega -> 0, traced to a limit: (n, 4) of ln omega, u, gradient.

    Raises
    ------
    ArithmeticError
        If the state at omega -> 0 is not unique, which makes no branch connected to it.
    """
    at_one = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    states = states_at(at_one, ANGULAR_RATE, log(_SLOWEST))
    if len(states) != 1:
        raise ArithmeticError(f"{len(states)} steady states at omega {_SLOWEST:g}")
    return whole(
        at_one, ANGULAR_RATE, log(_SLOWEST), states[0], log(_SLOWEST), log(omega_max), tolerance
    )


def first_minimum_state(
    parameters: Parameters, omega_max: float = _FASTEST_MINIMUM
) -> SteadyState | None:
    """The state at the first minimum of the end-mass radius on the branch connected to omega -> 0.

    Parameters
    ----------
    parameters : Parameters
        Its omega does not matter.
    omega_max : float

    Returns
    -------
    SteadyState or None
        That of least omega; None where the radius has no minimum up to the limit.
    """
    points = main_branch(parameters, omega_max, _SCAN)
    start = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    minima = []
    for i in np.flatnonzero(points[:-1, 3] * points[1:, 3] < 0.0):
        # d u/d ln omega = -h_tau/h_u goes from minus to plus with rising omega at a minimum.
        if -points[i, 3] / points[i, 2] * (points[i + 1, 0] - points[i, 0]) > 0.0:
            continue
        tau, u, good = continuation.zero_between(
            start.theta(), ANGULAR_RATE.exponents(), start.length, 0.0, TOLERANCE,
            np.ascontiguousarray(points[i : i + 2]), 3,
        )
        if good:
            minima.append((tau, u))
    if not minima:
        return None
    tau, u = min(minima)
    return correct_state(ANGULAR_RATE.at(start, tau), exp(u))


def largest_growth(
    parameters: Parameters, omega_max: float, functions: int, near: np.ndarray | None = None
) -> tuple[float, np.ndarray]:
    """The largest growth rate on the branch connected to omega -> 0, up to a limit of omega.

    Parameters
    ----------
    parameters : Parameters
        Its omega does not matter.
    omega_max : float
    functions : int
        Functions a coordinate.
    near : (2,) ndarray, optional
        (ln omega, ln(end-mass radius)) about which to look, instead of everywhere.

    Returns
    -------
    growth : float
        Per radian of orbit.
    place : (2,) ndarray
        (ln omega, ln(end-mass radius)) of it.
    """
    points = main_branch(parameters, omega_max, _SCAN)[:, :2]
    at_one = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    theta, exponents = at_one.theta(), ANGULAR_RATE.exponents()
    states, mesh = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)

    def place_at(s):
        i = min(int(s), len(points) - 2)
        tau, u = points[i] + (s - i) * (points[i + 1] - points[i])
        return np.array(continuation.project(
            theta, exponents, at_one.length, 0.0, tau, u, TOLERANCE, states, mesh
        )[:2])

    def growth(s):
        tau, u = place_at(s)
        state = describe(ANGULAR_RATE.at(at_one, tau), u)
        return -inf if state is None else _growth(state, functions)

    looked = np.arange(len(points))
    if near is not None:
        looked = looked[np.abs(points - near).max(axis=1) < _ABOUT]
    if not looked.size:
        return -inf, points[-1]
    rates = np.full(len(points) + 2, -inf)  # the first and the last have no neighbour
    rates[looked + 1] = [growth(float(i)) for i in looked]
    best = int(np.argmax(rates)) - 1
    s, rate = float(best), rates[best + 1]
    # A peak between points may be higher, and the highest of all.
    for i in looked[(looked > 0) & (looked < len(points) - 1)]:
        a, b, c = rates[i : i + 3]
        if not (a <= b >= c) or b < min(rate, 0.0) - _NEAR or not np.isfinite(a + c):
            continue
        refined = minimize_scalar(
            lambda s: -max(growth(s), -1.0), bounds=(i - 1.0, i + 1.0), method="bounded",
            options={"xatol": 1e-3 if near is None else 1e-4, "maxiter": 20},
        )
        if -refined.fun > rate:
            s, rate = float(refined.x), float(-refined.fun)
    return float(rate), place_at(s)


def _growth(state: SteadyState, functions: int) -> float:
    return stability(state, functions=(functions,)).growth_rate


def _first_zero_from_above(growth, drags, rough: int) -> float | None:
    """The largest drag at which a growth rate, negative above, is zero; None without one.

    growth(ln d_n, functions, near) : the growth rate in so many functions a coordinate, and its
    place; near the place of another drag, or anywhere where that is None.
    drags : ln d_n from above, at which the rate is sampled.
    rough : functions for the samples.
    """
    seen: list[tuple[float, float, np.ndarray | None]] = []
    for delta in drags:
        seen.append((delta, *growth(delta, rough, None)))
        zero = None
        if seen[-1][1] >= 0.0:
            if len(seen) == 1:
                return None
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
            high += log(_RATIO)
        try:
            new = float(brentq(followed, low, high, args=(functions,), xtol=_LOCATED))
        except ValueError:
            break
        settled = found is not None and abs(new - found[0]) < _SETTLED
        found, low, high = (new, functions), max(new - 0.01, below), min(new + 0.01, above)
        if settled:
            break
    return found


class _FirstMinimum:
    """The state at the first minimum over ln d_n, in pieces on which it changes continuously.

    It is the minimum of least omega on the branch connected to omega -> 0. Where that branch has
    none, it is the one followed from the nearest larger drag at which it has: the minimum then
    lies on a branch that has parted from it. A piece ends where another minimum becomes the first.
    """

    def __init__(self, parameters: Parameters):
        self.parameters = parameters
        self.known: dict[float, tuple[int, SteadyState | None]] = {}  # piece, state

    def drags(self):
        """ln d_n from above: neighbours at most a ratio apart, and both sides of each jump."""
        deltas = [float(delta) for delta in falling(*np.log(DRAG_RANGE), _RATIO)]
        high, on_branch = deltas[0], self._on_branch(deltas[0])
        self.known[high] = 0, on_branch
        yield high
        for low in deltas[1:]:
            before, on_branch = on_branch, self._on_branch(low)
            if on_branch is None and before is not None:
                # What is followed onto a branch that parts is the minimum it parts with.
                last = self._last_on_branch(high, low)
                yield from self._between(high, last, self._on_branch(last))
                high = last
            yield from self._between(high, low, on_branch)
            high = low

    def at(self, delta: float) -> SteadyState | None:
        """The state at ln d_n, or None where there is no such minimum."""
        if delta in self.known:
            return self.known[delta][1]
        above = min((d for d in self.known if d > delta), default=None)
        below = max((d for d in self.known if d < delta), default=None)
        if None not in (above, below) and self.known[above][0] == self.known[below][0]:
            state = self._followed(above, delta)
            if state is not None:
                self.known[delta] = self.known[above][0], state
                return state
        state = self._on_branch(delta)
        return state if state is not None or above is None else self._followed(above, delta)

    def _on_branch(self, delta: float) -> SteadyState | None:
        there = with_drag(self.parameters, exp(delta))
        return first_minimum_state(there) or first_minimum_state(there, _FASTEST_FOLLOWED)

    def _last_on_branch(self, high: float, low: float) -> float:
        """The least drag of two between at which the branch connected to omega -> 0 has one."""
        while high - low > log(_FOLLOWED):
            middle = 0.5 * (high + low)
            high, low = (high, middle) if self._on_branch(middle) is None else (middle, low)
        return high

    def _between(self, high: float, low: float, on_branch: SteadyState | None):
        """Go on from one drag to a lower one: both sides of each jump on the way, and that one."""
        for _ in range(_MOST_JUMPS):
            if self._continues(high, low, on_branch):
                break
            above, below, first = self._jump(high, low, on_branch)
            if above != high:
                yield above
            self.known[below] = self.known[high][0] + 1, first
            if below == low:
                break
            yield below
            high = below
        else:
            self.known[low] = self.known[high][0] + 1, on_branch
        yield low

    def _jump(self, high: float, below: float, first: SteadyState):
        """Two drags close together between which another minimum becomes the first, and that."""
        above = high
        while above - below > _NARROW:
            middle = 0.5 * (above + below)
            state = self._on_branch(middle)
            if self._continues(above, middle, state):
                above = middle
            else:
                below, first = middle, state
        # It is born with a maximum. While they are close a trace steps over both, Newton does not.
        top = next((d for d in (above, above + _NARROW, above + 3 * _NARROW)
                    if d <= high and self._exists(d, first) is None), None)  # fmt: skip
        if top is not None:
            while top - below > _JUMP:
                middle = 0.5 * (top + below)
                state = self._exists(middle, first)
                if state is None:
                    top = middle
                else:
                    below, first = middle, state
            above = top
            self.known[above] = self.known[high][0], self._followed(high, above)
        return above, below, first

    def _exists(self, delta: float, near: SteadyState) -> SteadyState | None:
        return _minimum_near(with_drag(self.parameters, exp(delta)), near)

    def _continues(self, high: float, low: float, on_branch: SteadyState | None) -> bool:
        """Whether the minimum followed from one drag is still the first at a lower one."""
        piece, state = self.known[high]
        if on_branch is not None and state is not None:
            # One long step does where the minimum moves little.
            moved = self._exists(low, state)
            if not _same(moved, on_branch):
                moved = self._followed(high, low)
        else:
            moved = self._followed(high, low)
        if on_branch is not None and not _same(moved, on_branch):
            return False
        self.known[low] = piece, moved
        return True

    def _followed(self, above: float, delta: float) -> SteadyState | None:
        state = self.known[above][1]
        steps = max(int(np.ceil((above - delta) / log(_FOLLOWED))), 1)
        for between in np.linspace(above, delta, steps + 1)[1:]:
            if state is None:
                return None
            state = _minimum_near(with_drag(self.parameters, exp(between)), state)
        return state


def _same(state: SteadyState | None, other: SteadyState) -> bool:
    return state is not None and abs(
        log(state.parameters.omega / other.parameters.omega)
    ) < _SAME


def _minimum_near(parameters: Parameters, state: SteadyState) -> SteadyState | None:
    """The minimum of the end-mass radius near the one of another drag: h = dh/d ln omega = 0."""
    start = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    states, mesh = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)
    theta, exponents = start.theta(), ANGULAR_RATE.exponents()

    def level(tau, u):
        h, h_u, h_tau, status = continuation.level(
            theta, exponents, start.length, 0.0, tau, u, TOLERANCE, states, mesh
        )
        return (h, h_u, h_tau) if status == OK else (np.nan, np.nan, np.nan)

    def equations(z):
        h, _, h_tau = level(*z)
        return h, h_tau

    guess = (log(state.parameters.omega), log(state.end_mass_radius))
    found = root(equations, guess, tol=1e-10)
    # Judged by the residual: the step cannot get below the integration's own error.
    if not np.abs(found.fun).max() < 1e-9 or np.abs(found.x - guess).max() > 0.3:
        return None
    # d2u/d(ln omega)2 = -h_tautau/h_u is positive at a minimum.
    tau, u = (float(x) for x in found.x)
    _, h_u, before = level(tau - _APART, u)
    _, _, after = level(tau + _APART, u)
    if not (before - after) * h_u > 0.0:
        return None
    return correct_state(ANGULAR_RATE.at(start, tau), exp(u))
