"""From local samples to the circle flown: a sliding window of about one turn, fitted robustly.

The window holds the newest samples over which the course has turned by up to a little more than a
full turn; the straight flight before a turn, in which the course stands still, falls off its end.
Where the whole window is not on one circle (a radius just changed) a shorter one is tried.
"""

from dataclasses import dataclass
from math import atan2, hypot, isfinite, nan, pi, sqrt

import numpy as np

from ctcbs_ros.kernels.circle import (
    continuous_angles,
    mean_rate,
    newest_offset,
    progress,
    trend,
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
        Least angle about the centre for a valid orbit [rad].
    position_sigma, velocity_sigma : float
        Standard deviations of one axis where the source states none [m], [m/s].
    least_sigma : float
        Smallest standard deviation of a position believed [m]: an autopilot does not hold a circle
        better than this.
    least_velocity_sigma : float
        Smallest standard deviation of a velocity believed [m/s].
    residual_share : float
        Largest root mean square distance from the circle, over its radius, beyond the noise.
    trend_share : float
        Largest change of the radius in one turn, over the radius; more is a spiral.
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
    least_arc: float = 0.45 * _TURN
    position_sigma: float = 2.0
    velocity_sigma: float = 0.4
    least_sigma: float = 0.3
    least_velocity_sigma: float = 0.05
    residual_share: float = 0.03
    trend_share: float = 0.15
    minimum_radius: float = 5.0
    maximum_radius: float = 20e3
    minimum_speed: float = 3.0
    longest_gap: float = 30.0
    most_samples: int = 240


@dataclass(frozen=True)
class OrbitFix:
    """An orbit, or the reason why there is none."""

    orbit: Orbit | None
    reason: str = ""


# Columns of the window.
_TIME, _E, _N, _U, _VE, _VN, _SP, _SV, _COURSE = range(9)
# Windows tried in turn, over the whole one.
_SHARES = (1.0, 0.75, 0.55)


class OrbitEstimator:
    """Sliding-window estimator; samples are added in order of time."""

    def __init__(self, settings: OrbitSettings | None = None):
        self._settings = settings or OrbitSettings()
        self._capacity = 4 * self._settings.most_samples
        self._rows = np.empty((2 * self._capacity, 9))
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._first = self._end = 0
        self._rate = nan
        self._last: CircleFit | None = None

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
        for part in self._candidates(rows, turned):
            fix = self._fit(part)
            if fix.orbit is not None:
                return fix
            reason = reason or fix.reason
        return self._none(reason)

    def _candidates(self, rows: np.ndarray, turned: float):
        """Windows to try: what lies on the circle flown so far, then ever shorter ones."""
        if self._last is not None:
            center, radius = self._last.center, self._last.radius
            off = np.abs(np.hypot(rows[:, _E] - center[0], rows[:, _N] - center[1]) - radius)
            near = off < np.hypot(4.0 * rows[:, _SP], 0.08 * radius)
            # A single glitch does not end the run: three in a row do.
            away = np.flatnonzero(~near[2:] & ~near[1:-1] & ~near[:-2])
            run = rows[away[-1] + 3 :] if away.size else rows
            if 6 <= len(run) < len(rows):
                yield run
        for share in _SHARES:
            part = _newest(rows, share * turned)
            if len(part) < 6:
                return
            yield part

    def _none(self, reason: str) -> OrbitFix:
        self._last = None
        self._rate = nan
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
        row[_SP] = max(stated, s.least_sigma)
        stated = velocity_sigma if isfinite(velocity_sigma) else s.velocity_sigma
        row[_SV] = max(stated, s.least_velocity_sigma)
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

    def _fit(self, rows: np.ndarray) -> OrbitFix:
        s = self._settings
        points, velocities = rows[:, _E : _N + 1], rows[:, _VE : _VN + 1]
        start = None if self._last is None else (self._last.center, self._last.radius)
        fit = fit_circle(points, velocities, rows[:, _SP], rows[:, _SV], start)
        if fit is None and start is not None:
            fit = fit_circle(points, velocities, rows[:, _SP], rows[:, _SV])
        if fit is None:
            return OrbitFix(None, "the track is not a circle")
        time = rows[:, _TIME]
        angle = np.empty(len(rows))
        continuous_angles(
            points, *fit.center, time, self._rate if isfinite(self._rate) else 0.0, angle
        )
        arc = angle[-1] - angle[0]
        sense = 1 if arc > 0.0 else -1
        arc = abs(arc)
        reason = self._objection(fit, rows, angle, arc, sense)
        if reason:
            return OrbitFix(None, reason)
        # In wind the rate varies once a turn. Over a whole turn that variation is fitted beside
        # the mean; over less it cannot be told from the mean, and the residuals' scatter says so.
        rate, rate_variance = mean_rate(
            time, angle, rows[:, _SP] / fit.radius, arc > 0.95 * _TURN
        )
        if not rate * sense > 0.0 or abs(rate) * fit.radius < s.minimum_speed:
            return OrbitFix(None, "the angle about the centre does not advance")
        phase, phase_variance = _phase(time, angle, rows, fit, abs(rate))
        up, climb, up_variance = _height(time, rows)
        covariance = np.zeros((6, 6))
        keep = np.array([0, 1, 3])
        covariance[np.ix_(keep, keep)] = fit.covariance
        covariance[2, 2] = up_variance
        covariance[4, 4] = rate_variance
        covariance[5, 5] = phase_variance
        self._last = fit
        self._rate = rate
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
        )
        return OrbitFix(orbit)

    def _objection(self, fit: CircleFit, rows, angle, arc, sense) -> str:
        """Why a fitted circle is not the orbit flown; empty if it is."""
        s = self._settings
        if not s.minimum_radius <= fit.radius <= s.maximum_radius:
            return f"a radius of {fit.radius:.0f} m is no orbit"
        if arc < s.least_arc:
            return f"only {np.degrees(arc):.0f} deg of a circle so far"
        sigma = float(np.sqrt(np.mean(rows[:, _SP] ** 2)))
        allowed = hypot(2.0 * sigma, s.residual_share * fit.radius)
        rms = float(np.sqrt(np.mean(np.minimum(np.abs(fit.radial), 10.0 * allowed) ** 2)))
        if rms > allowed:
            return f"the track is {rms:.1f} m (rms) off the best circle of {fit.radius:.0f} m"
        # The newest eighth of a turn must be on the circle: the aircraft may just be leaving it.
        off, count = newest_offset(fit.radial, angle, 0.08 * _TURN)
        if abs(off) > max(3.0 * sigma / sqrt(count), 1.0) + s.residual_share * fit.radius:
            return f"the aircraft is {abs(off):.1f} m off the circle flown so far"
        change = trend(fit.radial, angle)
        noise = 4.0 * sigma / (sqrt(len(rows) / 12.0) * arc)
        if abs(change) > s.trend_share * fit.radius + noise * _TURN:
            return f"a spiral: the radius changes by {change:+.0f} m a turn"
        quiet = 3.0 * sqrt(2.0) * sigma / fit.radius
        back, newest, broken = progress(
            fit.radial, angle, rows[:, _TIME], sense, arc, 5.0 * allowed, quiet
        )
        # Over the newest steps together, noise does not hide which way the aircraft turns.
        if back > 0.1 or newest < -quiet:
            return "the sense of rotation changes"
        return "the track is broken" if broken else ""


def _newest(rows: np.ndarray, angle: float) -> np.ndarray:
    """The newest rows over which the course turned by an angle."""
    turned = np.abs(rows[:, _COURSE] - rows[-1, _COURSE])
    return rows[np.argmax(turned <= angle * 1.0001) :]


def _phase(time, angle, rows, fit, rate) -> tuple[float, float]:
    """Angle at the newest sample and its variance, from the newest part of the turn."""
    newest = time > time[-1] - 0.12 * _TURN / rate
    newest[-3:] = True
    weight = (fit.radius / rows[newest, _SP]) ** 2
    phase, _, variance, _, _ = line(time[newest] - time[-1], angle[newest], weight)
    of_center = (fit.covariance[0, 0] + fit.covariance[1, 1]) / (2.0 * fit.radius**2)
    return phase, variance * fit.inflation + of_center


def _height(time, rows) -> tuple[float, float, float]:
    """Height at the newest sample [m], climb rate [m/s] and the variance of the height."""
    up, climb, spread, _, squares = line(time - time[-1], rows[:, _U], np.ones(len(rows)))
    variance = max(squares / max(len(rows) - 2, 1), rows[-1, _SP] ** 2)
    return up, climb, variance * spread
