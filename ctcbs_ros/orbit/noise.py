"""The samples' errors: stated, or seen in their scatter; and what of them reaches the orbit."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.circle_covariance import propagate
from ctcbs_ros.kernels.regression import correlated_form, line
from ctcbs_ros.orbit.circle_fit import CircleFit, fit_circle
from ctcbs_ros.orbit.settings import TURN, OrbitSettings
from ctcbs_ros.orbit.window import Samples

# Scatter seen, over that stated or assumed, from which it is believed instead.
_NOISIER = 1.5
# Part by which a scatter may differ from that which a fit was made for.
_ALIKE = 0.25
# Excess of the residuals' variance over the stated one, in its standard deviations, from which
# the track is taken to be off a circle, and for how much of a turn that lasts.
_EXCESS = 3.0
_EXCESS_TURN = 0.1
# Mean of Huber's weight times squared residual over the mean weight, for normal errors; and what
# the gain of the fit misses of the variance of Huber's estimate.
_HUBER_VARIANCE = 0.856
_HUBER_COST = 1.04


class Scatter(NamedTuple):
    """White errors seen, over those stated."""

    position: float
    velocity: float

    def of(self, position_sigma: np.ndarray, velocity_sigma: np.ndarray) -> tuple:
        """The standard deviations seen, from those stated."""
        return position_sigma * self.position, velocity_sigma * self.velocity

    def is_like(self, other: "Scatter") -> bool:
        """Whether a fit for one serves the other: the weights decide little."""
        return all(
            abs(one - two) <= _ALIKE * max(one, two) for one, two in zip(self, other, strict=True)
        )


AS_STATED = Scatter(1.0, 1.0)


def fit_by_scatter(
    samples: Samples, start: tuple | None, drifts: bool, usual: Scatter = AS_STATED
) -> tuple[CircleFit | None, np.ndarray, np.ndarray, Scatter]:
    """Fit a circle, and once more where the samples scatter otherwise than it was made for.

    Parameters
    ----------
    samples : Samples
    start : tuple or None
        As of `fit_circle`.
    drifts : bool
        Whether a drift is fitted.
    usual : Scatter
        That of the fit to the samples so far, which spares the second fit.

    Returns
    -------
    fit : CircleFit or None
    position_sigma, velocity_sigma : (n,) ndarray
        Standard deviations of the white errors [m], [m/s].
    scatter : Scatter
        What they are over the stated ones.
    """
    points, velocities = samples.points, samples.velocities
    stated = samples.white_sigma, samples.velocity_sigma
    age = samples.age if drifts else None
    made_for = usual
    fit = fit_circle(points, velocities, *made_for.of(*stated), start, age)
    if fit is None and (start is not None or made_for is not AS_STATED):
        made_for = AS_STATED
        fit = fit_circle(points, velocities, *stated, None, age)
    if fit is None:
        return None, *stated, AS_STATED
    seen = _seen(fit, samples, *stated)
    if not made_for.is_like(seen):
        start = (fit.center, fit.radius, fit.drift)
        again = fit_circle(points, velocities, *seen.of(*stated), start, age)
        if again is not None:
            fit = again
    return fit, *seen.of(*stated), seen


def _seen(fit: CircleFit, samples: Samples, position_sigma, velocity_sigma) -> Scatter:
    """Noise is seen from sample to sample, whatever the shape of the track."""
    position = scatter(fit.radial) / float(np.mean(position_sigma))
    if position <= _NOISIER:
        return AS_STATED
    velocity = 1.0
    if np.isfinite(samples.velocities[:, 0]).any():
        turned = np.hypot(*fit.velocities.T) * position * position_sigma / fit.radius
        expected = float(np.sqrt(np.nanmean(velocity_sigma**2 + turned**2)))
        velocity = max(scatter(fit.along) / max(expected, 1e-9), 1.0)
    return Scatter(position, velocity)


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
    held = np.empty((2, 2))
    correlated_form(gain * samples.correlated_sigma, age, correlation_time, held)
    return up, climb, white * gain @ gain.T + held
