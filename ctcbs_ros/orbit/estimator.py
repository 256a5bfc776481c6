"""From local samples to the circle flown: a sliding window of about one turn, fitted robustly.

The window holds the newest samples over which the course has turned by up to a little more than a
full turn; the straight flight before a turn, in which the course stands still, falls off its end.
Where the whole window is not on one circle (a radius just changed) a shorter one is tried. Once
enough of a turn is flown to tell, the circle may also drift.
"""

from dataclasses import dataclass
from math import atan2, hypot, inf, isfinite, nan, pi, sqrt

import numpy as np

from ctcbs_ros.kernels.circle import (
    continuous_angles,
    mean_rate,
    newest_offset,
    progress,
    propagate,
    scatter,
    widening,
)
from ctcbs_ros.kernels.regression import line
from ctcbs_ros.orbit.circle_fit import CircleFit, fit_circle
from ctcbs_ros.orbit.orbit import Orbit

_TURN = 2.0 * pi


@dataclass(frozen=True)
class OrbitSettings:
    """What counts as an orbit, and the errors assumed where a source states none.

    Attributes
    ----------
    window : float
        Angle of the course that the window covers [rad]; a little over a turn averages a
        once-per-orbit variation of the speed.
    least_arc : float
        Least angle about the centre for a valid orbit [rad]. The ends of a racetrack are circles
        of half a turn.
    confirming_arc : float
        Least angle instead [rad] after a long turn the other way, or after a circle that was left
        before it was flown so far: the loops of a figure of eight, the ends of a racetrack.
    position_sigma, velocity_sigma : float
        Standard deviations of one axis where the source states none [m], [m/s].
    correlated_share : float
        Share of the standard deviation of a position, stated or not, that is correlated in time;
        the rest is white: s^2 = (share s)^2 + (1 - share^2) s^2. Nought is white noise alone.
    correlation_time : float
        Time in which that correlation falls to 1/e [s] (first-order Gauss-Markov).
    least_sigma : float
        Smallest standard deviation of a position believed [m]: an autopilot does not hold a circle
        better than this.
    least_velocity_sigma : float
        Smallest standard deviation of a velocity believed [m/s].
    residual_share : float
        Largest root mean square distance from the circle, over its radius, beyond the noise.
    trend_share : float
        Largest change of the radius in one turn, over the radius; more is a spiral. It must
        exceed this by two of its standard deviations.
    drift_arc : float
        Least angle about the centre for which a drift of the circle is fitted [rad]: over less it
        is hardly told from another radius, and fitting it would cost the others' accuracy.
    drift_share : float
        Drift in one turn, over the radius, below which a circle is taken to stand still.
    speed_share : float
        Largest variation (rms) of the speed relative to a drifting centre, over its mean: such a
        circle is flown in the air that it drifts with.
    minimum_radius, maximum_radius : float
        [m]
    minimum_speed : float
        [m/s]
    longest_gap : float
        Time without a sample after which the window starts anew [s].
    most_samples : int
        Samples in the window; at higher rates every second, third, ... is used.
    """

    window: float = 1.1 * _TURN
    least_arc: float = 0.46 * _TURN
    confirming_arc: float = 0.95 * _TURN
    position_sigma: float = 2.0
    velocity_sigma: float = 0.4
    correlated_share: float = 0.97
    correlation_time: float = 45.0
    least_sigma: float = 0.3
    least_velocity_sigma: float = 0.05
    residual_share: float = 0.03
    trend_share: float = 0.08
    drift_arc: float = 0.7 * _TURN
    drift_share: float = 0.02
    speed_share: float = 0.1
    minimum_radius: float = 5.0
    maximum_radius: float = 20e3
    minimum_speed: float = 3.0
    longest_gap: float = 30.0
    most_samples: int = 240


@dataclass(frozen=True)
class OrbitFix:
    """An orbit, or the reason why there is none; `final` if no part of the stretch can be one."""

    orbit: Orbit | None
    reason: str = ""
    final: bool = False


# Columns of the window.
_TIME, _E, _N, _U, _VE, _VN, _SP, _SC, _SV, _COURSE, _STATED = range(11)
# Where centre, radius, drift, rate and phase stand in `Orbit.covariance`.
_STANDING, _DRIFTING = [0, 1, 3, 4, 5], [0, 1, 3, 7, 8, 4, 5]
# chi^2 of two components above which a drift is believed: by chance once in a hundred turns.
_SEEN_DRIFT = 9.21
# Windows tried in turn, over the whole one.
_SHARES = (1.0, 0.75, 0.55)
# Time for which a circle left early makes the next one need more evidence, in turns of it.
_DOUBTFUL = 2.0
# Time for which a circle is remembered once lost, in turns of it.
_REMEMBERED = 0.25
# Angle by which the course turned the other way, within the time before, for a figure of eight.
_REVERSED = 0.35 * _TURN
_UNTOLD = "a drift is not yet told from a spiral"
# Standard deviations of a change of the radius from which the circle is taken to change.
_SEEN_CHANGE = 3.5
# Scatter seen, over that stated or assumed, from which it is believed instead.
_NOISIER = 1.5
# Excess of the residuals' variance over the stated one, in its standard deviations, from which
# the track is taken to be off a circle, and for how much of a turn that lasts.
_EXCESS = 3.0
_EXCESS_TURN = 0.1
# Mean square of the residuals beside a spiral, in those expected, below which it is just that.
_CLEAN = 2.0
# Mean of Huber's weight times squared residual over the mean weight, for normal errors; and what
# the gain of the fit misses of the variance of Huber's estimate.
_HUBER_VARIANCE = 0.856
_HUBER_COST = 1.04


class OrbitEstimator:
    """Sliding-window estimator; samples are added in order of time."""

    def __init__(self, settings: OrbitSettings | None = None):
        self._settings = settings or OrbitSettings()
        self._capacity = 4 * self._settings.most_samples
        self._rows = np.empty((2 * self._capacity, 11))
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._first = self._end = 0
        self._rate = nan
        self._last: CircleFit | None = None
        self._last_time = nan
        # The newest orbit, and until when one left early makes the next need more evidence [s].
        self._orbit: Orbit | None = None
        self._doubtful_until = -np.inf

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
        s = self._settings
        if self._end > self._first and time - self._rows[self._end - 1, _TIME] > s.longest_gap:
            self.reset()
        self._append(time, position, velocity, position_sigma, velocity_sigma)
        if self._end - self._first < 6:
            return self._none("too few samples yet")
        rows = self._window()
        turned = abs(rows[-1, _COURSE] - rows[0, _COURSE])
        if turned < 0.8 * s.least_arc:
            return self._none(
                f"the course has turned by {np.degrees(turned):.0f} deg in the last "
                f"{rows[-1, _TIME] - rows[0, _TIME]:.0f} s"
            )
        reason = ""
        for part, may_drift in self._candidates(rows, turned):
            fix = self._fit(part, may_drift)
            if fix.orbit is not None:
                self._orbit = fix.orbit
                return fix
            reason = reason or fix.reason
            if fix.final and len(part) == len(rows):
                break
        return self._none(reason)

    def _candidates(self, rows: np.ndarray, turned: float):
        """Windows to try: what lies on the circle flown so far, then ever shorter ones.

        With each, whether it may drift: a spiral seen for less than it could be looks like that.
        """
        if self._last is not None:
            moved = np.outer(rows[:, _TIME] - self._last_time, self._last.drift)
            offset = rows[:, _E : _N + 1] - self._last.center - moved
            off = np.abs(np.hypot(*offset.T) - self._last.radius)
            radius = self._last.radius
            near = off < np.hypot(4.0 * np.hypot(rows[:, _SP], rows[:, _SC]), 0.08 * radius)
            # A single glitch does not end the run: three in a row do.
            away = np.flatnonzero(~near[2:] & ~near[1:-1] & ~near[:-2])
            run = rows[away[-1] + 3 :] if away.size else rows
            if 6 <= len(run) < len(rows):
                yield run, self._last.drifts
        for share in _SHARES:
            part = _newest(rows, share * turned)
            if len(part) < 6:
                return
            yield part, share == 1.0

    def _least_arc(self, rows: np.ndarray, sense: int) -> float:
        """Angle to be flown before a circle is an orbit, by what was flown before [rad]."""
        s = self._settings
        start, end = rows[0, _TIME], rows[-1, _TIME]
        if self._orbit is not None:
            return s.least_arc
        if end < self._doubtful_until:
            return s.confirming_arc
        before = self._rows[self._first : self._end]
        course = sense * before[before[:, _TIME] > start - 2.0 * (end - start), _COURSE]
        reverse = np.max(np.maximum.accumulate(course) - course)
        return s.confirming_arc if reverse > _REVERSED else s.least_arc

    def _none(self, reason: str) -> OrbitFix:
        self._last = None
        self._rate = nan
        lost = self._orbit
        if lost is not None and self._end > self._first:
            turn = _TURN / lost.angular_rate
            if self._rows[self._end - 1, _TIME] - lost.time > _REMEMBERED * turn:
                if lost.arc < self._settings.confirming_arc:
                    self._doubtful_until = lost.time + _DOUBTFUL * turn
                self._orbit = None
        return OrbitFix(None, reason)

    def _append(self, time, position, velocity, position_sigma, velocity_sigma) -> None:
        s = self._settings
        if self._end == len(self._rows):
            kept = self._rows[self._first : self._end]
            if len(kept) > self._capacity:
                # A slow circle at a high rate: half as many samples still fill the window.
                kept = kept[::-1][::2][::-1]
            kept = kept.copy()
            self._rows[: len(kept)] = kept
            self._first, self._end = 0, len(kept)
        row = self._rows[self._end]
        row[_TIME] = time
        row[_E : _U + 1] = position
        row[_VE : _VN + 1] = nan if velocity is None else velocity[:2]
        stated = position_sigma if isfinite(position_sigma) else s.position_sigma
        row[_SC] = s.correlated_share * stated
        row[_SP] = max(sqrt(1.0 - s.correlated_share**2) * stated, s.least_sigma)
        stated = velocity_sigma if isfinite(velocity_sigma) else s.velocity_sigma
        row[_SV] = max(stated, s.least_velocity_sigma)
        row[_STATED] = isfinite(position_sigma)
        row[_COURSE] = self._course(row)
        self._end += 1

    def _course(self, row: np.ndarray) -> float:
        """Course over ground, continuous with the sample before."""
        before = self._rows[self._first : self._end]
        if isfinite(row[_VE]):
            if hypot(row[_VE], row[_VN]) < self._settings.minimum_speed:
                return before[-1, _COURSE] if len(before) else 0.0
            course = atan2(row[_VN], row[_VE])
        else:
            # The chord to an earlier position far enough away for the noise not to matter.
            far = np.hypot(before[:, _E] - row[_E], before[:, _N] - row[_N]) > 8.0 * row[_SP]
            if not far.any():
                return before[-1, _COURSE] if len(before) else 0.0
            start = before[np.flatnonzero(far)[-1]]
            course = atan2(row[_N] - start[_N], row[_E] - start[_E])
        if not len(before):
            return course
        last = before[-1]
        # Across a gap the course goes on turning as it did.
        expected = last[_COURSE]
        gap = row[_TIME] - last[_TIME]
        if isfinite(self._rate):
            expected += self._rate * gap
        return expected + (course - expected + pi) % _TURN - pi

    def _window(self) -> np.ndarray:
        """The newest samples, as far back as the course keeps turning and the window reaches."""
        s = self._settings
        rows = self._rows[self._first : self._end]
        course = rows[:, _COURSE]
        turned = course - course[-1]
        outside = np.flatnonzero(np.abs(turned) > s.window)
        if outside.size:
            # Older samples will never be needed again.
            self._first += int(outside[-1])
            rows = rows[outside[-1] :]
            turned = turned[outside[-1] :]
        # Straight flight before the turn: drop what adds no angle.
        most = np.abs(turned).max()
        start = int(np.flatnonzero(np.abs(turned) >= most - 0.03 * most - 0.02)[-1])
        rows = rows[start:]
        stride = -(-len(rows) // s.most_samples)
        return rows[::-1][::stride][::-1]

    def _fit(self, rows: np.ndarray, may_drift: bool) -> OrbitFix:
        """The orbit of a circle that stands still, or of one that is seen to drift."""
        standing, fit = self._orbit_of(rows, False)
        found = standing, fit
        turned = abs(rows[-1, _COURSE] - rows[0, _COURSE])
        if may_drift and turned > self._settings.drift_arc:
            drifting, moving_fit = self._orbit_of(rows, True)
            if drifting.orbit is not None:
                if self._is_seen_to_drift(drifting.orbit):
                    found = drifting, moving_fit
                elif standing.orbit is not None:
                    block = slice(7, 9)
                    standing.orbit.covariance[block, block] = drifting.orbit.covariance[
                        block, block
                    ]
            elif standing.orbit is None and drifting.final and drifting.reason == _UNTOLD:
                # Neither stands it still: a part of it would only seem to.
                found = drifting, None
        if found[0].orbit is not None:
            self._last, self._last_time = found[1], rows[-1, _TIME]
            self._rate = found[0].orbit.sense * found[0].orbit.angular_rate
        return found[0]

    def _is_seen_to_drift(self, orbit: Orbit) -> bool:
        turn = _TURN / orbit.angular_rate
        if hypot(*orbit.drift) * turn < self._settings.drift_share * orbit.radius:
            return False
        return orbit.drift @ np.linalg.solve(orbit.covariance[7:, 7:], orbit.drift) > _SEEN_DRIFT

    def _orbit_of(self, rows: np.ndarray, drifts: bool) -> tuple[OrbitFix, CircleFit | None]:
        s = self._settings
        fit, position_sigma, velocity_sigma = self._circle(rows, drifts)
        if fit is None:
            return OrbitFix(None, "the track is not a circle"), None
        time = rows[:, _TIME]
        angle = np.empty(len(rows))
        continuous_angles(
            fit.points, *fit.center, time, self._rate if isfinite(self._rate) else 0.0, angle
        )
        arc = angle[-1] - angle[0]
        sense = 1 if arc > 0.0 else -1
        arc = abs(arc)
        # What is stated in all, or the scatter alone where that is more.
        whole = np.hypot(rows[:, _SP], rows[:, _SC])
        sigma = float(np.sqrt(np.mean(np.maximum(whole, position_sigma) ** 2)))
        widened = widening(
            fit.points, fit.velocities, time - time[-1], fit.circle, fit.drifts, angle, fit.radial,
            fit.along, fit.weight, np.ascontiguousarray(rows[:, _SC]), s.correlation_time,
        )
        objection = self._objection(fit, rows, angle, arc, sense, sigma, widened)
        if objection is not None:
            return objection, None
        # In wind the rate varies once a turn. Over a whole turn that variation is fitted beside
        # the mean; over less it cannot be told from the mean, and the residuals' scatter says so.
        operators = np.zeros((2, len(rows)))
        rate, excess = mean_rate(
            time, angle, position_sigma / fit.radius, arc > 0.95 * _TURN and not drifts,
            operators[0],
        )
        if not rate * sense > 0.0 or abs(rate) * fit.radius < s.minimum_speed:
            return OrbitFix(None, "the angle about the centre does not advance"), None
        phase = _phase(time, angle, position_sigma, abs(rate), operators[1])
        up, climb, height_covariance = _height(time, rows, s.correlation_time)
        covariance = np.zeros((9, 9))
        places = _DRIFTING if drifts else _STANDING
        fitted = self._covariance(
            fit, rows, position_sigma, velocity_sigma, operators, abs(rate), excess
        )
        covariance[np.ix_(places, places)] = fitted
        covariance[4] *= sense
        covariance[:, 4] *= sense
        covariance[np.ix_([2, 6], [2, 6])] = height_covariance
        if not drifts:
            covariance[7, 7] = covariance[8, 8] = inf
        change, variance, _ = widened
        if abs(change) > _SEEN_CHANGE * sqrt(variance):
            # The window lags a radius that changes, by what it changes in half of it.
            covariance[3, 3] += (0.5 * change * arc / _TURN) ** 2
        orbit = Orbit(
            time=float(time[-1]),
            start_time=float(time[0]),
            center=np.array([*fit.center, up]),
            radius=float(fit.radius),
            angular_rate=float(abs(rate)),
            sense=sense,
            phase=float(-((-phase + pi) % _TURN - pi)),
            climb_rate=float(climb),
            rms_residual=float(np.sqrt(np.mean(fit.radial**2))),
            arc=float(arc),
            samples=len(rows),
            covariance=covariance,
            drift=np.array(fit.drift),
        )
        return OrbitFix(orbit), fit

    def _circle(self, rows: np.ndarray, drifts: bool):
        """The fit, and the standard deviations of positions and velocities it was made with."""
        points, velocities = _measured(rows)
        position_sigma, velocity_sigma = rows[:, _SP], rows[:, _SV]
        age = rows[:, _TIME] - rows[-1, _TIME] if drifts else None
        start = None
        if self._last is not None and self._last.drifts == drifts:
            start = (self._last.center, self._last.radius, self._last.drift)
        fit = fit_circle(points, velocities, position_sigma, velocity_sigma, start, age)
        if fit is None and start is not None:
            fit = fit_circle(points, velocities, position_sigma, velocity_sigma, None, age)
        if fit is None:
            return None, position_sigma, velocity_sigma
        # Noise is seen from sample to sample, whatever the shape of the track.
        seen = scatter(fit.radial) / float(np.mean(position_sigma))
        if seen > _NOISIER:
            position_sigma = position_sigma * seen
            turned = np.hypot(*fit.velocities.T) * position_sigma / fit.radius
            noisier = scatter(fit.along) / max(
                float(np.sqrt(np.nanmean(velocity_sigma**2 + turned**2))), 1e-9
            ) if np.isfinite(velocities[:, 0]).any() else 1.0
            velocity_sigma = velocity_sigma * max(noisier, 1.0)
            again = fit_circle(
                points, velocities, position_sigma, velocity_sigma,
                (fit.center, fit.radius, fit.drift), age,
            )
            if again is not None:
                fit = again
        return fit, position_sigma, velocity_sigma

    def _covariance(
        self, fit, rows, position_sigma, velocity_sigma, operators, rate, excess
    ) -> np.ndarray:
        """Of centre, radius, drift if it is fitted, rate and phase, (5, 5) or (7, 7)."""
        s = self._settings
        velocities = fit.velocities
        age = rows[:, _TIME] - rows[-1, _TIME]
        position_variance = position_sigma**2
        velocity_variance = (fit.late * velocity_sigma) ** 2
        share = fit.weight[0] * position_variance
        seen = share @ (fit.radial**2 / position_variance)
        seen /= max(share.sum() - 3.0, 1.0) * _HUBER_VARIANCE
        correlated = [rows[:, _SC]]
        times = [s.correlation_time]
        off = 0.0
        # Of a slowly varying error, the part that a straight course through it does not follow.
        duration = -float(age[0])
        varying = float(np.mean(rows[:, _SC] ** 2)) * min(
            1.0, duration / (6.0 * s.correlation_time)
        )
        expected = 1.0 + varying / float(np.mean(position_variance))
        if not rows[:, _STATED].any():
            # Nobody states the errors: they are what the residuals show.
            position_variance = position_variance * seen
            known = fit.weight[1] > 0.0
            if known.any():
                # The weights carry the variance, and the number of unknowns is shared.
                squares = fit.weight[1][known] @ fit.along[known] ** 2
                turned = np.sum(velocities[known] ** 2, axis=1) / fit.radius**2
                assumed = velocity_variance[known] + fit.late**2 * turned * rows[known, _SP] ** 2
                total = squares / (_HUBER_VARIANCE * float(np.sum(fit.weight[1][known] * assumed)))
                own = total * assumed - turned * position_variance[known]
                velocity_variance[known] = np.maximum(own, s.least_velocity_sigma**2)
        elif seen > expected + _EXCESS * sqrt(2.0 / len(rows)):
            off = (seen - expected) * float(np.mean(position_variance))
        if off > 0.0:
            correlated.append(np.full(len(rows), sqrt(off)))
            times.append(_EXCESS_TURN * _TURN / rate)
        rate_at = len(fit.inverse)
        covariance = np.empty((rate_at + 2, rate_at + 2))
        propagate(
            fit.points, velocities, age, fit.circle, fit.weight, fit.inverse, operators,
            position_variance, velocity_variance, np.array(correlated), np.array(times),
            covariance,
        )
        covariance *= _HUBER_COST
        more = sqrt(max(1.0, excess - expected + 1.0))
        covariance[rate_at] *= more
        covariance[:, rate_at] *= more
        return covariance

    def _objection(
        self, fit: CircleFit, rows, angle, arc, sense, sigma, widened
    ) -> OrbitFix | None:
        """Why a fitted circle is not the orbit flown; None if it is."""
        s = self._settings
        if not s.minimum_radius <= fit.radius <= s.maximum_radius:
            return OrbitFix(None, f"a radius of {fit.radius:.0f} m is no orbit")
        if arc < (s.drift_arc if fit.drifts else self._least_arc(rows, sense)):
            return OrbitFix(None, f"only {np.degrees(arc):.0f} deg of a circle so far")
        if fit.drifts:
            speed = np.hypot(*fit.velocities[np.isfinite(fit.velocities[:, 0])].T)
            if len(speed) < 6 or np.std(speed) > hypot(
                s.speed_share * np.mean(speed), 2.0 * float(np.mean(rows[:, _SV]))
            ):
                return OrbitFix(None, "the speed about the drifting centre varies")
        change, variance, clean = widened
        if fit.drifts and 2.0 * sqrt(variance) > s.trend_share * fit.radius:
            return OrbitFix(None, _UNTOLD, final=clean < _CLEAN)
        # A spiral looks much like a drift: of a circle that drifts the radius has to stand still.
        share = s.drift_share if fit.drifts else s.trend_share
        # Over a whole turn it shows for what it is; over half a turn noise makes some of each.
        deviations = 1.0 if arc > 0.95 * _TURN else 2.0
        if abs(change) > share * fit.radius + deviations * sqrt(variance):
            spiral = f"a spiral: the radius changes by {change:+.0f} m a turn"
            return OrbitFix(None, spiral, final=clean < _CLEAN)
        allowed = hypot(2.0 * sigma, s.residual_share * fit.radius)
        rms = float(np.sqrt(np.mean(np.minimum(np.abs(fit.radial), 3.0 * allowed) ** 2)))
        if rms > allowed:
            return OrbitFix(
                None, f"the track is {rms:.1f} m (rms) off the best circle of {fit.radius:.0f} m"
            )
        # The newest eighth of a turn must be on the circle: the aircraft may just be leaving it.
        off, count = newest_offset(fit.radial, angle, 0.08 * _TURN)
        if abs(off) > max(3.0 * sigma / sqrt(count), 1.0) + s.residual_share * fit.radius:
            return OrbitFix(None, f"the aircraft is {abs(off):.1f} m off the circle flown so far")
        quiet = 3.0 * sqrt(2.0) * sigma / fit.radius
        back, newest, broken = progress(
            fit.radial, angle, rows[:, _TIME], sense, arc, 5.0 * allowed, quiet
        )
        # Over the newest steps together, noise does not hide which way the aircraft turns.
        if back > 0.1 or newest < -quiet:
            return OrbitFix(None, "the sense of rotation changes")
        return OrbitFix(None, "the track is broken") if broken else None


def _newest(rows: np.ndarray, angle: float) -> np.ndarray:
    """The newest rows over which the course turned by an angle."""
    turned = np.abs(rows[:, _COURSE] - rows[-1, _COURSE])
    return rows[np.argmax(turned <= angle * 1.0001) :]


def _measured(rows) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities, (n, 2) each."""
    return np.ascontiguousarray(rows[:, _E : _N + 1]), np.ascontiguousarray(rows[:, _VE : _VN + 1])


def _phase(time, angle, sigma, rate, operator) -> float:
    """Angle at the newest sample, from a line through the newest part of the turn.

    operator : (n,) array of nought, written: takes the angles to the phase
    """
    newest = time > time[-1] - 0.08 * _TURN / rate
    newest[-3:] = True
    t, weight = time[newest] - time[-1], 1.0 / sigma[newest] ** 2
    weight = weight / weight.sum()
    mean = weight @ t
    spread = weight @ (t - mean) ** 2
    operator[newest] = weight * (1.0 - mean * (t - mean) / spread) if spread > 0.0 else weight
    return float(operator @ angle)


def _height(time, rows, correlation_time) -> tuple[float, float, np.ndarray]:
    """Height at the newest sample [m], climb rate [m/s] and their covariance (2, 2)."""
    age = time - time[-1]
    n = len(age)
    up, climb, _, _, squares = line(age, rows[:, _U], np.ones(n))
    off = age - age.mean()
    by_sample = off / max(off @ off, 1e-12)
    gain = np.vstack([1.0 / n - age.mean() * by_sample, by_sample])
    white = max(squares / max(n - 2, 1), float(np.mean(rows[:, _SP] ** 2)))
    # An error that varies as slowly as a climb moves the height whole.
    held = np.exp(-(np.abs(age[:, None] - age)) / correlation_time)
    correlated = gain * rows[:, _SC]
    return up, climb, white * gain @ gain.T + correlated @ held @ correlated.T
