"""Unevenness of the ground speed along the circle: the sign of wind.

At constant airspeed A in a wind w the ground velocities of a turn lie on a circle, |v - w| = A, so
that the ground speed varies once an orbit by |w|. Squared, |v|^2 = 2 w.v + A^2 - |w|^2 is linear
in the unknowns.
"""

from collections import deque
from math import hypot, nan, pi

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit

# Less of a turn than this cannot tell a once-per-orbit variation from a change of speed.
_LEAST_ARC = 1.5 * pi
_MOST_SAMPLES = 600
_FEWEST_SAMPLES = 12
# Error of the amplitude, over the mean speed, beyond which it is not known.
_KNOWN = 0.025


class GroundSpeedVariation:
    """Keeps the velocities of the last turn."""

    def __init__(self):
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=_MOST_SAMPLES)
        # Least time between samples [s], so that at high rates a whole turn is kept.
        self._spacing = 0.0

    def reset(self) -> None:
        """Forget the velocities of an orbit that is over."""
        self._samples.clear()
        self._spacing = 0.0

    def add(self, time: float, velocity) -> None:
        """Take in a velocity, east, north, up [m/s], or None where none was sent."""
        if velocity is None:
            return
        if not self._samples or time - self._samples[-1][0] >= self._spacing:
            self._samples.append((time, float(velocity[0]), float(velocity[1])))

    def variation(self, orbit: Orbit) -> float:
        """Amplitude of the once-per-orbit variation over the mean speed; nan if not known."""
        turn = 2.0 * pi / orbit.angular_rate
        self._spacing = turn / (0.9 * _MOST_SAMPLES)
        while self._samples and self._samples[0][0] < orbit.time - turn:
            self._samples.popleft()
        if len(self._samples) < _FEWEST_SAMPLES:
            return nan
        time, east, north = np.array(self._samples).T
        if (time[-1] - time[0]) * orbit.angular_rate < _LEAST_ARC:
            return nan
        # An airspeed that rises or falls is no wind.
        since = (time - time.mean()) / turn
        design = np.column_stack([2.0 * east, 2.0 * north, np.ones_like(time), since])
        squared = east**2 + north**2
        solution, _, rank, _ = np.linalg.lstsq(design, squared, rcond=None)
        if rank < design.shape[1]:
            return nan
        residual = squared - design @ solution
        variance = residual @ residual / (len(time) - design.shape[1])
        covariance = np.linalg.inv(design.T @ design) * variance
        if np.sqrt(np.trace(covariance[:2, :2])) > _KNOWN * orbit.speed:
            return nan
        return hypot(solution[0], solution[1]) / orbit.speed
