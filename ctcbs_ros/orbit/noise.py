"""The samples' errors: stated, or seen in their scatter; and what of them reaches the orbit."""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.circle_covariance import propagate
from ctcbs_ros.kernels.circle_errors import (
    expected_square,
    height_and_climb,
    shown_variances,
    white_scatter,
)
from ctcbs_ros.kernels.circle_trend import lag
from ctcbs_ros.orbit.circle_fit import CircleFit, fit_circle
from ctcbs_ros.orbit.settings import TURN, OrbitSettings
from ctcbs_ros.orbit.window import Samples

# Part of a turn whose angles tell the phase.
NEWEST = 0.08
# Scatter seen, over that stated or assumed, from which it is believed instead.
_NOISIER = 1.5
# Part by which a scatter may differ from that which a fit was made for.
_ALIKE = 0.25
# Excess of the residuals' variance over the stated one, in its standard deviations, from which
# the track is taken to be off a circle, and for how much of a turn that lasts.
_EXCESS = 3.0
_EXCESS_TURN = 0.1
# Standard deviations of a change of the radius within `trend_share`, for a circle to be told from
# a spiral: one of 20 % a turn is then taken for a circle once in two hundred.
TOLD = 1.6
# Standard deviations from which a change of the radius is seen, and what its lag then counts for.
_SEEN, _GOES_ON = 2.0, 2.0
# What the radius may be off by where the track is off the circle, at a whole turn: a radius that
# changed within an arc of x turns leaves residuals of so much less, times x^2.3 (0.5 to 1 turn).
_HIDDEN, _HIDDEN_POWER = 5.0, 2.3
# Parts of the samples that a line of the height is fitted to, the fewest, and by how much the line
# may pass by the newest ones [m], beside noise of at least so much [m].
_HEIGHT_SHARES = (1.0, 0.5, 0.25, 0.12)
_FEWEST_HEIGHTS = 6
_BENT, _LEAST_HEIGHT_NOISE = 0.3, 0.02
# What the gain of the fit misses of the variance of Huber's estimate.
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
    samples: Samples, start: np.ndarray | None, drifts: bool, usual: Scatter = AS_STATED
) -> tuple[CircleFit | None, np.ndarray, np.ndarray, Scatter]:
    """Fit a circle, and once more where the samples scatter otherwise than it was made for.

    Parameters
    ----------
    samples : Samples
    start : (5,) ndarray or None
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
    seen = Scatter(
        *white_scatter(fit.radial, fit.along, fit.velocities, fit.radius, *stated, _NOISIER)
    )
    if not made_for.is_like(seen):
        again = fit_circle(points, velocities, *seen.of(*stated), fit.start, age)
        if again is not None:
            fit = again
    return fit, *seen.of(*stated), seen


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
    seen, expected = shown_variances(
        fit.radial, fit.along, fit.weight, fit.velocities, fit.radius, fit.late, samples.age,
        samples.white_sigma, samples.correlated_sigma, settings.correlation_time, samples.stated,
        settings.least_velocity_sigma, position_variance, velocity_variance,
    )
    correlated, times = samples.correlated_sigma[None, :], [settings.correlation_time]
    if samples.stated and seen > expected + _EXCESS * sqrt(2.0 / len(samples)):
        off = sqrt((seen - expected) * float(np.mean(position_variance)))
        correlated = np.vstack([correlated, np.full(len(samples), off)])
        times.append(_EXCESS_TURN * TURN / rate)
    rate_at = len(fit.inverse)
    covariance = np.empty((rate_at + 2, rate_at + 2))
    propagate(
        fit.points, fit.velocities, samples.age, fit.circle, fit.weight,
        sqrt(_HUBER_COST) * fit.inverse, operators, position_variance, velocity_variance,
        correlated, np.array(times), covariance,
    )
    if excess > expected + _EXCESS * sqrt(2.0 / len(samples)):
        more = sqrt(excess - expected + 1.0)
        covariance[rate_at] *= more
        covariance[:, rate_at] *= more
        # The angle swings about its line, as in wind once a turn; a line leaves of the square of
        # that some 0.85 turns^3. Where it bends, the line through the newest angles misses it.
        swing = (excess - expected) * float(np.mean(position_variance)) / fit.radius**2
        swing /= 0.85 * min(rate * -samples.age[0] / TURN, 1.0) ** 3
        covariance[-1, -1] += swing * ((NEWEST * TURN) ** 2 / 12.0) ** 2
    return covariance


def misfit(
    samples: Samples, position_sigma: np.ndarray, square: float, settings: OrbitSettings
) -> tuple[float, float]:
    """Residuals beyond the stated errors and a steady change of the radius.

    Parameters
    ----------
    samples, position_sigma, settings
        As `circle_covariance` has them.
    square : float
        Of `kernels.circle_trend.widening`.

    Returns
    -------
    excess : float
        Of their mean square, beyond chance, over the white errors' variance; at least nought.
    variance : float
        The same [m^2].
    """
    white = float(position_sigma @ position_sigma) / len(samples)
    expected = expected_square(
        samples.age, samples.correlated_sigma, settings.correlation_time, white
    )
    # Of positions and velocities but for what the fit took: of few it has far longer tails than a
    # normal error (Wilson and Hilferty 1931). Where the white errors are not stated, their own
    # scale is uncertain as well.
    of_one = 2.0 / (9.0 * max(2 * len(samples) - 6, 2))
    chance = (1.0 - of_one + _EXCESS * sqrt(of_one)) ** 3 - 1.0
    excess = max(square - expected - (1.0 if samples.stated else 2.0) * chance, 0.0)
    return excess, excess * white


def lag_covariance(
    fit: CircleFit,
    samples: Samples,
    angle: np.ndarray,
    operators: np.ndarray,
    rate: float,
    widened: tuple[float, float, float],
    shortened: bool,
    off: float,
    settings: OrbitSettings,
) -> np.ndarray | float:
    """What `circle_covariance` misses where the radius changes: its circle lags behind.

    The square of the change beyond chance; while a spiral is not told from a circle, that change
    with its variance. A change that is seen may go on: it counts twice, and for the centre in any
    direction. So does any where the circle fits a part of the window alone: it has just changed.
    An arc that is off its circle may be of two: a change within it hides behind small residuals.

    Parameters
    ----------
    fit, samples, operators
        As `circle_covariance` has them.
    angle : (n,) ndarray
        About the centre, continuous [rad].
    rate : float
        [rad/s], positive anticlockwise.
    widened : (float, float, float)
        Of `kernels.circle_trend.widening`.
    shortened : bool
        Whether the samples are but a part of the window, the whole of which is on no circle.
    off : float
        Of `misfit`, where the samples are less than a turn, else nought [m^2].
    settings : OrbitSettings

    Returns
    -------
    (5, 5) or (7, 7) ndarray, or 0.0
    """
    change, variance, _ = widened
    arc = abs(angle[-1] - angle[0])
    untold = arc < settings.drift_arc
    seen = _GOES_ON**2 * max(change**2 - _SEEN**2 * variance, 0.0)
    if shortened:
        seen = _GOES_ON**2 * change**2 + variance
    square = max(change**2 + (variance if untold else -variance), seen, 0.0)
    hidden = off * (_HIDDEN / (arc / TURN) ** _HIDDEN_POWER) ** 2
    if not 0.0 < square + hidden < inf:
        return 0.0
    moved = np.empty(len(fit.inverse) + 2)
    lag(
        fit.points, fit.velocities, samples.age, fit.circle, fit.weight, fit.inverse, angle,
        operators, rate, moved,
    )
    covariance = square * np.outer(moved, moved)
    # Which way the centre is off depends on how the radius changes.
    apart = seen * float(moved[2]) ** 2 + hidden
    covariance[2, 2] += hidden
    covariance[-2, -2] += hidden * (rate / fit.radius) ** 2
    covariance[0, 0] += apart
    covariance[1, 1] += apart
    covariance[-1, -1] += apart / fit.radius**2
    return covariance


def height(samples: Samples, correlation_time: float) -> tuple[float, float, np.ndarray]:
    """Height at the newest sample [m], climb rate [m/s] and their covariance (2, 2).

    By a line through as much of the samples as it fits up to the newest ones: a climb may have
    begun or ended within the turn.
    """
    noise = max(scatter(samples.up), _LEAST_HEIGHT_NOISE)
    covariance = np.empty((2, 2))
    for share in _HEIGHT_SHARES:
        part = samples[-max(int(share * len(samples)), _FEWEST_HEIGHTS) :]
        up, climb = height_and_climb(
            part.age, part.up, part.white_sigma, part.correlated_sigma, correlation_time,
            covariance,
        )
        newest = max(len(part) // 8, 3)
        off = float(np.mean(part.up[-newest:] - climb * part.age[-newest:])) - up
        if abs(off) < 3.0 * noise / sqrt(newest) + _BENT:
            break
    covariance[0, 0] += off * off
    return up, climb, covariance
