"""Cusps, and the least cable drag for unique and for stable solutions (thesis Chapters 3 and 4).

Drag varies at a fixed drag ratio. With enough of it the branch connected to omega -> 0 is the only
one, and single-valued; what ends that when drag falls is a cusp, in which two folds are born, or a
fold that enters the range of omega, or an isolated branch.
"""

from dataclasses import dataclass
from math import exp, log

import numpy as np
from scipy.optimize import root

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import TOLERANCE, correct_state, steady_states

OMEGA_MAX = 3.0
DRAG_RANGE = (0.01, 2000.0)
DRAG = Family("cable_drag", cable_drag=1.0, end_mass_drag=1.0)
# First minima of the end-mass radius lie at up to omega 8 within Table 2.1.
_FASTEST_MINIMUM = 10.0
_SLOWEST = 0.02
# Ratio of neighbouring trial drags, and of those at which a minimum is followed: what happens in a
# window of drag narrower than the first may be passed over.
_STEP = 1.25
_FOLLOWED = 1.04
_MOST_POINTS = 4000
_STENCIL = 3e-3


@dataclass(frozen=True)
class Cusp:
    """A point where two folds merge: omega, cable drag d_n, end-mass radius."""

    omega: float
    cable_drag: float
    end_mass_radius: float


@dataclass(frozen=True)
class CriticalDrag:
    """Least cable drag above which solutions are unique, stable, and both; None if there is none.

    `unique` holds for every omega up to the limit; `stable` at the first minimum of the end-mass
    radius.
    """

    unique: float | None
    stable: float | None

    @property
    def required(self) -> float | None:
        """The larger of the two."""
        known = [d for d in (self.unique, self.stable) if d is not None]
        return max(known, default=None)


def main_branch(parameters: Parameters, omega_max: float) -> np.ndarray:
    """The branch connected to omega -> 0, traced to `omega_max`: (n, 4) of ln(omega), u, gradient.

    Raises
    ------
    ArithmeticError
        If the state at omega -> 0 is not unique, which makes no branch connected to it.
    """
    start = ANGULAR_RATE.at(parameters, log(_SLOWEST / parameters.omega))
    states = steady_states(start).states
    if len(states) != 1:
        raise ArithmeticError(f"{len(states)} steady states at omega {_SLOWEST:g}")
    points = np.empty((_MOST_POINTS, 4))
    _, count = continuation.trace(
        start.theta(), ANGULAR_RATE.exponents(), start.length, 0.0,
        log(states[0].end_mass_radius), 1.0, -1.0, log(omega_max / _SLOWEST), 1e-9, points,
    )
    points = points[:count].copy()
    points[:, 0] += log(_SLOWEST)
    return points


def cusp(parameters: Parameters, omega_max: float = OMEGA_MAX) -> Cusp | None:
    """The cusp of largest cable drag on the branch connected to omega -> 0.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float
        Cusps beyond it do not count.

    Returns
    -------
    Cusp or None
        None where the branch has no folds for any drag in `DRAG_RANGE`.
    """
    above = None
    for drag in _falling_drags():
        pair = _fold_pair(_with_drag(parameters, drag), omega_max)
        if pair is not None:
            break
        above = drag
    else:
        return None
    if above is None:
        return None
    # A narrower bracket, so that the pair is close and the cusp is between.
    below = drag
    for _ in range(6):
        middle = (above * below) ** 0.5
        closer = _fold_pair(_with_drag(parameters, middle), omega_max)
        if closer is None:
            above = middle
        else:
            below, pair = middle, closer
    ln_omega, u = pair
    return _newton_cusp(parameters, u, ln_omega, log(below))


def critical_drag(parameters: Parameters, omega_max: float = OMEGA_MAX) -> CriticalDrag:
    """Least cable drag for unique and for stable solutions at a fixed drag ratio.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float
        Limit of omega for uniqueness.

    Returns
    -------
    CriticalDrag
    """
    return CriticalDrag(_least_unique(parameters, omega_max), _least_stable(parameters))


def first_minimum_state(parameters: Parameters):
    """The state at the first minimum of the end-mass radius on the branch connected to omega -> 0.

    Returns
    -------
    SteadyState or None
        None where the radius has no minimum up to omega 10.
    """
    points = main_branch(parameters, _FASTEST_MINIMUM)
    start = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    for i in np.flatnonzero(points[:-1, 3] * points[1:, 3] < 0.0):
        # d u/d ln omega = -h_tau/h_u goes from minus to plus with rising omega at a minimum.
        if -points[i, 3] / points[i, 2] * (points[i + 1, 0] - points[i, 0]) > 0.0:
            continue
        tau, u, good = continuation.zero_between(
            start.theta(), ANGULAR_RATE.exponents(), start.length, 0.0, TOLERANCE,
            np.ascontiguousarray(points[i : i + 2]), 3,
        )
        if good:
            return correct_state(ANGULAR_RATE.at(start, tau), exp(u))
    return None


def _with_drag(parameters: Parameters, drag: float) -> Parameters:
    return DRAG.at(parameters, log(drag / parameters.cable_drag))


def _falling_drags():
    low, high = DRAG_RANGE
    count = int(np.ceil(log(high / low) / log(_STEP))) + 1
    return np.geomspace(high, low, count)


def _fold_pair(parameters: Parameters, omega_max: float) -> tuple[float, float] | None:
    """Midpoint (ln omega, u) between the first two folds of the main branch, if it has any."""
    points = main_branch(parameters, omega_max)
    turns = np.flatnonzero(points[:-1, 2] * points[1:, 2] < 0.0)
    if turns.size < 2:
        return None
    between = points[turns[0] : turns[1] + 2, :2]
    return float(between[:, 0].mean()), float(between[:, 1].mean())


def _newton_cusp(parameters, u, ln_omega, ln_drag) -> Cusp | None:
    """Newton's method for h = h_u = h_uu = 0 in (u, ln omega, ln d_n).

    First derivatives of h are analytic; higher ones in u are five-point differences of them.
    """
    for _ in range(25):
        residual, jacobian = _cusp_equations(parameters, u, ln_omega, ln_drag)
        if residual is None:
            return None
        try:
            step = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        step *= min(1.0, 0.3 / size)
        u, ln_omega, ln_drag = u + step[0], ln_omega + step[1], ln_drag + step[2]
        if size < 1e-9:
            return Cusp(exp(ln_omega), exp(ln_drag), exp(u))
    return None


def _cusp_equations(parameters, u, ln_omega, ln_drag):
    here = _with_drag(parameters, exp(ln_drag))
    here = ANGULAR_RATE.at(here, ln_omega - log(here.omega))
    states, mesh = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)
    # Rows: h_u, dh/d ln omega, dh/d ln d_n at u - 2e .. u + 2e.
    rows = np.empty((3, 5))
    h = 0.0
    for j, shift in enumerate((-2, -1, 0, 1, 2)):
        for row, family in ((1, ANGULAR_RATE), (2, DRAG)):
            value, h_u, h_tau, status = continuation.level(
                here.theta(), family.exponents(), here.length, 0.0, 0.0, u + shift * _STENCIL,
                1e-12, states, mesh,
            )
            if status != OK:
                return None, None
            rows[0, j], rows[row, j] = h_u, h_tau
            if shift == 0:
                h = value
    first = rows @ np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * _STENCIL)
    second = rows @ np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * _STENCIL**2)
    residual = np.array([h, rows[0, 2], first[0]])
    jacobian = np.array(
        [
            [rows[0, 2], rows[1, 2], rows[2, 2]],
            [first[0], first[1], first[2]],
            [second[0], second[1], second[2]],
        ]
    )
    return residual, jacobian


def _least_unique(parameters: Parameters, omega_max: float) -> float | None:
    above = None
    for drag in _falling_drags():
        if _is_multivalued(_with_drag(parameters, drag), omega_max):
            break
        above = drag
    else:
        return None
    if above is None:
        return None
    below = drag
    born = cusp(parameters, omega_max)
    if born is not None and below <= born.cable_drag <= above:
        just_above = _with_drag(parameters, born.cable_drag * (1.0 + 1e-3))
        if born.omega <= omega_max and not _is_multivalued(just_above, omega_max):
            return born.cable_drag
    while above / below > 1.0 + 1e-9:
        middle = (above * below) ** 0.5
        if _is_multivalued(_with_drag(parameters, middle), omega_max):
            below = middle
        else:
            above = middle
    return above


def _is_multivalued(parameters: Parameters, omega_max: float) -> bool:
    """Whether there is more than one state anywhere up to a limit of omega."""
    points = main_branch(parameters, omega_max)
    if np.any(points[:-1, 2] * points[1:, 2] < 0.0):
        return True
    # Isolated branches reach up in omega without end: they show at the limit, and above 0.5.
    for omega in np.geomspace(0.5, omega_max, 12):
        here = ANGULAR_RATE.at(parameters, log(omega / parameters.omega))
        if len(steady_states(here).states) > 1:
            return True
    return False


def _least_stable(parameters: Parameters) -> float | None:
    """Least drag above which the state at the first minimum of the radius is stable."""
    above, stable_state = None, None
    for drag in _falling_drags():
        state = _first_minimum(parameters, float(drag), above, stable_state)
        if state is not None and stability(state).growth_rate >= 0.0:
            break
        # Without a minimum there is nothing to be unstable at; another may come at less drag.
        above, stable_state = float(drag), state
    else:
        return None
    if above is None:
        return None
    below = float(drag)
    while above / below > 1.0 + 1e-9:
        middle = (above * below) ** 0.5
        state = _first_minimum(parameters, middle, above, stable_state)
        if state is not None and stability(state).growth_rate >= 0.0:
            below = middle
        else:
            above, stable_state = middle, state
    return above


def _first_minimum(parameters: Parameters, drag: float, before: float | None, known):
    """The state at the first minimum of the radius, at one drag.

    Where the minimum lies on a branch that has parted from the one connected to omega -> 0, it is
    followed from the drag `before`, at which `known` is the state.
    """
    state = first_minimum_state(_with_drag(parameters, drag))
    if state is not None or known is None:
        return state
    steps = int(np.ceil(abs(log(drag / before)) / log(_FOLLOWED))) or 1
    for between in np.geomspace(before, drag, steps + 1)[1:]:
        known = _minimum_near(_with_drag(parameters, float(between)), known)
        if known is None:
            return None
    return known


def _minimum_near(parameters: Parameters, state):
    """The extremum of the end-mass radius near the one of another drag: h = dh/d ln omega = 0."""
    start = ANGULAR_RATE.at(parameters, -log(parameters.omega))
    states, mesh = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)
    theta, exponents = start.theta(), ANGULAR_RATE.exponents()

    def equations(z):
        h, _, h_tau, status = continuation.level(
            theta, exponents, start.length, 0.0, z[0], z[1], TOLERANCE, states, mesh
        )
        return (h, h_tau) if status == OK else (np.nan, np.nan)

    guess = (log(state.parameters.omega), log(state.end_mass_radius))
    found = root(equations, guess, tol=1e-10)
    # Judged by the residual: the step cannot get below the integration's own error.
    if not np.abs(found.fun).max() < 1e-9 or np.abs(found.x - guess).max() > 0.3:
        return None
    return correct_state(ANGULAR_RATE.at(start, float(found.x[0])), exp(found.x[1]))
