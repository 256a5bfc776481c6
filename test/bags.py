"""ROS 2 bags written with rosbags, and the messages in them."""

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
PLUGINS = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
FIX, ODOM = "/mavros/global_position/global", "/mavros/local_position/odom"
POSE, TWIST = "/mavros/local_position/pose", "/mavros/local_position/velocity_local"
WIND = "/mavros/wind_estimation"
UNKNOWN = np.zeros(36)


def make(name, *fields, **named):
    package, kind = name.split("/")
    return TYPES.types[f"{package}/msg/{kind}"](*fields, **named)


def header(stamp_ns, frame="map"):
    stamp = make("builtin_interfaces/Time", *divmod(stamp_ns, 10**9))
    return make("std_msgs/Header", stamp, frame)


def vector(values):
    return make("geometry_msgs/Vector3", *map(float, values))


def fix(stamp_ns, latitude=47.4, longitude=8.5, altitude=547.0, accuracy=1.5, status=0):
    covariance = np.diag([accuracy**2, accuracy**2, 9.0]).ravel()
    return make(
        "sensor_msgs/NavSatFix", header(stamp_ns, "gps"),
        make("sensor_msgs/NavSatStatus", status, 1), latitude, longitude, altitude, covariance, 2,
    )  # fmt: skip


def pose_of(position):
    return make(
        "geometry_msgs/Pose", make("geometry_msgs/Point", *map(float, position)),
        make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0),
    )  # fmt: skip


def odometry(stamp_ns, velocity=(4.0, 3.0, 2.0), position=(7.0, 0.0, 0.0), speed_accuracy=0.25):
    """An odometry of a body that points east, so that its axes are east, north, up."""
    zero = vector((0.0, 0.0, 0.0))
    covariance = np.zeros(36)
    covariance[[0, 7, 14]] = speed_accuracy**2
    return make(
        "nav_msgs/Odometry", header(stamp_ns), "base_link",
        make("geometry_msgs/PoseWithCovariance", pose_of(position), UNKNOWN),
        make(
            "geometry_msgs/TwistWithCovariance",
            make("geometry_msgs/Twist", vector(velocity), zero), covariance,
        ),
    )  # fmt: skip


def pose(stamp_ns, position=(7.0, 0.0, 0.0)):
    return make("geometry_msgs/PoseStamped", header(stamp_ns), pose_of(position))


def twist(stamp_ns, velocity=(4.0, 3.0, 2.0), frame="map"):
    both = make("geometry_msgs/Twist", vector(velocity), vector((0, 0, 0)))
    return make("geometry_msgs/TwistStamped", header(stamp_ns, frame), both)


def wind(stamp_ns, velocity):
    both = make("geometry_msgs/Twist", vector(velocity), vector((0, 0, 0)))
    with_covariance = make("geometry_msgs/TwistWithCovariance", both, UNKNOWN)
    return make("geometry_msgs/TwistWithCovarianceStamped", header(stamp_ns), with_covariance)


def write_bag(
    folder, messages, kind="db3", delay_ns=40_000_000, compression=None, altered=lambda data: data
):
    """Write (topic, message) as received some time after their stamps; returns the folder."""
    writer = Writer(folder, version=9, storage_plugin=PLUGINS[kind])
    if compression:
        writer.set_compression(*compression)
    with writer:
        connections = {}
        for topic, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, message.__msgtype__, typestore=TYPES
                )
            stamp = message.header.stamp
            received = stamp.sec * 10**9 + stamp.nanosec + delay_ns
            data = TYPES.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], received, altered(bytes(data)))
    return folder
