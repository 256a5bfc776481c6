"""Which samples are believed: each one is, or is skipped for one reason.

A position is believed on evidence, not because it is there: the receiver's own word on its fix,
and that it lies where the positions and velocities before it lead. What contradicts the sample
believed last is a jump, unless it persists: then the vehicle was moved, or that sample was wrong.
A time far ahead is believed once another sample follows it: after a gap the second sample is used;
and if it was wrong nevertheless, the samples that go on at the time before.
"""

from dataclasses import replace
from math import hypot, inf, isfinite, isnan

from ctcbs_ros.geodesy import Datum, to_enu
from ctcbs_ros.telemetry.clock import LATE_US
from ctcbs_ros.telemetry.evidence import FIX_3D
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.skip_code import SkipCode

# What an aircraft that tows can do; beyond it the sample is damaged.
LARGEST_SPEED = 400.0  # m/s
HEIGHTS = (-1_000.0, 50_000.0)  # m
LARGEST_LOCAL = 1e6  # m

POOREST_ACCURACY = 25.0  # m, one standard deviation
FEWEST_SATELLITES = 4  # that a 3D fix takes
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
# No aircraft flies to the mirror image of where it is: that is believed only while samples of the
# other place are so few that they may be the wrong ones.
SURE_OF_PLACE = 20
LATE = LATE_US / 1e6

MOVING = 3.0  # m/s
FROZEN_SAMPLES = 2
FROZEN_DISTANCE = 1.0  # m that the velocity led away meanwhile; positions are sent to 0.01 m


class Screen:
    """Judges the samples of one source in their order; a new flight is judged afresh.

    Parameters
    ----------
    moving : float
        Speed from which a position that stands still contradicts it [m/s].
    longest_still : float
        Time for which the very same position is believed of what does not say how fast it moves,
        or that it stands [s].
    """

    def __init__(self, moving: float = MOVING, longest_still: float = inf):
        self._moving, self._longest_still = moving, longest_still
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
        if not is_in_range(sample):
            return SkipCode.OUT_OF_RANGE
        if is_zero_position(sample):
            return SkipCode.ZERO_POSITION
        if not has_fix(sample):
            return SkipCode.BAD_FIX
        before = self._believed
        if before is not None and sample.time <= before.time:
            if sample.time == before.time:
                return SkipCode.DUPLICATE
            is_late = before.time - sample.time <= LATE
            if is_late or not self._past.confirms(sample, CONFIRMATIONS_OF_JUMP):
                return SkipCode.OUT_OF_ORDER
            before = self._believed = None  # it was the time believed that was wrong
        if self._is_frozen(sample):
            return SkipCode.FROZEN

        if before is None:
            states_fix = sample.fix_type is not None or _is_local(sample)
            goes_on = self._past.confirmations >= CONFIRMATIONS_OF_JUMP
            confirmed = states_fix or goes_on
            if not confirmed and not self._place.confirms(sample, CONFIRMATIONS_AT_START):
                return SkipCode.BAD_FIX
        elif not agree(before, sample):
            mirrored = any(agree(before, image) for image in _mirror_images(sample))
            if mirrored and self._times_believed >= SURE_OF_PLACE:
                return SkipCode.MIRRORED
            if not self._place.confirms(sample, CONFIRMATIONS_OF_JUMP):
                return SkipCode.MIRRORED if mirrored else SkipCode.JUMP
            self._times_believed = 0
        elif sample.time - before.time > FAR_AHEAD and not self._place.confirms(
            sample, CONFIRMATIONS_AFTER_GAP
        ):
            return SkipCode.AHEAD
        self._believed = sample
        self._times_believed += 1
        self._place, self._past = _Candidate(), _Candidate()
        return None

    def _begin(self, flight: int | None) -> None:
        self._flight = flight
        self._believed: Sample | None = None
        self._times_believed = 0  # in a row about one place
        self._place = _Candidate()  # a place not believed yet
        self._past = _Candidate()  # a time before that of the sample believed last
        self._still_since: Sample | None = None  # first sample at the position of the newest
        self._still_samples = 0

    def _is_frozen(self, sample: Sample) -> bool:
        since = self._still_since
        if since is None or _spot(since) != _spot(sample) or sample.time < since.time:
            self._still_since, self._still_samples = sample, 1
            return False
        self._still_samples += 1
        if self._still_samples < FROZEN_SAMPLES:
            return False
        still = sample.time - since.time
        if still > self._longest_still:
            return True
        if sample.velocity is None:
            return False
        speed = hypot(sample.velocity[0], sample.velocity[1])
        return speed > self._moving and speed * still > FROZEN_DISTANCE


class _Candidate:
    """Samples in a row that agree with each other, though not with the sample believed last."""

    def __init__(self):
        self.confirmations = 0
        self._newest: Sample | None = None

    def confirms(self, sample: Sample, enough: int) -> bool:
        """Whether with this sample there are enough."""
        if self._newest is not None and sample.time <= self._newest.time:
            return False
        follows = self._newest is not None and agree(self._newest, sample)
        self.confirmations = self.confirmations + 1 if follows else 1
        self._newest = sample
        return self.confirmations >= enough


def is_finite(sample: Sample) -> bool:
    """Whether time, position and velocity are there, and numbers.

    The position is geodetic with at least one of the three heights, or local.
    """
    numbers = [sample.time, *(sample.velocity or ())]
    if _is_local(sample):
        numbers += sample.local_position
    else:
        heights = _heights(sample)
        if not heights:
            return False
        numbers += [sample.latitude, sample.longitude, *heights]
    return all(map(isfinite, numbers))


def is_in_range(sample: Sample) -> bool:
    """Whether position and velocity are such as an aircraft can have."""
    if sample.velocity is not None and not hypot(*sample.velocity) <= LARGEST_SPEED:
        return False
    if _is_local(sample):
        return all(abs(x) <= LARGEST_LOCAL for x in sample.local_position)
    return (
        abs(sample.latitude) <= 90.0
        and abs(sample.longitude) <= 180.0
        and all(HEIGHTS[0] <= height <= HEIGHTS[1] for height in _heights(sample))
    )


def is_zero_position(sample: Sample) -> bool:
    """Whether it is at latitude and longitude 0 or near, where no fix has been yet."""
    return not _is_local(sample) and max(abs(sample.latitude), abs(sample.longitude)) <= START_UP


def has_fix(sample: Sample) -> bool:
    """Whether nothing that the source says about the fix speaks against the position."""
    if sample.fix_type is not None and sample.fix_type < FIX_3D:
        return False
    if sample.satellites is not None and sample.satellites < FEWEST_SATELLITES:
        return False
    return not sample.horizontal_accuracy > POOREST_ACCURACY  # nan is not known


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


def _heights(sample: Sample) -> list[float]:
    """The heights that were sent."""
    heights = (sample.altitude_amsl, sample.altitude_ellipsoid, sample.height_above_home)
    return [height for height in heights if not isnan(height)]


def _mirror_images(sample: Sample) -> list[Sample]:
    """The sample with the mistakes in its position undone that senders make."""
    if _is_local(sample):
        return []
    latitude, longitude = sample.latitude, sample.longitude
    images = [(-latitude, longitude), (latitude, -longitude), (-latitude, -longitude)]
    if abs(longitude) <= 90.0:
        images.append((longitude, latitude))
    return [replace(sample, latitude=north, longitude=east) for north, east in images]


def _spot(sample: Sample):
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
