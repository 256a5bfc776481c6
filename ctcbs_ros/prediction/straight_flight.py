"""Straight flight, which ends the history of the end mass: its cable trails straight behind."""

from collections import deque
from math import atan2, hypot, pi

# The track is kept as this many stretches of the cable's length in all.
_STRETCHES = 8
# Turn between the halves of the track [rad], and their chords over their lengths: straighter than
# this the tow radius is above 2.5 cable lengths.
_MOST_TURN = 0.2
_LEAST_CHORD = 0.9


class StraightFlight:
    """Notices that the aircraft has flown straight for a cable length."""

    def __init__(self):
        self._track: deque[tuple[float, float]] = deque(maxlen=_STRETCHES + 1)

    def reset(self) -> None:
        """Forget the track: the aircraft orbits."""
        self._track.clear()

    def add(self, position, cable_length: float) -> bool:
        """Take in a position of the aircraft.

        Parameters
        ----------
        position : (3,) array_like
            East, north, up [m].
        cable_length : float
            [m]

        Returns
        -------
        bool
            Whether the last cable length was flown straight.
        """
        track = self._track
        here = float(position[0]), float(position[1])
        stretch = cable_length / _STRETCHES
        if track and _distance(track[-1], here) < stretch:
            return False
        track.append(here)
        if len(track) <= _STRETCHES:
            return False
        halves = [
            (track[start], track[start + _STRETCHES // 2]) for start in (0, _STRETCHES // 2)
        ]
        if min(_distance(*half) for half in halves) < _LEAST_CHORD * cable_length / 2:
            return False
        before, after = (atan2(b[1] - a[1], b[0] - a[0]) for a, b in halves)
        return abs((after - before + pi) % (2.0 * pi) - pi) < _MOST_TURN


def _distance(a: tuple[float, float], b: tuple[float, float]) -> float:
    return hypot(b[0] - a[0], b[1] - a[1])
