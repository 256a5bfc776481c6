"""Which samples are believed: each one is, or is skipped for one reason.

A position is believed on evidence, not because it is there: the receiver's own word on its fix,
and that it lies where the positions and velocities before it lead. What contradicts the sample
believed last is a jump, unless it persists: then the vehicle was moved, or that sample was wrong.
A time far ahead is believed once another sample follows it: after a gap the second sample is used.
"""

from math import hypot, isfinite

from ctcbs_ros.geodesy import Datum, to_enu
from ctcbs_ros.telemetry.evidence import FIX_3D
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.skip_code import SkipCode

# What an aircraft that tows can do; beyond it the sample is damaged.
LARGEST_SPEED = 400.0  # m/s
HEIGHTS = (-1_000.0, 50_000.0)  # m
LARGEST_LOCAL = 1e6  # m

POOREST_ACCURACY = 25.0  # m, one standard deviation
# Positions before the first fix, and offsets of metres from them, lie this close to 0, 0.
START_UP = 0.1  # deg

# How far a position may lie from where the velocities lead: receivers wander and filters correct
# themselves by POSITION_STEP, velocities change by ACCELERATION (2 g), in gaps up to ANY_SPEED.
POSITION_STEP = 15.0  # m
HEIGHT_STEP = 50.0  # m; barometers and home positions are reset in flight
ACCELERATION = 20.0  # m/s^2
ANY_SPEED = 100.0  # m/s
# Further ahead of the sample believed last than this, a time stamp may be wrong, and believing it
# would put every sample after it out of order.
FAR_AHEAD = 10.0  # s
# Samples in a row that agree on a place until it is believed: at the start, where the source tells
# nothing about its fix, after a long gap, and against the sample believed last.
CONFIRMATIONS_AT_START = 3
CONFIRMATIONS_AFTER_GAP = 2
CONFIRMATIONS_OF_JUMP = 5

MOVING = 3.0  # m/s
FROZEN_SAMPLES = 3
FROZEN_DISTANCE = 10.0  # m that the velocity led away meanwhile


class Screen:
    """Judges the samples of one source in their order; a new flight is judged afresh."""

    def __init__(self):
        self._begin(None)

    def check(self, sample: Sample) -> SkipCode | None:
        """Whether a sample can be used.

        Parameters
        ----------
        sample : Sample
            Whatever it contains: nothing raises.

        Returns
        -------
        SkipCode or None
            Why it is skipped; None if it is believed.
        """
        if sample.flight != self._flight:
            self._begin(sample.flight)
        if not is_finite(sample):
            return SkipCode.NOT_FINITE
        if not has_fix(sample):
            return SkipCode.BAD_FIX
        if self._believed is not None:
            if sample.time < self._believed.time:
                return SkipCode.OUT_OF_ORDER
            if sample.time == self._believed.time:
                return SkipCode.DUPLICATE
        if self._is_frozen(sample):
            return SkipCode.FROZEN

        if self._believed is None:
            states_fix = sample.fix_type is not None or _is_local(sample)
            if not states_fix and not self._confirms(sample, CONFIRMATIONS_AT_START):
                return SkipCode.BAD_FIX
        elif not agree(self._believed, sample):
            if not self._confirms(sample, CONFIRMATIONS_OF_JUMP):
                return SkipCode.JUMP
        elif self._is_far_ahead(sample) and not self._confirms(sample, CONFIRMATIONS_AFTER_GAP):
            return SkipCode.AHEAD
        self._believed = sample
        self._candidate = None
        return None

    def _is_far_ahead(self, sample: Sample) -> bool:
        return sample.time - self._believed.time > FAR_AHEAD

    def _begin(self, flight: int | None) -> None:
        self._flight = flight
        self._believed: Sample | None = None
        self._candidate: Sample | None = None  # newest sample of a place not believed yet
        self._confirmations = 0
        self._still_since: Sample | None = None  # first sample at the position of the newest
        self._still_samples = 0

    def _confirms(self, sample: Sample, enough: int) -> bool:
        """Whether with this sample enough in a row agree on the candidate place."""
        if self._candidate is not None and sample.time <= self._candidate.time:
            return False
        follows = self._candidate is not None and agree(self._candidate, sample)
        self._confirmations = self._confirmations + 1 if follows else 1
        self._candidate = sample
        return self._confirmations >= enough

    def _is_frozen(self, sample: Sample) -> bool:
        since = self._still_since
        if since is None or _place(since) != _place(sample) or sample.time < since.time:
            self._still_since, self._still_samples = sample, 1
            return False
        self._still_samples += 1
        if sample.velocity is None or self._still_samples < FROZEN_SAMPLES:
            return False
        speed = hypot(sample.velocity[0], sample.velocity[1])
        return speed > MOVING and speed * (sample.time - since.time) > FROZEN_DISTANCE


def is_finite(sample: Sample) -> bool:
    """Whether time, position and velocity are numbers that an aircraft can have.

    The position is geodetic with at least one of the three heights, or local.
    """
    if not isfinite(sample.time):
        return False
    if sample.velocity is not None and not hypot(*sample.velocity) <= LARGEST_SPEED:
        return False
    if _is_local(sample):
        return all(abs(x) <= LARGEST_LOCAL for x in sample.local_position)
    heights = [
        height
        for height in (
            sample.altitude_amsl,
            sample.altitude_ellipsoid,
            sample.height_above_home,
        )
        if height == height  # nan is a height that was not sent
    ]
    return (
        abs(sample.latitude) <= 90.0
        and abs(sample.longitude) <= 180.0
        and len(heights) > 0
        and all(HEIGHTS[0] <= height <= HEIGHTS[1] for height in heights)
    )


def has_fix(sample: Sample) -> bool:
    """Whether nothing that the source says about the fix speaks against the position."""
    if sample.fix_type is not None and sample.fix_type < FIX_3D:
        return False
    if sample.horizontal_accuracy > POOREST_ACCURACY:
        return False
    if _is_local(sample):
        return True
    return abs(sample.latitude) > START_UP or abs(sample.longitude) > START_UP


def agree(before: Sample, after: Sample) -> bool:
    """Whether an aircraft at one sample can be at the next, given the velocities of both."""
    duration = after.time - before.time
    moved = _displacement(before, after)
    if moved is None or not duration > 0:
        return False
    velocities = [s.velocity for s in (before, after) if s.velocity is not None]
    if velocities:
        led = [
            sum(component) / len(velocities) * duration
            for component in zip(*velocities, strict=True)
        ]
        change = min(ACCELERATION / 2 * duration, ANY_SPEED) * duration
    else:
        led = [0.0, 0.0, 0.0]
        change = ANY_SPEED * duration
    accuracies = [
        s.horizontal_accuracy for s in (before, after) if isfinite(s.horizontal_accuracy)
    ]
    noise = POSITION_STEP + 3 * hypot(*accuracies)
    return (
        hypot(moved[0] - led[0], moved[1] - led[1]) <= noise + change
        and abs(moved[2] - led[2]) <= HEIGHT_STEP + change
    )


def _is_local(sample: Sample) -> bool:
    return sample.local_position is not None and not isfinite(sample.latitude)


def _place(sample: Sample):
    """The horizontal position, for telling whether it is the very same."""
    return sample.local_position if _is_local(sample) else (sample.latitude, sample.longitude)


def _displacement(before: Sample, after: Sample) -> Vector | None:
    """East, north, up from one sample to another [m]; None where their frames differ."""
    if _is_local(before) != _is_local(after):
        return None
    if _is_local(before):
        return tuple(
            b - a for a, b in zip(before.local_position, after.local_position, strict=True)
        )
    datum = Datum(before.latitude, before.longitude, 0.0, True)
    east, north, _ = to_enu(datum, after.latitude, after.longitude, 0.0)
    for kind in ("altitude_amsl", "altitude_ellipsoid", "height_above_home"):
        climbed = getattr(after, kind) - getattr(before, kind)
        if isfinite(climbed):
            return east, north, climbed
    return east, north, 0.0
