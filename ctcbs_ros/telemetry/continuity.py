"""Whether a believed sample goes on where those before led, as closely as the track itself shows.

The screen believes what an aircraft can do. A correction of the autopilot's filter, a small step
of its clock or of its barometer passes it, and a circle through what came before and after would
be neither. Velocities lead from each position to the next: the misses of late show how closely,
and what misses by far more is a stray position, or, where others follow it, a break in the track.
"""

from collections import deque
from enum import Enum
from math import atan2, hypot, pi, tan
from statistics import median
from typing import NamedTuple

import numpy as np

from ctcbs_ros.telemetry.sample import Sample, Vector

# For longer than this [s] or through more than this angle [rad] velocities lead nowhere.
_LONGEST, _FARTHEST = 3.0, 0.8 * pi
# Misses remembered, and how many it takes to know what is usual.
_REMEMBERED, _ENOUGH = 61, 8
# Samples that may lead to the next one: the newest alone may be a poor one itself.
_LEADING = 3
# What misses by more than so many medians does not go on, horizontally and vertically: of normal
# errors on two axes and on one 5.5 standard deviations.
_MEDIANS = (4.7, 8.2)
# Medians are at least taken to be this large [m]: barometers drift, and some sources send no
# vertical velocity.
_LEAST = (0.4, 1.0)
# A manoeuvre's change of acceleration, which velocities at two times do not show [m/s^3].
_JERK = 20.0
# Samples in a row that go on from each other until the track is believed to go on there.
_CONFIRMATIONS = 5

_Point = tuple[float, np.ndarray, Vector]  # time, position, velocity

class Track(Enum):
    """What a sample is to the track."""

    GOES_ON = "goes on"
    STRAYS = "strays"  # not where the track led, and no others with it so far
    BREAKS = "breaks"  # a new track begins


class Continuity:
    """Follows believed samples in order of time."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the track."""
        self._track: deque[_Point] = deque(maxlen=_LEADING)
        self._stray: _Point | None = None
        self._strays = 0
        self._misses = tuple(deque(maxlen=_REMEMBERED) for _ in _LEAST)
        self._usual: tuple[float, ...] = ()

    def check(self, sample: Sample, position: np.ndarray) -> Track:
        """Take in one more believed sample.

        Parameters
        ----------
        sample : Sample
            Its time and velocity are used; without a velocity it goes on anywhere.
        position : (3,) ndarray
            East, north, up of it [m].

        Returns
        -------
        Track
        """
        if sample.velocity is None:
            self.reset()
            return Track.GOES_ON
        point = (sample.time, position, sample.velocity)
        led = [miss for before in self._track if (miss := _miss(before, point)) is not None]
        strayed = None if self._stray is None else _miss(self._stray, point)
        if self._goes_on(led, strayed):
            if led:
                for remembered, length in zip(self._misses, led[-1].lengths, strict=True):
                    remembered.append(length)
                self._usual = self._usual_lengths()
            found = Track.GOES_ON
        else:
            follows = strayed is not None and self._is_usual(strayed)
            self._strays = self._strays + 1 if follows else 1
            self._stray = point
            if self._strays < _CONFIRMATIONS:
                return Track.STRAYS
            found = Track.BREAKS
            self._track.clear()
        self._track.append(point)
        self._stray = None
        return found

    def _goes_on(self, led: "list[_Miss]", strayed: "_Miss | None") -> bool:
        """Whether a point belongs to the track rather than to the strays after it, if any."""
        # The older ones are to make up for noise of the newest, not to allow for more manoeuvres.
        led = [miss._replace(manoeuvre=led[-1].manoeuvre) for miss in led]
        usual = [sum(miss.lengths) for miss in led if self._is_usual(miss)]
        if strayed is None:
            return not led or len(usual) > 0
        # Over its longer time more is usual of the track.
        return len(usual) > 0 and (
            not self._is_usual(strayed) or min(usual) <= sum(strayed.lengths)
        )

    def _usual_lengths(self) -> tuple[float, ...]:
        """What a miss does not exceed by chance [m]; none while too few are remembered."""
        if len(self._misses[0]) < _ENOUGH:
            return ()
        return tuple(
            medians * max(median(remembered), least)
            for remembered, least, medians in zip(self._misses, _LEAST, _MEDIANS, strict=True)
        )

    def _is_usual(self, miss: "_Miss") -> bool:
        return not self._usual or all(
            length <= usual + miss.manoeuvre
            for length, usual in zip(miss.lengths, self._usual, strict=True)
        )


class _Miss(NamedTuple):
    """How far off a point is from where another one led, and what a manoeuvre adds to it [m]."""

    lengths: tuple[float, float]  # horizontal, vertical
    manoeuvre: float


def _miss(before: _Point, after: _Point) -> _Miss | None:
    """The miss of a point; None where the one before leads nowhere.

    In between the velocity is taken to turn evenly.
    """
    (start, here, velocity), (end, there, last) = before, after
    duration = end - start
    turned = atan2(
        velocity[0] * last[1] - velocity[1] * last[0],
        velocity[0] * last[0] + velocity[1] * last[1],
    )
    if not 0.0 < duration < _LONGEST or abs(turned) > _FARTHEST:
        return None
    # The arc's chord is longer than the mean of the velocities at its ends makes it.
    longer = tan(turned / 2) / (turned / 2) if turned else 1.0
    east, north, up = (
        float(there[i] - here[i]) - along * duration * (velocity[i] + last[i]) / 2
        for i, along in enumerate((longer, longer, 1.0))
    )
    return _Miss((hypot(east, north), abs(up)), _JERK * duration**3 / 12)
