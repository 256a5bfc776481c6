"""The orbits of a flight, one after another, for its summary."""

from array import array
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit

# Time without an orbit after which the next one is another [s].
_LOST_AFTER = 8.0
# Change of radius or centre, over the radius, that makes another orbit once it lasts.
_MOVED = 0.15
_LASTS = 0.5 * pi
# Distance from the circle, over the radius, within which the aircraft is joining it.
_JOINING = 0.25
# Less than this is a turn, not an orbit [turns].
LEAST_TURNS = 0.9
# Bounds of the memory: samples kept for backdating, and orbits kept of one circle.
_LONGEST_TRACK = 5_000
_MOST_SAMPLED = 500


@dataclass(frozen=True)
class OrbitSegment:
    """A stretch of flight on one circle.

    Attributes
    ----------
    start_time, end_time : float
        Vehicle clock [s]; from where the track first lies on the circle, before the first
        estimate.
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
    """Collects orbits sample by sample, in bounded memory."""

    def __init__(self):
        self._done: list[OrbitSegment] = []
        self._run: _Run | None = None
        # Orbits that have left the run's circle, and may prove to be another one.
        self._moved: _Run | None = None
        self._track = array("d")  # time, east, north, of one sample after another

    def add(self, time: float, orbit: Orbit | None, position: np.ndarray) -> None:
        """Take in the estimate at a time [s], None where there is no orbit, and the tow point."""
        newest = self._moved or self._run
        if newest is not None and time < newest.last.time:  # its time stamps were wrong
            self._close()
            del self._track[:]
        self._track.extend((time, position[0], position[1]))
        if len(self._track) >= 2 * 3 * _LONGEST_TRACK:
            del self._track[: -3 * _LONGEST_TRACK]
        if orbit is None:
            newest = self._moved or self._run
            if newest is not None and time - newest.last.time > _LOST_AFTER:
                self._close()
            return
        if self._run is not None and orbit.sense != self._run.last.sense:
            self._close()
        if self._run is None:
            self._run = _Run(orbit)
        elif _is_elsewhere(orbit, self._run.middle):
            if self._moved is None:
                self._moved = _Run(orbit)
            else:
                self._moved.add(orbit)
            if self._moved.angle > _LASTS:
                moved, self._moved = self._moved, None
                self._close()
                self._run = moved
        else:
            self._moved = None
            self._run.add(orbit)

    def finish(self) -> list[OrbitSegment]:
        """All orbits of the flight so far; the one still flown is ended here."""
        self._close()
        return self._done

    def _close(self) -> None:
        run, self._run, self._moved = self._run, None, None
        if run is None:
            return
        # The first windows still hold the entry: what they say is left to the ones after.
        settled = [o for o in run.sampled if o.arc > 0.9 * 2.0 * pi]
        settled = settled or run.sampled[len(run.sampled) // 2 :]
        radius = float(np.median([o.radius for o in settled]))
        rate = float(np.median([o.angular_rate for o in settled]))
        center = np.median([o.center[:2] for o in settled], axis=0)
        start, before = self._backdated(run.first, center, radius, rate)
        angle = before + run.first.arc + run.angle
        if self._done and start < self._done[-1].end_time:
            # The first window reaches back into the orbit before: that part is counted there.
            angle -= rate * (self._done[-1].end_time - start)
            start = self._done[-1].end_time
        turns = angle / (2.0 * pi)
        if turns < LEAST_TURNS:
            return
        self._done.append(
            OrbitSegment(
                start_time=start,
                end_time=run.last.time,
                turns=turns,
                radius=radius,
                speed=radius * rate,
                sense=run.first.sense,
                center=center,
                up=float(np.median([o.center[2] for o in settled])),
                angular_rate=rate,
            )
        )

    def _backdated(self, first: Orbit, center, radius: float, rate: float) -> tuple[float, float]:
        """When the track came onto the circle, and the angle flown from then to the first window.

        Searched backwards from the first window, to the end of the orbit before at the most.
        """
        start, angle = first.start_time, 0.0
        earliest = self._done[-1].end_time if self._done else -np.inf
        last = None
        for row in range(len(self._track) - 3, -1, -3):
            time, east, north = self._track[row : row + 3]
            azimuth = atan2(north - center[1], east - center[0])
            if time > first.start_time:
                continue
            off = abs(hypot(east - center[0], north - center[1]) - radius)
            if time < earliest or off > _JOINING * radius:
                break
            if last is not None:
                if start - time > _LOST_AFTER:
                    break
                expected = first.sense * rate * (start - time)
                step = (last - azimuth - expected + pi) % (2.0 * pi) - pi + expected
                if step * first.sense < 0.0 and abs(step) > 0.2:
                    break
                angle += first.sense * step
            start, last = time, azimuth
        return start, max(angle, 0.0)


def _is_elsewhere(orbit: Orbit, reference: Orbit) -> bool:
    moved = hypot(*(orbit.center[:2] - reference.center[:2]))
    return max(abs(orbit.radius - reference.radius), moved) > _MOVED * reference.radius


class _Run:
    """Successive orbits on one circle: the angle flown, and every so many of them."""

    def __init__(self, first: Orbit):
        self.first = self.last = first
        self.angle = 0.0
        self.sampled = [first]
        self._every = self._since = 1

    @property
    def middle(self) -> Orbit:
        """The orbit that new ones are compared with."""
        return self.sampled[len(self.sampled) // 2]

    def add(self, orbit: Orbit) -> None:
        """Take in the next orbit."""
        expected = orbit.sense * orbit.angular_rate * (orbit.time - self.last.time)
        step = (orbit.phase - self.last.phase - expected + pi) % (2.0 * pi) - pi + expected
        self.angle += orbit.sense * step
        self.last = orbit
        if self._since < self._every:
            self._since += 1
            return
        self._since = 1
        self.sampled.append(orbit)
        if len(self.sampled) > _MOST_SAMPLED:
            # Half as many, from now on twice as far apart.
            self.sampled = self.sampled[::2]
            self._every *= 2
