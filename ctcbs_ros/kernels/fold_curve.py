"""Continuation of folds in two parameters.

Two families of towed cables at once (`ctcbs_ros.kernels.continuation` has the one): with tau and
delta the logarithms of what varies,

    theta_i(tau, delta) = theta_i exp(e1_i tau + e2_i delta),   l alike.

The steady states are a surface h(tau, delta, u) = 0, u = ln x_d. Its folds, h = h_u = 0, are a
smooth curve in these three coordinates, through its cusps (h_uu = 0) as well, and are traced as
such by arc length; so is any curve h = g = 0 of which g and its gradient are known.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.continuation import CLOSED, FULL, LEFT_RANGE, LOST, slope_over_length
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import N_THETA, OK, X_D, G, integrate

# Second derivatives of h are central differences of its analytic first ones.
_DIFFERENCE = 3e-4


@kernel
def surface(theta, exponents, length, length_exponents, z, tolerance, states, mesh, out):
    """Write h and its derivatives by tau, delta and u to `out`, (4,); return the status.

    theta : (8,) at tau = delta = 0; exponents : (2, 8); length_exponents : (2,)
    z : (3,) tau, delta, u; states : (1, 4, 6) and mesh, work space.
    """
    here = np.empty(N_THETA)
    directions = np.zeros((3, N_THETA))
    for i in range(N_THETA):
        here[i] = theta[i] * np.exp(exponents[0, i] * z[0] + exponents[1, i] * z[1])
        directions[0, i] = exponents[0, i] * here[i]
        directions[1, i] = exponents[1, i] * here[i]
    here[X_D] = np.exp(z[2])
    directions[0, X_D] = 0.0
    directions[1, X_D] = 0.0
    directions[2, X_D] = here[X_D]
    end = length * np.exp(length_exponents[0] * z[0] + length_exponents[1] * z[1])
    nodes = np.array([end])
    status, _, _ = integrate(here, directions, nodes, tolerance, MAX_STEPS, states, mesh)
    x, y = states[0, 0, 0], states[0, 0, 1]
    out[0] = x * x + y * y - 1.0
    for j in range(3):
        out[1 + j] = 2.0 * (x * states[0, 1 + j, 0] + y * states[0, 1 + j, 1])
    per_length = slope_over_length(states[0, 0], here[G], end)
    out[1] += per_length * length_exponents[0]
    out[2] += per_length * length_exponents[1]
    if status == OK and not np.all(np.isfinite(out)):
        status = 2
    return status


@kernel
def fold_equations(
    theta, exponents, length, length_exponents, z, tolerance, states, mesh, jacobian
):
    """Return h, h_u and the status; write their gradients by (tau, delta, u), (2, 3).

    `jacobian` is written; jacobian[1, 2] is h_uu.
    """
    here, up, down = np.empty(4), np.empty(4), np.empty(4)
    status = surface(
        theta, exponents, length, length_exponents, z, tolerance, states, mesh, here
    )
    if status != OK:
        return 0.0, 0.0, status
    shifted = z.copy()
    shifted[2] = z[2] + _DIFFERENCE
    status = surface(
        theta, exponents, length, length_exponents, shifted, tolerance, states, mesh, up
    )
    if status != OK:
        return 0.0, 0.0, status
    shifted[2] = z[2] - _DIFFERENCE
    status = surface(
        theta, exponents, length, length_exponents, shifted, tolerance, states, mesh, down
    )
    for j in range(3):
        jacobian[0, j] = here[1 + j]
        jacobian[1, j] = (up[1 + j] - down[1 + j]) / (2.0 * _DIFFERENCE)
    return here[0], here[3], status


@kernel
def correct_fold(theta, exponents, length, length_exponents, z, tolerance, states, mesh, jacobian):
    """Correct z, (3,), in place onto the fold curve by the shortest Newton steps.

    Returns
    -------
    moved : float
        Distance moved.
    converged : bool
        The last step was below 1e-8, which Newton's squaring leaves below the integration's error.
    """
    moved = 0.0
    for _ in range(10):
        h, h_u, status = fold_equations(
            theta, exponents, length, length_exponents, z, tolerance, states, mesh, jacobian
        )
        if status != OK:
            return moved, False
        # Least-norm solution of J dz = -(h, h_u): dz = J' (J J')^-1 (-h, -h_u).
        a = np.dot(jacobian[0], jacobian[0])
        b = np.dot(jacobian[0], jacobian[1])
        c = np.dot(jacobian[1], jacobian[1])
        determinant = a * c - b * b
        if not determinant > 1e-14 * a * c:
            return moved, False
        first = (-h * c + h_u * b) / determinant
        second = (h * b - h_u * a) / determinant
        step = 0.0
        for j in range(3):
            change = jacobian[0, j] * first + jacobian[1, j] * second
            z[j] += change
            step += change * change
        step = np.sqrt(step)
        moved += step
        if not moved < 0.5:
            return moved, False
        if step < 1e-8:
            return moved, True
    return moved, False


@kernel
def tangent_of(jacobian, tangent):
    """Write the unit vector along the curve, (3,): the cross product of both gradients."""
    tangent[0] = jacobian[0, 1] * jacobian[1, 2] - jacobian[0, 2] * jacobian[1, 1]
    tangent[1] = jacobian[0, 2] * jacobian[1, 0] - jacobian[0, 0] * jacobian[1, 2]
    tangent[2] = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]
    size = np.sqrt(np.dot(tangent, tangent))
    if size > 0.0:
        tangent /= size
    return size


@kernel
def trace_folds(
    theta, exponents, length, length_exponents, start, direction, low, high, tolerance, points
):
    """Trace the fold curve from a point on it until it leaves a box or closes.

    Parameters
    ----------
    theta, exponents, length, length_exponents
        The two families, as in `surface`.
    start : (3,) array
        tau, delta, u near the curve.
    direction : float
        +1 or -1: the two ways along the curve.
    low, high : (2,) arrays
        The box of tau and delta.
    tolerance : float
        Of the integration.
    points : (n, 5) array, written
        tau, delta, u, h_uu and h_tau; the last point is outside the box if the curve left it.

    Returns
    -------
    status : int
        LEFT_RANGE, CLOSED, FULL (n points did not suffice) or LOST (no further point found).
    count : int
    """
    states = np.empty((1, 4, 6))
    mesh = np.empty(MAX_STEPS + 1)
    jacobian = np.empty((2, 3))
    tangent, new_tangent = np.empty(3), np.empty(3)
    z = start.copy()
    _, good = correct_fold(
        theta, exponents, length, length_exponents, z, tolerance, states, mesh, jacobian
    )
    if not good:
        return LOST, 0
    tangent_of(jacobian, tangent)
    tangent *= direction
    first, first_tangent = z.copy(), tangent.copy()
    points[0, :3] = z
    points[0, 3], points[0, 4] = jacobian[1, 2], jacobian[0, 0]
    count = 1
    step, travelled = 0.02, 0.0
    while count < points.shape[0]:
        new = z + step * tangent
        moved, good = correct_fold(
            theta, exponents, length, length_exponents, new, tolerance, states, mesh, jacobian
        )
        turn = 0.0
        if good:
            # The cross product keeps its sense along the curve: a reversal is another curve.
            tangent_of(jacobian, new_tangent)
            new_tangent *= direction
            turn = 1.0 - np.dot(new_tangent, tangent)
            good = turn < 0.03 and moved < 0.3 * step
        if not good:
            step *= 0.5
            if step < 1e-6:
                return LOST, count
            continue
        travelled += step
        z[:] = new
        tangent[:] = new_tangent
        points[count, :3] = z
        points[count, 3], points[count, 4] = jacobian[1, 2], jacobian[0, 0]
        count += 1
        for j in range(2):
            if z[j] < low[j] or z[j] > high[j]:
                return LEFT_RANGE, count
        gap = z - first
        near = np.sqrt(np.dot(gap, gap)) < 0.7 * step
        if travelled > 4.0 * step and near and np.dot(tangent, first_tangent) > 0.5:
            return CLOSED, count
        if turn < 0.008:
            step = min(0.1, 1.5 * step)
    return FULL, count


@kernel
def correct_cusp(theta, exponents, length, length_exponents, z, tolerance, states, mesh):
    """Newton's method for a cusp, h = h_u = h_uu = 0, from z, (3,), changed in place.

    First derivatives of h are analytic; higher ones in u are five-point differences of them.

    Returns
    -------
    moved : float
        Distance moved.
    converged : bool
    """
    e = 3e-3
    rows = np.empty((5, 4))
    shifted = np.empty(3)
    matrix = np.empty((3, 3))
    right = np.empty(3)
    moved, step = 0.0, 1.0
    for _ in range(15):
        # Far from the cusp rough derivatives do.
        fine = tolerance if step < 1e-2 else 1e-8
        for j in range(5):
            shifted[:] = z
            shifted[2] = z[2] + (j - 2) * e
            status = surface(
                theta, exponents, length, length_exponents, shifted, fine, states, mesh, rows[j]
            )
            if status != OK:
                return moved, False
        for j in range(3):
            first = (
                rows[0, j + 1] - 8.0 * rows[1, j + 1] + 8.0 * rows[3, j + 1] - rows[4, j + 1]
            ) / (12.0 * e)
            second = (
                -rows[0, j + 1] + 16.0 * rows[1, j + 1] - 30.0 * rows[2, j + 1]
                + 16.0 * rows[3, j + 1] - rows[4, j + 1]
            ) / (12.0 * e * e)
            matrix[0, j] = rows[2, j + 1]
            matrix[1, j] = first
            matrix[2, j] = second
        right[0] = -rows[2, 0]
        right[1] = -rows[2, 3]
        right[2] = -matrix[1, 2]
        if not abs(np.linalg.det(matrix)) > 1e-300:
            return moved, False
        change = np.linalg.solve(matrix, right)
        step = np.max(np.abs(change))
        if not step < np.inf:
            return moved, False
        change *= min(1.0, 0.3 / max(step, 1e-300))
        z += change
        moved += np.sqrt(np.dot(change, change))
        if moved > 3.0:
            return moved, False
        if step < 1e-9 and fine == tolerance:
            return moved, True
    return moved, False
