"""The payload's beacon through the real node: from a log as through the core, and from a topic."""

import json
import re
from dataclasses import replace
from math import cos, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from beacon_flight import DRONE, OFFSET, STILL, SYSTEM, fly
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from running_node import RunningNode
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import String

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.nodes.beacon import UNEXPLAINED, NodeBeacon
from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.table.storage import load_table
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted
from ctcbs_ros.telemetry.source import open_log
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


@pytest.fixture(scope="module")
def flight(tmp_path_factory, drone_table):
    folder = tmp_path_factory.mktemp("flight")
    table = load_table(drone_table, load_configuration(with_beacon(folder)))
    return fly(folder, table, turns=3.0)


def test_a_beacon_in_a_log_comes_through_the_node_as_through_the_core(
    flight, tmp_path, drone_table
):
    file, log = with_beacon(tmp_path), flight.folder / "flight.tlog"

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


def told_of(flight, length=None, shift=0.0):
    """The node's part for the beacon after a flight, with the predictions shifted east [m]."""
    configuration = flight.configuration
    if length is not None:
        configuration = replace(configuration, cable=replace(configuration.cable, length=length))
    nothing = SimpleNamespace(publish_comparison=lambda comparison: None)
    beacon = NodeBeacon(configuration, SimpleNamespace(frame=flight.frame), nothing)
    predictions = iter(flight.predictions)
    levels = []
    for item in open_log(flight.folder / "flight.tlog", beacon=BeaconWanted(SYSTEM)):
        if isinstance(item, BeaconSample):
            beacon.take(item)
            levels.append(beacon.status(None, {}))
            continue
        prediction = next(predictions)
        if shift and prediction.end_mass is not None:
            off = np.array([shift, 0.0, 0.0])
            end_mass = replace(prediction.end_mass, position=prediction.end_mass.position + off)
            prediction = replace(prediction, end_mass=end_mass)
        beacon.hear(item, item.time, prediction)
    return beacon, levels


def test_a_beacon_out_of_reach_is_told_as_a_cable_length_to_check(flight):
    beacon, _ = told_of(flight)
    right = beacon.status(None, {})
    assert "cable.length" not in right.message
    beacon, _ = told_of(flight, length=80.0)
    wrong = beacon.status(None, {})
    assert wrong.level == DiagnosticStatus.WARN
    assert "% of the reports are out of the cable's reach: check cable.length" in wrong.message
    beacon.change(flight.configuration.cable.length)
    assert "out of the cable's reach" not in beacon.status(None, {}).message


def test_a_beacon_many_deviations_off_is_never_ok_settled_or_not(flight):
    _, told = told_of(flight, shift=90.0)
    off = [(re.search(r"([\d.]+) standard deviations", s.message), s) for s in told]
    far = [s for found, s in off if found and float(found[1]) > UNEXPLAINED]
    assert len(far) > 50, [s.message for _, s in off[::40]]
    assert {s.level for s in far} == {DiagnosticStatus.WARN}
    assert all("check cable.length" in s.message for s in far)


def test_a_status_has_no_key_of_what_is_not_there(flight):
    beacon, _ = told_of(flight)  # without a simulation
    pairs = {pair.key: pair.value for pair in beacon.status(None, {"link": None}).values}
    assert "none" not in pairs.values()
    assert "link" not in pairs
    assert "measured_minus_predicted.settled.mean_m[0]" in pairs
    assert pairs["measured_minus_simulated.settled.count"] == "0"
    assert "measured_minus_simulated.settled.mean_m" not in pairs


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
        # What is settled comes once a quarter of a turn more has been flown.
        due = last - (0.25 * 2.0 * pi / RATE + 2.0 * INTERVAL) * 1e9
        node.wait_until(lambda: off and nanoseconds(off[-1].header.stamp) >= due)
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

    while not is_taken():  # the first may be lost
        send["odom"].publish(odom)
        node.spin(0.01)
        send["fix"].publish(fix)
        node.spin(0.5 if number == 0 else 60.0, is_taken)
    send["beacon"].publish(beacon)
    while not records:  # the first may be lost
        node.spin(0.5, lambda: bool(records))
        if not records:
            send["beacon"].publish(beacon)
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
