"""The beacon's reports held against the predictions, each at the time of the report.

A report waits until the aircraft has been heard after it; then the prediction's motion is
interpolated to its time. It is screened as the aircraft's samples are, by a screen of its own.
One that counts as settled is held back for a quarter of a turn more: only then is it known that
the aircraft was not leaving its circle, which an orbit shows late.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import exp, hypot, inf, isfinite, pi

import numpy as np

from ctcbs_ros.beacon.comparison import STANDINGS, Comparison, Standing, Unmatched
from ctcbs_ros.beacon.difference import Difference, difference
from ctcbs_ros.beacon.motion import Motion, Place
from ctcbs_ros.configuration import Beacon
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.telemetry.beacon import BeaconSample
from ctcbs_ros.telemetry.continuity import Continuity, Track
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.twin.simulated import Simulated, TwinState

# A payload hangs almost still where an aircraft never does [m/s], but not to the centimetre of its
# receiver's digits for so long [s].
MOVING, LONGEST_STILL = 0.3, 5.0
# A cable stretches by less than this part before it breaks.
STRETCH = 0.1
# Reports that wait for the aircraft's next position, and outcomes that are held back.
MOST_WAITING = 1_000
# Turns for which a circle may still be seen after it was left.
SEEN_LATE = 0.25
# Accuracies stated as worse [m] are taken as this, so that squares of them stay finite.
POOREST = 1e3


@dataclass(frozen=True)
class _Waiting:
    """A believed report, placed."""

    report: BeaconSample
    position: np.ndarray
    sigma: float


class BeaconComparer:
    """Compares one beacon's reports with the predictions of one aircraft.

    Parameters
    ----------
    beacon : Beacon
        How sure its positions and times are.
    frame : LocalFrame
        The predictions' own; it is only read.
    cable_length : float
        Paid out [m]; `change` takes another.
    """

    def __init__(self, beacon: Beacon, frame: LocalFrame, cable_length: float):
        self._beacon = beacon
        self._frame = frame
        self._cable_length = cable_length
        self._screen = Screen(MOVING, LONGEST_STILL)
        self._continuity = Continuity()
        self._beacon_flight: int | None = None
        self._flight: int | None = None
        self._jumped_at = -inf
        self._stamp_offset_ns = 0  # of the aircraft: stamp less time
        self._waiting: deque[_Waiting] = deque()
        self._tow_point = Motion()
        self._predicted = Motion(worst=STANDINGS)
        self._simulated = Motion(worst=STANDINGS)
        self._held: deque[Comparison] = deque()  # in order; behind a settled one any others
        self._hold_for = 0.0

    def change(self, cable_length: float) -> None:
        """Take over the cable paid out [m]."""
        self._cable_length = cable_length

    def hear(self, prediction: Prediction) -> list[Comparison]:
        """Take in the prediction of one more of the aircraft's samples.

        Parameters
        ----------
        prediction : Prediction

        Returns
        -------
        list of Comparison
            The reports that waited for it, or for the circle to go on.
        """
        if prediction.skip is not None:
            return []
        found = []
        time = prediction.time
        if prediction.flight != self._flight or time < self._tow_point.newest:
            found = self.finish()
            self._flight, self._jumped_at = prediction.flight, -inf
            for motion in (self._tow_point, self._predicted, self._simulated):
                motion.clear()
        self._stamp_offset_ns = prediction.stamp_ns - round(time * 1e9)
        self._tow_point.add(time, self._tow_place(prediction))
        if any(warning.code is WarningCode.JUMPED for warning in prediction.warnings):
            self._jumped_at = time
        place = place_of(prediction, self._cable_length, time - self._jumped_at)
        self._predicted.add(time, place)
        simulated = prediction.simulated
        self._simulated.add(time, None if simulated is None else simulated_place(simulated))
        found += self._released(self._compare_waiting())
        if place is None:
            return found + self._all_released()
        self._hold_for = SEEN_LATE * 2.0 * pi / prediction.orbit.angular_rate
        if min(prediction.end_mass.time_on_orbit, time - self._jumped_at) < self._hold_for:
            return found + self._all_released()
        return found + self._released([])

    def add(self, report: BeaconSample) -> list[Comparison]:
        """Take in one report.

        Returns
        -------
        list of Comparison
            Those that need not wait, this one among them or not.
        """
        return self._released(self._judged(report))

    def _judged(self, report: BeaconSample) -> list[Comparison]:
        sample = report.sample
        skip = self._screen.check(sample)
        if skip is not None:
            return [self._outcome(report, skip)]
        if sample.flight != self._beacon_flight:
            self._beacon_flight = sample.flight
            self._continuity.reset()
        position = self._frame.place(sample)
        if position is None:
            return [self._outcome(report, Unmatched.NO_COMMON_HEIGHT)]
        if self._continuity.check(sample, position) is Track.STRAYS:
            return [self._outcome(report, SkipCode.JUMP)]
        if not isfinite(report.time):
            return [self._outcome(report, Unmatched.NO_COMMON_TIME, position)]
        stated = sample.horizontal_accuracy
        sigma = min(stated, POOREST) if stated > 0.0 else self._beacon.position_sigma
        waiting = _Waiting(report, position, sigma)
        if not self._waits(waiting):
            return [self._compared(waiting)]
        self._waiting.append(waiting)
        if len(self._waiting) <= MOST_WAITING:
            return []
        longest = self._waiting.popleft()
        return [self._outcome(longest.report, Unmatched.NO_AIRCRAFT, longest.position)]

    def finish(self) -> list[Comparison]:
        """The reports that still wait, for an aircraft that will not be heard any more."""
        found = [
            self._outcome(waiting.report, Unmatched.NO_AIRCRAFT, waiting.position)
            for waiting in self._waiting
        ]
        self._waiting.clear()
        return self._all_released() + found

    def _released(self, found: list[Comparison]) -> list[Comparison]:
        """Take in what reports came to; those of all so far that need not be held back."""
        self._held.extend(found)
        confirmed = self._tow_point.newest - self._hold_for
        out = []
        while self._held and (
            len(self._held) > MOST_WAITING
            or not self._held[0].settled
            or self._held[0].time <= confirmed
        ):
            out.append(self._held.popleft())
        return out

    def _all_released(self) -> list[Comparison]:
        """All that is held back, the settled unconfirmed: the circle does not go on."""
        out = [
            replace(one, outcome=Standing.UNCONFIRMED) if one.settled else one
            for one in self._held
        ]
        self._held.clear()
        return out

    def _compare_waiting(self) -> list[Comparison]:
        due = [waiting for waiting in self._waiting if not self._waits(waiting)]
        if due:
            self._waiting = deque(filter(self._waits, self._waiting))
        return [self._compared(waiting) for waiting in due]

    def _waits(self, waiting: _Waiting) -> bool:
        report = waiting.report
        return report.flight == self._flight and report.time > self._tow_point.newest

    def _tow_place(self, prediction: Prediction) -> Place:
        """The tow point, as fast as it came there."""
        time, before = prediction.time, self._tow_point.at(self._tow_point.newest)
        velocity = np.zeros(3)
        if before is not None:
            velocity = (prediction.tow_point - before.position) / max(time - before.time, 1e-3)
        return Place(time, prediction.tow_point, velocity, np.zeros((3, 3)))

    def _compared(self, waiting: _Waiting) -> Comparison:
        report, position = waiting.report, waiting.position
        time = report.time
        if self._tow_point.is_before(time):
            return self._outcome(report, Unmatched.LATE, position)
        tow_point = self._tow_point.at(time)
        if tow_point is None or report.flight != self._flight:
            return self._outcome(report, Unmatched.NO_AIRCRAFT, position)
        time_sigma = hypot(report.time_sigma, self._beacon.time_sigma)
        uncertain = np.diag([waiting.sigma**2, waiting.sigma**2, self._beacon.height_sigma**2])
        if self._is_out_of_reach(position, tow_point, uncertain, time_sigma):
            return self._outcome(report, Unmatched.OUT_OF_REACH, position)

        def against(place: Place) -> Difference:
            # What the beacon moves within the error of its time looks like an error of its place.
            spread = time_sigma**2 * np.outer(place.velocity, place.velocity)
            covariance = place.covariance + uncertain + spread
            return difference(position, place.position, covariance)

        outcome = Unmatched.NO_PREDICTION
        of_predicted = of_simulated = standing = None
        if (predicted := self._predicted.at(time)) is not None:
            outcome, of_predicted = Standing(predicted.standing), against(predicted)
        if (simulated := self._simulated.at(time)) is not None:
            standing, of_simulated = Standing(simulated.standing), against(simulated)
        return self._outcome(report, outcome, position, of_predicted, of_simulated, standing)

    def _outcome(
        self, report: BeaconSample, outcome, measured=None, predicted=None, simulated=None,
        standing=None,
    ) -> Comparison:  # fmt: skip
        stamp_ns = report.sample.stamp_ns
        if report.flight == self._flight and isfinite(report.time):
            stamp_ns = self._stamp_offset_ns + round(report.time * 1e9)
        return Comparison(
            stamp_ns, report.time, report.flight, report.time_by, report.time_sigma, outcome,
            measured, predicted, simulated, standing,
        )  # fmt: skip

    def _is_out_of_reach(
        self, position: np.ndarray, tow_point: Place, uncertain: np.ndarray, time_sigma: float
    ) -> bool:
        away = position - tow_point.position
        # Where the aircraft was is not known better than when that was.
        speed = np.linalg.norm(tow_point.velocity)
        unsure = 3.0 * hypot(*np.sqrt(np.diag(uncertain)), time_sigma * speed)
        return bool(np.linalg.norm(away) > (1.0 + STRETCH) * self._cable_length + unsure)


def place_of(prediction: Prediction, cable_length: float, since_jump: float = inf) -> Place | None:
    """Where a prediction has the end mass, with its motion; None where it has none.

    Parameters
    ----------
    prediction : Prediction
    cable_length : float
        [m]
    since_jump : float
        For how long it has been on its branch [s].

    Notes
    -----
    The covariance has, beside the prediction's, a share for what is left of the way there: the
    end mass began as far away as the cable is long (one standard deviation along each axis) and
    comes nearer as the least damped mode decays.
    """
    end_mass, orbit = prediction.end_mass, prediction.orbit
    if end_mass is None:
        return None
    ring = end_mass.circle()
    ahead, ahead_2, back_2, back = ring[1], ring[2], ring[-2], ring[-1]
    interval = 2.0 * np.pi / orbit.angular_rate / len(ring)
    velocity = (8.0 * (ahead - back) - (ahead_2 - back_2)) / (12.0 * interval)
    velocity += (*orbit.drift, orbit.climb_rate)
    covariance = np.asarray(end_mass.covariance)[:3, :3]
    settling_for = min(end_mass.time_on_orbit, since_jump)
    decay = end_mass.margin.per_second
    left = exp(-decay * settling_for) if decay > 0.0 else 1.0
    covariance = covariance + (cable_length * left) ** 2 * np.eye(3)
    if any(warning.code is WarningCode.WIND_UNMODELLED for warning in prediction.warnings):
        standing = Standing.UNMODELLED
    elif end_mass.holds and settling_for >= end_mass.settling_time:
        standing = Standing.SETTLED
    else:
        standing = Standing.SETTLING
    return Place(
        prediction.time, np.asarray(end_mass.position), velocity, covariance, standing.value
    )


def simulated_place(simulated: Simulated) -> Place | None:
    """Where the twin has the end mass; None while it has none."""
    if simulated.state is TwinState.WAITING:
        return None
    standing = Standing.SETTLED if simulated.valid else Standing.SETTLING
    if not simulated.wind_known:
        standing = Standing.UNMODELLED
    return Place(
        simulated.time, simulated.position, simulated.velocity, simulated.covariance[:3, :3],
        standing.value,
    )  # fmt: skip
