"""Whether the angular rate changes: how far its mean lags behind what it is now."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import least_squares


@kernel
def rate_lag(points, velocities, circle, time, angle, sigma, velocity_sigma, rate):
    """What the rate is at the newest sample above its mean, and the variance of that.

    A steady change is fitted to angles and rates of all samples, beside the variation once a turn
    that wind makes.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
        Of `CircleFit` [m], [m/s]; nan where a velocity is not known.
    circle : (3,) array
        Centre and radius [m].
    time, angle : (n,) arrays
        [s], rising; about the centre [rad], continuous.
    sigma, velocity_sigma : (n,) arrays
        Standard deviations of an axis [m], [m/s].
    rate : float
        Mean [rad/s].

    Returns
    -------
    lag : float
        [rad/s]
    variance : float
        Infinite where the samples do not tell.
    """
    n, radius = time.shape[0], circle[2]
    span = time[n - 1] - time[0]
    design, off, trust = np.zeros((2 * n, 5)), np.zeros(2 * n), np.zeros(2 * n)
    count = n
    for i in range(n):
        # From -1 to 1, so that a change adds nothing to the mean.
        t = 2.0 * (time[i] - time[0]) / span - 1.0
        turned = angle[i] - angle[n - 1]
        east, north = np.cos(turned), np.sin(turned)
        design[i, 0], design[i, 1], design[i, 2] = 1.0, t, t * t
        design[i, 3], design[i, 4] = east, north
        off[i] = turned - rate * (time[i] - time[n - 1])
        trust[i] = (radius / sigma[i]) ** 2
        out = points[i] - circle[:2]
        off_rate = (out[0] * velocities[i, 1] - out[1] * velocities[i, 0]) / radius**2 - rate
        if not np.isnan(off_rate):
            design[count, 1], design[count, 2] = 2.0 / span, 4.0 * t / span
            design[count, 3], design[count, 4] = -rate * north, rate * east
            off[count], trust[count] = off_rate, (radius / velocity_sigma[i]) ** 2
            count += 1
    solution, inverse = np.empty(5), np.empty((5, 5))
    squares, determined = least_squares(
        design[:count], off[:count], trust[:count], solution, inverse
    )
    if not determined:
        return 0.0, np.inf
    scale = 4.0 / span
    return scale * solution[2], scale**2 * inverse[2, 2] * max(1.0, squares / max(count - 5, 1))
