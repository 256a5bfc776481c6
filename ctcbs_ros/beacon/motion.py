"""Where a candidate was at any time between its newest positions: interpolated, never beyond them.

Between two positions with their velocities runs the cubic through both: of a circle flown in steps
of 20 degrees it is off by 4e-5 of the radius.
"""

from bisect import bisect_left
from collections import deque
from dataclasses import dataclass, field

import numpy as np

# What is remembered: the beacon's link may be late.
REMEMBERED = 10.0  # s
MOST = 2_000
# Between positions farther apart nothing is told.
LONGEST_GAP = 2.0  # s


@dataclass(frozen=True)
class Place:
    """A candidate at one time.

    Attributes
    ----------
    time : float
        Aircraft's clock [s].
    position, velocity : (3,) ndarrays
        East, north, up [m], [m/s].
    covariance : (3, 3) ndarray
        Of the position [m^2].
    standing : str
        What it is worth, e.g. "settled"; between two places that of the worse (the later by
        `Motion.worst`).
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    standing: str = ""


@dataclass
class Motion:
    """The newest places of a candidate, in order of time; None where it had none.

    `worst` names the standings from best to worst.
    """

    worst: tuple[str, ...] = ()
    _times: deque = field(default_factory=deque)
    _places: deque = field(default_factory=deque)

    def clear(self) -> None:
        """Forget all: another flight, another frame."""
        self._times.clear()
        self._places.clear()

    def add(self, time: float, place: Place | None) -> None:
        """Take in the newest place; one not later than the newest is left out."""
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        self._places.append(place)
        while len(self._times) > MOST or self._times[-1] - self._times[0] > REMEMBERED:
            self._times.popleft()
            self._places.popleft()

    @property
    def newest(self) -> float:
        """Time of the newest; -inf before any."""
        return self._times[-1] if self._times else -np.inf

    def covers(self, time: float) -> bool:
        """Whether positions on both sides of a time are near enough to tell something."""
        i = bisect_left(self._times, time)
        if i == len(self._times):
            return False
        return self._times[i] == time or (
            i > 0 and self._times[i] - self._times[i - 1] <= LONGEST_GAP
        )

    def is_before(self, time: float) -> bool:
        """Whether a time is before all that is remembered."""
        return bool(self._times) and time < self._times[0]

    def at(self, time: float) -> Place | None:
        """The place at a time that it covers; None where it has none on one side."""
        if not self.covers(time):
            return None
        i = bisect_left(self._times, time)
        after = self._places[i]
        if self._times[i] == time or after is None:
            return after
        before = self._places[i - 1]
        return None if before is None else interpolated(before, after, time, self.worst)


def interpolated(before: Place, after: Place, time: float, worst: tuple[str, ...] = ()) -> Place:
    """The place between two, by the cubic through both positions and velocities."""
    span = after.time - before.time
    s = (time - before.time) / span
    moved = after.position - before.position
    # The cubic of Hermite, and its derivative.
    bend = span * (before.velocity + after.velocity) - 2.0 * moved
    lean = 3.0 * moved - span * (2.0 * before.velocity + after.velocity)
    position = before.position + s * (span * before.velocity + s * (lean + s * bend))
    velocity = before.velocity + s * (2.0 * lean + 3.0 * s * bend) / span
    covariance = (1.0 - s) * before.covariance + s * after.covariance
    standing = before.standing
    if worst and worst.index(after.standing) > worst.index(standing):
        standing = after.standing
    return Place(time, position, velocity, covariance, standing)
