"""A lumped-mass towed line in the rotating frame, sharing no code with the solver.

N equal springs join N + 1 nodes; node 0 carries the end mass, node N is held at (1, 0, 0). Forces
are nonlinear: linear springs (with an optional dashpot beside each), weight, and on each segment
the cross-flow drag of its middle, half to either node. In the frame turning with the tow point,
lengths over a, times over 1/Omega:

    omega^2 M_i (r'' + 2 k x r' + k x (k x r)) = springs - weight - omega^2 drag

Second order in 1/N. Derivatives are by complex step, exact to rounding.
"""

import numpy as np
from reference_bvp import filled
from scipy.integrate import solve_ivp
from scipy.optimize import root


class LumpedMass:
    """The line of a point (see `reference_bvp`), with N segments.

    Free coordinates are those of nodes 0 .. N - 1, flat, (3 N,).
    """

    def __init__(self, point, segments, damping=0.0):
        self.point, self.n, self.damping = point, segments, damping
        self.h = point["l"] / segments
        self.gamma = point["gamma"]
        m = point["m"]
        self.mass = np.full(segments, self.h)
        self.mass[0] = 0.5 * self.h + m

    def acceleration(self, r, v):
        """r'' in the rotating frame for positions and velocities (..., 3 N)."""
        omega, _, _, w, d_n, d, rho, _ = filled(self.point)
        r, v = (np.reshape(a, (*a.shape[:-1], self.n, 3)) for a in (r, v))
        tow = np.zeros((*r.shape[:-2], 1, 3), r.dtype)
        still = tow.copy()
        tow[..., 0] = 1.0
        # nodes with the tow point, and their velocities against the air
        nodes = np.concatenate([r, tow], axis=-2)
        speeds = np.concatenate([v, still], axis=-2)
        wind = speeds.copy()
        wind[..., 0] -= nodes[..., 1]
        wind[..., 1] += nodes[..., 0]

        along = np.diff(nodes, axis=-2)
        size = np.sqrt(np.sum(along * along, axis=-1, keepdims=True))
        t = along / size
        rate = np.sum(t * np.diff(speeds, axis=-2), axis=-1, keepdims=True)
        spring = self.gamma * (size / self.h - 1.0 + self.damping * rate / self.h) * t
        middle = 0.5 * (wind[..., 1:, :] + wind[..., :-1, :])
        cross = middle - np.sum(middle * t, axis=-1, keepdims=True) * t
        drag = d_n * self.h * np.sqrt(np.sum(cross * cross, axis=-1, keepdims=True)) * cross

        force = spring.copy()
        force[..., 1:, :] -= spring[..., :-1, :]
        force[..., :, 2] -= rho * self.h
        force[..., 0, 2] -= w - 0.5 * rho * self.h
        air = 0.5 * drag
        air[..., 1:, :] += 0.5 * drag[..., :-1, :]
        ball = wind[..., 0, :]
        air[..., 0, :] += d * np.sqrt(np.sum(ball * ball, axis=-1, keepdims=True)) * ball
        a = (force / omega**2 - air) / self.mass[:, None]
        # minus Coriolis and centripetal accelerations
        a[..., 0] += 2.0 * v[..., 1] + r[..., 0]
        a[..., 1] += -2.0 * v[..., 0] + r[..., 1]
        return a.reshape(*a.shape[:-2], 3 * self.n)

    def jacobians(self, r):
        """d r''/d r and d r''/d r' at rest at r, (3 N, 3 N) each."""
        step = 1e-30j * np.eye(r.size)
        none = np.zeros_like(step)
        by_position = self.acceleration(r + step, none).imag.T / 1e-30
        by_velocity = self.acceleration(r + none, step).imag.T / 1e-30
        return by_position, by_velocity

    def equilibrium(self, shape):
        """Find the rest state near `shape`, a function of arc length as `reference_bvp` gives."""
        s = np.arange(self.n + 1) * self.h
        start = shape(s)[:3].T
        top = start[-1].copy()
        c, d = top[:2]
        start = start - [0.0, 0.0, top[2]]
        turned = np.column_stack(
            [c * start[:, 0] + d * start[:, 1], c * start[:, 1] - d * start[:, 0], start[:, 2]]
        )
        still = np.zeros(3 * self.n)
        found = root(
            lambda r: self.acceleration(r, still), turned[:-1].ravel(),
            jac=lambda r: self.jacobians(r)[0], tol=1e-12,
        )
        assert np.abs(self.acceleration(found.x, still)).max() < 1e-7, found.message
        return found.x

    def matrix(self, r):
        """First-order matrix of small motions about the rest state r, (6 N, 6 N)."""
        by_position, by_velocity = self.jacobians(r)
        n = r.size
        return np.block([[np.zeros((n, n)), np.eye(n)], [by_position, by_velocity]])

    def least_damped(self, r, band):
        """Least damped eigenvalue with |Im| <= band (Im >= 0), and its eigenvector."""
        values, vectors = np.linalg.eig(self.matrix(r))
        counted = np.flatnonzero((np.abs(values.imag) <= band) & (values.imag >= 0.0))
        worst = counted[np.argmax(values[counted].real)]
        return values[worst], vectors[:, worst]

    def simulate(self, r, v, times):
        """Integrate the nonlinear motion; states (len(times), 6 N)."""
        n = r.size

        def rhs(_, y):
            return np.concatenate([y[n:], self.acceleration(y[:n], y[n:])])

        found = solve_ivp(
            rhs, (times[0], times[-1]), np.concatenate([r, v]), "DOP853", t_eval=times,
            rtol=1e-8, atol=1e-10,
        )
        assert found.success
        return found.y.T


def radius_depth_lag(r):
    """End-mass radius, depth below and angle behind the tow point at (1, 0, 0)."""
    x, y, z = r[:3]
    return np.hypot(x, y), -z, -np.arctan2(y, x) % (2.0 * np.pi)


def extrapolate(coarse, fine, ratio=2.0):
    """Richardson's extrapolation of a second-order quantity from h and h/ratio."""
    return fine + (fine - coarse) / (ratio**2 - 1.0)
