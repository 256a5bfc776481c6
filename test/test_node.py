"""The real node in its own process: start, end, parameters, logs."""

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from processes import LIMIT
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
from running_node import DRONE, RunningNode
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.telemetry.source import open_log

EXAMPLES = DRONE.parents[1] / "msg_examples"
KEEP_ALL = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def position(message):
    found = message.pose.pose.position
    return found.x, found.y, found.z


def values(status):
    return {pair.key: pair.value for pair in status.values}


# --- start and end ------------------------------------------------------------------------------


def ended(node):
    return node.process.wait(LIMIT)


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"cable.length": -1.0}, "cable.length = -1.0: must be a number from 0.01"),
        ({"cable.length": 150}, "write 150.0"),
        # Of these two ROS would take the file's value without a word.
        ({"cable.length": "abc"}, "cable.length = 'abc': must be a number from 0.01"),
        ({"publish_cable": 1}, "publish_cable = 1: must be true or false"),
        ({"use_sim_time": 3}, "use_sim_time = 3: must be true or false"),
        ({"cable.lenght": 150.0}, "'cable.lenght': unknown parameter"),
        ({"mavlink.url": "absent.tlog"}, "log absent.tlog: cannot be read"),
        (
            {"mavlink.url": "udp:127.0.0.1:14550"},
            "mavlink.url = 'udp:127.0.0.1:14550': no such link or log; allowed: udpin:[HOST:]PORT",
        ),
        ({"mavlink.url": "udpin:127.0.0.1:0"}, "the port '0' is not a number from 1"),
        ({"table.file": str(DRONE)}, "small_drone.yaml"),
        ({"beacon.system_id": 42}, "only with a MAVLink link or log in mavlink.url"),
        ({"beacon.topic": "mavros/global_position/global"}, "is the tow aircraft's position"),
    ],
)
def test_what_cannot_work_is_refused_in_one_line_with_exit_2(tmp_path, parameters, reason):
    with RunningNode(tmp_path, parameters) as node:
        assert ended(node) == 2
        (line,) = [
            line for line in node.output.splitlines() if not line.startswith("[INFO]")
        ]
        assert line.startswith("predictor: ")
        assert reason in line


def test_missing_parameter_file_or_parameters_are_refused_with_exit_2(tmp_path):
    with RunningNode(tmp_path, configuration=None) as node:
        assert ended(node) == 2
        assert "cable.length is missing" in node.output
    with RunningNode(tmp_path, configuration=tmp_path / "absent.yaml") as node:
        assert ended(node) == 2
        assert node.output == f"predictor: {tmp_path}/absent.yaml: no such file\n"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("/**:\n  ros__parameters:\n    cable: {length: 1.0\n", "line 4, column 1: not valid: "),
        ("cable:\n  length: 1.0\n", "a parameter file holds '/**:', under it"),
    ],
)
def test_parameter_file_that_is_none_is_refused_with_the_place(tmp_path, content, told):
    file = tmp_path / "bad.yaml"
    file.write_text(content)
    with RunningNode(tmp_path, configuration=file) as node:
        assert ended(node) == 2
        (line,) = node.output.splitlines()
        assert str(file) in line
        assert told in line


def test_node_without_ros_names_the_way_to_get_it(tmp_path):
    code = (
        "import sys; sys.modules['rclpy'] = None; sys.argv = ['predictor']\n"
        "from ctcbs_ros.nodes.predictor import main; sys.exit(main())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2
    assert "ctcbs_ros[ros]" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "signals",
    [(signal.SIGINT, signal.SIGINT), (signal.SIGTERM,), (signal.SIGTERM, signal.SIGINT)],
    ids=["SIGINT twice", "SIGTERM", "both"],
)
def test_running_node_ends_with_zero(tmp_path, drone_table, signals):
    with RunningNode(tmp_path, {"table.file": quoted(str(drone_table))}) as node:
        node.wait_until_ready()
        assert node.end(*signals) == 0, node.output
        assert "Traceback" not in node.output


def test_signals_at_every_moment_of_the_end_do_not_break_it(tmp_path, drone_table):
    with RunningNode(tmp_path, {"table.file": quoted(str(drone_table))}) as node:
        node.wait_until_ready()
        while node.process.poll() is None:
            for number in (signal.SIGINT, signal.SIGTERM):
                node.process.send_signal(number)
        assert node.process.returncode == 0, node.output
        assert "Traceback" not in node.output


def test_node_amid_publishing_ends_with_zero(tmp_path, drone_log, drone_table):
    parameters = {
        "mavlink.url": quoted(str(drone_log)),
        "table.file": quoted(str(drone_table)),
        "replay.wait_for_subscribers": LIMIT,
    }
    with RunningNode(tmp_path, parameters) as node:
        poses = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose")
        node.wait_until(lambda: poses)
        assert node.end(signal.SIGINT, signal.SIGINT) == 0, node.output
        assert "Traceback" not in node.output


def test_node_that_builds_its_table_ends_with_zero_at_sigterm(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with RunningNode(tmp_path) as node:
        node.wait_until(lambda: "table" in node.output)
        assert node.end(signal.SIGTERM) == 0, node.output
        assert "Traceback" not in node.output


# --- parameters while it runs -------------------------------------------------------------------


@pytest.fixture(scope="module")
def idle_node(tmp_path_factory, drone_table):
    """A node that waits for topics, in a namespace and by another name."""
    folder = tmp_path_factory.mktemp("idle")
    parameters = {"table.file": quoted(str(drone_table)), "diagnostics.period": 0.1}
    names = ("-r", "__ns:=/tow", "-r", "__node:=mass")
    with RunningNode(folder, parameters, arguments=names) as node:
        node.wait_until_ready()
        yield node


def change(node, name, value):
    parameter = Parameter(name=name, value=ParameterValue(type=3, double_value=value))
    request = SetParameters.Request(parameters=[parameter])
    (result,) = node.call(SetParameters, "/tow/mass/set_parameters", request).results
    return result


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("cable.length", -1.0, "cable.length"),
        ("cable.length", float("nan"), "cable.length = nan: must be a number from 0.01"),
        ("cable.lenght", 100.0, "unknown parameter (did you mean cable.length?)"),
        # 400 N hold 40 kg, see config/small_drone.yaml
        ("end_mass.mass", 60.0, "cable.breaking_tension = 400.0: must be greater than the weight"),
        ("cable.diameter", 0.001, "read-only"),
    ],
)
def test_change_that_is_not_allowed_is_rejected_with_the_reason(idle_node, name, value, reason):
    result = change(idle_node, name, value)
    assert not result.successful
    assert reason in result.reason
    idle_node.wait_until(lambda: f"change refused: {result.reason}" in idle_node.output)


def test_allowed_change_is_taken_over_and_logged(idle_node):
    assert change(idle_node, "limits.minimum_height", 35.0).successful
    request = GetParameters.Request(names=["limits.minimum_height"])
    (value,) = idle_node.call(GetParameters, "/tow/mass/get_parameters", request).values
    assert value.double_value == 35.0
    told = "limits.minimum_height changed from 20.0 to 35.0"
    idle_node.wait_until(lambda: told in idle_node.output)
    assert idle_node.output.count(" changed from ") == 1


def test_without_telemetry_all_diagnostics_are_errors_by_the_names_of_the_node(idle_node):
    arrays = idle_node.messages(DiagnosticArray, "/diagnostics")
    idle_node.wait_until(lambda: arrays)
    statuses = arrays[0].status
    assert [s.name for s in statuses] == ["mass: telemetry", "mass: orbit", "mass: prediction"]
    assert all(status.level == DiagnosticStatus.ERROR for status in statuses)
    assert all(status.hardware_id for status in statuses)
    assert "no sample yet" in statuses[0].message


# --- a log --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log_replay(tmp_path_factory, drone_log, drone_table, core_replay):
    """The node after the log, and what it published."""
    folder = tmp_path_factory.mktemp("log_replay")
    parameters = {
        "mavlink.url": quoted(str(drone_log)),
        "table.file": quoted(str(drone_table)),
        "replay.wait_for_subscribers": LIMIT,
        "diagnostics.period": 0.1,
    }
    with RunningNode(folder, parameters) as node:
        node.found = {
            "markers": node.messages(MarkerArray, "/predictor/cable", 100),
            "fixes": node.messages(NavSatFix, "/predictor/end_mass/fix", KEEP_ALL),
            "diagnostics": node.messages(DiagnosticArray, "/diagnostics", 100),
            "poses": node.messages(
                PoseWithCovarianceStamped, "/predictor/end_mass/pose", KEEP_ALL
            ),
        }
        node.wait_until(lambda: "end of the log" in node.output)
        node.wait_until(lambda: all_received(node.found, core_replay[1]))
        yield node


def all_received(found, summary):
    """Whether the last of each topic is there."""
    if not all(found.values()):
        return False
    deleted = {marker.action for marker in found["markers"][-1].markers} == {Marker.DELETE}
    counted = values(found["diagnostics"][-1].status[0])["samples"] == str(summary["samples"])
    return deleted and counted and min(
        len(found["poses"]), len(found["fixes"])
    ) >= summary["predictions"]


def test_every_pose_of_the_core_comes_through_the_node_equal(log_replay, core_replay):
    expected = {
        record["stamp_ns"]: [record[f"end_mass_{axis}_m"] for axis in ("east", "north", "up")]
        for record in core_replay[0]
        if record["valid"]
    }
    assert len(expected) > 150
    found = {stamp_ns(message): position(message) for message in log_replay.found["poses"]}
    assert len(log_replay.found["poses"]) == len(found)
    assert found.keys() == expected.keys()
    for stamp, enu in expected.items():
        np.testing.assert_allclose(found[stamp], enu, rtol=0.0, atol=1e-6)


def test_fixes_lie_where_the_poses_are(log_replay, core_replay):
    expected = {r["stamp_ns"]: r for r in core_replay[0] if r["valid"]}
    fixes = log_replay.found["fixes"]
    assert len(fixes) == len(expected)
    for message in fixes:
        record = expected[stamp_ns(message)]
        # Two processes: where one of them compiled its kernels anew, the last digit may differ.
        assert message.latitude == pytest.approx(record["end_mass_latitude_deg"], abs=1e-12)
        assert message.altitude == pytest.approx(record["end_mass_altitude_m"], abs=1e-9)


def test_summary_and_datum_reach_who_subscribes_after_the_end(log_replay, core_replay):
    summaries = log_replay.messages(String, "/predictor/summary", LATCHED)
    datums = log_replay.messages(NavSatFix, "/predictor/datum", LATCHED)
    log_replay.wait_until(lambda: summaries and datums)
    assert json.loads(summaries[0].data) == json.loads(json.dumps(core_replay[1]))
    assert datums[0].latitude == pytest.approx(47.4, abs=0.01)


def test_summary_example_is_that_of_the_log(core_replay):
    example = yaml.safe_load((EXAMPLES / "summary.yaml").read_text())
    shown, found = json.loads(example["data"]), core_replay[1]
    assert list(shown) == list(found)
    (orbit,), (expected,) = shown.pop("orbits"), found["orbits"]
    assert shown == {key: value for key, value in found.items() if key != "orbits"}
    assert list(orbit) == list(expected)
    for key, value in orbit.items():
        tolerance = 1e-6 if key == "center" else 0.05 if key.startswith("simulated") else 1e-3
        if isinstance(value, float | list):
            assert value == pytest.approx(expected[key], rel=tolerance), key
        else:
            assert value == expected[key], key


def test_markers_go_when_the_orbit_ends(log_replay):
    arrays = log_replay.found["markers"]
    actions = [[marker.action for marker in array.markers] for array in arrays]
    assert Marker.ADD in actions[0]
    assert set(actions[-1]) == {Marker.DELETE}


def test_diagnostics_of_a_log_count_every_sample(log_replay, core_replay):
    telemetry = log_replay.found["diagnostics"][-1].status[0]
    assert values(telemetry)["samples"] == str(core_replay[1]["samples"])
    assert values(telemetry)["altitude of ~/end_mass/fix and ~/datum is above"] in (
        "ellipsoid", "mean sea level",
    )  # fmt: skip


def test_paced_log_answers_parameters_and_is_ended_amid_it_with_zero(
    tmp_path, drone_log, drone_table
):
    parameters = {
        "mavlink.url": quoted(str(drone_log)),
        "table.file": quoted(str(drone_table)),
        "replay.rate": 0.2,  # for five minutes
        "replay.wait_for_subscribers": 0.0,
    }
    with RunningNode(tmp_path, parameters) as node:
        records = node.messages(String, "/predictor/prediction")
        node.wait_until(lambda: records)
        request = GetParameters.Request(names=["replay.rate"])
        (value,) = node.call(GetParameters, "/predictor/get_parameters", request).values
        assert value.double_value == 0.2
        assert node.end() == 0, node.output
        assert "end of the log" not in node.output
        assert "Traceback" not in node.output


def test_paced_log_takes_its_time_and_the_node_exits_at_its_end(tmp_path, drone_log, drone_table):
    parameters = {
        "mavlink.url": quoted(str(drone_log)),
        "table.file": quoted(str(drone_table)),
        "replay.rate": 40.0,
        "replay.wait_for_subscribers": 0.0,
        "replay.exit_at_end": "true",
    }
    with RunningNode(tmp_path, parameters) as node:
        assert ended(node) == 0, node.output
        ready, end = (
            float(re.search(rf"\[([\d.]+)\] \[predictor\]: {text}", node.output)[1])
            for text in ("ready", "end of the log")
        )
    seconds = [sample.time for sample in open_log(drone_log)]
    assert end - ready > 0.99 * (seconds[-1] - seconds[0]) / 40.0
