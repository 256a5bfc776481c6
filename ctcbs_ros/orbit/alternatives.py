"""Other ways to find a circle, for comparison with the estimator's on the same samples.

Each is given the samples of the circle alone, from its entry on: what a window has to find out for
itself. Each returns centre and radius [m], (3,), or None. None of them is used in flight.
"""

import numpy as np
from scipy.optimize import least_squares

from ctcbs_ros.orbit.circle_fit import algebraic_circle


def taubin(time, points, velocities, position_sigma, velocity_sigma):
    """Algebraic fit to the positions."""
    return algebraic_circle(points)


def soft_l1(time, points, velocities, position_sigma, velocity_sigma):
    """Geometric fit to positions and velocities with scipy's least squares and soft-L1 loss."""
    start = algebraic_circle(points)
    if start is None:
        return None

    def residuals(circle):
        offset = points - circle[:2]
        distance = np.hypot(*offset.T)
        unit = offset / distance[:, None]
        along = np.sum(velocities * unit, axis=1)
        swept = velocities[:, 1] * unit[:, 0] - velocities[:, 0] * unit[:, 1]
        sigma = np.hypot(velocity_sigma, swept / distance * position_sigma)
        return np.concatenate([(distance - circle[2]) / position_sigma, along / sigma])

    return least_squares(residuals, start, loss="soft_l1", x_scale=100.0).x


def kalman_filter(time, points, velocities, position_sigma, velocity_sigma):
    """Extended Kalman filter: centre, radius, angle and rate; a random walk of the rate.

    Started from the algebraic fit of the first third of the samples, with its errors unknown.
    """
    first = max(len(points) // 3, 6)
    start = algebraic_circle(points[:first])
    if start is None:
        return None
    radius = start[2]
    offset = points[first - 1] - start[:2]
    speed = float(np.median(np.hypot(*velocities[:first].T)))
    sense = np.sign(offset[0] * velocities[first - 1, 1] - offset[1] * velocities[first - 1, 0])
    state = np.array([*start, np.arctan2(offset[1], offset[0]), sense * speed / radius])
    covariance = np.diag([radius**2, radius**2, radius**2, 1.0, (0.5 * speed / radius) ** 2])
    noise = np.diag([position_sigma**2] * 2 + [velocity_sigma**2] * 2)
    for i in range(len(points)):
        step = time[i] - time[i - 1] if i else 0.0
        if i == 0:
            # Back to the first sample, at the rate supposed.
            state[3] -= state[4] * (time[first - 1] - time[0])
        move = np.eye(5)
        move[3, 4] = step
        state = move @ state
        # 5 % of the rate in a second, as wind, gusts and pilots vary it.
        covariance = move @ covariance @ move.T
        covariance[4, 4] += (0.05 * state[4]) ** 2 * step
        _, _, r, angle, rate = state
        c, s = np.cos(angle), np.sin(angle)
        expected = np.array([state[0] + r * c, state[1] + r * s, -r * rate * s, r * rate * c])
        by_state = np.array([
            [1.0, 0.0, c, -r * s, 0.0],
            [0.0, 1.0, s, r * c, 0.0],
            [0.0, 0.0, -rate * s, -r * rate * c, -r * s],
            [0.0, 0.0, rate * c, -r * rate * s, r * c],
        ])
        gain = covariance @ by_state.T @ np.linalg.inv(by_state @ covariance @ by_state.T + noise)
        state = state + gain @ (np.array([*points[i], *velocities[i]]) - expected)
        covariance = (np.eye(5) - gain @ by_state) @ covariance
    return state[:3]


METHODS = {
    "Taubin's algebraic fit, positions": taubin,
    "scipy least_squares, soft L1": soft_l1,
    "extended Kalman filter": kalman_filter,
}
