"""The tow point's path from noisy telemetry: without delay, and smooth enough for a stiff cable.

A Kalman filter of position, velocity and acceleration turns with the orbit where there is one: in
a steady turn the velocity through the air, u, turns at the orbit's rate W, d2u/dt2 = -W^2 u. What
a sample corrects of it would be a jump of the path; the path takes it over along a critically
damped way instead, so that position and velocity are continuous. The path ends at the newest
sample: there is no delay, but a correction has come into it by half only after 0.8 s.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ctcbs_ros.kernels import tow_filter

# Of the critically damped way, by which a correction has come in by a quarter [s]: of samples with
# a velocity, and of those without, whose filter is corrected by more.
TAKEN_OVER, TAKEN_OVER_OF_POSITIONS = 0.5, 1.0
# Jerk that the filter does not foresee, as white noise of this density, level and upright
# [m^2/s^5]: an aircraft banks in some seconds.
_JERK = np.array([10.0, 0.3])
# An acceleration nobody has told yet [m/s^2].
_FIRST_ACCELERATION = 3.0
# What is stated beyond is correlated in time: no filter takes it out of a position [m].
_MOST_SIGMA = 1.5
# Velocities that lead past the positions, as those of a receiver that smooths them do by some m/s
# in a turn, count for less within this time [s].
_DOUBT_TIME = 1.0
# Longest piece of the path, in turns of the orbit [rad] and in seconds: a cubic through a turn.
_PIECE_ANGLE, _PIECE_TIME = 0.25, 1.0
_UNTOLD = np.full(3, np.nan)


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

    @cached_property
    def fastest(self) -> float:
        """Greatest sum of the speeds along the axes, of all breaks [m/s]."""
        return float(np.abs(self.coefficients[1]).sum(axis=1).max())


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
        breaks = breaks_of(interval, rate)
        knots = np.empty((2, breaks.size, 3))
        missed, sigma, self._doubt = tow_filter.follow(
            self._mean, self._off, self._level, self._upright, _JERK, rate,
            np.array(wind, float), breaks,
            TAKEN_OVER_OF_POSITIONS if velocity is None else TAKEN_OVER,
            np.array(position, float),
            _UNTOLD if velocity is None else np.array(velocity, float),
            min(position_sigma, _MOST_SIGMA), velocity_sigma, self._doubt, _DOUBT_TIME, knots,
        )  # fmt: skip
        return hermite(breaks, *knots), missed, sigma


def breaks_of(interval: float, rate: float) -> np.ndarray:
    """Where the cubics of a stretch meet, turning at a rate [rad/s], from 0 to its end [s]."""
    pieces = int(np.ceil(max(rate * interval / _PIECE_ANGLE, interval / _PIECE_TIME, 1e-9)))
    return interval * np.arange(pieces + 1) / pieces


def hermite(breaks, positions, velocities) -> Pieces:
    """The cubics through positions and velocities at the breaks, (k + 1, 3) each."""
    coefficients = np.empty((4, len(breaks) - 1, 3))
    tow_filter.cubics(breaks, positions, velocities, coefficients)
    return Pieces(breaks, coefficients)
