"""The node and faults: what is dropped of a flight is counted in /diagnostics and the summary."""

import json

import faults_log
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray
from faults_replay import replay
from geometry_msgs.msg import PoseWithCovarianceStamped
from processes import LIMIT
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
from running_node import RunningNode
from soak import soak, write_log
from std_msgs.msg import String

from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.telemetry.skip_code import SkipCode

LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
KEEP_ALL = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)


def faulty_flight(log):
    """A flight with a fault of each kind, as .tlog."""
    random = np.random.default_rng(3)
    seconds = faults_log.seconds
    log = faults_log.shift(log, seconds(log, 28.0, 28.5), north=100.0)
    log = faults_log.freeze(log, seconds(log, 38.0, 39.0))
    log = faults_log.step_clock(log, seconds(log, 55.0), -100_000)
    log = faults_log.interleave(log, faults_log.sent_by(log, 2))
    log = faults_log.gap(log, 42.0, 11.0)
    start, rest = log[:120], log[120:]
    rest = faults_log.repeat(faults_log.lose(rest, 0.1, random), 0.1, random)
    rest = faults_log.delay(rest, 0.5, random)
    data, _, _ = faults_log.corrupt(rest, 3e-4, random)
    return faults_log.as_bytes(start) + data


def test_all_that_is_dropped_stands_in_diagnostics_and_summary(log, drone_table, tmp_path):
    data = faulty_flight(log)
    core = replay(data, tmp_path)
    assert {"JUMP", "FROZEN", "AHEAD", "DUPLICATE", "OUT_OF_ORDER"} <= set(core.skipped)
    link = core.link
    assert link["time_steps"] == {"reboot": 1}
    assert min(link[name] for name in ("lost", "repeated", "bad_bytes", "other_positions")) > 0
    parameters = {
        "mavlink.url": quoted(str(tmp_path / "faults.tlog")), "table.file": drone_table,
        "replay.wait_for_subscribers": LIMIT,
    }  # fmt: skip
    with RunningNode(tmp_path, parameters) as node:
        reports = node.messages(DiagnosticArray, "/diagnostics")
        records = node.messages(String, "/predictor/prediction", KEEP_ALL)
        summaries = node.messages(String, "/predictor/summary", LATCHED)
        node.wait_until_ready()
        node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", KEEP_ALL)  # it waits
        node.wait_until(lambda: summaries and len(records) >= core.summary["samples"])
        seen = len(reports)
        node.wait_until(lambda: len(reports) > seen + 1)
    summary = json.loads(summaries[0].data)
    for name in ("samples", "skipped", "link", "flights"):
        assert summary[name] == core.summary[name]
    (told,) = [s for s in reports[-1].status if s.name.endswith("telemetry")]
    told = {pair.key: pair.value for pair in told.values}
    assert told["samples"] == str(summary["samples"])
    for code in SkipCode:
        assert told[f"skipped {code.value}"] == str(summary["skipped"].get(code.value, 0))
    for name in ("messages", "lost", "repeated", "bad_runs", "bad_bytes", "other_positions"):
        assert told[f"link.{name}"] == str(summary["link"][name])
    assert told["link.time_steps.reboot"] == "1"
    assert told["link.other_systems.2"] == str(link["other_systems"]["2"])


@pytest.mark.slow
def test_a_day_of_flight_loses_no_prediction_and_leaves_the_memory(tmp_path):
    path = tmp_path / "day.tlog"
    log = write_log(path, hours=24.0, rate=1.0)
    soak(path, log, tmp_path).assert_good(log)
