"""The orbit flown on: where the tow point is at other times than the samples'.

Ahead of the newest sample it is all there is; through a gap it is what lies between the samples
before and after, which are known better.
"""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.periodic.circle import Circle
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED
from ctcbs_ros.twin.tow_point import Pieces, breaks_of, hermite


def circle_of(orbit: Orbit, wind, at_airspeed: bool) -> Circle:
    """The orbit in a wind, (2,), as seen by who drifts with its centre.

    Raises
    ------
    InputError
        If the air is as fast as the aircraft.
    """
    past = np.asarray(wind, float) - orbit.drift
    kind = AIRSPEED if at_airspeed else GROUND_SPEED
    return Circle(orbit.radius, orbit.angular_rate, orbit.sense, *past.tolist(), kind)


@dataclass(frozen=True)
class Course:
    """An orbit flown on, over the ground or with its drift.

    Attributes
    ----------
    orbit : Orbit
    wind : (2,) array_like
        [m/s]
    at_airspeed : bool
        Whether at constant airspeed or at constant ground speed.
    """

    orbit: Orbit
    wind: np.ndarray
    at_airspeed: bool

    @property
    def moves(self) -> np.ndarray:
        """Velocity of its centre, (3,) [m/s]."""
        return np.array([*self.orbit.drift, self.orbit.climb_rate])

    def about_centre(self, times) -> np.ndarray:
        """Positions and velocities past the centre at times since the orbit's, (2, k, 3).

        Raises
        ------
        InputError
            If the air is as fast as the aircraft.
        """
        orbit = self.orbit
        circle = circle_of(orbit, self.wind, self.at_airspeed)
        places, speeds, _ = circle.tow_path.motion(
            circle.time_at(orbit.phase) + orbit.angular_rate * np.asarray(times, float)
        )
        return np.stack([
            orbit.radius * circle.in_field(places), orbit.speed * circle.in_field(speeds)
        ])  # fmt: skip

    def at(self, times) -> np.ndarray:
        """Positions and velocities at times since the orbit's, (2, k, 3); errors as above."""
        found = self.about_centre(times)
        found[0] += self.orbit.center + np.multiply.outer(times, self.moves)
        found[1] += self.moves
        return found


def through_gap(
    interval: float, before: np.ndarray, after: np.ndarray, course: Course | None, since: float
) -> tuple[Pieces, np.ndarray]:
    """The path between two samples far apart.

    What its ends are off the course is a cubic in time; without a course that is the path itself.
    A filter's way from its last acceleration on is 60 m off after 10 s, that back from the sample
    after the gap as much.

    Parameters
    ----------
    interval : float
        [s]
    before, after : (2, 3) ndarrays
        Position and velocity at its ends [m], [m/s].
    course : Course or None
    since : float
        Time of the first end since that of the course's orbit [s].

    Returns
    -------
    path : Pieces
    missed : (3,) ndarray
        By how much more the second end is off the course than the first [m].
    """
    breaks = breaks_of(interval, 0.0 if course is None else course.orbit.angular_rate)
    along = np.zeros((2, breaks.size, 3)) if course is None else course.at(since + breaks)
    ends = np.stack([before, after], axis=1) - along[:, [0, -1]]
    off = hermite(breaks[[0, -1]], *ends).coefficients[:, 0]
    powers = breaks[:, None] ** np.arange(4)
    along[0] += powers @ off
    along[1] += powers[:, :3] @ (np.arange(1, 4)[:, None] * off[1:])
    return hermite(breaks, *along), ends[0, 1] - ends[0, 0]
