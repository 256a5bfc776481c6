"""The motion in the wind, followed from orbit to orbit at a bounded cost a sample.

It is solved now and then, in pieces shared out over the samples; in between it is linear. Coarsely
at first, which takes a sample or two; finer while the flight stays near. Where no periodic motion
is found, the cable is flown in time until its turns are the same.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from math import inf, nan, pi
from typing import Any

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.periodic.factors import Storage
from ctcbs_ros.prediction.jumps import is_on_another_branch
from ctcbs_ros.prediction.prediction import Margin, MarginOf, MotionInWind, MotionSource
from ctcbs_ros.prediction.wind_growth import LinearGrowth, growth_search
from ctcbs_ros.prediction.wind_in_time import motion_in_time_search
from ctcbs_ros.prediction.wind_motion import (
    EFFORT,
    Flight,
    LinearMotion,
    Scaled,
    finer_motion_search,
    linear_motion_search,
    motion_in_wind,
)
from ctcbs_ros.prediction.wind_reasons import NO_TIME, STILL_JUDGED, STILL_SOLVED
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.stability import FUNCTIONS
from ctcbs_ros.solver.steady_state import SteadyState

# Distance (see `Flight.distance`) from where the motion was solved: from which it is solved anew,
# and up to which it is used until that is done.
_ANEW, _USED = 0.02, 0.08
# The same of its growth rate, up to which that is used until the next one is computed.
_GROWTH_USED = 0.04
# Distance from where none was found, from which one is looked for before a quarter turn is over.
_ELSEWHERE = 0.1
# Error of a coarse motion [a] from which the cable flown in time is worth its work.
_POOR = 1e-2
# Work a sample, in that of `newton.work`: 20 ms of one core; of samples that come less often than
# so many seconds apart it is in proportion, up to so many times as much.
_PIECE, _OFTEN, _MOST_PIECES = 0.6, 0.1, 3.0


@dataclass(frozen=True)
class _Failed:
    """Where no periodic motion was found, and when it was sought."""

    flight: Flight
    time: float


@dataclass(frozen=True)
class _Judging:
    """A search for how stable a motion is, and that motion."""

    search: Generator
    motion: LinearMotion


class WindFollower:
    """Follows the motion from orbit to orbit.

    Parameters
    ----------
    in_time : bool
        Whether the cable is flown in time where no periodic motion is found.
    """

    def __init__(self, in_time: bool = False):
        self._in_time = in_time
        self._storage: Storage | None = None  # until the first wind is known
        self.reset()

    def reset(self) -> None:
        """Forget the motion: the next one is continued from still air."""
        self._solved: LinearMotion | None = None
        self._search = self._sought = None
        # How stable it is; the motion last judged, and the one being judged.
        self._growth: LinearGrowth | None = None
        # Flight on which that could not be told; it stands until it can, or the flight is another.
        self._untold: Flight | None = None
        self._open_since = nan
        self._judged: LinearMotion | None = None
        self._judging: _Judging | None = None
        self._why_untold = ""
        self._updated_at = nan
        # Whether the search is for the same motion, finer; when one such was begun.
        self._refining = False
        self._refined_at = -inf
        self._unrefined: LinearMotion | None = None  # which could not be
        self._state: SteadyState | None = None
        self._failed: _Failed | None = None
        self.reason = ""

    @property
    def searching(self) -> bool:
        """Whether a motion is being solved."""
        return self._search is not None

    @property
    def _is_judged(self) -> bool:
        """Whether all is done of the motion as it is known now."""
        return self._search is None and self._judging is None and self._solved is self._judged

    @property
    def judging(self) -> bool:
        """Whether it is still open how stable the motion is, and has not been found untellable."""
        return self._untold is None and (self.searching or self._solved is not self._judged)

    def update(
        self,
        orbit: Orbit,
        scaled: Scaled,
        state: SteadyState,
        velocity: np.ndarray,
        covariance: np.ndarray,
        kind: str,
        functions: int = FUNCTIONS[1],
    ) -> MotionInWind | None:
        """The motion on the present orbit.

        Parameters
        ----------
        orbit : Orbit
        scaled : callable
            Parameters at a tow radius [m] and a speed [m/s].
        state : SteadyState
            Flown, in still air.
        velocity : (2,) ndarray
            Of the air past the circle, towards east and north [m/s].
        covariance : (2, 2) ndarray
            Of that.
        kind : str
            What is constant round the circle, see `TowPath`.
        functions : int
            A coordinate, that the vibration of `state` is resolved with.

        Returns
        -------
        MotionInWind or None
            None where there is no motion, or none yet; then `reason` says why.
        """
        flight = Flight.of(orbit, float(np.hypot(*velocity)), kind, state.parameters)
        self._forget_others(state, flight)
        if self._storage is None:
            self._storage = Storage(EFFORT.most_memory, EFFORT.most_times)
        self._drop_what_is_left_behind(flight)
        if (self._search is None or self._refining) and self._is_due(flight, orbit.time):
            self._search = self._found_anyhow(flight, scaled, state, orbit.time)
            self._sought, self._refining = flight, False
        elif self._is_judged and self._may_be_finer(orbit.time):
            self._search = self._found_finer(flight, scaled, state, orbit.time)
            self._sought, self._refining = flight, True
            self._refined_at = orbit.time
        self._work(self._work_due(orbit.time), functions)
        if self._solved is None or self._solved.flight.distance(flight) > _USED:
            if self._search is not None:
                self.reason = STILL_SOLVED
            return None
        try:
            motion = motion_in_wind(self._solved, orbit, flight, velocity, covariance)
            return replace(motion, margin=self._margin(flight, orbit.time))
        except InputError as error:  # beside it lies a wind as fast as the aircraft
            self.reason = str(error)
            return None

    def _drop_what_is_left_behind(self, flight: Flight) -> None:
        """Give up what would be known of a flight too far from the present one to be used."""
        if self._search is not None and self._sought.distance(flight) > _USED:
            self._search = None
        if (
            self._judging is not None
            and self._judging.motion is not self._solved
            and self._judging.motion.flight.distance(flight) > _GROWTH_USED
        ):
            self._judging = None

    def _work_due(self, time: float) -> float:
        """Work that is due at a sample by when the one before came."""
        since, self._updated_at = time - self._updated_at, time
        return _PIECE * min(max(since / _OFTEN, 1.0), _MOST_PIECES) if since > 0.0 else _PIECE

    def _work(self, left: float, functions: int) -> None:
        """So much of what is being sought: the motion first, then how stable it is."""
        if self._search is not None:
            found, left = _some_of(self._search, left)
            if found is not None:
                self._search = None
                self._take(found.value)
        if left <= 0.0:
            return
        if self._judging is None and self._solved is not self._judged:
            self._judging = _Judging(growth_search(self._solved, functions), self._solved)
        if self._judging is not None:
            found, left = _some_of(self._judging.search, left)
            if found is not None:
                self._told(found.value)

    def _told(self, growth: LinearGrowth | str) -> None:
        """Take what is known of how stable a motion is, or why that is not."""
        motion = self._judging.motion
        self._judging, self._judged = None, motion
        if isinstance(growth, str):
            self._untold, self._why_untold = motion.flight, growth
        else:
            self._growth, self._untold = growth, None

    def _forget_others(self, state: SteadyState, flight: Flight) -> None:
        """Forget the motion of another branch or another kind of flight."""
        known = self._solved.flight if self._solved is not None else self._sought
        if (
            (self._state is not None and is_on_another_branch(self._state, state))
            or (known is not None and known.kind != flight.kind)
        ):
            self.reset()
        self._state = state

    def _found_anyhow(self, flight: Flight, scaled: Scaled, state: SteadyState, time: float):
        """The periodic motion, or else the one in time, or why there is neither; yields work."""
        before = self._solved
        is_in_time = before is not None and before.source is MotionSource.IN_TIME
        if not self._is_hopeless(flight, time):
            known = None if before is None or is_in_time else before.motion
            found = yield from linear_motion_search(
                flight, scaled, state, known, self._storage
            )
            if not isinstance(found, str):
                self._failed = None
                return found
            self._failed = _Failed(flight, time)
            if not self._in_time:
                return found
        return (
            yield from motion_in_time_search(
                flight, scaled, state, before if is_in_time else None
            )
        )

    def _found_finer(self, flight: Flight, scaled: Scaled, state: SteadyState, time: float):
        """The coarse motion known better; in time where it cannot be and is poor. Yields work."""
        coarse = self._solved
        found = yield from finer_motion_search(coarse, flight, scaled, state, self._storage)
        if isinstance(found, str) and self._in_time and coarse.motion.residual > _POOR:
            found = yield from motion_in_time_search(flight, scaled, state, None)
            if not isinstance(found, str):
                self._failed = _Failed(flight, time)
        return found

    def _is_due(self, flight: Flight, time: float) -> bool:
        if self._solved is not None:
            return self._solved.flight.distance(flight) > _ANEW
        return not self._is_hopeless(flight, time)

    def _is_hopeless(self, flight: Flight, time: float) -> bool:
        """Whether no periodic motion is to be looked for: none was found near here."""
        there = self._failed
        if there is None:
            return False
        moved = there.flight.distance(flight)
        quarter = 0.5 * pi / flight.rate  # the speed found from half a turn in wind changes yet
        return moved <= _ANEW or (moved <= _ELSEWHERE and time - there.time <= quarter)

    def _may_be_finer(self, time: float) -> bool:
        """Whether a coarse motion is to be solved finer: once a turn at most."""
        if self._solved is None or not self._solved.coarse or self._solved is self._unrefined:
            return False
        return time - self._refined_at > 2.0 * pi / self._solved.flight.rate

    def _margin(self, flight: Flight, time: float) -> Margin:
        """How stable the motion on a flight is, as far as that is known.

        A flight that moves on and on may leave no time to find out: after half a turn it is "not
        known" then, for a warning to say so.
        """
        known = self._growth
        if self._untold is not None and self._untold.distance(flight) > _USED:
            self._untold = None
        if known is None or known.flight.distance(flight) > _GROWTH_USED:
            if not self._open_since <= time:
                self._open_since = time
            if self._untold is not None:
                return Margin(MarginOf.NOT_KNOWN, because=self._why_untold)
            if self.judging and time - self._open_since <= pi / flight.rate:
                return Margin(MarginOf.NOT_YET, because=STILL_JUDGED)
            return Margin(MarginOf.NOT_KNOWN, because=NO_TIME)
        self._open_since = nan
        margin = -known.at(flight)
        return Margin(
            MarginOf.WIND, margin, margin * flight.rate, known.frequency * flight.rate,
            known.nearest_loss,
        )  # fmt: skip

    def _take(self, found: LinearMotion | str) -> None:
        if isinstance(found, str) and self._refining:
            self._unrefined = self._solved  # the coarse one stays
            return
        if isinstance(found, str):
            self._solved, self.reason = None, found
            self._judged = self._judging = None
        else:
            if self._solved is not None:
                found = found.after(self._solved)
            self._solved, self.reason = found, ""


@dataclass(frozen=True)
class _Found:
    value: Any


def _some_of(search, left: float) -> tuple[_Found | None, float]:
    """So much work of a search: what it found, None while it goes on, and the work left."""
    with one_blas_thread():
        while left > 0.0:
            try:
                left -= next(search)
            except StopIteration as ended:
                # Not the exception itself: its traceback keeps all that the search has made.
                return _Found(ended.value), left
    return None, left
