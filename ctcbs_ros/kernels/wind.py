"""The centre of the circle on which ground velocities lie: the wind, and how well it is known."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import invert_normal

_ITERATIONS = 30


@kernel
def refine_wind(
    time, velocity, sigma, reference, by_heading, turn, trend_sigma, huber, solution, inverse,
    residual, unit, gain,
):
    """Robust fit by Gauss-Newton with Huber's weights, of one of two relations.

    Of the air velocity a = v - w: its length is k e (1 + b t / turn), where e is a measured
    airspeed, or 1 for an airspeed that is constant; or its direction is e + k, where e is a
    heading and k the error of the compass.

    Parameters
    ----------
    time : (n,) array
        From the middle of the window [s].
    velocity : (n, 2) array
        Over the ground, east and north [m/s].
    sigma : (n,) array
        Standard deviation of the residual [m/s].
    reference : (n,) array
        e: airspeed [m/s] or 1, or heading, ENU angle [rad].
    by_heading : bool
    turn : float
        Duration of a turn [s].
    trend_sigma : float
        Standard deviation of b, known beforehand to be about 0.
    huber : float
        Huber's constant.
    solution : (4,) array
        Wind towards east and north [m/s], k, b: the start, overwritten by the fit.
    inverse : (4, 4) array, written
        Inverse of the normal matrix.
    residual : (n,) array, written
        [m/s]; for a heading, the air velocity's component across it.
    unit : (n, 2) array, written
        Direction in which the velocity's error changes the residual.
    gain : (n, 4) array, written
        Change of the solution by the residual's error.

    Returns
    -------
    bool
        Whether the last step was below 1e-4 of the mean speed.
    """
    n = velocity.shape[0]
    normal = np.empty((4, 4))
    right = np.empty(4)
    rows = np.empty((n, 4))
    weight = np.empty(n)
    speed = 0.0
    for i in range(n):
        speed += np.hypot(velocity[i, 0], velocity[i, 1]) / n
    if not 0.0 < speed < np.inf:
        return False
    for iteration in range(_ITERATIONS):
        normal[:] = 0.0
        right[:] = 0.0
        normal[3, 3] = 1.0 / trend_sigma**2
        right[3] = -solution[3] / trend_sigma**2
        for i in range(n):
            ax, ay = velocity[i, 0] - solution[0], velocity[i, 1] - solution[1]
            if by_heading:
                c, s = np.cos(reference[i] + solution[2]), np.sin(reference[i] + solution[2])
                residual[i] = c * ay - s * ax
                unit[i, 0], unit[i, 1] = -s, c
                rows[i, 2], rows[i, 3] = -(c * ax + s * ay), 0.0
            else:
                length = np.hypot(ax, ay)
                if length < 1e-3 * speed:
                    return False
                later = 1.0 + solution[3] * time[i] / turn
                # Noise across the air velocity lengthens it, by this much on average.
                longer = 0.5 * sigma[i] * min(sigma[i] / length, 1.0)
                residual[i] = length - longer - solution[2] * reference[i] * later
                unit[i, 0], unit[i, 1] = ax / length, ay / length
                rows[i, 2] = -reference[i] * later
                rows[i, 3] = -solution[2] * reference[i] * time[i] / turn
            rows[i, 0], rows[i, 1] = -unit[i, 0], -unit[i, 1]
            off = abs(residual[i]) / sigma[i]
            weight[i] = min(1.0, huber / max(off, 1e-12)) / sigma[i] ** 2
            for j in range(4):
                right[j] -= weight[i] * rows[i, j] * residual[i]
                for m in range(4):
                    normal[j, m] += weight[i] * rows[i, j] * rows[i, m]
        if not invert_normal(normal, inverse):
            return False
        step = inverse @ right
        solution += step
        if not np.isfinite(solution).all():
            return False
        if iteration > 1 and np.hypot(step[0], step[1]) < 1e-4 * speed:
            for i in range(n):
                for j in range(4):
                    gain[i, j] = 0.0
                    for m in range(4):
                        gain[i, j] -= inverse[j, m] * rows[i, m] * weight[i]
            return True
    return False


@kernel
def wind_covariance(
    time, unit, gain, white, velocity_variance, velocity_time, airspeed_variance, airspeed_time,
    trend_sigma, inverse, covariance,
):
    """Covariance of the fit of `refine_wind`: each sample's error moves it by its gain.

    Errors that are correlated in time are summed over all pairs of samples, by their recursion.

    Parameters
    ----------
    time : (n,) array
        Rising [s].
    unit, gain : (n, 2), (n, 4) arrays
        As `refine_wind` left them.
    white : (n,) array
        Variance of the residual's white error [(m/s)^2].
    velocity_variance, velocity_time : float
        Of one axis of a first-order Gauss-Markov error of the velocity [(m/s)^2], [s].
    airspeed_variance, airspeed_time : float
        Of such an error of the residual itself: of the airspeed, or of the heading.
    trend_sigma : float
    inverse : (4, 4) array
        As `refine_wind` left it.
    covariance : (4, 4) array, written
    """
    before = np.zeros((4, 3))
    by_error = np.zeros((4, 3))
    share = np.array([velocity_variance, velocity_variance, airspeed_variance])
    for j in range(4):
        for m in range(4):
            covariance[j, m] = inverse[j, 3] * inverse[3, m] / trend_sigma**2
    for i in range(time.shape[0]):
        for j in range(4):
            by_error[j, 0] = gain[i, j] * unit[i, 0]
            by_error[j, 1] = gain[i, j] * unit[i, 1]
            by_error[j, 2] = gain[i, j]
        if i > 0:
            step = time[i] - time[i - 1]
            before[:, :2] *= np.exp(-step / velocity_time)
            before[:, 2] *= np.exp(-step / airspeed_time)
        for j in range(4):
            for m in range(4):
                covariance[j, m] += white[i] * gain[i, j] * gain[i, m]
                for k in range(3):
                    a, b = by_error[j, k], by_error[m, k]
                    covariance[j, m] += share[k] * (a * b + a * before[m, k] + before[j, k] * b)
        before += by_error


@kernel
def turned(velocity, wind):
    """Angle that the air velocities sweep [rad], whole turns counted.

    velocity : (n, 2) array, over the ground; wind : (2,) array
    """
    low, high, angle, before = 0.0, 0.0, 0.0, 0.0
    for i in range(velocity.shape[0]):
        now = np.arctan2(velocity[i, 1] - wind[1], velocity[i, 0] - wind[0])
        if i > 0:
            angle += (now - before + np.pi) % (2.0 * np.pi) - np.pi
        before = now
        low, high = min(low, angle), max(high, angle)
    return high - low


@kernel
def scaled_scatter(residual, variance):
    """Deviation of residuals (n,) over the stated one, by their median; variance : (n,)."""
    return 1.4826 * np.median(np.abs(residual) / np.sqrt(variance))


@kernel
def clipped_square(residual, variance, scale, most):
    """Mean of the squares of residuals over `scale` deviations, linear from `most` of them on.

    residual, variance : (n,)
    """
    total = 0.0
    for i in range(residual.shape[0]):
        off = abs(residual[i]) / (scale * np.sqrt(variance[i]))
        total += min(off, most) * off
    return total / residual.shape[0]


@kernel
def mean_speed(velocity):
    """Mean length of vectors (n, 2)."""
    total = 0.0
    for i in range(velocity.shape[0]):
        total += np.hypot(velocity[i, 0], velocity[i, 1])
    return total / velocity.shape[0]
