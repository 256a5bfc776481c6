"""The example messages against the running node: it takes the inputs and publishes the outputs."""

import array
import json
from functools import partial
from math import cos, isnan, pi, radians, sin
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    PointStamped,
    PoseStamped,
    PoseWithCovarianceStamped,
    TwistStamped,
    TwistWithCovarianceStamped,
)
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from running_node import RunningNode
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Float64, String
from visualization_msgs.msg import MarkerArray

from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.telemetry.topics import nanoseconds, velocity_enu

EXAMPLES = Path(__file__).parents[1] / "msg_examples"
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)

# The flight that the examples are a moment of: anticlockwise over Zurich, no noise.
RADIUS, SPEED, TURNS, RATE = 60.0, 20.0, 2.0, 5.0
CENTER = Datum(47.4, 8.5, 700.0, True)
LAST_STAMP_NS = 1_767_268_800_000_000_000  # 2026-01-01 12:00 UTC
LAST_ANGLE = radians(30.0)

INPUTS = {"fix": NavSatFix, "odom": Odometry}
LOCAL_INPUTS = {
    "pose": PoseStamped, "velocity": TwistStamped, "wind": TwistWithCovarianceStamped
}  # fmt: skip
OUTPUTS = {
    "end_mass_pose": ("/predictor/end_mass/pose", PoseWithCovarianceStamped, 10),
    "end_mass_simulated_pose": (
        "/predictor/end_mass/simulated_pose", PoseWithCovarianceStamped, 10,
    ),
    "end_mass_fix": ("/predictor/end_mass/fix", NavSatFix, 10),
    "orbit_center": ("/predictor/orbit_center", PointStamped, 10),
    "stability_margin": ("/predictor/stability_margin", Float64, 10),
    "jump_margin": ("/predictor/jump_margin", Float64, 10),
    "cable": ("/predictor/cable", MarkerArray, 10),
    "prediction": ("/predictor/prediction", String, 10),
    "datum": ("/predictor/datum", NavSatFix, LATCHED),
    "diagnostics": ("/diagnostics", DiagnosticArray, 10),
}

MARGINS = ("stability_margin", "jump_margin")
OF_BEACON = {"beacon", "measured_minus_predicted"}  # see test_beacon_node.py

UNCERTAINTY = (
    "_std_m", "_std_m_s", "rms_residual_m", "climb_rate_m_s", "arc_rad", "samples", "residual",
)  # fmt: skip


def example(name):
    return yaml.safe_load((EXAMPLES / f"{name}.yaml").read_text())


def flight():
    """Fix and odometry of each moment; the last are the example messages."""
    count = round(2.0 * pi * RADIUS * TURNS / SPEED * RATE)
    for number in range(-count, 1):
        seconds = number / RATE
        angle = LAST_ANGLE + SPEED / RADIUS * seconds
        east, north = RADIUS * cos(angle), RADIUS * sin(angle)
        latitude, longitude, altitude = to_geodetic(CENTER, east, north, 0.0)
        fix = NavSatFix(latitude=latitude, longitude=longitude, altitude=altitude)
        # What is flown has no noise: the orbit is not to be corrected for what 1.5 m would do.
        fix.position_covariance = np.diag([1e-6, 1e-6, 1e-6]).ravel()
        fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        fix.header.frame_id = "gps"
        fix.status.status = NavSatStatus.STATUS_FIX
        odom = Odometry(child_frame_id="base_link")
        odom.header.frame_id = "map"
        odom.pose.pose.position.x, odom.pose.pose.position.y = east, north
        odom.pose.pose.position.z = 200.0
        yaw = angle + pi / 2  # along the circle, the nose ahead
        odom.pose.pose.orientation.z, odom.pose.pose.orientation.w = sin(yaw / 2), cos(yaw / 2)
        odom.twist.twist.linear.x = SPEED
        odom.twist.twist.angular.z = SPEED / RADIUS
        stamp_ns = LAST_STAMP_NS + round(seconds * 1e9)
        for message in (fix, odom):
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        yield fix, odom


def newest_stamp_ns(node):
    """Stamp of the sample that the node has taken last; 0 before the first."""
    records = node.received["prediction"]
    return json.loads(records[-1].data)["stamp_ns"] if records else 0


def is_taken(node, fix):
    """Whether the node has taken a fix, or one after it."""
    return newest_stamp_ns(node) >= nanoseconds(fix.header.stamp)


def as_data(message):
    """A message as YAML shows it: nested mappings, lists, numbers and texts."""
    if hasattr(message, "get_fields_and_field_types"):
        return {
            name: as_data(getattr(message, name)) for name in message.get_fields_and_field_types()
        }
    if isinstance(message, bytes):
        return message[0]
    if isinstance(message, list | tuple | array.array | np.ndarray):
        return [as_data(item) for item in message]
    return message.item() if isinstance(message, np.generic) else message


def as_message(message_type, data):
    """A message with the fields of an example; those that it leaves out keep their defaults."""
    message = message_type()
    for name, value in data.items():
        field = getattr(message, name)
        if isinstance(value, dict):
            value = as_message(type(field), value)
        setattr(message, name, value)
    return message


def assert_same(found, expected, where):
    """The same names and texts, and numbers as near as the orbit is known without noise.

    Its stated uncertainty is the estimator's business, and only has to be there.
    """
    if isinstance(expected, dict):
        assert set(found) == set(expected), where
        for name in expected:
            assert_same(found[name], expected[name], f"{where}.{name}")
    elif isinstance(expected, list):
        assert len(found) == len(expected), where
        for number, item in enumerate(expected):
            assert_same(found[number], item, f"{where}[{number}]")
    elif where.endswith(UNCERTAINTY) or "covariance[" in where:
        assert type(found) is type(expected), where
    elif isinstance(expected, float):
        degrees = where.endswith(("latitude", "longitude", "latitude_deg", "longitude_deg"))
        tolerance = {"abs": 1e-7} if degrees else {"rel": 1e-4, "abs": 1e-3}
        assert found == pytest.approx(expected, **tolerance), where
    else:
        assert found == expected, where


@pytest.fixture(scope="module")
def flown(tmp_path_factory, drone_table):
    """The node after the flight, by mavros's topics, and all it published."""
    folder = tmp_path_factory.mktemp("flown")
    parameters = {
        "table.file": quoted(str(drone_table)), "diagnostics.period": 0.1,
        "limits.stale_after": 5.0,  # not sooner than the markers go
        "wind.speed": 0.0, "wind.from_direction": 0.0, "wind.accuracy": 0.4,
    }  # fmt: skip
    with RunningNode(folder, parameters) as node:
        node.received = {
            name: node.messages(message_type, topic, qos)
            for name, (topic, message_type, qos) in OUTPUTS.items()
        }
        fixes = node.observer.create_publisher(NavSatFix, "mavros/global_position/global", 10)
        # Kept for the tests: the node may see a new publisher later than that one sees the node.
        node.fixes = fixes
        odoms = node.observer.create_publisher(Odometry, "mavros/local_position/odom", 10)
        node.wait_until(
            lambda: fixes.get_subscription_count() and odoms.get_subscription_count()
        )
        node.wait_until_ready()

        for fix, odom in flight():
            first = not newest_stamp_ns(node)
            while not is_taken(node, fix):  # the first may be lost
                if not first:  # the first position is to be that of a fix
                    odoms.publish(odom)
                    # Two topics keep no order, but what came before a request is taken before it.
                    node.call(GetParameters, "/predictor/get_parameters", GetParameters.Request())
                fixes.publish(fix)
                node.spin(0.5 if first else 60.0, partial(is_taken, node, fix))
        node.wait_until(lambda: all_received(node.received))
        yield node


def known(margins):
    """Those that are numbers: a nan follows when the silence after the flight is seen."""
    return [margin for margin in margins if not isnan(margin.data)]


def all_received(received):
    """Whether the last message of each topic is there."""
    if not all(received.values()):
        return False
    poses, arrays = received["end_mass_pose"], received["diagnostics"]
    counted = {pair.key: pair.value for pair in arrays[-1].status[0].values}["samples"]
    return (
        nanoseconds(poses[-1].header.stamp) == LAST_STAMP_NS
        and nanoseconds(received["end_mass_fix"][-1].header.stamp) == LAST_STAMP_NS
        and nanoseconds(received["orbit_center"][-1].header.stamp) == LAST_STAMP_NS
        and all(len(received[name]) >= len(poses) for name in MARGINS)
        and nanoseconds(received["cable"][-1].markers[-1].header.stamp) == LAST_STAMP_NS
        and counted == str(len(received["prediction"]))
    )


@pytest.mark.parametrize("name", INPUTS)
def test_input_example_is_the_last_message_of_the_flight(name):
    message = as_message(INPUTS[name], example(name))
    last = dict(zip(INPUTS, list(flight())[-1], strict=True))[name]
    assert_same(as_data(message), as_data(last), name)


def test_there_is_an_example_of_each_topic():
    examples = {path.stem for path in EXAMPLES.glob("*.yaml")}
    assert examples == {*INPUTS, *LOCAL_INPUTS, *OUTPUTS, *OF_BEACON, "summary"}


def test_examples_of_pose_velocity_and_wind_are_of_the_same_moment():
    pose, velocity, wind = (as_message(LOCAL_INPUTS[name], example(name)) for name in LOCAL_INPUTS)
    odom = as_message(Odometry, example("odom"))
    assert_same(as_data(pose.pose.position), as_data(odom.pose.pose.position), "pose")
    assert pose.header.stamp == velocity.header.stamp == odom.header.stamp
    v = velocity.twist.linear
    assert (v.x, v.y, v.z) == pytest.approx(velocity_enu(odom), abs=1e-6)
    w = wind.twist.twist.linear
    assert (w.x, w.y) == pytest.approx((7 * sin(radians(31)), 7 * cos(radians(31))), abs=1e-6)


@pytest.mark.parametrize(
    "name",
    ["end_mass_pose", "end_mass_fix", "orbit_center", *MARGINS, "datum"],
)
def test_output_example_is_what_the_node_publishes(flown, name):
    received = flown.received[name]
    last = (known(received) if name in MARGINS else received)[-1]
    assert_same(as_data(last), example(name), name)


def test_cable_example_is_what_the_node_publishes_without_most_points(flown):
    found = as_data(flown.received["cable"][-1])
    for marker in found["markers"]:
        assert len(marker["points"]) > 40
        marker["points"] = marker["points"][:2]
    assert_same(found, example("cable"), "cable")


def test_prediction_example_is_what_the_node_publishes(flown):
    found = json.loads(flown.received["prediction"][-1].data)
    assert_same(found, json.loads(example("prediction")["data"]), "prediction")


def test_diagnostics_example_has_the_levels_names_and_keys_that_the_node_publishes(flown):
    found, shown = as_data(flown.received["diagnostics"][-1]), example("diagnostics")
    assert set(found) == set(shown)
    for status, expected in zip(found["status"], shown["status"], strict=True):
        keys, expected_keys = (
            [pair["key"] for pair in data.pop("values")] for data in (status, expected)
        )
        assert keys == expected_keys
        assert status == expected


def test_poses_go_round_with_the_sample_times_of_the_fixes(flown):
    stamps = [nanoseconds(message.header.stamp) for message in flown.received["end_mass_pose"]]
    assert np.diff(stamps) == pytest.approx(np.full(len(stamps) - 1, 0.2e9))
    assert stamps[-1] == LAST_STAMP_NS


def test_change_of_the_cable_in_flight_changes_the_next_prediction(flown):
    value = ParameterValue(type=3, double_value=120.0)
    request = SetParameters.Request(parameters=[Parameter(name="cable.length", value=value)])
    (result,) = flown.call(SetParameters, "/predictor/set_parameters", request).results
    assert result.successful
    before = json.loads(flown.received["prediction"][-1].data)
    fix, _ = list(flight())[-1]
    fix.header.stamp.nanosec += 10_000_000
    flown.fixes.publish(fix)
    count = len(flown.received["prediction"])
    flown.wait_until(lambda: len(flown.received["prediction"]) > count)
    after = json.loads(flown.received["prediction"][-1].data)
    # a 30 m shorter line hangs less deep
    assert after["end_mass_depth_m"] < before["end_mass_depth_m"] - 15.0
