"""The newest samples in a sliding window: as far back as the course keeps turning, about a turn.

The straight flight before a turn, in which the course stands still, falls off its end. Samples are
kept with their errors, stated or assumed, and their course, which counts whole turns.
"""

from dataclasses import dataclass
from math import atan2, hypot, isfinite, nan, pi, sqrt

import numpy as np

from ctcbs_ros.orbit.settings import TURN, OrbitSettings

_TIME, _E, _N, _U, _VE, _VN, _WHITE, _CORRELATED, _VELOCITY, _COURSE, _STATED = range(11)


@dataclass(frozen=True)
class Samples:
    """Samples in order of time.

    Attributes
    ----------
    rows : (n, 11) ndarray
        A view of the window's memory, which the properties below name column by column.
    """

    rows: np.ndarray

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, part: slice) -> "Samples":
        return Samples(self.rows[part])

    @property
    def time(self) -> np.ndarray:
        """(n,) [s]"""
        return self.rows[:, _TIME]

    @property
    def age(self) -> np.ndarray:
        """Time less that of the newest sample, (n,) [s]."""
        return self.rows[:, _TIME] - self.rows[-1, _TIME]

    @property
    def points(self) -> np.ndarray:
        """East, north, (n, 2) [m]."""
        return np.ascontiguousarray(self.rows[:, _E : _N + 1])

    @property
    def up(self) -> np.ndarray:
        """(n,) [m]"""
        return self.rows[:, _U]

    @property
    def velocities(self) -> np.ndarray:
        """East, north, (n, 2) [m/s]; nan where not known."""
        return np.ascontiguousarray(self.rows[:, _VE : _VN + 1])

    @property
    def white_sigma(self) -> np.ndarray:
        """Standard deviation of the white error of the position along one axis, (n,) [m]."""
        return self.rows[:, _WHITE]

    @property
    def correlated_sigma(self) -> np.ndarray:
        """The same of the error that is correlated in time, (n,) [m]."""
        return np.ascontiguousarray(self.rows[:, _CORRELATED])

    @property
    def position_sigma(self) -> np.ndarray:
        """Of both together, (n,) [m]."""
        return np.hypot(self.rows[:, _WHITE], self.rows[:, _CORRELATED])

    @property
    def velocity_sigma(self) -> np.ndarray:
        """Standard deviation of the velocity along one axis, (n,) [m/s]."""
        return self.rows[:, _VELOCITY]

    @property
    def course(self) -> np.ndarray:
        """Course over ground, ENU, continuous, (n,) [rad]."""
        return self.rows[:, _COURSE]

    @property
    def stated(self) -> bool:
        """Whether the source states the error of any of the positions."""
        return bool(self.rows[:, _STATED].any())

    @property
    def turned(self) -> float:
        """Angle by which the course turned from the first to the newest [rad], positive."""
        return abs(self.rows[-1, _COURSE] - self.rows[0, _COURSE])

    def newest(self, angle: float) -> "Samples":
        """Those over which the course turned by an angle [rad]."""
        turned = np.abs(self.course - self.course[-1])
        return self[np.argmax(turned <= angle * 1.0001) :]


class SampleWindow:
    """Takes in samples one by one, in bounded memory."""

    def __init__(self, settings: OrbitSettings):
        self._settings = settings
        self._capacity = 4 * settings.most_samples
        self._rows = np.empty((2 * self._capacity, 11))
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def kept(self) -> Samples:
        """All that are kept, those before the window as well."""
        return Samples(self._rows[self._first : self._end])

    @property
    def newest_time(self) -> float:
        """[s]; nan where there is no sample."""
        return float(self._rows[self._end - 1, _TIME]) if len(self) else nan

    def add(
        self, time: float, position: np.ndarray, velocity: np.ndarray | None,
        position_sigma: float, velocity_sigma: float, rate: float,
    ) -> None:
        """Take in a sample.

        Parameters
        ----------
        time, position, velocity, position_sigma, velocity_sigma
            As `OrbitEstimator.add` has them.
        rate : float
            At which the course turned before, ENU [rad/s]; nan where not known.
        """
        s = self._settings
        self._make_room()
        row = self._rows[self._end]
        row[_TIME] = time
        row[_E : _U + 1] = position
        row[_VE : _VN + 1] = nan if velocity is None else velocity[:2]
        stated = position_sigma if isfinite(position_sigma) else s.position_sigma
        row[_CORRELATED] = s.correlated_share * stated
        row[_WHITE] = max(sqrt(1.0 - s.correlated_share**2) * stated, s.least_sigma)
        stated = velocity_sigma if isfinite(velocity_sigma) else s.velocity_sigma
        row[_VELOCITY] = max(stated, s.least_velocity_sigma)
        row[_STATED] = isfinite(position_sigma)
        row[_COURSE] = self._course(row, rate)
        self._end += 1

    def newest_turn(self) -> Samples:
        """As far back as the course keeps turning and the window reaches."""
        s = self._settings
        rows = self._rows[self._first : self._end]
        turned = rows[:, _COURSE] - rows[-1, _COURSE]
        outside = np.flatnonzero(np.abs(turned) > s.window)
        if outside.size:
            # Older samples will never be needed again.
            self._first += int(outside[-1])
            rows = rows[outside[-1] :]
            turned = turned[outside[-1] :]
        # Straight flight before the turn: drop what adds no angle.
        most = np.abs(turned).max()
        start = int(np.flatnonzero(np.abs(turned) >= most - 0.03 * most - 0.02)[-1])
        rows = rows[start:]
        stride = -(-len(rows) // s.most_samples)
        return Samples(rows[::-1][::stride][::-1])

    def _make_room(self) -> None:
        if self._end < len(self._rows):
            return
        kept = self._rows[self._first : self._end]
        if len(kept) > self._capacity:
            # A slow circle at a high rate: half as many samples still fill the window.
            kept = kept[::-1][::2][::-1]
        kept = kept.copy()
        self._rows[: len(kept)] = kept
        self._first, self._end = 0, len(kept)

    def _course(self, row: np.ndarray, rate: float) -> float:
        """Course over ground, continuous with the sample before."""
        before = self._rows[self._first : self._end]
        if isfinite(row[_VE]):
            if hypot(row[_VE], row[_VN]) < self._settings.minimum_speed:
                return before[-1, _COURSE] if len(before) else 0.0
            course = atan2(row[_VN], row[_VE])
        else:
            # The chord to an earlier position far enough away for the noise not to matter.
            distance = np.hypot(before[:, _E] - row[_E], before[:, _N] - row[_N])
            far = distance > 8.0 * row[_WHITE]
            if not far.any():
                return before[-1, _COURSE] if len(before) else 0.0
            start = before[np.flatnonzero(far)[-1]]
            course = atan2(row[_N] - start[_N], row[_E] - start[_E])
        if not len(before):
            return course
        last = before[-1]
        # Across a gap the course goes on turning as it did.
        expected = last[_COURSE]
        if isfinite(rate):
            expected += rate * (row[_TIME] - last[_TIME])
        return expected + (course - expected + pi) % TURN - pi
