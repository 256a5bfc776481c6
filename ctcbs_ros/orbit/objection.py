"""Why a circle that was fitted is not the orbit flown: spiral, turn just left, broken track."""

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from ctcbs_ros.kernels.circle_angles import newest_offset, progress
from ctcbs_ros.kernels.circle_errors import clipped_rms
from ctcbs_ros.orbit.circle_fit import CircleFit
from ctcbs_ros.orbit.noise import TOLD
from ctcbs_ros.orbit.settings import TURN, OrbitSettings
from ctcbs_ros.orbit.window import Samples

# Mean square of the residuals beside a spiral, in those expected, below which it is just that.
_CLEAN = 2.0
# Over less than a turn: standard deviations by which a change of the radius exceeds the largest
# allowed, and of one that noise alone exceeds once in a hundred times.
_BEYOND, _NOISE = 1.8, 2.6
# Swing of the speed relative to a drifting centre, once a turn, from which it does not drift: over
# the drift, and in the swing's standard deviations.
_SWINGS, _UNSEEN = 0.5, 1.5
# Velocities from which they tell the way round, and the part by which their rate about the centre
# may differ from the positions': once round more, or the other way, it differs by more than all.
_FEWEST_VELOCITIES, _SAME_RATE = 3, 0.5
# Acceleration towards the centre that no aircraft on tow flies: a bank of 70 degrees [m/s^2].
_MOST_ACCELERATION = 27.0


@dataclass(frozen=True)
class Objection:
    """What speaks against a circle.

    Attributes
    ----------
    reason : str
    final : bool
        No part of the samples can be an orbit: a part would only seem to.
    untold : bool
        A drift cannot be told from a spiral yet.
    """

    reason: str
    final: bool = False
    untold: bool = False


def objection(
    fit: CircleFit,
    samples: Samples,
    angle: np.ndarray,
    least_arc: float,
    sigma: float,
    widened: tuple[float, float, float],
    flown: bool,
    settings: OrbitSettings,
) -> Objection | None:
    """Why a fitted circle is not the orbit flown; None if it is.

    Parameters
    ----------
    fit : CircleFit
    samples : Samples
    angle : (n,) ndarray
        About the centre, continuous [rad].
    least_arc : float
        To be flown before a circle that stands still is an orbit [rad].
    sigma : float
        Standard deviation of a position [m].
    widened : (float, float, float)
        Of `kernels.circle_trend.widening`.
    flown : bool
        Whether the orbit of the sample before was such a circle, drifting or not.
    settings : OrbitSettings
    """
    arc = abs(angle[-1] - angle[0])
    if not settings.minimum_radius <= fit.radius <= settings.maximum_radius:
        return Objection(f"a radius of {fit.radius:.0f} m is no orbit")
    if arc < (settings.drift_arc if fit.drifts else least_arc):
        return Objection(f"only {np.degrees(arc):.0f} deg of a circle so far")
    return (
        _changes(fit, arc, widened, flown, settings)
        or _is_too_sparse(fit, samples, angle)
        or _off_the_circle(fit, angle, sigma, settings)
        or _goes_back(fit, samples, angle, sigma, settings)
    )


def drifts_with_the_air(fit: CircleFit, samples: Samples, settings: OrbitSettings) -> bool:
    """Whether the speed bears a fitted drift out.

    A circle that is converged onto fits one that drifts as well. But flown in air that drifts, the
    speed over the ground swings once a turn by the drift; without that swing, the speed relative
    to the drifting centre does.
    """
    known = fit.velocities[np.isfinite(fit.velocities[:, 0])]
    speed = np.hypot(*known.T)
    most = hypot(
        settings.speed_share * np.mean(speed), 2.0 * float(np.mean(samples.velocity_sigma))
    )
    if len(speed) < 6 or np.std(speed) > most:
        return False
    design = np.column_stack([np.ones(len(speed)), known / speed[:, None]])
    found, *_ = np.linalg.lstsq(design, speed, rcond=None)
    noise = float(np.mean(samples.velocity_sigma)) * sqrt(2.0 / len(speed))
    return hypot(found[1], found[2]) < max(_SWINGS * hypot(*fit.drift), _UNSEEN * noise)


def _changes(fit, arc, widened, flown, settings) -> Objection | None:
    """The radius changes, or may change."""
    change, variance, square = widened
    final = square < _CLEAN
    # A spiral looks much like a drift: a circle is believed to drift only once its radius is known
    # to stand still. From then on noise does not take that back, only a change that is seen.
    in_doubt = fit.drifts and not flown
    if in_doubt and TOLD * sqrt(variance) > settings.trend_share * fit.radius:
        return Objection("a drift is not yet told from a spiral", final, untold=True)
    share = settings.drift_share if in_doubt else settings.trend_share
    # Over a whole turn a change shows for what it is; over half a turn noise makes some of each.
    beyond, noise = (1.0, 0.0) if in_doubt or arc > 0.95 * TURN else (_BEYOND, _NOISE)
    most = max(share * fit.radius + beyond * sqrt(variance), noise * sqrt(variance))
    if abs(change) > most:
        return Objection(f"a spiral: the radius changes by {change:+.0f} m a turn", final)
    return None


def _is_too_sparse(fit, samples, angle) -> Objection | None:
    """Between samples far apart it may have gone the other way round, or once more.

    The velocities tell which it was; without them, that nobody could fly it.
    """
    elapsed = samples.time[-1] - samples.time[0]
    rate = (angle[-1] - angle[0]) / elapsed
    (x, y), (east, north) = (fit.points - fit.center).T, fit.velocities.T
    by_velocity = (x * north - y * east) / (x * x + y * y)
    # A glitch near the centre would seem to fly round it in no time.
    near = np.abs(fit.radial) < 0.5 * fit.radius
    known = by_velocity[near & np.isfinite(by_velocity)]
    if len(known) >= _FEWEST_VELOCITIES:
        if abs(float(np.mean(known)) - rate) < _SAME_RATE * abs(rate):
            return None
        return Objection("velocities do not go round with the positions; samples too far apart?")
    interval = elapsed / (len(samples) - 1)
    other_way = TURN / interval - abs(rate)
    if other_way * other_way * fit.radius > _MOST_ACCELERATION:
        return None
    return Objection(
        f"samples {interval:.1f} s apart, without velocities, do not tell which way round it goes"
    )


def _off_the_circle(fit, angle, sigma, settings) -> Objection | None:
    allowed = _allowed(fit, sigma, settings)
    rms = clipped_rms(fit.radial, 3.0 * allowed)
    if rms > allowed:
        return Objection(
            f"the track is {rms:.1f} m (rms) off the best circle of {fit.radius:.0f} m"
        )
    # The newest eighth of a turn must be on the circle: the aircraft may just be leaving it.
    off, count = newest_offset(fit.radial, angle, 0.08 * TURN)
    if abs(off) > max(3.0 * sigma / sqrt(count), 1.0) + settings.residual_share * fit.radius:
        return Objection(f"the aircraft is {abs(off):.1f} m off the circle flown so far")
    return None


def _goes_back(fit, samples, angle, sigma, settings) -> Objection | None:
    turned = angle[-1] - angle[0]
    quiet = 3.0 * sqrt(2.0) * sigma / fit.radius
    back, newest, broken = progress(
        fit.radial, angle, samples.time, 1 if turned > 0.0 else -1, abs(turned),
        5.0 * _allowed(fit, sigma, settings), quiet,
    )
    # Over the newest steps together, noise does not hide which way the aircraft turns.
    if back > 0.1 or newest < -quiet:
        return Objection("the sense of rotation changes")
    return Objection("the track is broken") if broken else None


def _allowed(fit, sigma, settings) -> float:
    """Root mean square distance from the circle that is allowed [m]."""
    return hypot(2.0 * sigma, settings.residual_share * fit.radius)
