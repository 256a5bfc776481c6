"""The newest samples in a sliding window: as far back as the course keeps turning, about a turn.

The straight flight before a turn, in which the course stands still, falls off its end. Samples are
kept with their errors, stated or assumed, and their course, which counts whole turns.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, hypot, isfinite, nan, pi, sqrt

import numpy as np

from ctcbs_ros.kernels.track import turn_start
from ctcbs_ros.orbit.settings import TURN, OrbitSettings

_TIME, _E, _N, _U, _VE, _VN, _WHITE, _CORRELATED, _VELOCITY, _COURSE, _STATED = range(11)


@dataclass(frozen=True)
class Samples:
    """Samples in order of time.

    Attributes
    ----------
    columns : (11, n) ndarray
        A view of the window's memory, which the properties below name one by one.
    """

    columns: np.ndarray

    def __len__(self) -> int:
        return self.columns.shape[1]

    def __getitem__(self, part: slice) -> "Samples":
        return Samples(self.columns[:, part])

    @property
    def time(self) -> np.ndarray:
        """(n,) [s]"""
        return self.columns[_TIME]

    @cached_property
    def age(self) -> np.ndarray:
        """Time less that of the newest sample, (n,) [s]."""
        return self.time - self.time[-1]

    @cached_property
    def points(self) -> np.ndarray:
        """East, north, (n, 2) [m]."""
        return np.ascontiguousarray(self.columns[_E : _N + 1].T)

    @property
    def up(self) -> np.ndarray:
        """(n,) [m]"""
        return self.columns[_U]

    @cached_property
    def velocities(self) -> np.ndarray:
        """East, north, (n, 2) [m/s]; nan where not known."""
        return np.ascontiguousarray(self.columns[_VE : _VN + 1].T)

    @property
    def white_sigma(self) -> np.ndarray:
        """Standard deviation of the white error of the position along one axis, (n,) [m]."""
        return self.columns[_WHITE]

    @property
    def correlated_sigma(self) -> np.ndarray:
        """The same of the error that is correlated in time, (n,) [m]."""
        return self.columns[_CORRELATED]

    @property
    def velocity_sigma(self) -> np.ndarray:
        """Standard deviation of the velocity along one axis, (n,) [m/s]."""
        return self.columns[_VELOCITY]

    @property
    def course(self) -> np.ndarray:
        """Course over ground, ENU, continuous, (n,) [rad]."""
        return self.columns[_COURSE]

    @cached_property
    def stated(self) -> bool:
        """Whether the source states the error of any of the positions."""
        return bool(self.columns[_STATED].any())

    @property
    def turned(self) -> float:
        """Angle by which the course turned from the first to the newest [rad], positive."""
        return float(abs(self.course[-1] - self.course[0]))

    def newest(self, angle: float) -> "Samples":
        """Those over which the course turned by an angle [rad]."""
        turned = np.abs(self.course - self.course[-1])
        return self[np.argmax(turned <= angle * 1.0001) :]


class SampleWindow:
    """Takes in samples one by one, in bounded memory."""

    def __init__(self, settings: OrbitSettings):
        self._settings = settings
        self._capacity = 4 * settings.most_samples
        self._columns = np.empty((11, 2 * self._capacity))
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        self._first = self._end = 0
        self._has_course = False

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def kept(self) -> Samples:
        """All that are kept, those before the window as well."""
        return Samples(self._columns[:, self._first : self._end])

    @property
    def newest_time(self) -> float:
        """[s]; nan where there is no sample."""
        return float(self._columns[_TIME, self._end - 1]) if len(self) else nan

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
        new = self._columns[:, self._end]
        new[_TIME] = time
        new[_E : _U + 1] = position
        new[_VE : _VN + 1] = nan if velocity is None else velocity[:2]
        stated = position_sigma if isfinite(position_sigma) else s.position_sigma
        new[_CORRELATED] = s.correlated_share * stated
        new[_WHITE] = max(sqrt(1.0 - s.correlated_share**2) * stated, s.least_sigma)
        stated = velocity_sigma if isfinite(velocity_sigma) else s.velocity_sigma
        new[_VELOCITY] = max(stated, s.least_velocity_sigma)
        new[_STATED] = isfinite(position_sigma)
        course = self._course(new, rate)
        if isfinite(course) and not self._has_course:
            # Where it stood before, or had not moved far enough yet, it has not turned.
            self._columns[_COURSE, self._first : self._end] = course
            self._has_course = True
        new[_COURSE] = course if self._has_course else 0.0
        self._end += 1

    def newest_turn(self) -> Samples:
        """As far back as the course keeps turning and the window reaches."""
        s = self._settings
        window = self._columns[:, self._first : self._end]
        kept, start = turn_start(window[_TIME], window[_COURSE], s.window)
        start += self._first
        self._first += kept
        columns = self._columns[:, start : self._end]
        stride = -(-columns.shape[1] // s.most_samples)
        if stride > 1:
            columns = np.ascontiguousarray(columns[:, ::-1][:, ::stride][:, ::-1])
        return Samples(columns)

    def _make_room(self) -> None:
        if self._end < self._columns.shape[1]:
            return
        kept = self._columns[:, self._first : self._end]
        if kept.shape[1] > self._capacity:
            # A slow circle at a high rate: half as many samples still fill the window.
            kept = kept[:, ::-1][:, ::2][:, ::-1]
        kept = kept.copy()
        self._end = kept.shape[1]
        self._columns[:, : self._end] = kept
        self._first = 0

    def _course(self, new: np.ndarray, rate: float) -> float:
        """Course over ground, continuous with the sample before; nan before the first is known."""
        before = self._columns[:, self._first : self._end]
        known = self._has_course
        if isfinite(new[_VE]):
            if hypot(new[_VE], new[_VN]) < self._settings.minimum_speed:
                return before[_COURSE, -1] if known else nan
            course = atan2(new[_VN], new[_VE])
        else:
            # The chord to an earlier position far enough away for the noise not to matter.
            distance = np.hypot(before[_E] - new[_E], before[_N] - new[_N])
            far = distance > 8.0 * new[_WHITE]
            if not far.any():
                return before[_COURSE, -1] if known else nan
            start = before[:, np.flatnonzero(far)[-1]]
            course = atan2(new[_N] - start[_N], new[_E] - start[_E])
        if not known:
            return course
        # Across a gap the course goes on turning as it did.
        expected = before[_COURSE, -1]
        if isfinite(rate):
            expected += rate * (new[_TIME] - before[_TIME, -1])
        return expected + (course - expected + pi) % TURN - pi
