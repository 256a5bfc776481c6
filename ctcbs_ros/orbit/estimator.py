"""From local samples to the circle flown: a sliding window of about one turn, fitted robustly.

Each sample goes into the window (`window.py`); a circle is fitted to it with the noise that it
shows (`circle_fit.py`, `noise.py`), and is the orbit unless something speaks against it
(`objection.py`). Where the whole window is not on one circle (a radius just changed) a shorter one
is tried. Once enough of a turn is flown to tell, the circle may also drift.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, nan, pi, sqrt

import numpy as np

from ctcbs_ros.kernels.circle_angles import continuous_angles, mean_rate, newest_phase
from ctcbs_ros.kernels.circle_errors import clipped_rms, larger_rms
from ctcbs_ros.kernels.circle_trend import widening
from ctcbs_ros.kernels.course_trend import course_widening
from ctcbs_ros.kernels.rate_trend import rate_lag
from ctcbs_ros.kernels.track import joined_circle
from ctcbs_ros.orbit.circle_fit import CircleFit
from ctcbs_ros.orbit.noise import (
    AS_STATED,
    NEWEST,
    Scatter,
    circle_covariance,
    fit_by_scatter,
    height,
    lag_covariance,
    misfit,
)
from ctcbs_ros.orbit.objection import Objection, drifts_with_the_air, objection
from ctcbs_ros.orbit.orbit import ORBIT_STATE, Orbit
from ctcbs_ros.orbit.settings import TURN, OrbitSettings
from ctcbs_ros.orbit.window import Samples, SampleWindow

# Where centre, radius, drift, rate and phase stand in `Orbit.covariance`.
_STANDING, _DRIFTING = (np.ix_(at, at) for at in ([0, 1, 3, 4, 5], [0, 1, 3, 7, 8, 4, 5]))
_HEIGHT = np.ix_([2, 6], [2, 6])
_DRIFT = slice(7, 9)
# chi^2 of two components above which a drift is believed: by chance once in a hundred turns.
_SEEN_DRIFT = 9.21
# A drift lasts if it has changed by less than this share of itself since this part of a turn ago
# (at least, and at most): that of a spiral, or of a circle converged onto, turns with the window.
_LASTING, _CHANGED = (0.5, 0.8), 0.4
# Times a turn at which a drift is remembered for that.
_DRIFTS_KEPT = 32
# Angle by which the course has to turn until a circle is tried again after one was refused.
_TRIED_ANEW = TURN / 64.0
# Part of a turn after which a circle that stands still is asked again whether it drifts.
_SOUGHT_ANEW = 1.0 / 16.0
# Turn of the course [deg] below which there is none to speak of.
_NO_TURN = 5.0
# Fewest samples of a circle.
_FEWEST = 6
# Windows tried in turn, over the whole one.
_SHARES = (1.0, 0.75, 0.55)
# Excess of the mean square residual, over the white errors', from which a part of the window, that
# is tried because the whole is on no circle, is taken to be of two itself.
_TWO_CIRCLES = 2.0
# Part of a turn from which a fit to all of the window shows a change for what it is.
_WHOLE = 0.95
# Standard deviations from which a change of the rate is seen.
_SEEN = 2.0
# Time for which a circle left early makes the next one need more evidence, in turns of it.
_DOUBTFUL = 2.0
# Time for which a circle is remembered once lost, in turns of it.
_REMEMBERED = 0.25
# Angle by which the course turned the other way, within the time before, for a figure of eight.
_REVERSED = 0.35 * TURN


@dataclass(frozen=True)
class OrbitFix:
    """An orbit, or the reason why there is none."""

    orbit: Orbit | None
    reason: str = ""


@dataclass(frozen=True)
class _Found:
    """An orbit with the circle it was made of."""

    orbit: Orbit
    fit: CircleFit
    scatter: Scatter


@dataclass(frozen=True)
class _Unbelieved:
    """What a drift that was fitted but not believed adds to the covariance of a standing circle.

    None of it is excluded: were the circle to drift, its state would be that of the other fit. So
    the variance between the two counts, as in an average of models, where it is beyond chance.
    """

    covariance: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, standing: Orbit, drifting: Orbit) -> "_Unbelieved":
        """Of the two orbits of the same samples."""
        apart = np.zeros(len(ORBIT_STATE))
        apart[_DRIFT] = drifting.drift
        if _is_beyond_chance(drifting):
            apart[:2] = drifting.center[:2] - standing.center[:2]
            apart[3] = drifting.radius - standing.radius
            apart[4] = drifting.angular_rate - standing.angular_rate
            apart[5] = (drifting.phase - standing.phase + pi) % TURN - pi
        covariance = np.outer(apart, apart)
        covariance[_DRIFT, _DRIFT] += drifting.covariance[_DRIFT, _DRIFT]
        return cls(covariance)

    def count_in(self, standing: Orbit) -> None:
        """Add it."""
        standing.covariance[_DRIFT, _DRIFT] = 0.0
        standing.covariance[:] += self.covariance


def _is_beyond_chance(orbit: Orbit) -> bool:
    """Whether the drift of a drifting circle is."""
    drift = orbit.drift
    return drift @ np.linalg.solve(orbit.covariance[_DRIFT, _DRIFT], drift) > _SEEN_DRIFT


class OrbitEstimator:
    """Sliding-window estimator; samples are added in order of time."""

    def __init__(self, settings: OrbitSettings | None = None):
        self._settings = settings or OrbitSettings()
        self._window = SampleWindow(self._settings)
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._window.clear()
        # Of the sample before.
        self._last: _Found | None = None
        # Why the circle tried last was refused, and the course then.
        self._refused, self._refused_at = "", inf
        # When a drift was last looked for, and what one that was not believed may be worth.
        self._drift_sought = -inf
        self._unbelieved: _Unbelieved | None = None
        # Drifts that were fitted, believed or not, with their times.
        self._drifts: deque[tuple[float, np.ndarray]] = deque(maxlen=_DRIFTS_KEPT)
        # The newest orbit, and until when one left early makes the next need more evidence [s].
        self._orbit: Orbit | None = None
        self._doubtful_until = -inf

    def add(
        self,
        time: float,
        position: np.ndarray,
        velocity: np.ndarray | None,
        position_sigma: float = nan,
        velocity_sigma: float = nan,
    ) -> OrbitFix:
        """Take in a sample and estimate the orbit at its time.

        Parameters
        ----------
        time : float
            [s], later than the sample before.
        position : (3,) ndarray
            East, north, up [m].
        velocity : (3,) ndarray or None
            East, north, up [m/s].
        position_sigma, velocity_sigma : float
            Standard deviations of one horizontal axis; nan where not known.

        Returns
        -------
        OrbitFix
        """
        if time - self._window.newest_time > self._settings.longest_gap:
            self.reset()
        self._window.add(time, position, velocity, position_sigma, velocity_sigma, self._rate())
        if len(self._window) < _FEWEST:
            return self._none("too few samples yet")
        samples = self._window.newest_turn()
        if samples.turned < 0.8 * self._settings.least_arc:
            turned = np.degrees(samples.turned)
            if turned < _NO_TURN:
                return self._none("the course does not turn")
            seconds = samples.time[-1] - samples.time[0]
            return self._none(f"the course has turned by {turned:.0f} deg in {seconds:.1f} s")
        course = float(self._window.kept.course[-1])
        if self._last is None and abs(course - self._refused_at) < _TRIED_ANEW:
            return self._none(self._refused)
        if len(samples) < _FEWEST:
            return self._none(f"only {len(samples)} samples in about a turn, fewer than {_FEWEST}")
        reason = ""
        for part, may_drift in self._candidates(samples):
            found = self._best(part, may_drift, len(part) < len(samples))
            if isinstance(found, _Found):
                self._orbit, self._last = found.orbit, found
                return OrbitFix(found.orbit)
            reason = reason or found.reason
            if found.final and len(part) == len(samples):
                break
        self._refused, self._refused_at = reason, course
        return self._none(reason)

    def _rate(self) -> float:
        """At which the circle was flown at the sample before, ENU [rad/s]; nan off any."""
        if self._last is None:
            return nan
        return self._last.orbit.sense * self._last.orbit.angular_rate

    def _none(self, reason: str) -> OrbitFix:
        self._last = self._unbelieved = None
        lost = self._orbit
        if lost is not None and len(self._window):
            turn = TURN / lost.angular_rate
            if self._window.newest_time - lost.time > _REMEMBERED * turn:
                if lost.arc < self._settings.confirming_arc:
                    self._doubtful_until = lost.time + _DOUBTFUL * turn
                self._orbit = None
        return OrbitFix(None, reason)

    def _candidates(self, samples: Samples) -> Iterator[tuple[Samples, bool]]:
        """Windows to try: what lies on the circle flown so far, then ever shorter ones.

        With each, whether it may drift: a spiral seen for less than it could be looks like that.
        """
        last = self._last
        if last is not None:
            joined = joined_circle(
                samples.points, samples.time - last.orbit.time, samples.white_sigma,
                samples.correlated_sigma, last.fit.circle, last.fit.drift,
            )
            if 0 < joined <= len(samples) - _FEWEST:
                yield samples[joined:], last.fit.drifts
        for share in _SHARES:
            part = samples if share == 1.0 else samples.newest(share * samples.turned)
            if len(part) < _FEWEST:
                return
            yield part, share == 1.0

    def _least_arc(self, samples: Samples, sense: int) -> float:
        """Angle to be flown before a circle is an orbit, by what was flown before [rad]."""
        s = self._settings
        start, end = samples.time[0], samples.time[-1]
        if self._orbit is not None:
            return s.least_arc
        if end < self._doubtful_until:
            return s.confirming_arc
        before = self._window.kept
        course = sense * before.course[before.time > start - 2.0 * (end - start)]
        reverse = np.max(np.maximum.accumulate(course) - course)
        return s.confirming_arc if reverse > _REVERSED else s.least_arc

    def _best(self, samples: Samples, may_drift: bool, shortened: bool) -> _Found | Objection:
        """The orbit of a circle that stands still, or of one that is seen to drift."""
        standing = self._orbit_of(samples, False, shortened)
        found = self._drifting_instead(standing, samples, may_drift, shortened)
        if found is standing and isinstance(standing, _Found) and self._unbelieved is not None:
            self._unbelieved.count_in(standing.orbit)
        return found

    def _drifting_instead(
        self, standing: _Found | Objection, samples: Samples, may_drift: bool, shortened: bool
    ) -> _Found | Objection:
        """The circle that drifts, where that is believed, instead of one that stands still."""
        if not may_drift or samples.turned <= self._settings.drift_arc:
            return standing
        if isinstance(standing, _Found) and self._last is not None and not self._last.fit.drifts:
            turn = TURN / standing.orbit.angular_rate
            if standing.orbit.time < self._drift_sought + _SOUGHT_ANEW * turn:
                return standing
            self._drift_sought = standing.orbit.time
        drifting = self._orbit_of(samples, True, shortened)
        if isinstance(drifting, Objection):
            if isinstance(standing, Objection) and drifting.untold and drifting.final:
                # Neither stands it still: a part of it would only seem to.
                return drifting
            return standing
        if self._is_seen_to_drift(drifting, samples):
            self._unbelieved = None
            return drifting
        if isinstance(standing, _Found):
            self._unbelieved = _Unbelieved.of(standing.orbit, drifting.orbit)
        return standing

    def _is_seen_to_drift(self, found: _Found, samples: Samples) -> bool:
        orbit = found.orbit
        lasts = self._lasts(orbit)
        turn = TURN / orbit.angular_rate
        if hypot(*orbit.drift) * turn < self._settings.drift_share * orbit.radius:
            return False
        if not _is_beyond_chance(orbit):
            return False
        return lasts or drifts_with_the_air(found.fit, samples, self._settings)

    def _lasts(self, orbit: Orbit) -> bool:
        """Whether the drift is that of half a turn ago."""
        turn = TURN / orbit.angular_rate
        if not self._drifts or orbit.time - self._drifts[-1][0] > turn / _DRIFTS_KEPT:
            self._drifts.append((orbit.time, orbit.drift))
        least, most = _LASTING
        before = [d for t, d in self._drifts if least * turn <= orbit.time - t <= most * turn]
        if not before:
            return False
        return hypot(*(orbit.drift - before[-1])) < _CHANGED * hypot(*orbit.drift)

    def _orbit_of(self, samples: Samples, drifts: bool, shortened: bool) -> _Found | Objection:
        s = self._settings
        start, usual = None, AS_STATED
        flown = self._last is not None and self._last.fit.drifts == drifts
        if flown:
            start, usual = self._last.fit.start, self._last.scatter
        fit, position_sigma, velocity_sigma, seen = fit_by_scatter(samples, start, drifts, usual)
        if fit is None:
            return Objection("the track is not a circle")
        time, rate = samples.time, self._rate()
        angle = np.empty(len(samples))
        continuous_angles(fit.points, *fit.center, time, rate if isfinite(rate) else 0.0, angle)
        arc = float(abs(angle[-1] - angle[0]))
        sense = 1 if angle[-1] > angle[0] else -1
        # What is stated in all, or the scatter alone where that is more.
        sigma = larger_rms(position_sigma, samples.white_sigma, samples.correlated_sigma)
        by_course = (0.0, inf)
        if not drifts:
            by_course = course_widening(
                samples.velocities, samples.age, fit.radius, velocity_sigma, arc > s.drift_arc
            )
        widened = widening(
            fit.points, fit.velocities, samples.age, fit.circle, drifts, angle, fit.radial,
            fit.along, fit.weight, samples.correlated_sigma, s.correlation_time, by_course,
        )
        least_arc = self._least_arc(samples, sense)
        against = objection(fit, samples, angle, least_arc, sigma, widened, flown, s)
        if against is not None:
            return against
        excess_square = off = 0.0
        if shortened or arc < _WHOLE * TURN:
            excess_square, off = misfit(samples, position_sigma, widened[2], s)
        if shortened and excess_square > _TWO_CIRCLES:
            return Objection("the newest part of the turn is not on one circle yet")
        # In wind the rate varies once a turn. Over a whole turn that variation is fitted beside
        # the mean; over less it cannot be told from the mean, and the residuals' scatter says so.
        operators, harmonic = np.zeros((2, len(samples))), np.empty(2)
        rate, excess = mean_rate(
            time, angle, position_sigma / fit.radius, arc > _WHOLE * TURN, operators[0],
            harmonic,
        )
        if not rate * sense > 0.0 or abs(rate) * fit.radius < s.minimum_speed:
            return Objection("the angle about the centre does not advance")
        reach = NEWEST * TURN / abs(rate)
        phase = newest_phase(time, angle, position_sigma, harmonic, reach, operators[1])
        up, climb, height_covariance = height(samples, s.correlation_time)
        of_circle = circle_covariance(
            fit, samples, position_sigma, velocity_sigma, operators, abs(rate), excess, s
        )
        of_circle += lag_covariance(
            fit, samples, angle, operators, rate, widened, shortened, off, s
        )
        if arc > _WHOLE * TURN:
            lag, chance = rate_lag(
                fit.points, fit.velocities, fit.circle, time, angle, position_sigma,
                velocity_sigma, rate,
            )
            if lag**2 > _SEEN**2 * chance:
                of_circle[-2, -2] += lag**2 - chance
        if not of_circle[2, 2] < (s.known_share * fit.radius) ** 2:
            return Objection(
                f"the radius of {fit.radius:.0f} m is known to +-{sqrt(of_circle[2, 2]):.1f} m, "
                f"not to {100.0 * s.known_share:.0f} %"
            )
        covariance = np.zeros((9, 9))
        covariance[_DRIFTING if drifts else _STANDING] = of_circle
        covariance[4] *= sense
        covariance[:, 4] *= sense
        covariance[_HEIGHT] = height_covariance
        if not drifts:
            covariance[7, 7] = covariance[8, 8] = inf
        orbit = Orbit(
            time=float(time[-1]),
            start_time=float(time[0]),
            center=np.array([*fit.center, up]),
            radius=fit.radius,
            angular_rate=abs(rate),
            sense=sense,
            phase=-((-phase + pi) % TURN - pi),
            climb_rate=climb,
            rms_residual=clipped_rms(fit.radial, inf),
            arc=arc,
            samples=len(samples),
            covariance=covariance,
            drift=fit.drift,
        )
        return _Found(orbit, fit, seen)

