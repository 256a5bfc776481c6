"""The twin's cables: the one that is shown, two in other winds, and so what it may be off by."""

from math import atan2, exp, log, pi, sqrt

import numpy as np

from ctcbs_ros.dynamics.line import Line
from ctcbs_ros.twin.simulated_cable import SimulatedCable
from ctcbs_ros.twin.tow_point import Pieces

# What it begins with is settled motion, and the flight before may have been anything: so much of
# the cable's length it may be off for that, along each axis.
_BEFORE = 0.3
# A small error decays to 5 % in the settling time.
_SETTLED = log(20.0)


class FollowedCable:
    """A cable since it was begun.

    Parameters
    ----------
    cable : SimulatedCable
    off_wind : list of SimulatedCable
        Those of winds a standard deviation off, see `off_winds`; empty where they do not differ
        yet.
    since, valid_from : float
        When it was begun and when a small error of that has decayed to 5 % [s].
    errors : (4, 4) ndarray or None
        Covariance of east, north, up and yaw of the end mass as it was begun; None where nobody
        knows, and no more than the cable's length.
    length : float
        Of the cable [m].
    """

    def __init__(
        self, cable: SimulatedCable, off_wind: list[SimulatedCable], since: float,
        valid_from: float, errors: np.ndarray | None, length: float,
    ):  # fmt: skip
        self.cable, self._off_wind = cable, off_wind
        self.since, self.valid_from = since, valid_from
        speed = max(float(np.hypot(*cable.velocities[0, :2])), 1e-3)
        fall = _SETTLED / max(valid_from - since, 1e-3)
        # An error of a motion that decays like this moves by so much of itself a second.
        before = (_BEFORE * length) ** 2 * np.array([1.0, 1.0, 1.0, (fall / speed) ** 2])
        if errors is None or not errors[:3, :3].trace() < 3.0 * length**2:
            errors = np.diag([length**2, length**2, length**2, 1.0])
        self._errors = errors + np.diag(before)
        # What paths through gaps have left, and when.
        self._elsewhere, self._elsewhere_at = np.zeros((4, 4)), since

    def move(self, by) -> None:
        """Take the cables as they are to another place, (3,) [m]."""
        for cable in (self.cable, *self._off_wind):
            cable.positions += by

    def led_elsewhere(self, time: float, unsure) -> None:
        """It has been led by a path that is off by a standard deviation, as a vector (3,) [m].

        The end mass goes where the tow point has led it, and forgets that as it does how it began.
        """
        if not np.any(unsure):
            return
        off = np.append(unsure, 0.0)
        self._elsewhere = self._faded(time, self._elsewhere_at) * self._elsewhere
        self._elsewhere, self._elsewhere_at = self._elsewhere + np.outer(off, off), time

    def advance(
        self, line: Line, path: Pieces, wind_before, wind, wind_covariance: np.ndarray,
        length_before: float, axes,
    ) -> bool:  # fmt: skip
        """Go on along the tow point's path; False where one of them cannot be followed.

        Parameters
        ----------
        line : Line
        path : Pieces
        wind_before, wind : (3,) ndarray
            At its beginning and its end [m/s].
        wind_covariance : (2, 2) ndarray
            [m^2/s^2]
        length_before : float
            Of the cable, at the beginning [m].
        axes : (7,) ndarray
            To step in.
        """
        if not self._off_wind:
            self._off_wind = [self.cable.copy() for _ in range(2)]
        cables = [(self.cable, np.zeros(3))]
        cables += zip(self._off_wind, off_winds(wind_covariance), strict=True)
        return all(
            cable.advance(line, path, wind_before + off, wind + off, length_before, axes=axes)
            for cable, off in cables
        )

    def covariance(self, time: float) -> np.ndarray:
        """Of east, north, up and yaw, (4, 4): the wind, what is left of beginning and gaps."""
        known = self._faded(time, self.since) * self._errors
        known += self._faded(time, self._elsewhere_at) * self._elsewhere
        here = _yaw(self.cable)
        for other in self._off_wind:
            turned = (_yaw(other) - here + pi) % (2.0 * pi) - pi
            change = np.append(other.positions[0] - self.cable.positions[0], turned)
            known += np.outer(change, change)
        return known

    def _faded(self, time: float, since: float) -> float:
        """What is left at a time of a variance."""
        settling = max(self.valid_from - self.since, 1e-3)
        return exp(-2.0 * _SETTLED * (time - since) / settling)


def off_winds(covariance: np.ndarray) -> np.ndarray:
    """By what two winds are off that together have a covariance, (2, 3) from (2, 2).

    The symmetric root: it changes as little as the covariance does, where eigenvectors change
    sign and place. Of two rows it is (C + r 1)/sqrt(tr C + 2 r), r = sqrt(det C).
    """
    (east, both), (_, north) = covariance.tolist()
    root = sqrt(max(east * north - both * both, 0.0))
    scale = sqrt(max(east + north + 2.0 * root, 0.0))
    if not scale > 0.0:
        return np.zeros((2, 3))
    both /= scale
    return np.array([
        [(east + root) / scale, both, 0.0], [both, (north + root) / scale, 0.0],
    ])  # fmt: skip


def _yaw(cable: SimulatedCable) -> float:
    return atan2(cable.velocities[0, 1], cable.velocities[0, 0])
