"""Wind and airspeed from a turn: the ground velocities lie on a circle about the wind.

With the airspeed constant, |v - w| is: the circle's centre is the wind w, its radius the airspeed.
Where a sensor measures the airspeed, |v - w| is proportional to that, constant or not. Where a
heading is sent, v - w points along it, whatever the airspeed. An aircraft that holds its ground
speed looks like still air to the first of the three, and a heading that is the course, or held,
to the last: that there is no wind, only a measured airspeed shows.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import isfinite, nan, pi, radians, sqrt

import numpy as np

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.wind import (
    clipped_square,
    mean_speed,
    refine_wind,
    scaled_scatter,
    turned,
    wind_covariance,
)
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.wind import CONTRADICTION, squared_distance, worst_sigma

_TURN = 2.0 * pi
# Huber's constant: 95 % efficiency for normal errors (Huber and Ronchetti, Robust Statistics), and
# the mean weighted square of residuals that are normal.
_HUBER = 1.345
_HUBER_VARIANCE = 0.8213
# The price of robustness, in variance.
_HUBER_COST = 1.0 / 0.95
_FEWEST_SAMPLES = 12
_LEAST_COURSE = 0.5
# Part of a turn after which the wind is estimated anew.
_ANEW = 1.0 / 16.0
_MOST_SAMPLES = 240
# Ratio of two speeds' scatter up to which they vary alike.
_ALIKE = 1.25
# Squared distance of two winds along one axis, in units of its variance, as chance makes it.
_EXPECTED = 1.0
# The same of the winds of two turns from which it is seen to have changed; estimates back that the
# newest is held against, half a turn and a whole one.
_CHANGED, _BACK = 6.0, (9, 17)


@dataclass(frozen=True)
class FlightWind:
    """Wind and airspeed that a turn shows.

    Attributes
    ----------
    time : float
        Vehicle clock [s] of the newest sample.
    velocity : (2,) ndarray
        Of the air, towards east and north [m/s].
    covariance : (2, 2) ndarray
        [(m/s)^2]
    airspeed, airspeed_sigma : float
        Mean over the window, and its standard deviation [m/s].
    relation : str
        "constant airspeed", "measured airspeed" or "heading".
    note : str
        Whether that could be tested, and what came out.
    lasting : float
        Standard deviation of the part of its error, along any axis, that is the same from turn to
        turn [m/s].
    """

    time: float
    velocity: np.ndarray
    covariance: np.ndarray
    airspeed: float
    airspeed_sigma: float
    relation: str
    note: str = ""
    lasting: float = 0.0


@dataclass(frozen=True)
class WindSettings:
    """Errors assumed of velocities, airspeed and heading.

    Attributes
    ----------
    least_arc : float
        Least turn of the air velocity for an estimate [rad].
    velocity_sigma : float
        White error of one axis of the velocity where the source states none [m/s].
    least_velocity_sigma : float
        Smallest one believed [m/s].
    correlated_sigma, correlation_time : float
        Of a first-order Gauss-Markov error of the velocity beside it, one axis [m/s], [s].
    airspeed_wander : float
        Standard deviation of a variation of the airspeed once a turn, over the airspeed, where it
        is taken for constant. It looks like wind.
    airspeed_trend : float
        Standard deviation of the change of the airspeed in a turn, over it.
    sensor_sigma, sensor_error : float
        White error of a measured airspeed [m/s], and an error once a turn, over the airspeed.
    heading_sigma, compass_deviation : float
        White error of a heading and an error once a turn [rad].
    """

    least_arc: float = 0.4 * _TURN
    velocity_sigma: float = OrbitSettings.velocity_sigma
    least_velocity_sigma: float = OrbitSettings.least_velocity_sigma
    correlated_sigma: float = 0.0
    correlation_time: float = 45.0
    airspeed_wander: float = 0.02
    airspeed_trend: float = 0.1
    sensor_sigma: float = 0.5
    sensor_error: float = 0.01
    heading_sigma: float = radians(1.5)
    compass_deviation: float = radians(3.0)


# What the residuals show beyond the stated errors, a gust or a change of power, lasts this part of
# a turn.
_EXCESS_TURN = 0.12
# Standard deviations of the residuals' scatter from which they exceed the stated errors.
_SEEN = 1.0
# Residuals over the stated errors from which these are taken larger in the fit.
_NOISIER = 1.3
_STILL = np.zeros(2)
# Part of such an error that is left in the residuals, at least.
_LEAST_KEPT = 0.2
# Columns of the window.
_TIME, _VE, _VN, _SIGMA, _AIRSPEED, _HEADING = range(6)


class WindEstimator:
    """Keeps the velocities of the last turn, and makes wind of them.

    They are taken in before an orbit is recognised, too: when it is, half a turn has been flown.
    """

    def __init__(self, settings: WindSettings | None = None):
        self._settings = settings or WindSettings()
        self._rows = np.empty((2 * _MOST_SAMPLES, 6))
        self.reset()

    def reset(self) -> None:
        """Forget all velocities."""
        self._first = self._end = 0
        self._latest: FlightWind | None = None
        # As they came, of the newest turn, the oldest first.
        self._estimates: deque[FlightWind] = deque(maxlen=round(1.0 / _ANEW) + 1)
        self._estimated_at = -np.inf
        # Least time between samples [s], so that at high rates a whole turn is kept.
        self._spacing = 0.0

    def begin(self) -> None:
        """Another orbit is flown: what was estimated on the one before says nothing about it."""
        self._latest = None
        self._estimates.clear()
        self._estimated_at = -np.inf

    def _forget(self, time: float) -> None:
        while self._first < self._end and self._rows[self._first, _TIME] < time:
            self._first += 1

    def add(
        self,
        time: float,
        velocity,
        velocity_sigma: float = nan,
        airspeed: float = nan,
        heading: float = nan,
    ) -> None:
        """Take in a sample.

        Parameters
        ----------
        time : float
            [s]
        velocity : sequence of float, or None
            Over the ground, east, north [m/s]; None where none was sent.
        velocity_sigma : float
            Standard deviation of one axis, as stated [m/s]; nan where it is not.
        airspeed : float
            By a sensor [m/s]; nan where none came.
        heading : float
            ENU angle of the nose [rad]; nan where none came.
        """
        if velocity is None or not isfinite(velocity[0] + velocity[1]):
            return
        if self._end > self._first:
            last = self._rows[self._end - 1]
            if time - last[_TIME] < self._spacing:
                return
        if self._end == len(self._rows):
            self._make_room()
        self._rows[self._end] = (
            time, velocity[0], velocity[1], velocity_sigma,
            airspeed if airspeed > 0.0 else nan, heading,
        )  # fmt: skip
        self._end += 1

    def _make_room(self) -> None:
        kept = self._rows[self._first : self._end]
        if len(kept) > _MOST_SAMPLES:
            # Long before an orbit, or on one at a high rate: half as many cover the same time.
            kept = kept[::2]
            self._spacing = (kept[-1, _TIME] - kept[0, _TIME]) / len(kept)
        kept = kept.copy()
        self._rows[: len(kept)] = kept
        self._first, self._end = 0, len(kept)

    def holds_airspeed(self, wind, before: bool = False) -> bool:
        """Whether over the newest turn the airspeed varied less than the ground speed.

        Where they vary alike, as without wind, it is as before.

        wind : (2,) array_like, velocity of the air towards east and north [m/s]
        """
        velocity = self._rows[self._first : self._end, _VE : _VN + 1]
        if len(velocity) < _FEWEST_SAMPLES:
            return before
        air, ground = (np.std(np.hypot(*v.T)) for v in (velocity - wind, velocity))
        return bool(air < (_ALIKE if before else 1.0 / _ALIKE) * ground)

    def estimate(self, orbit: Orbit) -> FlightWind | None:
        """Wind over the last turn of an orbit, since it began; None where that does not show it.

        Begun anew, an orbit may reach back later into what was flown before: that is kept.

        It hardly changes from one sample to the next, and is estimated anew 16 times a turn.
        """
        turn = _TURN / orbit.angular_rate
        self._spacing = turn / (0.9 * _MOST_SAMPLES)
        self._forget(orbit.time - turn)
        if not orbit.time < self._estimated_at + _ANEW * turn:
            self._estimated_at = orbit.time
            rows = self._rows[self._first : self._end]
            rows = rows[np.searchsorted(rows[:, _TIME], orbit.start_time) :]
            self._latest = self._widened(wind_of_turn(rows, turn, self._settings), turn)
        return self._latest

    def _widened(self, found: FlightWind | None, turn: float) -> FlightWind | None:
        """With its lag behind a wind that changes: a mean of a turn is half a turn behind."""
        if found is None:
            self._estimates.clear()
            return None
        self._estimates.append(found)
        count = len(self._estimates)
        lags = [_lag(self._estimates[-back], found, turn) for back in _BACK if back <= count]
        lag = max(lags, key=np.linalg.norm, default=_STILL)
        return replace(found, covariance=found.covariance + np.outer(lag, lag))


def _lag(then: FlightWind, now: FlightWind, turn: float) -> np.ndarray:
    """By how much a wind is behind, as far as its change since then is seen, (2,) [m/s]."""
    change, part = now.velocity - then.velocity, (now.time - then.time) / turn
    if not part > 0.0:
        return _STILL
    # What lasts is in both; the rest differs by as much as their turns do.
    lasts = (now.lasting**2 + then.lasting**2) * np.eye(2)
    errors = min(part, 1.0) * (now.covariance + then.covariance - lasts)
    apart = change @ np.linalg.solve(errors, change)
    return sqrt(max(0.0, 1.0 - _CHANGED / apart)) * 0.5 / part * change if apart > 0.0 else _STILL


def wind_of_turn(
    rows: np.ndarray, turn: float, settings: WindSettings | None = None
) -> FlightWind | None:
    """Wind and airspeed from the samples of a turn.

    Where two relations contradict each other, the one that assumes less is taken: a measured
    airspeed before all, a heading before a constant airspeed; but not a heading that shows no
    wind, as some autopilots send the course over ground for it.

    Parameters
    ----------
    rows : (n, 6) ndarray
        Time [s], velocity east and north, its standard deviation, airspeed [m/s], heading (ENU
        angle [rad]); the last three nan where not known.
    turn : float
        Duration of a turn [s].
    settings : WindSettings, optional

    Returns
    -------
    FlightWind or None
        None with fewer than 12 samples or less of a turn than `settings.least_arc`, where the
        velocities stand still, or where they look like still air and no airspeed is measured.
    """
    settings = settings or WindSettings()
    measured = rows[np.isfinite(rows[:, _AIRSPEED])]
    by_speed = _fit(measured, turn, settings, "measured airspeed")
    if by_speed is None:
        by_speed = _fit(rows, turn, settings, "constant airspeed")
    by_heading = _fit(rows[np.isfinite(rows[:, _HEADING])], turn, settings, "heading")
    found = _reconciled(by_speed, by_heading)
    if found is None or (found.relation != "measured airspeed" and _is_nought(found)):
        return None
    return found


def _reconciled(by_speed: FlightWind | None, by_heading: FlightWind | None) -> FlightWind | None:
    """One wind of those that the airspeed and the heading show."""
    if by_speed is None or by_heading is None:
        return by_speed or by_heading
    apart = squared_distance(by_speed, by_heading)
    if by_speed.relation == "measured airspeed":
        agrees = "agrees" if apart <= CONTRADICTION else "says otherwise"
        return replace(by_speed, note=f"the heading {agrees}")
    if _is_nought(by_heading) and not _is_nought(by_speed):
        # The course over ground, it seems: a ground speed does not vary so in still air.
        return replace(by_speed, note="the heading follows the course and is not used")
    if apart > CONTRADICTION:
        return replace(by_heading, note="the airspeed is not constant")
    if _is_nought(by_speed):
        return by_heading
    # What they differ by beyond chance counts as an error: the airspeed may not be constant.
    off = by_speed.velocity - by_heading.velocity
    doubt = max(0.0, 1.0 - _EXPECTED / apart) if apart > 0.0 else 0.0
    return replace(
        by_speed,
        covariance=by_speed.covariance + doubt * np.outer(off, off),
        note="the heading agrees",
    )


def _is_nought(wind: FlightWind) -> bool:
    off = wind.velocity
    return bool(off @ np.linalg.solve(wind.covariance, off) < CONTRADICTION)


def _fit(
    rows: np.ndarray, turn: float, settings: WindSettings, relation: str
) -> FlightWind | None:
    n = len(rows)
    if n < _FEWEST_SAMPLES:
        return None
    velocity = np.ascontiguousarray(rows[:, _VE : _VN + 1])
    s = settings
    # In strong wind the course turns by less than the heading, or by more.
    if turned(velocity, _STILL) < _LEAST_COURSE * s.least_arc:
        return None
    ground_speed = mean_speed(velocity)
    stated = np.isfinite(rows[:, _SIGMA])
    own = np.where(stated, rows[:, _SIGMA], s.velocity_sigma)
    white = np.maximum(own, s.least_velocity_sigma) ** 2
    trend_sigma, once = s.airspeed_trend, s.airspeed_wander
    heading = relation == "heading"
    if heading:
        reference = np.ascontiguousarray(rows[:, _HEADING])
        white = white + (s.heading_sigma * ground_speed) ** 2
        once = s.compass_deviation
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        late = float(np.angle(np.mean(np.exp(1j * (course - reference)))))
        solution = np.array([0.0, 0.0, late, 0.0])
    elif relation == "measured airspeed":
        reference = np.ascontiguousarray(rows[:, _AIRSPEED])
        white = white + s.sensor_sigma**2
        # A measured airspeed may change as it likes.
        once, trend_sigma = s.sensor_error, 1e-6
        solution = np.array([*velocity.mean(axis=0), ground_speed / reference.mean(), 0.0])
    else:
        reference = np.ones(n)
        solution = np.array([*_middle(velocity), ground_speed, 0.0])
    time = np.ascontiguousarray(rows[:, _TIME])
    inverse, residual = np.empty((4, 4)), np.empty(n)
    unit, gain, covariance = np.empty((n, 2)), np.empty((n, 4)), np.empty((4, 4))
    scale = 1.0
    for _ in range(2):
        if not refine_wind(
            time - time.mean(), velocity, scale * np.sqrt(white), reference, heading, turn,
            trend_sigma, _HUBER, solution, inverse, residual, unit, gain,
        ):
            return None
        if not stated.any() and not heading:
            # Nobody states the errors: white ones are seen from sample to sample.
            white = np.full(n, max(scatter(residual), s.least_velocity_sigma) ** 2)
        seen = scaled_scatter(residual, white)
        if seen < _NOISIER:
            break
        # Where the airspeed wanders, that is no reason to believe the farther samples less.
        scale = seen
    clock = time - time[0]
    lasting = _EXCESS_TURN * turn
    wind_covariance(
        clock, unit, gain, white, s.correlated_sigma**2, s.correlation_time, 0.0, lasting,
        trend_sigma, inverse, covariance,
    )
    nought, by_excess = np.zeros(n), np.empty((4, 4))
    wind_covariance(
        clock, unit, gain, nought, 0.0, 1.0, 1.0, lasting, np.inf, inverse, by_excess
    )
    covariance += _excess(residual, white, inverse / scale**2, by_excess) * by_excess
    covariance *= _HUBER_COST
    if turned(velocity, solution) < s.least_arc:
        return None
    airspeed = mean_air = mean_speed(velocity - solution[:2])
    of_wind = covariance[:2, :2] + (once * mean_air) ** 2 * np.eye(2)
    if not np.isfinite(of_wind).all():
        return None
    if relation == "constant airspeed":
        airspeed, sigma = float(solution[2]), sqrt(covariance[2, 2])
    else:
        sigma = worst_sigma(of_wind)
    return FlightWind(
        float(time[-1]), solution[:2].copy(), of_wind, airspeed, sigma, relation,
        lasting=once * mean_air,
    )  # fmt: skip


def _excess(residual, white, inverse, by_excess) -> float:
    """Variance of a slowly varying error that explains the residuals beside the white one.

    by_excess : (4, 4) array
        Covariance of the solution by such an error of unit variance. What of it moves the solution
        is missing in the residuals: a wandering airspeed shows little of itself in a turn.
    """
    n = len(residual)
    mean_white = float(np.mean(white))
    scale = max(1.0, scaled_scatter(residual, white))
    seen = scale**2 * clipped_square(residual, white, scale, _HUBER) / _HUBER_VARIANCE
    expected = 1.0 - 3.0 / n
    if seen < expected + _SEEN * sqrt(2.0 / n):
        return 0.0
    kept = 1.0 - float(np.trace(np.linalg.solve(inverse, by_excess))) * mean_white / n
    return (seen - expected) * mean_white / max(kept, _LEAST_KEPT)


def _middle(velocity: np.ndarray) -> np.ndarray:
    """Centre of the circle through velocities, by linear least squares (Kasa's fit)."""
    design = np.column_stack([2.0 * velocity, np.ones(len(velocity))])
    squares = np.sum(velocity**2, axis=1)
    return np.linalg.lstsq(design, squares, rcond=None)[0][:2]
