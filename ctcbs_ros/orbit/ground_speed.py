"""Unevenness of the ground speed along the circle: the sign of wind.

An aircraft that holds its airspeed flies fast over the ground downwind and slowly upwind, so that
its ground speed varies once an orbit with the course; the amplitude is about the wind speed.
"""

from collections import deque
from math import atan2, hypot, nan, pi

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit

# Less of a turn than this cannot tell a once-per-orbit variation from a change of speed.
_LEAST_ARC = 1.5 * pi
_MOST_SAMPLES = 600


class GroundSpeedVariation:
    """Keeps the velocities of the last turn."""

    def __init__(self):
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=_MOST_SAMPLES)

    def reset(self) -> None:
        """Forget the velocities of an orbit that is over."""
        self._samples.clear()

    def add(self, time: float, velocity) -> None:
        """Take in a velocity, east, north, up [m/s], or None where none was sent."""
        if velocity is not None:
            course = atan2(velocity[1], velocity[0])
            self._samples.append((time, course, hypot(velocity[0], velocity[1])))

    def variation(self, orbit: Orbit) -> float:
        """Amplitude of the once-per-orbit variation over the mean speed; nan if not known."""
        turn = 2.0 * pi / orbit.angular_rate
        while self._samples and self._samples[0][0] < orbit.time - turn:
            self._samples.popleft()
        if len(self._samples) < 6:
            return nan
        time, course, speed = np.array(self._samples).T
        if (time[-1] - time[0]) * orbit.angular_rate < _LEAST_ARC:
            return nan
        design = np.column_stack([np.ones_like(course), np.cos(course), np.sin(course)])
        mean, cosine, sine = np.linalg.lstsq(design, speed, rcond=None)[0]
        return hypot(cosine, sine) / mean if mean > 0.0 else nan
