"""The tow point's path from noisy telemetry: without delay, and smooth enough for a stiff cable.

A Kalman filter of position, velocity and acceleration turns with the orbit where there is one: in
a steady turn the velocity through the air, u, turns at the orbit's rate W, d2u/dt2 = -W^2 u. What
a sample corrects of it would be a jump of the path; the path takes it over along a critically
damped way instead, so that position and velocity are continuous. The path ends at the newest
sample: there is no delay, but a correction has come into it by half only after 0.8 s.
"""

from dataclasses import dataclass
from math import cos, exp, sin

import numpy as np

# Of the critically damped way, by which a correction has come in by a quarter [s]: of samples with
# a velocity, and of those without, whose filter is corrected by more.
TAKEN_OVER, TAKEN_OVER_OF_POSITIONS = 0.5, 1.0
# Jerk that the filter does not foresee, as white noise of this density, level and upright
# [m^2/s^5]: an aircraft banks in some seconds.
JERK_LEVEL, JERK_UP = 10.0, 0.3
# An acceleration nobody has told yet [m/s^2].
_FIRST_ACCELERATION = 3.0
# What is stated beyond is correlated in time: no filter takes it out of a position [m].
_MOST_SIGMA = 1.5
# Velocities that lead past the positions, as those of a receiver that smooths them do by some m/s
# in a turn, count for less within this time [s].
_DOUBT_TIME = 1.0
# Longest piece of the path, in turns of the orbit [rad] and in seconds: a cubic through a turn.
_PIECE_ANGLE, _PIECE_TIME = 0.25, 1.0


@dataclass(frozen=True)
class Pieces:
    """A stretch of the path, as cubics; times since its beginning.

    Attributes
    ----------
    breaks : (k + 1,) ndarray
        From 0 to the stretch's end [s].
    coefficients : (4, k, 3) ndarray
        Of powers 0 to 3 of the time since a break (`ctcbs_ros.kernels.piecewise`) [m].
    """

    breaks: np.ndarray
    coefficients: np.ndarray


class TowPoint:
    """Follows the tow point.

    Attributes
    ----------
    position, velocity : (3,) ndarray
        Of the path's end [m], [m/s].
    """

    def __init__(self, position, velocity, position_sigma: float, velocity_sigma: float):
        """Begin with a sample.

        Parameters
        ----------
        position : (3,) array_like
            East, north, up [m].
        velocity : (3,) array_like
            [m/s]
        position_sigma, velocity_sigma : float
            Standard deviations of one axis [m], [m/s].
        """
        # Rows: position, velocity, acceleration. Columns: east, north, up.
        self._mean = np.zeros((3, 3))
        self._mean[0], self._mean[1] = position, velocity
        first = [position_sigma**2, velocity_sigma**2, _FIRST_ACCELERATION**2]
        self._level, self._upright = np.diag(first), np.diag(first)
        self._off = np.zeros((2, 3))  # path less filter: position and velocity
        # What the positions say against the filter, 1 where it is as it should be.
        self._doubt = 1.0

    @property
    def position(self) -> np.ndarray:
        return self._mean[0] + self._off[0]

    @property
    def velocity(self) -> np.ndarray:
        return self._mean[1] + self._off[1]

    @property
    def variances(self) -> np.ndarray:
        """Of the position, by the filter's own account, (3,) [m^2]."""
        return np.array([self._level[0, 0], self._level[0, 0], self._upright[0, 0]])

    def add(
        self, interval: float, position, velocity, position_sigma: float, velocity_sigma: float,
        rate: float = 0.0, wind=(0.0, 0.0, 0.0),
    ) -> tuple[Pieces, float, float]:  # fmt: skip
        """Take in the next sample.

        Parameters
        ----------
        interval : float
            Since the sample before, above 0 [s].
        position, velocity : (3,) array_like
            `velocity` may be None.
        position_sigma, velocity_sigma : float
        rate : float
            Of turning, 0 off any orbit [rad/s].
        wind : (3,) array_like
            Velocity of the air [m/s].

        Returns
        -------
        path : Pieces
            From the sample before to this one.
        missed, sigma : float
            How far the position is from where the filter led, level, and the standard deviation
            of that along an axis [m].
        """
        count = int(np.ceil(max(rate * interval / _PIECE_ANGLE, interval / _PIECE_TIME, 1e-9)))
        wind = np.asarray(wind, float)
        begun, off = self._mean, self._off
        level, up = _transition(interval, rate), _transition(interval, 0.0)
        foreseen = _moved(begun, level, up, wind, interval)
        self._level = level @ self._level @ level.T + JERK_LEVEL * _jerked(interval)
        self._upright = up @ self._upright @ up.T + JERK_UP * _jerked(interval)
        position_sigma = min(position_sigma, _MOST_SIGMA)
        missed = float(np.hypot(*(np.asarray(position, float) - foreseen[0])[:2]))
        sigma = float(np.sqrt(self._level[0, 0] + position_sigma**2))
        corrected = foreseen.copy()
        self._correct(corrected, 0, position, position_sigma)
        part = min(1.0, interval / _DOUBT_TIME)
        self._doubt += part * (0.5 * (missed / sigma) ** 2 - self._doubt)
        if velocity is not None:
            self._correct(corrected, 1, velocity, velocity_sigma * max(1.0, self._doubt))
        # As if the correction had been known from the beginning: a long interval takes it over.
        slowness = TAKEN_OVER if velocity is not None else TAKEN_OVER_OF_POSITIONS
        change = (corrected - foreseen)[:2]
        start = off - change
        breaks = interval * np.arange(count + 1) / count
        knots = np.empty((count + 1, 2, 3))
        knots[0] = begun[:2] + off
        for i, t in enumerate(breaks[1:], 1):
            part = t / interval
            moved = foreseen if i == count else _moved(
                begun, _transition(t, rate), _transition(t, 0.0), wind, t
            )  # fmt: skip
            way = start + (1.0 - part) * change if i < count else start
            knots[i] = moved[:2] + (change if i == count else part * change)
            knots[i] += decayed(way, t, slowness)
        self._mean, self._off = corrected, knots[-1] - corrected[:2]
        return hermite(breaks, knots[:, 0], knots[:, 1]), missed, sigma

    def _correct(self, mean, row, measured, sigma) -> None:
        for covariance, axes in ((self._level, slice(0, 2)), (self._upright, slice(2, 3))):
            gain = covariance[:, row] / (covariance[row, row] + sigma * sigma)
            mean[:, axes] += np.outer(gain, np.asarray(measured, float)[axes] - mean[row, axes])
            covariance -= np.outer(gain, covariance[row])


def hermite(breaks, positions, velocities) -> Pieces:
    """The cubics through positions and velocities at the breaks, (k + 1, 3) each."""
    h = np.diff(breaks)[:, None]
    slope = np.diff(positions, axis=0) / h
    first, last = velocities[:-1], velocities[1:]
    coefficients = np.stack([
        positions[:-1], first, (3.0 * slope - 2.0 * first - last) / h,
        (first + last - 2.0 * slope) / h**2,
    ])  # fmt: skip
    return Pieces(np.ascontiguousarray(breaks, float), coefficients)


def _moved(mean, level, up, wind, interval):
    """The filter's mean after an interval, (3, 3)."""
    through_air = mean.copy()
    through_air[1] -= wind
    moved = np.empty((3, 3))
    moved[:, :2] = level @ through_air[:, :2]
    moved[:, 2] = up @ through_air[:, 2]
    moved[0] += wind * interval
    moved[1] += wind
    return moved


def _transition(t, rate):
    """Of position, velocity and acceleration of one axis over a time t."""
    angle = rate * t
    if angle < 1e-4:
        return np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    c, s = cos(angle), sin(angle)
    return np.array([
        [1.0, s / rate, (1.0 - c) / rate**2], [0.0, c, s / rate], [0.0, -rate * s, c]
    ])  # fmt: skip


def _jerked(t):
    """What white noise of the jerk of density 1 does in a time t."""
    return np.array([
        [t**5 / 20.0, t**4 / 8.0, t**3 / 6.0],
        [t**4 / 8.0, t**3 / 3.0, t**2 / 2.0],
        [t**3 / 6.0, t**2 / 2.0, t],
    ])  # fmt: skip


def decayed(off, t, slowness):
    """A difference (2, 3) of position and velocity after a critically damped time t."""
    k = 1.0 / slowness
    fade = exp(-k * t)
    b = off[1] + k * off[0]
    return np.stack([(off[0] + b * t) * fade, (off[1] - k * b * t) * fade])
