"""The samples' errors: stated, or seen in their scatter; and what of them reaches the orbit."""

from math import sqrt

import numpy as np

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.circle_covariance import propagate
from ctcbs_ros.kernels.regression import line
from ctcbs_ros.orbit.circle_fit import CircleFit, fit_circle
from ctcbs_ros.orbit.settings import TURN, OrbitSettings
from ctcbs_ros.orbit.window import Samples

# Scatter seen, over that stated or assumed, from which it is believed instead.
_NOISIER = 1.5
# Excess of the residuals' variance over the stated one, in its standard deviations, from which
# the track is taken to be off a circle, and for how much of a turn that lasts.
_EXCESS = 3.0
_EXCESS_TURN = 0.1
# Mean of Huber's weight times squared residual over the mean weight, for normal errors; and what
# the gain of the fit misses of the variance of Huber's estimate.
_HUBER_VARIANCE = 0.856
_HUBER_COST = 1.04


def fit_by_scatter(
    samples: Samples, start: tuple | None, drifts: bool
) -> tuple[CircleFit | None, np.ndarray, np.ndarray]:
    """Fit a circle, and once more where the samples scatter more than their errors say.

    Parameters
    ----------
    samples : Samples
    start : tuple or None
        As of `fit_circle`.
    drifts : bool
        Whether a drift is fitted.

    Returns
    -------
    fit : CircleFit or None
    position_sigma, velocity_sigma : (n,) ndarray
        Standard deviations it was made with, of the white errors [m], [m/s].
    """
    points, velocities = samples.points, samples.velocities
    position_sigma, velocity_sigma = samples.white_sigma, samples.velocity_sigma
    age = samples.age if drifts else None
    fit = fit_circle(points, velocities, position_sigma, velocity_sigma, start, age)
    if fit is None and start is not None:
        fit = fit_circle(points, velocities, position_sigma, velocity_sigma, None, age)
    if fit is None:
        return None, position_sigma, velocity_sigma
    # Noise is seen from sample to sample, whatever the shape of the track.
    seen = scatter(fit.radial) / float(np.mean(position_sigma))
    if seen > _NOISIER:
        position_sigma = position_sigma * seen
        if np.isfinite(velocities[:, 0]).any():
            turned = np.hypot(*fit.velocities.T) * position_sigma / fit.radius
            stated = float(np.sqrt(np.nanmean(velocity_sigma**2 + turned**2)))
            velocity_sigma = velocity_sigma * max(scatter(fit.along) / max(stated, 1e-9), 1.0)
        start = (fit.center, fit.radius, fit.drift)
        again = fit_circle(points, velocities, position_sigma, velocity_sigma, start, age)
        if again is not None:
            fit = again
    return fit, position_sigma, velocity_sigma


def circle_covariance(
    fit: CircleFit,
    samples: Samples,
    position_sigma: np.ndarray,
    velocity_sigma: np.ndarray,
    operators: np.ndarray,
    rate: float,
    excess: float,
    settings: OrbitSettings,
) -> np.ndarray:
    """Covariance of centre, radius, drift if it is fitted, rate and phase.

    Parameters
    ----------
    fit, position_sigma, velocity_sigma
        Of `fit_by_scatter`.
    samples : Samples
    operators : (2, n) ndarray
        Takes the angles about the centre to rate and phase.
    rate : float
        [rad/s], positive.
    excess : float
        Variance of the angles about a constant rate, over the stated one.
    settings : OrbitSettings

    Returns
    -------
    (5, 5) or (7, 7) ndarray
    """
    position_variance = position_sigma**2
    velocity_variance = (fit.late * velocity_sigma) ** 2
    share = fit.weight[0] * position_variance
    seen = share @ (fit.radial**2 / position_variance)
    seen /= max(share.sum() - 3.0, 1.0) * _HUBER_VARIANCE
    correlated = [samples.correlated_sigma]
    times = [settings.correlation_time]
    # Of a slowly varying error, the part that a straight course through it does not follow.
    duration = -float(samples.age[0])
    varying = float(np.mean(samples.correlated_sigma**2)) * min(
        1.0, duration / (6.0 * settings.correlation_time)
    )
    expected = 1.0 + varying / float(np.mean(position_variance))
    if not samples.stated:
        # Nobody states the errors: they are what the residuals show.
        position_variance = position_variance * seen
        known = fit.weight[1] > 0.0
        if known.any():
            # The weights carry the variance, and the number of unknowns is shared.
            squares = fit.weight[1][known] @ fit.along[known] ** 2
            turned = np.sum(fit.velocities[known] ** 2, axis=1) / fit.radius**2
            white = samples.white_sigma[known]
            assumed = velocity_variance[known] + fit.late**2 * turned * white**2
            total = squares / (_HUBER_VARIANCE * float(np.sum(fit.weight[1][known] * assumed)))
            own = total * assumed - turned * position_variance[known]
            velocity_variance[known] = np.maximum(own, settings.least_velocity_sigma**2)
    elif seen > expected + _EXCESS * sqrt(2.0 / len(samples)):
        off = (seen - expected) * float(np.mean(position_variance))
        correlated.append(np.full(len(samples), sqrt(off)))
        times.append(_EXCESS_TURN * TURN / rate)
    rate_at = len(fit.inverse)
    covariance = np.empty((rate_at + 2, rate_at + 2))
    propagate(
        fit.points, fit.velocities, samples.age, fit.circle, fit.weight, fit.inverse, operators,
        position_variance, velocity_variance, np.array(correlated), np.array(times), covariance,
    )
    covariance *= _HUBER_COST
    more = sqrt(max(1.0, excess - expected + 1.0))
    covariance[rate_at] *= more
    covariance[:, rate_at] *= more
    return covariance


def height(samples: Samples, correlation_time: float) -> tuple[float, float, np.ndarray]:
    """Height at the newest sample [m], climb rate [m/s] and their covariance (2, 2)."""
    age = samples.age
    n = len(age)
    up, climb, _, _, squares = line(age, samples.up, np.ones(n))
    off = age - age.mean()
    by_sample = off / max(off @ off, 1e-12)
    gain = np.vstack([1.0 / n - age.mean() * by_sample, by_sample])
    white = max(squares / max(n - 2, 1), float(np.mean(samples.white_sigma**2)))
    # An error that varies as slowly as a climb moves the height whole.
    held = np.exp(-(np.abs(age[:, None] - age)) / correlation_time)
    correlated = gain * samples.correlated_sigma
    return up, climb, white * gain @ gain.T + correlated @ held @ correlated.T
