"""Galerkin matrices of small vibrations about a steady state, per radian of orbit.

The weak form of the thesis's (2.19)-(2.20): with test functions phi that vanish at the tow point,

    M u'' + C u' + K u = 0,      M = (int phi phi + m phi phi|_0) I,

the end mass entering as a boundary term. Each model of the steady state has its linearisation:

* elastic (thesis's model with stretch kept): tension along the unit tangent, stiffness
  gamma t t^T + p / (1 + p/gamma) (I - t t^T), drag from the unit tangent;
* inextensible base (the thesis's own): stiffness gamma t t^T + p I, and v_n of (2.6), which is not
  normalised by the stretch.

The functions are a linear one and integrated Legendre polynomials, orthonormalised in the mass
matrix, so that M becomes the unit matrix. They converge faster than the sines of (C.5). Those of
a smaller number are the first ones of a larger: so are their matrices.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.trajectory import D_N, OMEGA, X_D, D, M


@kernel
def basis(n, length, nodes, value, slope):
    """Values and slopes of the n functions at the nodes; the first one is 1 at s = 0, others 0.

    n : int; nodes : (q,) arc lengths; value, slope : (n, q), written.
    """
    for i in range(nodes.shape[0]):
        x = 1.0 - 2.0 * nodes[i] / length
        value[0, i] = 0.5 * (1.0 + x)
        slope[0, i] = -1.0 / length
        before, now = 1.0, x
        for k in range(2, n + 1):
            after = ((2 * k - 1) * x * now - (k - 1) * before) / k
            # The integral of P_(k-1) over [-1, x] is (P_k - P_(k-2)) / (2 k - 1).
            scale = np.sqrt((2 * k - 1) / 2.0)
            value[k - 1, i] = scale * (after - before) / (2 * k - 1)
            slope[k - 1, i] = scale * now * (-2.0 / length)
            before, now = now, after


@kernel
def local_matrices(
    theta, gamma, elastic, damping, state, b_rate, b_position, b_slope, stiffness, rub
):
    """Linearised drag and stiffness at one point of the cable, all (3, 3), written.

    The drag on u is d_n J (b_rate u' + b_position u + b_slope u_s); `stiffness` and `rub` (line
    damping) act on u_s and are divided by omega^2.

    theta : (8,); gamma : elasticity of the vibration; elastic : whether the steady state
    stretches; damping : time constant of the line times Omega; state : (6,) position and tension
    """
    o2 = theta[OMEGA] ** 2
    p = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2)
    t = state[3:6] / p
    v = np.array((-state[1], state[0], 0.0))
    v_t = v[0] * t[0] + v[1] * t[1]
    n = v - v_t * t
    q = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
    stretch = 1.0 + p / gamma if elastic else 1.0

    jacobian = np.empty((3, 3))
    by_slope = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            across = unit - t[i] * t[j]
            # J is 0 where v_n is (erratum to A.1).
            jacobian[i, j] = q * unit + n[i] * n[j] / q if q > 0.0 else 0.0
            by_slope[i, j] = -(t[i] * n[j] + v_t * across) / stretch
            if elastic:
                stiffness[i, j] = (gamma * t[i] * t[j] + p / stretch * across) / o2
            else:
                by_slope[i, j] += 2.0 * n[i] * t[j]
                stiffness[i, j] = (gamma * t[i] * t[j] + p * unit) / o2
            rub[i, j] = gamma * damping * t[i] * t[j] / o2
    for i in range(3):
        for j in range(3):
            rate, slope = 0.0, 0.0
            for k in range(3):
                across = (1.0 if k == j else 0.0) - t[k] * t[j]
                rate += jacobian[i, k] * across
                slope += jacobian[i, k] * by_slope[k, j]
            b_rate[i, j] = rate
            b_slope[i, j] = slope
    for i in range(3):
        # u' + k x u: k x turns (x, y, z) into (-y, x, 0).
        b_position[i, 0] = b_rate[i, 1]
        b_position[i, 1] = -b_rate[i, 0]
        b_position[i, 2] = 0.0


@kernel
def assemble(theta, length, gamma, elastic, damping, n, nodes, weights, states):
    """First-order matrix of the vibration in n functions a coordinate.

    Parameters
    ----------
    theta : (8,) array
        Parameters, in the order of `ctcbs_ros.kernels.trajectory`.
    length, gamma, elastic, damping
        As in `local_matrices`.
    n : int
    nodes, weights : (q,) arrays
        Quadrature over the cable.
    states : (q, 6) array
        Position and tension vector at the nodes.

    Returns
    -------
    (6 n, 6 n) array
        A of (u, u')' = A (u, u'); its eigenvalues are per radian of orbit.
    """
    q = nodes.shape[0]
    value = np.empty((n, q))
    slope = np.empty((n, q))
    basis(n, length, nodes, value, slope)

    mass = np.dot(value * weights, value.T)
    mass[0, 0] += theta[M]
    # Orthonormal functions, of which fewer are the first of more: the mass matrix becomes the
    # unit matrix.
    factor = np.linalg.cholesky(mass)
    at_end = np.zeros(n)
    at_end[0] = 1.0
    for i in range(n):
        for j in range(i):
            c = factor[i, j]
            at_end[i] -= c * at_end[j]
            for k in range(q):
                value[i, k] -= c * value[j, k]
                slope[i, k] -= c * slope[j, k]
        c = 1.0 / factor[i, i]
        at_end[i] *= c
        for k in range(q):
            value[i, k] *= c
            slope[i, k] *= c

    b_rate = np.empty((3, 3))
    b_position = np.empty((3, 3))
    b_slope = np.empty((3, 3))
    stiffness = np.empty((3, 3))
    rub = np.empty((3, 3))
    # Fields of each pair of coordinates; two products of matrices make all pairs' blocks.
    fields = np.empty((5, 9, q))
    for k in range(q):
        local_matrices(
            theta, gamma, elastic, damping, states[k], b_rate, b_position, b_slope, stiffness, rub
        )
        for i in range(3):
            for j in range(3):
                fields[0, 3 * i + j, k] = theta[D_N] * b_rate[i, j] * weights[k]
                fields[1, 3 * i + j, k] = theta[D_N] * b_position[i, j] * weights[k]
                fields[2, 3 * i + j, k] = theta[D_N] * b_slope[i, j] * weights[k]
                fields[3, 3 * i + j, k] = stiffness[i, j] * weights[k]
                fields[4, 3 * i + j, k] = rub[i, j] * weights[k]
    # Without line damping nothing of the damping acts on slopes.
    used = 2 * q if damping != 0.0 else q
    tests = np.empty((n, 2 * q))
    by_rate = np.empty((9 * n, used))
    by_position = np.empty((9 * n, 2 * q))
    for r in range(n):
        for k in range(q):
            tests[r, k] = value[r, k]
            tests[r, q + k] = slope[r, k]
        for pair in range(9):
            row = pair * n + r
            for k in range(q):
                v, d = value[r, k], slope[r, k]
                by_rate[row, k] = fields[0, pair, k] * v
                by_position[row, k] = fields[1, pair, k] * v + fields[2, pair, k] * d
                by_position[row, q + k] = fields[3, pair, k] * d
            for k in range(used - q):
                by_rate[row, q + k] = fields[4, pair, k] * slope[r, k]
    c_blocks = np.dot(tests if damping != 0.0 else value, by_rate.T)
    k_blocks = np.dot(tests, by_position.T)

    a = np.zeros((6 * n, 6 * n))
    half = 3 * n
    for i in range(3):
        for r in range(n):
            for j in range(3):
                for s in range(n):
                    a[half + i * n + r, j * n + s] = -k_blocks[r, (3 * i + j) * n + s]
                    a[half + i * n + r, half + j * n + s] = -c_blocks[r, (3 * i + j) * n + s]
    # Drag of the end mass: J_d = x_d diag(1, 2, 1) of Appendix A, on u' + k x u.
    drag = theta[D] * theta[X_D]
    for r in range(n):
        for s in range(n):
            e = at_end[r] * at_end[s] * drag
            a[half + r, half + s] -= e
            a[half + n + r, half + n + s] -= 2.0 * e
            a[half + 2 * n + r, half + 2 * n + s] -= e
            a[half + r, n + s] += e
            a[half + n + r, s] -= 2.0 * e
    for r in range(n):
        # Centrifugal and Coriolis terms, with M the unit matrix.
        a[half + r, r] += 1.0
        a[half + n + r, n + r] += 1.0
        a[half + r, half + n + r] += 2.0
        a[half + n + r, half + r] -= 2.0
    for r in range(half):
        a[r, half + r] = 1.0
    return a


@kernel
def slow_wave_phase(states, weights, omega, cable_drag, elasticity, rate):
    """Phase [rad] by which a damped wave turns along the cable.

    Parameters
    ----------
    states : (n, 6) array
        Position and tension vector at the points of a quadrature.
    weights : (n,) array
        Of that quadrature, of arc length.
    omega, cable_drag, elasticity : float
        The last infinite for a cable that does not stretch.
    rate : float
        |lambda| of the wave, per radian of orbit.
    """
    phase = 0.0
    for i in range(states.shape[0]):
        x, y = states[i, 0], states[i, 1]
        f_x, f_y, f_z = states[i, 3], states[i, 4], states[i, 5]
        tension = np.sqrt(f_x * f_x + f_y * f_y + f_z * f_z)
        along = (x * f_y - y * f_x) / tension
        drag = cable_drag * np.sqrt(max(x * x + y * y - along * along, 0.0))
        stiffness = tension / (1.0 + tension / elasticity)
        phase += weights[i] * omega * np.sqrt((rate * rate + drag * rate) / stiffness)
    return phase
