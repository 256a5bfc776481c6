"""The branch connected to omega -> 0: its trace, and the largest growth rate on it.

Along it omega varies at a fixed tow radius. It is the branch that an aircraft is on which has gone
from straight flight into its circle.
"""

from math import inf, log

import numpy as np
from scipy.optimize import minimize_scalar

from ctcbs_ros.kernels import continuation
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.solver.family import ANGULAR_RATE, at_omega_one
from ctcbs_ros.solver.level_set import states_at, whole
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import TOLERANCE, describe

SCAN = 1e-7  # tolerance of a trace that is looked over, its events located anew
_SLOWEST = 0.02
# A growth rate between two points is looked for where it is nearer to zero than this.
_NEAR = 0.05
# How far from a place (in ln omega, ln radius) its continuation at another drag is looked for.
_ABOUT = 0.4


def main_branch(
    parameters: Parameters, omega_max: float, tolerance: float = 1e-9
) -> np.ndarray:
    """The branch connected to omega -> 0, traced to a limit: (n, 4) of ln omega, u, gradient.

    Raises
    ------
    ArithmeticError
        If the state at omega -> 0 is not unique, which makes no branch connected to it.
    """
    at_one = at_omega_one(parameters)
    states = states_at(at_one, ANGULAR_RATE, log(_SLOWEST))
    if len(states) != 1:
        raise ArithmeticError(f"{len(states)} steady states at omega {_SLOWEST:g}")
    return whole(
        at_one, ANGULAR_RATE, log(_SLOWEST), states[0], log(_SLOWEST), log(omega_max), tolerance
    )


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
    points = main_branch(parameters, omega_max, SCAN)[:, :2]
    at_one = at_omega_one(parameters)
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
        return -inf if state is None else stability(state, functions=(functions,)).growth_rate

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
