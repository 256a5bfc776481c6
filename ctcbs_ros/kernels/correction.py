"""One steady state from a guess of its end-mass radius, and the evidence that it is one.

Newton's method in u = ln x_d for h(u) = 0 of `ctcbs_ros.kernels.search`: first with integration
steps just small enough to come near, then with those that the result needs. The state found is
then integrated once more with every step halved; what is reported comes from there, and h there
is the residual.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.search import MAX_STEPS, tow_circle
from ctcbs_ros.kernels.trajectory import OK, X_D, integrate_halved

RESIDUAL_LIMIT = 1e-9
# Local error of an integration step on the way; and those of the result, tried in turn until the
# residual is met.
_ROUGH = 1e-6
_TOLERANCES = (1e-11, 1e-12, 1e-13)
# Newton's error squares: a step of the first size leaves about the rough integration's own error,
# one of the second less than the residual, which proves it.
_NEAR, _THERE = 1e-3, 1e-5
_MOST_ITERATIONS = 12
# A correction of u beyond this means another state, not a better integration.
_LARGEST_MENDING = 1e-7

# What `out` holds; X .. F_Z are position and tension vector at the tow point.
U, MISS, SLOPE, LEAST_TENSION, GREATEST_TENSION, X, Y, Z, F_X, F_Y, F_Z = range(11)
N_OUT = 11


@kernel
def correct(theta, length, u, max_step, out):
    """Correct a guess by Newton's method and describe the state it leads to.

    Parameters
    ----------
    theta : (8,) array
        Parameters; x_d is overwritten.
    length : float
    u : float
        ln(end-mass radius) near the wanted state.
    max_step : float
        How far u may move.
    out : (11,) array, written
        As by `describe`.

    Returns
    -------
    good : bool
        False where Newton's method fails or goes too far.
    """
    states = np.empty((1, 2, 6))
    mesh = np.empty(MAX_STEPS + 1)
    start = u
    tolerance = _ROUGH
    for _ in range(_MOST_ITERATIONS):
        h, slope, status, steps, least = tow_circle(theta, length, u, tolerance, states, mesh)
        if status != OK or slope == 0.0:
            return False
        step = -h / slope
        if not abs(u + step - start) <= max_step:
            return False
        u += step
        if tolerance == _ROUGH:
            if abs(step) < _NEAR:
                tolerance = _TOLERANCES[0]
        elif abs(step) < _THERE:
            # The mesh of the last iteration serves: u has hardly moved.
            return _check(theta, length, u, slope, least, steps, mesh, out) or _mend(
                theta, length, out, states, mesh
            )
    return False


@kernel
def describe(theta, length, u, out):
    """Describe the state at u as it is, whether or not it fulfils the tow-circle condition.

    Parameters
    ----------
    theta : (8,) array
        Parameters; x_d is overwritten.
    length, u : float
    out : (11,) array, written
        u; h there, integrated with every step halved; dh/du, whose sign tells on which side of a
        fold the state lies; least and greatest tension; position and tension vector at the tow
        point. u has moved a little where the state had to be mended.

    Returns
    -------
    good : bool
        False where the integration fails.
    """
    states = np.empty((1, 2, 6))
    mesh = np.empty(MAX_STEPS + 1)
    _, slope, status, steps, least = tow_circle(theta, length, u, _TOLERANCES[0], states, mesh)
    if status != OK:
        return False
    return _check(theta, length, u, slope, least, steps, mesh, out) or _mend(
        theta, length, out, states, mesh
    )


@kernel
def _check(theta, length, u, slope, least, steps, mesh, out):
    """Integrate over the halved steps of a mesh into `out`; return whether the residual is met."""
    theta[X_D] = np.exp(u)
    end, greatest = integrate_halved(theta, mesh, steps)
    out[U], out[SLOPE], out[LEAST_TENSION], out[GREATEST_TENSION] = u, slope, least, greatest
    out[MISS] = end[0] * end[0] + end[1] * end[1] - 1.0
    out[X:] = end
    return abs(out[MISS]) < RESIDUAL_LIMIT


@kernel
def _mend(theta, length, out, states, mesh):
    """Correct a state whose residual is not met with smaller steps, where it is nearly right.

    Where the cable nearly lies along its velocity at some point, |v_n| v_n bends sharply and a
    step's error estimate can be too small.
    """
    for tolerance in _TOLERANCES[1:]:
        if not abs(out[MISS]) <= _LARGEST_MENDING * abs(out[SLOPE]):
            break
        u = out[U] - out[MISS] / out[SLOPE]
        _, slope, status, steps, least = tow_circle(theta, length, u, tolerance, states, mesh)
        if status != OK:
            return False
        if _check(theta, length, u, slope, least, steps, mesh, out):
            break
    return True
