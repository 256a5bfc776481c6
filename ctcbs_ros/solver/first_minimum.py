"""The first minimum of the end-mass radius over omega, at one drag and followed over drag.

It is where a mass is best towed, and where the thesis asks for stability (Fig. 4.2). With falling
drag it moves continuously but for jumps: another minimum is born at less omega and becomes the
first, or the branch it lies on parts from the one connected to omega -> 0.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import exp, log

import numpy as np
from scipy.optimize import root

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.family import ANGULAR_RATE, at_omega_one
from ctcbs_ros.solver.main_branch import SCAN, main_branch
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import TOLERANCE, SteadyState, correct_state

# First minima lie at up to omega 8 within most of Table 2.1; over drag they are followed to where
# no orbit is flown any more.
_FASTEST_MINIMUM = 10.0
_FASTEST_FOLLOWED = 30.0
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
    points = main_branch(parameters, omega_max, SCAN)
    start = at_omega_one(parameters)
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


class FirstMinimum:
    """The state at the first minimum over ln d_n, in pieces on which it changes continuously.

    It is the minimum of least omega on the branch connected to omega -> 0. Where that branch has
    none, it is the one followed from the nearest larger drag at which it has: the minimum then
    lies on a branch that has parted from it. A piece ends where another minimum becomes the first.
    """

    def __init__(self, parameters: Parameters):
        self._parameters = parameters
        self._known: dict[float, tuple[int, SteadyState | None]] = {}  # piece, state

    def drags(self, deltas: Sequence[float]) -> Iterator[float]:
        """Those of ln d_n from above, and both sides of each jump between them."""
        high, on_branch = deltas[0], self._on_branch(deltas[0])
        self._known[high] = 0, on_branch
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
        if delta in self._known:
            return self._known[delta][1]
        above = min((d for d in self._known if d > delta), default=None)
        below = max((d for d in self._known if d < delta), default=None)
        if None not in (above, below) and self._known[above][0] == self._known[below][0]:
            state = self._followed(above, delta)
            if state is not None:
                self._known[delta] = self._known[above][0], state
                return state
        state = self._on_branch(delta)
        return state if state is not None or above is None else self._followed(above, delta)

    def _with_drag(self, delta: float) -> Parameters:
        return replace(self._parameters, cable_drag=exp(delta))

    def _on_branch(self, delta: float) -> SteadyState | None:
        there = self._with_drag(delta)
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
            self._known[below] = self._known[high][0] + 1, first
            if below == low:
                break
            yield below
            high = below
        else:
            self._known[low] = self._known[high][0] + 1, on_branch
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
            self._known[above] = self._known[high][0], self._followed(high, above)
        return above, below, first

    def _exists(self, delta: float, near: SteadyState) -> SteadyState | None:
        return _minimum_near(self._with_drag(delta), near)

    def _continues(self, high: float, low: float, on_branch: SteadyState | None) -> bool:
        """Whether the minimum followed from one drag is still the first at a lower one."""
        piece, state = self._known[high]
        if on_branch is not None and state is not None:
            # One long step does where the minimum moves little.
            moved = self._exists(low, state)
            if not _same(moved, on_branch):
                moved = self._followed(high, low)
        else:
            moved = self._followed(high, low)
        if on_branch is not None and not _same(moved, on_branch):
            return False
        self._known[low] = piece, moved
        return True

    def _followed(self, above: float, delta: float) -> SteadyState | None:
        state = self._known[above][1]
        steps = max(int(np.ceil((above - delta) / log(_FOLLOWED))), 1)
        for between in np.linspace(above, delta, steps + 1)[1:]:
            if state is None:
                return None
            state = _minimum_near(self._with_drag(between), state)
        return state


def _same(state: SteadyState | None, other: SteadyState) -> bool:
    return state is not None and abs(
        log(state.parameters.omega / other.parameters.omega)
    ) < _SAME


def _minimum_near(parameters: Parameters, state: SteadyState) -> SteadyState | None:
    """The minimum of the end-mass radius near the one of another drag: h = dh/d ln omega = 0."""
    start = at_omega_one(parameters)
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
