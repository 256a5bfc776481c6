"""Predictions to messages. Stamps are the sample's time; what is not finite is never published."""

from math import cos, isfinite, sin

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    PointStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    Vector3,
    Vector3Stamped,
)
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Header

from ctcbs_ros.beacon.difference import Difference
from ctcbs_ros.geodesy import Datum
from ctcbs_ros.prediction.prediction import Prediction


def header(prediction: Prediction, frame_id: str) -> Header:
    """Header with the time of the sample."""
    return stamped(prediction.stamp_ns, frame_id)


def stamped(stamp_ns: int, frame_id: str) -> Header:
    """Header with a time."""
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame_id)


def end_mass_pose(prediction: Prediction, frame_id: str) -> PoseWithCovarianceStamped:
    """Pose of the end mass of a valid prediction: x forward along its motion, z up."""
    end_mass = prediction.end_mass
    message = PoseWithCovarianceStamped(header=header(prediction, frame_id))
    message.pose.pose.position = point(end_mass.position)
    message.pose.pose.orientation = Quaternion(
        z=sin(end_mass.yaw / 2), w=cos(end_mass.yaw / 2)
    )
    message.pose.covariance = end_mass.covariance.ravel()
    return message


def simulated_pose(prediction: Prediction, frame_id: str) -> PoseWithCovarianceStamped:
    """The twin's pose of the end mass, the same way."""
    simulated = prediction.simulated
    message = PoseWithCovarianceStamped(header=header(prediction, frame_id))
    message.pose.pose.position = point(simulated.position)
    message.pose.pose.orientation = Quaternion(
        z=sin(simulated.yaw / 2), w=cos(simulated.yaw / 2)
    )
    message.pose.covariance = simulated.covariance.ravel()
    return message


def end_mass_fix(prediction: Prediction, frame_id: str) -> NavSatFix | None:
    """Geodetic position of the end mass of a valid prediction; None where no datum is known."""
    geodetic = prediction.end_mass.geodetic
    if not isfinite(geodetic.latitude + geodetic.longitude + geodetic.altitude):
        return None
    message = NavSatFix(
        header=header(prediction, frame_id),
        latitude=geodetic.latitude,
        longitude=geodetic.longitude,
        altitude=geodetic.altitude,
        position_covariance=prediction.end_mass.covariance[:3, :3].ravel(),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_KNOWN,
    )
    message.status.status = NavSatStatus.STATUS_FIX
    return message


def orbit_center(prediction: Prediction, frame_id: str) -> PointStamped:
    """Centre of the circle of a prediction that has an orbit."""
    return PointStamped(
        header=header(prediction, frame_id), point=point(prediction.orbit.center)
    )


def datum_fix(datum: Datum, prediction: Prediction, frame_id: str) -> NavSatFix:
    """Origin of the local frame, as first known from the sample of a prediction."""
    message = NavSatFix(
        header=header(prediction, frame_id),
        latitude=datum.latitude,
        longitude=datum.longitude,
        altitude=datum.altitude,
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
    message.status.status = NavSatStatus.STATUS_FIX
    return message


def difference(found: Difference, stamp_ns: int, frame_id: str) -> Vector3Stamped:
    """Measured minus another position: a free vector, which tf turns and never moves."""
    x, y, z = found.enu.tolist()
    return Vector3Stamped(header=stamped(stamp_ns, frame_id), vector=Vector3(x=x, y=y, z=z))


def point(position: np.ndarray) -> Point:
    """A position, (3,), as a message."""
    x, y, z = position.tolist()
    return Point(x=x, y=y, z=z)
