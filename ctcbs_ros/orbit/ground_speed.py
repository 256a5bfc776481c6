"""Unevenness of the ground speed along the circle: the sign of wind.

At constant airspeed A in a wind w the ground velocities of a turn lie on a circle, |v - w| = A, so
that the ground speed varies once an orbit by |w|. Squared, |v|^2 = 2 w.v + A^2 - |w|^2 is linear
in the unknowns.
"""

from math import hypot, nan, pi

import numpy as np

from ctcbs_ros.kernels.circle import velocity_circle
from ctcbs_ros.orbit.orbit import Orbit

# Less of a turn than this cannot tell a once-per-orbit variation from a change of speed.
LEAST_ARC = 1.5 * pi
_MOST_SAMPLES = 600
_FEWEST_SAMPLES = 12
# Error of the amplitude, over the mean speed, beyond which it is not known.
_KNOWN = 0.025


class GroundSpeedVariation:
    """Keeps the velocities of the last turn.

    They are taken in before an orbit is recognised, too: when it is, half a turn has been flown.
    """

    def __init__(self):
        self._rows = np.empty((2 * _MOST_SAMPLES, 3))  # time, east, north
        self.reset()

    def reset(self) -> None:
        """Forget all velocities."""
        self._first = self._end = 0
        # Least time between samples [s], so that at high rates a whole turn is kept.
        self._spacing = 0.0

    def begin(self, time: float) -> None:
        """An orbit was begun at a time [s]: what was flown before says nothing about it."""
        while self._first < self._end and self._rows[self._first, 0] < time:
            self._first += 1

    def add(self, time: float, velocity) -> None:
        """Take in a velocity, east, north, up [m/s], or None where none was sent."""
        if velocity is None:
            return
        if self._end > self._first and time - self._rows[self._end - 1, 0] < self._spacing:
            return
        if self._end == len(self._rows):
            self._make_room()
        self._rows[self._end] = time, velocity[0], velocity[1]
        self._end += 1

    def _make_room(self) -> None:
        kept = self._rows[self._first : self._end]
        if len(kept) > _MOST_SAMPLES:
            # Long before an orbit, or on one at a high rate: half as many cover the same time.
            kept = kept[::2]
            self._spacing = (kept[-1, 0] - kept[0, 0]) / len(kept)
        kept = kept.copy()
        self._rows[: len(kept)] = kept
        self._first, self._end = 0, len(kept)

    def variation(self, orbit: Orbit) -> float:
        """Amplitude of the once-per-orbit variation over the mean speed; nan if not known."""
        turn = 2.0 * pi / orbit.angular_rate
        self._spacing = turn / (0.9 * _MOST_SAMPLES)
        self.begin(orbit.time - turn)
        rows = self._rows[self._first : self._end]
        if len(rows) < _FEWEST_SAMPLES:
            return nan
        if (rows[-1, 0] - rows[0, 0]) * orbit.angular_rate < LEAST_ARC:
            return nan
        # An airspeed that rises or falls is no wind.
        east, north, error, determined = velocity_circle(rows, turn)
        if not determined or not error <= _KNOWN * orbit.speed:
            return nan
        return hypot(east, north) / orbit.speed
