"""Continuation of steady states along a one-parameter family of towed cables.

Every family of interest is a power law: with tau the logarithm of the quantity that varies,

    theta_i(tau) = theta_i exp(e_i tau),   l(tau) = l exp(e_l tau)

(angular rate at fixed tow radius: omega alone; tow radius at fixed speed: all of them).
The states are the level set h(tau, u) = 0 of one smooth function, u = ln x_d, and are traced as
such, by arc length in the (tau, u) plane; a fold is a point with dh/du = 0 and nothing special to
the trace.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import N_THETA, OK, X_D, G, integrate

LEFT_RANGE, CLOSED, FULL, LOST = range(4)


@kernel
def slope_over_length(state, g, length):
    """Return dh/d ln(length): a longer cable goes on along its tension, stretched.

    state : (6,) position and tension at the tow point; g : the stretch per tension.
    """
    x, y, fx, fy, fz = state[0], state[1], state[3], state[4], state[5]
    p = np.sqrt(fx * fx + fy * fy + fz * fz)
    return 2.0 * (x * fx + y * fy) * (1.0 / p + g) * length


@kernel
def level(theta, exponents, length, length_exponent, tau, u, tolerance, states, mesh):
    """Return h, dh/du, dh/dtau and the status of the integration.

    theta, exponents : (8,) at tau = 0; states : (1, 3, 6) and mesh, work space.
    """
    here = np.empty(N_THETA)
    directions = np.zeros((2, N_THETA))
    for i in range(N_THETA):
        here[i] = theta[i] * np.exp(exponents[i] * tau)
        directions[1, i] = exponents[i] * here[i]
    here[X_D] = np.exp(u)
    directions[0, X_D] = here[X_D]
    directions[1, X_D] = 0.0
    end = length * np.exp(length_exponent * tau)
    nodes = np.array([end])
    status, _, _ = integrate(here, directions, nodes, tolerance, MAX_STEPS, states, mesh)
    x, y = states[0, 0, 0], states[0, 0, 1]
    h = x * x + y * y - 1.0
    h_u = 2.0 * (x * states[0, 1, 0] + y * states[0, 1, 1])
    h_tau = 2.0 * (x * states[0, 2, 0] + y * states[0, 2, 1])
    h_tau += slope_over_length(states[0, 0], here[G], end) * length_exponent
    if status == OK and not (np.isfinite(h) and np.isfinite(h_u) and np.isfinite(h_tau)):
        status = 2
    return h, h_u, h_tau, status


@kernel
def project(theta, exponents, length, length_exponent, tau, u, tolerance, states, mesh):
    """Correct a point onto the level set along the gradient (Gauss-Newton).

    Returns tau, u, the gradient (h_u, h_tau) there, the distance moved, and whether it converged.
    """
    moved = 0.0
    h_u, h_tau = 0.0, 0.0
    for _ in range(8):
        h, h_u, h_tau, status = level(
            theta, exponents, length, length_exponent, tau, u, tolerance, states, mesh
        )
        square = h_u * h_u + h_tau * h_tau
        if status != OK or square == 0.0:
            return tau, u, h_u, h_tau, moved, False
        step = abs(h) / np.sqrt(square)
        tau -= h * h_tau / square
        u -= h * h_u / square
        moved += step
        if moved > 0.5:
            return tau, u, h_u, h_tau, moved, False
        if step < 1e-6:
            return tau, u, h_u, h_tau, moved, True
    return tau, u, h_u, h_tau, moved, False


@kernel
def trace(
    theta, exponents, length, length_exponent, u, direction, tau_low, tau_high, tolerance, points
):
    """Trace the level set from (tau = 0, u) until it leaves [tau_low, tau_high] or closes.

    Parameters
    ----------
    theta, exponents, length, length_exponent
        The family, at tau = 0.
    u : float
        A state at tau = 0.
    direction : float
        +1 to start towards rising tau, -1 towards falling.
    points : (n, 4) array, written
        tau, u, and dh/du, dh/dtau there; the last point is outside the range if the trace left.

    Returns
    -------
    status : int
        LEFT_RANGE, CLOSED, FULL (n points did not suffice) or LOST (no further point found).
    count : int
    """
    states = np.empty((1, 3, 6))
    mesh = np.empty(MAX_STEPS + 1)
    tau, u, h_u, h_tau, _, good = project(
        theta, exponents, length, length_exponent, 0.0, u, tolerance, states, mesh
    )
    if not good:
        return LOST, 0
    size = np.sqrt(h_u * h_u + h_tau * h_tau)
    # The gradient stays on one side of the curve. Where it changes side, a step has gone over a
    # narrow neck (a saddle of h) to another curve.
    side = -1.0 if h_u * direction < 0.0 else 1.0
    t_tau, t_u = side * h_u / size, -side * h_tau / size
    points[0, 0], points[0, 1], points[0, 2], points[0, 3] = tau, u, h_u, h_tau
    count = 1
    step = 0.02
    start_tau, start_u = tau, u
    travelled = 0.0
    while count < points.shape[0]:
        new_tau, new_u, g_u, g_tau, moved, good = project(
            theta, exponents, length, length_exponent,
            tau + step * t_tau, u + step * t_u, tolerance, states, mesh,
        )
        size = np.sqrt(g_u * g_u + g_tau * g_tau)
        n_tau, n_u = 0.0, 0.0
        if good:
            n_tau, n_u = side * g_u / size, -side * g_tau / size
            turn = 1.0 - (n_tau * t_tau + n_u * t_u)
            # Near a fold (a tangent almost along u) steps are shorter, so that a pair of folds
            # about to merge in a cusp shows as two changes of sign and not as none.
            steep = min(abs(n_tau), abs(t_tau)) < 0.15
            good = turn < 0.02 and moved < 0.5 * step and not (steep and step > 0.02)
        if not good:
            step *= 0.5
            if step < 1e-7:
                return LOST, count
            continue
        travelled += step
        tau, u, t_tau, t_u = new_tau, new_u, n_tau, n_u
        points[count, 0], points[count, 1] = tau, u
        points[count, 2], points[count, 3] = g_u, g_tau
        count += 1
        if tau < tau_low or tau > tau_high:
            return LEFT_RANGE, count
        if travelled > 4.0 * step and np.hypot(tau - start_tau, u - start_u) < 0.7 * step:
            return CLOSED, count
        if turn < 0.004:
            step = min(0.12, 1.5 * step)
    return FULL, count


@kernel
def zero_between(theta, exponents, length, length_exponent, tolerance, points, column):
    """Locate where one component of the gradient vanishes between two points of a trace.

    Parameters
    ----------
    theta, exponents, length, length_exponent
        The family, at tau = 0.
    tolerance : float
        Of the integration.
    points : (2, 4) array
        Two neighbours of a trace, the component of opposite sign at them.
    column : int
        2 for dh/du (a fold), 3 for dh/dtau (an extremum of the end-mass radius).

    Returns
    -------
    tau, u : float
    converged : bool
    """
    states = np.empty((1, 3, 6))
    mesh = np.empty(MAX_STEPS + 1)
    tau, u = points[0, 0], points[0, 1]
    # The chord is a coordinate of the curve in between: bisection guarded regula falsi (Illinois).
    a, b = 0.0, 1.0
    size_a = np.sqrt(points[0, 2] ** 2 + points[0, 3] ** 2)
    size_b = np.sqrt(points[1, 2] ** 2 + points[1, 3] ** 2)
    fa, fb = points[0, column] / size_a, points[1, column] / size_b
    side = 0
    for _ in range(60):
        c = (a * fb - b * fa) / (fb - fa)
        tau, u, h_u, h_tau, _, good = project(
            theta, exponents, length, length_exponent,
            points[0, 0] + c * (points[1, 0] - points[0, 0]),
            points[0, 1] + c * (points[1, 1] - points[0, 1]),
            tolerance, states, mesh,
        )
        if not good:
            return tau, u, False
        fc = (h_u if column == 2 else h_tau) / np.sqrt(h_u * h_u + h_tau * h_tau)
        if abs(fc) < 1e-9 or b - a < 1e-13:
            return tau, u, True
        if fc * fa > 0.0:
            a, fa = c, fc
            if side == 1:
                fb *= 0.5
            side = 1
        else:
            b, fb = c, fc
            if side == -1:
                fa *= 0.5
            side = -1
    return tau, u, False


@kernel
def fold(theta, exponents, length, length_exponent, tolerance, points):
    """Locate the fold h = 0, dh/du = 0 between two neighbours of a trace; see `zero_between`."""
    return zero_between(theta, exponents, length, length_exponent, tolerance, points, 2)


@kernel
def correct_fold(theta, exponents, length, length_exponent, tau, u, tolerance):
    """Newton's method for a fold, h = dh/du = 0, from a guess near it.

    Second derivatives of h are central differences of its analytic first ones.

    Returns
    -------
    tau, u : float
    converged : bool
    """
    states = np.empty((1, 3, 6))
    mesh = np.empty(MAX_STEPS + 1)
    e = 1e-4
    for _ in range(12):
        h, h_u, h_tau, status = level(
            theta, exponents, length, length_exponent, tau, u, tolerance, states, mesh
        )
        _, up, up_tau, status1 = level(
            theta, exponents, length, length_exponent, tau, u + e, tolerance, states, mesh
        )
        _, down, down_tau, status2 = level(
            theta, exponents, length, length_exponent, tau, u - e, tolerance, states, mesh
        )
        if status != OK or status1 != OK or status2 != OK:
            return tau, u, False
        h_uu = (up - down) / (2.0 * e)
        h_utau = (up_tau - down_tau) / (2.0 * e)
        # [h_tau h_u; h_utau h_uu] (d tau, d u) = -(h, h_u)
        determinant = h_tau * h_uu - h_u * h_utau
        if determinant == 0.0:
            return tau, u, False
        d_tau = (-h * h_uu + h_u * h_u) / determinant
        d_u = (-h_tau * h_u + h_utau * h) / determinant
        if abs(d_tau) > 0.2 or abs(d_u) > 0.2:
            return tau, u, False
        tau += d_tau
        u += d_u
        if abs(d_tau) < 1e-9 and abs(d_u) < 1e-6:
            return tau, u, True
    return tau, u, False
