"""The towed cable as an initial-value problem, integrated from the end mass up.

Steady state in the rotating frame, thesis (2.11)-(2.16) with the errata of docs/thesis.md:
position r and tension vector F = p t (t the unit tangent) along the unstretched arc length s,

    dr/ds = (1 + g p) t                                           g = 1/gamma, 0 if inextensible
    dF/ds = rho k - omega^2 (x, y, 0) + omega^2 d_n |v_n| v_n     v_n = v - (v.t) t, v = (-y, x, 0)
    r(0)  = (x_d, 0, 0)
    F(0)  = (-omega^2 m x_d, omega^2 d x_d^2, w)

|t| = 1 is built in, so x_d alone fixes the whole cable. Derivatives by x_d and by every
parameter come from the variational equations, integrated beside the state.

The integrator is Dormand and Prince's 8(5,3) pair.
"""

import numpy as np

from ctcbs_ros.kernels import dormand_prince as pair
from ctcbs_ros.kernels.compiled import fused_kernel, kernel

# Columns of `theta`, and the order of all derivatives.
X_D, OMEGA, M, W, D_N, D, RHO, G = range(8)
N_THETA = 8

_STAGES = pair.STAGES
# Every stage as a list of (index, coefficient): more than a third of the tableau is zero. The
# last list is the end of the step.
_ROWS = (*pair.A, pair.B)
_INDEX = np.concatenate([np.flatnonzero(row) for row in _ROWS])
_COEFFICIENT = np.concatenate([row[np.flatnonzero(row)] for row in _ROWS])
_FIRST = np.cumsum([0, *(np.count_nonzero(row) for row in _ROWS)])
_ERROR_INDEX = np.flatnonzero((pair.E3 != 0.0) | (pair.E5 != 0.0))
_E3 = pair.E3[_ERROR_INDEX]
_E5 = pair.E5[_ERROR_INDEX]

OK, TOO_MANY_STEPS, NOT_FINITE = range(3)


@kernel
def initial_state(theta, directions, y):
    """Set the state at the end mass, and its derivatives along `directions`, (2.15)-(2.16).

    theta : (8,) parameters in the order of X_D .. G; directions : (k, 8); y : (1 + k, 6), written.
    """
    x_d, omega, m, w, d = theta[X_D], theta[OMEGA], theta[M], theta[W], theta[D]
    o2 = omega * omega
    y[0, 0] = x_d
    y[0, 1] = 0.0
    y[0, 2] = 0.0
    y[0, 3] = -o2 * m * x_d
    y[0, 4] = o2 * d * x_d * x_d
    y[0, 5] = w
    for j in range(directions.shape[0]):
        q = directions[j]
        do2 = 2.0 * omega * q[OMEGA]
        y[j + 1, 0] = q[X_D]
        y[j + 1, 1] = 0.0
        y[j + 1, 2] = 0.0
        y[j + 1, 3] = -(do2 * m * x_d + o2 * q[M] * x_d + o2 * m * q[X_D])
        y[j + 1, 4] = (do2 * d + o2 * q[D]) * x_d * x_d + 2.0 * o2 * d * x_d * q[X_D]
        y[j + 1, 5] = q[W]


@fused_kernel
def cable_rhs(theta, directions, y, dy):
    """Right-hand side of the steady state and of its variational equations.

    theta : (8,); directions : (k, 8); y, dy : (1 + k, 6), dy written.
    """
    omega, d_n, rho, g = theta[OMEGA], theta[D_N], theta[RHO], theta[G]
    o2 = omega * omega
    px, py = y[0, 0], y[0, 1]
    fx, fy, fz = y[0, 3], y[0, 4], y[0, 5]
    # In terms of F and 1/p^2 (t = F/p), so that the division does not wait for the square root.
    per_p2 = 1.0 / (fx * fx + fy * fy + fz * fz)
    per_p = np.sqrt(per_p2)
    w = (px * fy - py * fx) * per_p2
    nx, ny, nz = -py - w * fx, px - w * fy, -w * fz
    speed = np.sqrt(nx * nx + ny * ny + nz * nz)
    c = o2 * d_n * speed
    e = per_p + g
    dy[0, 0] = e * fx
    dy[0, 1] = e * fy
    dy[0, 2] = e * fz
    dy[0, 3] = -o2 * px + c * nx
    dy[0, 4] = -o2 * py + c * ny
    dy[0, 5] = rho + c * nz
    for j in range(directions.shape[0]):
        q = directions[j]
        do2 = 2.0 * omega * q[OMEGA]
        ux, uy = y[j + 1, 0], y[j + 1, 1]
        gx, gy, gz = y[j + 1, 3], y[j + 1, 4], y[j + 1, 5]
        dp_per_p = (fx * gx + fy * gy + fz * gz) * per_p2
        de = q[G] - dp_per_p * per_p
        dw = (ux * fy - uy * fx + px * gy - py * gx) * per_p2 - 2.0 * w * dp_per_p
        mx = -uy - dw * fx - w * gx
        my = ux - dw * fy - w * gy
        mz = -dw * fz - w * gz
        # |v_n| v_n is differentiable at v_n = 0, with derivative 0 (erratum to (A.1)).
        dspeed = (nx * mx + ny * my + nz * mz) / speed if speed > 0.0 else 0.0
        dc = (do2 * d_n + o2 * q[D_N]) * speed + o2 * d_n * dspeed
        dy[j + 1, 0] = de * fx + e * gx
        dy[j + 1, 1] = de * fy + e * gy
        dy[j + 1, 2] = de * fz + e * gz
        dy[j + 1, 3] = -do2 * px - o2 * ux + dc * nx + c * mx
        dy[j + 1, 4] = -do2 * py - o2 * uy + dc * ny + c * my
        dy[j + 1, 5] = q[RHO] + dc * nz + c * mz


@fused_kernel
def _stages(theta, directions, y, h, k, scratch):
    """Fill the stages k[1:] of one step from y (k[0] is the slope there); return the end state."""
    for i in range(1, _STAGES + 1):
        for a in range(y.shape[0]):
            # Six sums at once keep the processor's units busy, where one would wait for itself.
            x0, x1, x2, x3, x4, x5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for n in range(_FIRST[i], _FIRST[i + 1]):
                c, j = _COEFFICIENT[n], _INDEX[n]
                x0 += c * k[j, a, 0]
                x1 += c * k[j, a, 1]
                x2 += c * k[j, a, 2]
                x3 += c * k[j, a, 3]
                x4 += c * k[j, a, 4]
                x5 += c * k[j, a, 5]
            scratch[a, 0] = y[a, 0] + h * x0
            scratch[a, 1] = y[a, 1] + h * x1
            scratch[a, 2] = y[a, 2] + h * x2
            scratch[a, 3] = y[a, 3] + h * x3
            scratch[a, 4] = y[a, 4] + h * x4
            scratch[a, 5] = y[a, 5] + h * x5
        if i < _STAGES:
            cable_rhs(theta, directions, scratch, k[i])


@fused_kernel
def _step_error(k, y, new, h, tolerance):
    """Error of a step in units of the tolerance, over the state and its derivatives (DOP853)."""
    worst = 0.0
    for a in range(y.shape[0]):
        e5, e3 = 0.0, 0.0
        # Position and tension vector: a derivative is judged against its own size, which may be
        # far larger than the state's.
        for first in (0, 3):
            size, s5, s3 = 1e-3, 0.0, 0.0
            for b in range(first, first + 3):
                size = max(size, abs(y[a, b]), abs(new[a, b]))
                x5, x3 = 0.0, 0.0
                for n in range(_E5.size):
                    x = k[_ERROR_INDEX[n], a, b]
                    x5 += _E5[n] * x
                    x3 += _E3[n] * x
                s5 += x5 * x5
                s3 += x3 * x3
            scale = 1.0 / (tolerance * size) ** 2
            e5 += s5 * scale
            e3 += s3 * scale
        if not np.isfinite(e5):
            return np.inf
        if e5 > 0.0:
            worst = max(worst, abs(h) * e5 / np.sqrt((e5 + 0.01 * e3) * 6.0))
    return worst


@fused_kernel
def integrate(theta, directions, nodes, tolerance, max_steps, states, mesh):
    """Integrate from the end mass (s = 0) through every node, with step control.

    Parameters
    ----------
    theta : (8,) array
    directions : (k, 8) array
        Directions in parameter space along which the state is differentiated.
    nodes : (n,) array
        Rising arc lengths, the last one the tow point.
    tolerance : float
        Local error allowed in a step, relative to the size of the state.
    max_steps : int
    states : (n, 1 + k, 6) array, written
        State and derivatives at the nodes.
    mesh : (max_steps + 1,) array, written
        Ends of the accepted steps.

    Returns
    -------
    status : int
        OK, TOO_MANY_STEPS or NOT_FINITE.
    steps : int
        Number of accepted steps.
    least_tension : float
        Least tension at the ends of the steps.
    """
    rows = 1 + directions.shape[0]
    y = np.empty((rows, 6))
    scratch = np.empty((rows, 6))
    k = np.empty((_STAGES + 1, rows, 6))
    initial_state(theta, directions, y)
    cable_rhs(theta, directions, y, k[0])
    s = 0.0
    mesh[0] = 0.0
    length = nodes[-1]
    p0 = np.sqrt(y[0, 3] ** 2 + y[0, 4] ** 2 + y[0, 5] ** 2)
    least = p0
    # The tangent turns at a rate of |dF/ds| / p: a first step of a tenth of that radius.
    turn = np.sqrt(k[0, 0, 3] ** 2 + k[0, 0, 4] ** 2 + k[0, 0, 5] ** 2) / p0
    h = min(length / 8.0, 0.3 / turn if turn > 0.0 else length)
    steps = 0
    tries = 0
    for i in range(nodes.shape[0]):
        while s < nodes[i]:
            tries += 1
            if steps >= max_steps or tries > 4 * max_steps:
                return TOO_MANY_STEPS, steps, least
            left = nodes[i] - s
            last = h >= left * (1.0 - 1e-12)
            step = left if last else h
            _stages(theta, directions, y, step, k, scratch)
            cable_rhs(theta, directions, scratch, k[_STAGES])
            error = _step_error(k, y, scratch, step, tolerance)
            if not np.isfinite(error):
                h = 0.1 * step
                if h < 1e-12 * length:
                    return NOT_FINITE, steps, least
                continue
            # 0.9 error^(-1/8)
            factor = 0.9 / np.sqrt(np.sqrt(np.sqrt(error))) if error > 0.0 else 6.0
            factor = min(6.0, max(0.2, factor))
            if error > 1.0:
                h = step * min(1.0, factor)
                continue
            # A step cut short by a node says nothing against the longer one tried before.
            h = max(h, step * factor) if last else step * factor
            s = nodes[i] if last else s + step
            y[:] = scratch
            k[0] = k[_STAGES]
            p = np.sqrt(y[0, 3] ** 2 + y[0, 4] ** 2 + y[0, 5] ** 2)
            least = min(least, p)
            steps += 1
            mesh[steps] = s
        states[i] = y
    return OK, steps, least


@fused_kernel
def integrate_halved(theta, mesh, steps):
    """Integrate over the steps of `mesh`, each halved.

    Returns
    -------
    state : (6,) array
        At the tow point.
    greatest_tension : float
        Along the cable, inside the steps too.
    """
    directions = np.empty((0, N_THETA))
    y = np.empty((1, 6))
    scratch = np.empty((1, 6))
    inside = np.empty((1, 6))
    k = np.empty((_STAGES + 1, 1, 6))
    initial_state(theta, directions, y)
    cable_rhs(theta, directions, y, k[0])
    p, rise = _tension(y[0], k[0, 0])
    greatest = p
    for i in range(steps):
        h = 0.5 * (mesh[i + 1] - mesh[i])
        for _ in range(2):
            _stages(theta, directions, y, h, k, scratch)
            cable_rhs(theta, directions, scratch, k[_STAGES])
            p_end, rise_end = _tension(scratch[0], k[_STAGES, 0])
            greatest = max(greatest, p_end)
            if rise > 0.0 > rise_end:
                # The error of the place enters squared: it is the tension there to many digits.
                step = h * _maximum(p, p_end, h * rise, h * rise_end)
                _stages(theta, directions, y, step, k, inside)
                greatest = max(greatest, _tension(inside[0], k[0, 0])[0])
            y[:] = scratch
            k[0] = k[_STAGES]
            p, rise = p_end, rise_end
    return y[0].copy(), greatest


@fused_kernel
def _tension(y, dy):
    """Tension of a state, (6,), and with its slope, (6,), how fast the tension rises with s."""
    p = np.sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2)
    return p, (y[3] * dy[3] + y[4] * dy[4] + y[5] * dy[5]) / p


@kernel
def _maximum(p0, p1, d0, d1):
    """Where in [0, 1] the cubic with values p0, p1 and slopes d0 > 0 > d1 at its ends is largest.

    Its slope is d0 + b x + a x^2; of the forms of its root, the one that loses no digits.
    """
    a = 3.0 * (d0 + d1) - 6.0 * (p1 - p0)
    b = d1 - d0 - a
    return 2.0 * d0 / (np.sqrt(b * b - 4.0 * a * d0) - b)
