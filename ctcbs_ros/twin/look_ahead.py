"""When the end mass will have settled if the present orbit is flown on, and where.

A second cable goes on from the simulated one's present state, faster than time, a few turns of the
orbit as it was then, over the ground or with its drift, at constant airspeed or ground speed.
Orbits are held against each other, as a planned entry's are (`ctcbs_ros.dynamics.entry`): nothing
is taken from the periodic solution.
"""

from dataclasses import dataclass
from enum import Enum
from math import ceil, pi

import numpy as np

from ctcbs_ros.dynamics.line import Line
from ctcbs_ros.dynamics.settled import SPAN, approached, oscillates, settled_after
from ctcbs_ros.kernels.tow_filter import decayed
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.twin.course import Course
from ctcbs_ros.twin.simulated_cable import SimulatedCable, axes_of
from ctcbs_ros.twin.tow_point import hermite

A_TURN = 64  # states looked at
HORIZON = 3 * SPAN + 3  # turns, as many as tell an oscillation
# Of the tow radius: settled, and what may be left of the approach to know to what.
WITHIN, _LEFT = 0.05, 0.01
# Change of the orbit, over its radius, rate and speed, that makes it another.
_ANOTHER = 0.05
# A step is so many of these states at the most: long ones would take a state that slowly grows for
# one that stays.
_STEP = 2
# Part of a turn in which the aircraft is taken onto the circle fitted.
_JOINED = 1.0 / 16.0


class Ending(Enum):
    """What a look-ahead comes to."""

    SETTLES = "settles"
    OSCILLATES = "oscillates"
    UNDECIDED = "undecided"  # neither within the horizon


@dataclass(frozen=True)
class Settling:
    """The end mass's way from a time on, with the orbit of that time flown on.

    Attributes
    ----------
    begun : float
        That time [s].
    ending : Ending
        It settles; or keeps oscillating for good; or neither within `HORIZON` turns.
    settles_at : float
        From when on it stays within 5 % of the tow radius of where it will be at the same place
        of the last orbit looked at, itself nearer than 1 % to where that ends [s]; nan where it
        does not settle.
    mean : (3,) ndarray
        Mean of the end mass over the last orbit looked at, east, north, up [m]: about the centre
        as it will be at `settles_at`, or is at `begun`.
    radius : float
        Its mean horizontal distance from that mean [m].
    least_distance, greatest_distance : float
        Horizontally from the orbit's centre over that orbit, or over all the last thirty where it
        oscillates [m].
    """

    begun: float
    ending: Ending
    settles_at: float
    mean: np.ndarray
    radius: float
    least_distance: float
    greatest_distance: float


class LookAhead:
    """One way ahead, advanced in slices.

    Parameters
    ----------
    time : float
        Now [s].
    cable : SimulatedCable
        Now; it is copied.
    orbit : Orbit
        Now.
    line : Line
    wind : (3,) array_like
        [m/s]
    at_airspeed : bool
        Whether the circle is flown at constant airspeed or at constant ground speed.

    Raises
    ------
    InputError
        If the air is as fast as the aircraft.
    """

    def __init__(
        self, time: float, cable: SimulatedCable, orbit: Orbit, line: Line, wind,
        at_airspeed: bool = True,
    ):  # fmt: skip
        self._begun, self._orbit, self._line = time, orbit, line
        self._cable = cable.copy()
        self._wind = np.array(wind, float)
        self._period = 2.0 * pi / orbit.angular_rate
        course = Course(orbit, self._wind[:2], at_airspeed)
        self._places, self._speeds = course.about_centre(
            self._period * np.arange(A_TURN) / A_TURN
        )
        self._moves = course.moves
        self._off = np.stack([
            cable.positions[-1] - orbit.center - self._places[0],
            cable.velocities[-1] - self._moves - self._speeds[0],
        ])  # fmt: skip
        self._done = 0
        self._found: list[np.ndarray] = []

    def is_of(self, orbit: Orbit, wind) -> bool:
        """Whether an orbit and a wind, (3,), are those of this way, up to 5 %."""
        was = self._orbit
        centre = was.center[:2] + was.drift * (orbit.time - was.time)
        return bool(
            orbit.sense == was.sense
            and abs(orbit.radius / was.radius - 1.0) < _ANOTHER
            and abs(orbit.angular_rate / was.angular_rate - 1.0) < _ANOTHER
            and np.abs(orbit.center[:2] - centre).max() < _ANOTHER * was.radius
            and np.abs(np.asarray(wind) - self._wind).max() < _ANOTHER * was.speed
        )

    def go_on(self, seconds: float) -> Settling | None:
        """Look farther ahead by a time, a turn at the most.

        Returns
        -------
        Settling or None
            None while it is not known, or the cable could not be followed (`lost`).
        """
        count = min(A_TURN, ceil(seconds / self._period * A_TURN))
        # To the end of a turn, where orbits are compared.
        count = min(count, A_TURN - self._done % A_TURN)
        steps = np.arange(self._done, self._done + count + 1)
        times = self._period / A_TURN * steps
        tow = np.stack([self._places[steps % A_TURN], self._speeds[steps % A_TURN]])
        tow[0] += self._orbit.center + times[:, None] * self._moves
        tow[1] += self._moves
        if times[0] < self._period:
            left = np.empty((2, 3))
            for k, t in enumerate(times):
                decayed(self._off, t, _JOINED * self._period, left)
                tow[:, k] += left
        path = hermite(times - times[0], *tow)
        seen = np.empty((count, *self._cable.positions.shape))
        axes = axes_of(self._orbit, self._orbit.time + times[0])
        if not self._cable.advance(
            self._line, path, self._wind, self._wind, seen=seen, axes=axes,
            stops=path.breaks[_STEP::_STEP],
        ):
            self.lost = True
            return None
        centre = self._orbit.center + times[1:, None] * self._moves
        self._found.extend(seen[:, 0] - centre)
        self._done += count
        found = self._judged() if self._done % A_TURN == 0 else None
        self.ended = found is not None
        return found

    lost = ended = False

    def _judged(self) -> Settling | None:
        orbits = np.array(self._found).reshape(-1, A_TURN, 3)
        a = self._orbit.radius
        if approached(orbits, _LEFT * a):
            late = settled_after(orbits, WITHIN * a)
            at = self._begun + late * self._period / A_TURN
            return self._settling(Ending.SETTLES, at, orbits[-1:])
        if oscillates(orbits, WITHIN * a):
            return self._settling(Ending.OSCILLATES, np.nan, orbits[-3 * SPAN :])
        if len(orbits) >= HORIZON:
            return self._settling(Ending.UNDECIDED, np.nan, orbits[-1:])
        return None

    def _settling(self, ending: Ending, at: float, orbits) -> Settling:
        mean = orbits.mean(axis=(0, 1))
        moved = 0.0 if np.isnan(at) else at - self._begun
        distance = np.hypot(orbits[..., 0], orbits[..., 1])
        about = np.hypot(orbits[..., 0] - mean[0], orbits[..., 1] - mean[1])
        return Settling(
            self._begun, ending, float(at),
            mean + self._orbit.center + moved * self._moves,
            float(about.mean()), float(distance.min()), float(distance.max()),
        )  # fmt: skip
