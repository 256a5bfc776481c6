"""The payload's beacon through the real node: from a log as through the core, and from a topic."""

import json
from functools import partial
from math import cos, pi, sin

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from beacon_flight import DRONE, OFFSET, STILL, SYSTEM, fly
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from running_node import RunningNode
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import String

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.table.storage import load_table
from ctcbs_ros.telemetry.topics import nanoseconds

KEEP_ALL = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)


def with_beacon(folder):
    """The drone's parameter file in still air, with the beacon of the simulated flights."""
    text = DRONE.read_text()
    for before, after in (
        ("system_id: 0", f"system_id: {SYSTEM}"), ("speed: .nan", "speed: 0.0"),
        ("from_direction: .nan", "from_direction: 0.0"), ("accuracy: 2.0", "accuracy: 0.2"),
    ):  # fmt: skip
        assert before in text
        text = text.replace(before, after)
    file = folder / "drone.yaml"
    file.write_text(text)
    return file


def test_a_beacon_in_a_log_comes_through_the_node_as_through_the_core(tmp_path, drone_table):
    file = with_beacon(tmp_path)
    configuration = load_configuration(file)
    table = load_table(drone_table, configuration)
    fly(tmp_path, table, turns=3.0)
    log = tmp_path / "flight.tlog"

    summaries, tables = {}, {}
    for way in ("core", "node"):
        out = tmp_path / way
        arguments = ["replay", log, "--config", file, "--table", drone_table]
        arguments += ["--through", way, "--out", out]
        assert main(list(map(str, arguments))) == 0
        tables[way] = (out / "beacon.csv").read_text()
        summaries[way] = json.loads((out / "summary.json").read_text())
    core = summaries["core"]
    assert tables["node"] == tables["core"]
    assert summaries["node"]["beacon"] == core["beacon"]
    assert tables["core"].count("\n") - 1 == core["beacon"]["reports"] > 400
    assert core["beacon"]["vehicle"]["system"] == SYSTEM
    settled = core["beacon"]["measured_minus_predicted"]["settled"]
    assert settled["count"] > 100
    # of the entry some metres are left in the first of these
    np.testing.assert_allclose(settled["mean_m"], OFFSET, atol=2.0)


def test_a_topic_is_held_against_the_prediction_and_published_once_settled(tmp_path, drone_table):
    parameters = {
        "table.file": quoted(str(drone_table)), "beacon.topic": "payload/fix",
        "diagnostics.period": 0.1, "limits.stale_after": 600.0,
        **dict(setting.split("=") for setting in STILL),
    }  # fmt: skip
    with RunningNode(tmp_path, parameters) as node:
        topic = "/predictor/end_mass/measured_minus_predicted"
        off = node.messages(Vector3Stamped, topic, KEEP_ALL)
        records = node.messages(String, "/predictor/beacon", KEEP_ALL)
        taken = node.messages(String, "/predictor/prediction", KEEP_ALL)
        poses = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", KEEP_ALL)
        told = node.messages(DiagnosticArray, "/diagnostics", KEEP_ALL)
        send = {
            name: node.observer.create_publisher(kind, topic, 10)
            for name, kind, topic in (
                ("fix", NavSatFix, "mavros/global_position/global"),
                ("odom", Odometry, "mavros/local_position/odom"),
                ("beacon", NavSatFix, "payload/fix"),
            )
        }
        node.wait_until(lambda: all(p.get_subscription_count() for p in send.values()))
        node.wait_until_ready()
        for number in range(110):
            last = fly_on(node, send, taken, records, number)
        node.wait_until(lambda: off and nanoseconds(off[-1].header.stamp) == last)
        node.wait_until(
            lambda: told and beacon_status(told[-1])["reports"] == str(len(records))
        )

        found = [json.loads(record.data) for record in records]
        settled = {r["stamp_ns"]: r for r in found if r["outcome"] == "settled"}
        assert len(settled) > 10
        assert {nanoseconds(message.header.stamp) for message in off} == set(settled)
        assert {r["outcome"] for r in found[1:]} == {"NO_PREDICTION", "settling", "settled"}
        places = {nanoseconds(pose.header.stamp): pose.pose.pose.position for pose in poses}
        flown = {r["stamp_ns"]: r for r in (json.loads(one.data) for one in taken)}
        for message in off:
            stamp = nanoseconds(message.header.stamp)
            number = round((stamp - START_NS) / 1e9 / INTERVAL)
            for axis, name, beside in zip("xyz", AXES, beside_aircraft(number), strict=True):
                measured = flown[stamp][f"tow_point_{name}_m"] + beside
                expected = measured - getattr(places[stamp], axis)
                assert getattr(message.vector, axis) == pytest.approx(expected, abs=0.01)
                assert settled[stamp][f"measured_minus_predicted_{name}_m"] == pytest.approx(
                    getattr(message.vector, axis)
                )
        assert {r["time_by"] for r in found[1:]} == {"header stamps"}
        assert "standard deviations (settled)" in beacon_status(told[-1])["message"]

        # the examples are such messages
        shown = example("beacon")
        assert set(json.loads(shown["data"])) == set(found[-1])
        assert json.loads(shown["data"])["outcome"] == "settled"
        shown = example("measured_minus_predicted")
        assert set(shown) == {"header", "vector"} == set(off[-1].get_fields_and_field_types())
        assert shown["header"]["frame_id"] == off[-1].header.frame_id == "map"
        assert set(shown["vector"]) == set("xyz")


def example(name):
    file = DRONE.parents[1] / "msg_examples" / f"{name}.yaml"
    return yaml.safe_load(file.read_text())


AXES = ("east", "north", "up")
RADIUS, RATE, INTERVAL = 60.0, 20.0 / 60.0, 0.5
CENTER = Datum(47.4, 8.5, 700.0, True)
BEACON = (4.0, -7.0, -100.0)  # m from the circle's centre
START_NS = 1_767_268_800_000_000_000


def fly_on(node, send, taken, records, number):
    """Publish one moment of the flight, as often as it takes; returns its stamp."""
    angle, stamp = RATE * INTERVAL * number, START_NS + int(number * INTERVAL * 1e9)
    odom = Odometry(child_frame_id="base_link")
    yaw = angle + pi / 2
    odom.pose.pose.orientation.z, odom.pose.pose.orientation.w = sin(yaw / 2), cos(yaw / 2)
    odom.twist.twist.linear.x = RADIUS * RATE
    fix, beacon = fix_at(aircraft_at(number)), fix_at(beacon_at(number))
    for message in (odom, fix, beacon):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)

    def is_taken():
        return bool(taken) and json.loads(taken[-1].data)["stamp_ns"] == stamp

    def is_compared(before):
        return len(records) > before

    while not is_taken():  # the first may be lost
        send["odom"].publish(odom)
        node.spin(0.01)
        send["fix"].publish(fix)
        node.spin(0.5 if number == 0 else 60.0, is_taken)
    before = len(records)
    while not is_compared(before):
        send["beacon"].publish(beacon)
        node.spin(0.5 if number == 0 else 60.0, partial(is_compared, before))
    return stamp


def aircraft_at(number):
    angle = RATE * INTERVAL * number
    return RADIUS * cos(angle), RADIUS * sin(angle), 0.0


def beside_aircraft(number):
    """The beacon's position less the aircraft's."""
    return np.subtract(beacon_at(number), aircraft_at(number)).tolist()


def beacon_at(number):
    """Where the beacon is: almost still, as one that stood on the centimetre would be frozen."""
    return BEACON[0] + 0.04 * (number % 2), *BEACON[1:]


def fix_at(position):
    latitude, longitude, altitude = to_geodetic(CENTER, *position)
    fix = NavSatFix(latitude=latitude, longitude=longitude, altitude=altitude)
    fix.position_covariance = np.diag([1e-4, 1e-4, 1e-4]).ravel()
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    fix.status.status = NavSatStatus.STATUS_FIX
    return fix


def beacon_status(array):
    """Values and message of the beacon's status."""
    (status,) = [s for s in array.status if s.name.endswith("beacon")]
    return {pair.key: pair.value for pair in status.values} | {"message": status.message}
