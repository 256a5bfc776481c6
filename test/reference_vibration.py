"""The thesis's own vibration model and Galerkin's method in its own sines, for comparison.

Forces are the nonlinear ones of (2.2), (2.6) and (2.7) about the inextensible steady state, with
the errata; they are linearised by complex step, so that no entry of Appendix B is used. The end
mass enters the weak form as a boundary term.
"""

import numpy as np
from reference_bvp import boundary_value_problem, filled
from scipy.optimize import brentq

K = np.array([0.0, 0.0, 1.0])


def string_frequencies(length, m, n):
    """First n roots beta of cos beta = m beta/l sin beta, (C.4)."""
    return np.array(
        [
            brentq(lambda b: np.cos(b) - m * b / length * np.sin(b), j * np.pi, (j + 0.5) * np.pi)
            for j in range(n)
        ]
    )


def spring(gamma, p, slope, u_s):
    """Tension vector of (2.2): gamma epsilon_2 (r_s + u_s)."""
    strain = p / gamma + np.sum(slope * u_s, axis=-1) + 0.5 * np.sum(u_s * u_s, axis=-1)
    return gamma * strain[..., None] * (slope + u_s)


def drag_2_6(r, slope, u, u_s, u_t):
    """|v_n| v_n with v_n of (2.6), which the stretch does not normalise."""
    along = slope + u_s
    v_n = np.cross(along, np.cross(u_t + np.cross(K, u + r), along))
    return np.sqrt(np.sum(v_n * v_n, axis=-1))[..., None] * v_n


def drag_unit_tangent(r, slope, u, u_s, u_t):
    """|v_n| v_n with the unit tangent, the elastic model's; `slope` is dr/ds, stretch included."""
    along = slope + u_s
    t = along / np.sqrt(np.sum(along * along, axis=-1))[..., None]
    v = u_t + np.cross(K, u + r)
    v_n = v - np.sum(v * t, axis=-1)[..., None] * t
    return np.sqrt(np.sum(v_n * v_n, axis=-1))[..., None] * v_n


def complex_step(function, shape):
    """Derivative of function(u), u (..., 3) near 0, as matrices (..., 3, 3)."""
    out = np.empty((*shape, 3, 3))
    for j in range(3):
        u = np.zeros((*shape, 3), complex)
        u[..., j] = 1e-30j
        out[..., j] = function(u).imag / 1e-30
    return out


def eigenvalues_in_sines(point, x_d, n, gamma):
    """Eigenvalues of the inextensible steady state near x_d in n sines a coordinate."""
    omega, length, m, _, d_n, d, _, _ = filled(point)
    state, shape = boundary_value_problem(point, x_d)
    nodes, weights = np.polynomial.legendre.leggauss(40 + 8 * n)
    s, weights = 0.5 * length * (nodes + 1.0), 0.5 * length * weights
    y = shape(s).T
    r, t = y[:, :3], y[:, 3:]
    # (2.18) with rho 1
    p = state.tension_end_mass + r[:, 2]
    p = p + 0.5 * omega**2 * (state.x_d**2 - r[:, 0] ** 2 - r[:, 1] ** 2)

    none = np.zeros_like(r)
    at = (s.size,)
    stiffness = complex_step(lambda q: spring(gamma, p, t, q), at) / omega**2
    by_slope = d_n * complex_step(lambda q: drag_2_6(r, t, none, q, none), at)
    by_position = d_n * complex_step(lambda q: drag_2_6(r, t, q, none, none), at)
    by_rate = d_n * complex_step(lambda q: drag_2_6(r, t, none, none, q), at)

    end = np.array([state.x_d, 0.0, 0.0])

    def end_drag(u, u_t):
        v = u_t + np.cross(K, u + end)
        return d * np.sqrt(np.sum(v * v, axis=-1))[..., None] * v

    beta = string_frequencies(length, m, n)
    value = np.sin(np.outer(beta, (length - s) / length))
    slope = -beta[:, None] / length * np.cos(np.outer(beta, (length - s) / length))
    tip = np.sin(beta)
    ends = np.outer(tip, tip)
    gram = np.einsum("q,iq,jq->ij", weights, value, value) + m * ends
    cross = np.cross(K, np.eye(3)).T  # k x u = cross @ u

    def block(a, b, field):
        return np.einsum("q,iq,jq,qab->iajb", weights, a, b, field, optimize=True).reshape(
            3 * n, 3 * n
        )

    mass = np.kron(gram, np.eye(3))
    damping = np.kron(gram, 2.0 * cross) + block(value, value, by_rate)
    damping += np.kron(ends, complex_step(lambda q: end_drag(np.zeros(3), q), ()))
    matrix = np.kron(gram, cross @ cross) + block(value, value, by_position)
    matrix += block(value, slope, by_slope) + block(slope, slope, stiffness)
    matrix += np.kron(ends, complex_step(lambda q: end_drag(q, np.zeros(3)), ()))
    full = np.block(
        [
            [np.zeros_like(mass), np.eye(3 * n)],
            [-np.linalg.solve(mass, matrix), -np.linalg.solve(mass, damping)],
        ]
    )
    return np.linalg.eigvals(full)


def largest_in_band(values, band):
    """Eigenvalue with the largest real part among |Im| <= band."""
    values = values[np.abs(values.imag) <= band]
    return values[np.argmax(values.real)]
