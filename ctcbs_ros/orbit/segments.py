"""The orbits of a flight, one after another, for its summary."""

from dataclasses import dataclass
from itertools import pairwise
from math import hypot, pi

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit

# Time without an orbit after which the next one is another [s].
_LOST_AFTER = 8.0
# Change of radius or centre, over the radius, that makes another orbit once it lasts.
_MOVED = 0.15
_LASTS = 0.5 * pi


@dataclass(frozen=True)
class OrbitSegment:
    """A stretch of flight on one circle.

    Attributes
    ----------
    start_time, end_time : float
        Vehicle clock [s]; the start is that of the first estimate's window.
    turns : float
    radius : float
        Tow radius [m].
    speed : float
        Mean ground speed [m/s].
    sense : int
        +1 anticlockwise, -1 clockwise.
    center : (2,) ndarray
        East, north [m].
    up : float
        Mean height [m].
    angular_rate : float
        [rad/s]
    """

    start_time: float
    end_time: float
    turns: float
    radius: float
    speed: float
    sense: int
    center: np.ndarray
    up: float
    angular_rate: float


class OrbitSegments:
    """Collects orbits sample by sample."""

    def __init__(self):
        self._done: list[OrbitSegment] = []
        self._orbits: list[Orbit] = []
        self._moved: list[Orbit] = []

    def add(self, time: float, orbit: Orbit | None) -> None:
        """Take in the estimate at a time [s], None where there is no orbit."""
        if orbit is None:
            newest = (self._moved or self._orbits)[-1:] or None
            if newest and time - newest[0].time > _LOST_AFTER:
                self._close()
            return
        if self._orbits:
            reference = self._reference()
            if orbit.sense != self._orbits[0].sense:
                self._close()
            elif _is_elsewhere(orbit, reference):
                self._moved.append(orbit)
                if _flown(self._moved) > _LASTS:
                    moved, self._moved = self._moved, []
                    self._close()
                    self._orbits = moved
                return
        self._orbits += [*self._moved, orbit]
        self._moved = []

    def finish(self) -> list[OrbitSegment]:
        """All orbits of the flight so far; the one still flown is ended here."""
        self._close()
        return self._done

    def _reference(self) -> Orbit:
        """The orbit that others are compared with: the middle one so far."""
        return self._orbits[len(self._orbits) // 2]

    def _close(self) -> None:
        orbits = self._orbits + self._moved
        self._orbits, self._moved = [], []
        if not orbits:
            return
        # The first windows still hold the entry: what they say is left to the ones after.
        settled = [o for o in orbits if o.arc > 0.9 * 2.0 * pi] or orbits[len(orbits) // 2 :]
        radius = float(np.median([o.radius for o in settled]))
        rate = float(np.median([o.angular_rate for o in settled]))
        self._done.append(
            OrbitSegment(
                start_time=orbits[0].start_time,
                end_time=orbits[-1].time,
                turns=(orbits[0].arc + _flown(orbits)) / (2.0 * pi),
                radius=radius,
                speed=radius * rate,
                sense=orbits[0].sense,
                center=np.median([o.center[:2] for o in settled], axis=0),
                up=float(np.median([o.center[2] for o in settled])),
                angular_rate=rate,
            )
        )


def _is_elsewhere(orbit: Orbit, reference: Orbit) -> bool:
    moved = hypot(*(orbit.center[:2] - reference.center[:2]))
    return max(abs(orbit.radius - reference.radius), moved) > _MOVED * reference.radius


def _flown(orbits: list[Orbit]) -> float:
    """Angle flown between the first and the last of several orbits [rad]."""
    return sum(
        0.5 * (b.angular_rate + a.angular_rate) * (b.time - a.time)
        for a, b in pairwise(orbits)
    )
