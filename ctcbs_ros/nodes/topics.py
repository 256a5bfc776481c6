"""NavSatFix and Odometry messages to samples."""

import time
from math import hypot, nan, sqrt

from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix, NavSatStatus

from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.sample import Sample, Vector

# MAVLink GPS_FIX_TYPE, as `Sample.fix_type` has it.
NO_FIX, FIX_3D = 1, 3
# A velocity belongs to a fix when their stamps are no farther apart than this [s]; an aircraft in
# its tightest turn changes course by a few degrees meanwhile.
SAME_TIME = 0.1


class TopicSamples:
    """Samples of one aircraft that publishes `fix`, `odom` or both.

    Positions come from `fix` once it has been heard, as only it knows where on the Earth they are;
    `odom` then gives their velocities. Until then, or without `fix`, `odom` gives both, in its own
    local frame. Samples are timed by their header stamps; a stamp that steps back by more than a
    late message explains (a bag played again) begins a new flight.
    """

    def __init__(self):
        self._clock = VehicleClock()
        self._has_fix = False
        self._velocity: Vector | None = None
        self._velocity_ns = 0
        self._speed_accuracy = nan
        self._frames = 0

    def fix(self, message: NavSatFix) -> Sample:
        """The sample of a fix; its altitude is above the ellipsoid, as the message defines it."""
        if not self._has_fix:
            self._has_fix = True
            self._frames += 1  # another frame than that of `odom`: another flight
        stamp_ns = nanoseconds(message.header.stamp)
        with_velocity = abs(stamp_ns - self._velocity_ns) <= SAME_TIME * 1e9
        accuracy = nan
        if message.position_covariance_type != NavSatFix.COVARIANCE_TYPE_UNKNOWN:
            accuracy = _deviation(message.position_covariance, (0, 4))
        return Sample(
            time=self._time(stamp_ns),
            stamp_ns=stamp_ns,
            flight=self._flight,
            latitude=message.latitude,
            longitude=message.longitude,
            altitude_ellipsoid=message.altitude,
            velocity=self._velocity if with_velocity else None,
            fix_type=_fix_type(message.status.status),
            horizontal_accuracy=accuracy,
            speed_accuracy=self._speed_accuracy if with_velocity else nan,
        )

    def odometry(self, message: Odometry) -> Sample | None:
        """The sample of an odometry; None where it only gives the velocity of the fixes."""
        stamp_ns = nanoseconds(message.header.stamp)
        velocity = velocity_enu(message)
        speed_accuracy = _deviation(message.twist.covariance, (0, 7))
        self._velocity, self._velocity_ns = velocity, stamp_ns
        self._speed_accuracy = speed_accuracy
        if self._has_fix:
            return None
        position = message.pose.pose.position
        return Sample(
            time=self._time(stamp_ns),
            stamp_ns=stamp_ns,
            flight=self._flight,
            local_position=(position.x, position.y, position.z),
            velocity=velocity,
            horizontal_accuracy=_deviation(message.pose.covariance, (0, 7)),
            speed_accuracy=speed_accuracy,
        )

    def _time(self, stamp_ns: int) -> float:
        return self._clock.advance(stamp_ns // 1000, time.time_ns() // 1000) / 1e6

    @property
    def _flight(self) -> int:
        return self._clock.flight + self._frames


def velocity_enu(message: Odometry) -> Vector | None:
    """Velocity towards east, north, up [m/s] of an odometry, whose twist is in the body's frame.

    None where the orientation is no rotation (all zero, as if not set).
    """
    q = message.pose.pose.orientation
    norm = hypot(q.w, q.x, q.y, q.z)
    if not norm > 1e-6:
        return None
    w, x, y, z = q.w / norm, q.x / norm, q.y / norm, q.z / norm
    v = message.twist.twist.linear
    return (
        (1 - 2 * (y * y + z * z)) * v.x + 2 * (x * y - w * z) * v.y + 2 * (x * z + w * y) * v.z,
        2 * (x * y + w * z) * v.x + (1 - 2 * (x * x + z * z)) * v.y + 2 * (y * z - w * x) * v.z,
        2 * (x * z - w * y) * v.x + 2 * (y * z + w * x) * v.y + (1 - 2 * (x * x + y * y)) * v.z,
    )


def _fix_type(status: int) -> int | None:
    if status >= NavSatStatus.STATUS_FIX:
        return FIX_3D
    return NO_FIX if status == NavSatStatus.STATUS_NO_FIX else None  # None: it does not say


def nanoseconds(stamp) -> int:
    """A message's stamp in nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _deviation(covariance, diagonal: tuple[int, int]) -> float:
    """Standard deviation out of two variances of a covariance; nan where they are not set."""
    variance = max(covariance[index] for index in diagonal)
    return sqrt(variance) if variance > 0.0 else nan
