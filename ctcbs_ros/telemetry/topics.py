"""ROS messages to samples, whether a subscription or a bag brings them.

Only the fields of the messages are read, so that rclpy's and rosbags' own classes serve alike:
sensor_msgs/NavSatFix, nav_msgs/Odometry, geometry_msgs/PoseStamped with TwistStamped, and
geometry_msgs/TwistWithCovarianceStamped for the wind.
"""

from math import hypot, isfinite, nan, sqrt
from typing import Any

from ctcbs_ros.telemetry.between_samples import BetweenSamples
from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.evidence import FIX_3D, NO_FIX
from ctcbs_ros.telemetry.sample import Sample, Vector

# sensor_msgs/NavSatStatus.status and NavSatFix.position_covariance_type
STATUS_NO_FIX, STATUS_FIX = -1, 0
COVARIANCE_TYPE_UNKNOWN = 0
# A velocity belongs to a fix when their stamps are no farther apart than this [s]; an aircraft in
# its tightest turn changes course by a few degrees meanwhile.
SAME_TIME = 0.1
# Kinds of position, the better the higher.
POSE, ODOMETRY, FIX = range(3)
# Frame of a twist that is not towards east, north, up (REP 105).
BODY_FRAME = "base_link"


class TopicSamples:
    """Samples of one aircraft that publishes a fix, an odometry, a pose, or several of them.

    Positions come from the fix once it has been heard, as only it knows where on the Earth they
    are; until then, or without it, from the odometry, or else the pose, in its local frame. The
    velocity is that of the odometry, or of the twist, of the same time. Samples are timed by their
    header stamps; a stamp that steps back by more than a late message explains (a bag played
    again) begins a new flight.

    Parameters
    ----------
    clock : VehicleClock, optional
    best : int
        The best kind of position that there is, where known already: POSE, ODOMETRY or FIX.

    Attributes
    ----------
    best : int
        Of the kinds of position heard.
    """

    def __init__(self, clock: VehicleClock | None = None, best: int = POSE):
        self.best = best
        self._between = BetweenSamples()
        self._clock = clock or VehicleClock()
        self._frames = 0
        self._has_odometry = False  # with a velocity
        self._velocity: Vector | None = None
        self._velocity_ns = 0
        self._speed_accuracy = nan

    @property
    def wind(self) -> Vector | None:
        """Newest wind, towards east, north, up [m/s]."""
        return self._between.wind

    def fix(self, message: Any, receive_us: int | None = None) -> Sample:
        """The sample of a fix; its altitude is above the ellipsoid, as the message defines it.

        `receive_us` is when the message was received, microseconds since the Unix epoch; it only
        tells a gap from a jump of the clock.
        """
        self._is_best(FIX)
        stamp_ns = nanoseconds(message.header.stamp)
        velocity, speed_accuracy = self._velocity_at(stamp_ns)
        accuracy = nan
        if message.position_covariance_type != COVARIANCE_TYPE_UNKNOWN:
            accuracy = _deviation(message.position_covariance, (0, 4))
        return self._sample(
            stamp_ns,
            receive_us,
            latitude=message.latitude,
            longitude=message.longitude,
            altitude_ellipsoid=message.altitude,
            velocity=velocity,
            fix_type=_fix_type(message.status.status),
            horizontal_accuracy=accuracy,
            speed_accuracy=speed_accuracy,
        )

    def odometry(self, message: Any, receive_us: int | None = None) -> Sample | None:
        """The sample of an odometry; None where it only gives the velocity of the fixes."""
        stamp_ns = nanoseconds(message.header.stamp)
        velocity = velocity_enu(message)
        self._has_odometry |= velocity is not None
        speed_accuracy = _deviation(message.twist.covariance, (0, 7))
        self._velocity, self._velocity_ns = velocity, stamp_ns
        self._speed_accuracy = speed_accuracy
        if not self._is_best(ODOMETRY):
            return None
        position = message.pose.pose.position
        return self._sample(
            stamp_ns,
            receive_us,
            local_position=(position.x, position.y, position.z),
            velocity=velocity,
            horizontal_accuracy=_deviation(message.pose.covariance, (0, 7)),
            speed_accuracy=speed_accuracy,
        )

    def pose(self, message: Any, receive_us: int | None = None) -> Sample | None:
        """The sample of a pose (ENU); None where there are better positions."""
        if not self._is_best(POSE):
            return None
        stamp_ns = nanoseconds(message.header.stamp)
        velocity, speed_accuracy = self._velocity_at(stamp_ns)
        position = message.pose.position
        return self._sample(
            stamp_ns,
            receive_us,
            local_position=(position.x, position.y, position.z),
            velocity=velocity,
            speed_accuracy=speed_accuracy,
        )

    def twist(self, message: Any, receive_us: int | None = None) -> None:
        """Take in the velocity of the poses or fixes of its time, towards east, north, up."""
        if self._has_odometry or message.header.frame_id.endswith(BODY_FRAME):
            return
        v = message.twist.linear
        self._velocity = (v.x, v.y, v.z)
        self._velocity_ns = nanoseconds(message.header.stamp)
        self._speed_accuracy = nan

    def wind_estimation(self, message: Any, receive_us: int | None = None) -> None:
        """Take in the wind of mavros: where the air moves to, towards east, north, up."""
        v = message.twist.twist.linear
        if isfinite(v.x) and isfinite(v.y):
            wind = v.x, v.y, v.z if isfinite(v.z) else 0.0
            self._between.hear_wind(wind, _deviation(message.twist.covariance, (0, 7)))

    def _velocity_at(self, stamp_ns: int) -> tuple[Vector | None, float]:
        """Velocity and its accuracy, if they are of that time."""
        if abs(stamp_ns - self._velocity_ns) <= SAME_TIME * 1e9:
            return self._velocity, self._speed_accuracy
        return None, nan

    def _is_best(self, kind: int) -> bool:
        """Whether no better kind of position has been heard."""
        if kind > self.best:
            self.best = kind
            self._frames += 1  # another frame than that of before: another flight
        return kind == self.best

    def _sample(self, stamp_ns: int, receive_us: int | None, **fields) -> Sample:
        time_us = self._clock.advance(stamp_ns // 1000, receive_us)
        return Sample(
            time=time_us / 1e6,
            stamp_ns=stamp_ns,
            flight=self._clock.flight + self._frames,
            **self._between.tell(time_us),
            **fields,
        )


def velocity_enu(message: Any) -> Vector | None:
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
    if status >= STATUS_FIX:
        return FIX_3D
    return NO_FIX if status == STATUS_NO_FIX else None  # None: it does not say


def nanoseconds(stamp) -> int:
    """A message's stamp in nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _deviation(covariance, diagonal: tuple[int, int]) -> float:
    """Standard deviation out of two variances of a covariance; nan where they are not set."""
    variance = max(covariance[index] for index in diagonal)
    return sqrt(variance) if variance > 0.0 else nan
