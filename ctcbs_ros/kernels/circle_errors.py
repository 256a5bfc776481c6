"""The samples' errors, as stated and as their distances from a fitted circle show them."""

import numpy as np

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import correlated_form, line

# Mean of Huber's weight times squared residual over the mean weight, for normal errors.
_HUBER_VARIANCE = 0.856


@kernel
def white_scatter(radial, along, velocities, radius, position_sigma, velocity_sigma, noisier):
    """White errors seen from sample to sample, whatever the shape of the track.

    Parameters
    ----------
    radial, along : (n,) arrays
        As `refine_circle` left them.
    velocities : (n, 2) array
        [m/s]; nan where not known.
    radius : float
        [m]
    position_sigma, velocity_sigma : (n,) arrays
        Standard deviations of one axis, as stated [m], [m/s].
    noisier : float
        What scatter of the positions is believed, over that stated.

    Returns
    -------
    position, velocity : float
        The errors over those stated; both 1 where the positions scatter no more than stated.
    """
    n = radial.shape[0]
    position = scatter(radial) / np.mean(position_sigma)
    if position <= noisier:
        return 1.0, 1.0
    expected, known = 0.0, 0
    for i in range(n):
        if np.isfinite(velocities[i, 0]):
            speed_square = velocities[i, 0] ** 2 + velocities[i, 1] ** 2
            turned_square = speed_square * (position * position_sigma[i] / radius) ** 2
            expected += velocity_sigma[i] ** 2 + turned_square
            known += 1
    if known == 0:
        return position, 1.0
    return position, max(scatter(along) / max(np.sqrt(expected / known), 1e-9), 1.0)


@kernel
def larger_rms(one, two, three):
    """Root mean square of the larger of `one` and the root of the squares of `two` and `three`.

    one, two, three : (n,)
    """
    total = 0.0
    for i in range(one.shape[0]):
        total += max(one[i] ** 2, two[i] ** 2 + three[i] ** 2)
    return np.sqrt(total / one.shape[0])


@kernel
def clipped_rms(values, most):
    """Root mean square of values (n,), each counted as `most` where it is larger."""
    total = 0.0
    for i in range(values.shape[0]):
        total += min(abs(values[i]), most) ** 2
    return np.sqrt(total / values.shape[0])


@kernel
def expected_square(age, correlated_sigma, correlation_time, variance):
    """Mean square of the distances from a circle that the errors explain, over the white ones'.

    Parameters
    ----------
    age, correlated_sigma, correlation_time
        As `shown_variances` has them.
    variance : float
        Of a position's white error [m^2].
    """
    varying = 0.0
    for i in range(age.shape[0]):
        varying += correlated_sigma[i] ** 2 / age.shape[0]
    # Of a slowly varying error, the part that a straight course through it does not follow.
    return 1.0 + varying * min(1.0, -age[0] / (6.0 * correlation_time)) / variance


@kernel
def shown_variances(
    radial, along, weight, velocities, radius, late, age, white_sigma, correlated_sigma,
    correlation_time, stated, least_velocity_sigma, position_variance, velocity_variance,
):
    """Variances of the samples by what the residuals of their circle show.

    Parameters
    ----------
    radial, along, weight
        As `refine_circle` left them; `late`, too.
    velocities : (n, 2) array
        [m/s]; nan where not known.
    radius, late : float
    age : (n,) array
        [s], zero at the newest sample.
    white_sigma, correlated_sigma : (n,) arrays
        Standard deviations of the position of one axis, as stated or assumed [m].
    correlation_time : float
        [s]
    stated : bool
        Whether the source states any errors: otherwise they are what the residuals show.
    least_velocity_sigma : float
        [m/s]
    position_variance, velocity_variance : (n,) arrays, overwritten unless `stated`
        Of one axis, white, as the fit took them.

    Returns
    -------
    seen, expected : float
        Mean square of the distances from the circle, and that which the errors explain, over
        the white errors' variance as the fit took it.
    """
    n = radial.shape[0]
    shares, squares, variance = 0.0, 0.0, 0.0
    for i in range(n):
        shares += weight[0, i] * position_variance[i]
        squares += weight[0, i] * radial[i] ** 2
        variance += position_variance[i] / n
    seen = squares / (max(shares - 3.0, 1.0) * _HUBER_VARIANCE)
    expected = expected_square(age, correlated_sigma, correlation_time, variance)
    if stated:
        return seen, expected
    squares, total = 0.0, 0.0
    for i in range(n):
        position_variance[i] *= seen
        if weight[1, i] > 0.0:
            # The weights carry the variance, and the number of unknowns is shared.
            turned = (velocities[i, 0] ** 2 + velocities[i, 1] ** 2) / radius**2
            squares += weight[1, i] * along[i] ** 2
            total += weight[1, i] * (
                velocity_variance[i] + late**2 * turned * white_sigma[i] ** 2
            )
    if total > 0.0:
        velocity_seen = squares / (_HUBER_VARIANCE * total)
        for i in range(n):
            if weight[1, i] > 0.0:
                turned = (velocities[i, 0] ** 2 + velocities[i, 1] ** 2) / radius**2
                assumed = velocity_variance[i] + late**2 * turned * white_sigma[i] ** 2
                own = velocity_seen * assumed - turned * position_variance[i]
                velocity_variance[i] = max(own, least_velocity_sigma**2)
    return seen, expected


@kernel
def height_and_climb(age, up, white_sigma, correlated_sigma, correlation_time, covariance):
    """Height at the newest sample and climb rate.

    Parameters
    ----------
    age, up : (n,) arrays
        [s], zero at the newest sample, and [m].
    white_sigma, correlated_sigma : (n,) arrays
        Standard deviations [m].
    correlation_time : float
        [s]
    covariance : (2, 2) array, written

    Returns
    -------
    up, climb : float
        [m], [m/s]
    """
    n = age.shape[0]
    height, climb, _, _, squares = line(age, up, np.ones(n))
    mean = np.mean(age)
    spread, white = 0.0, 0.0
    for i in range(n):
        spread += (age[i] - mean) ** 2
        white += white_sigma[i] ** 2 / n
    spread = max(spread, 1e-12)
    gain, correlated = np.empty((2, n)), np.empty((2, n))
    for i in range(n):
        gain[1, i] = (age[i] - mean) / spread
        gain[0, i] = 1.0 / n - mean * gain[1, i]
        for j in range(2):
            correlated[j, i] = gain[j, i] * correlated_sigma[i]
    # An error that varies as slowly as a climb moves the height whole.
    correlated_form(correlated, age, correlation_time, covariance)
    white = max(squares / max(n - 2, 1), white)
    for j in range(2):
        for k in range(2):
            for i in range(n):
                covariance[j, k] += white * gain[j, i] * gain[k, i]
    return height, climb
