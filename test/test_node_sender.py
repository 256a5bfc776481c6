"""The real node on UDP, fed by a MAVLink sender in another process, killed and come back."""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from links import free_port
from processes import LIMIT
from running_node import RunningNode
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from ctcbs_ros.replay.through_node import quoted

RADIUS = 60.0  # m, flown in `drone_log`

# Sends a log over and over, a position each 0.01 s. Each time its clock begins anew: a reboot.
SENDER = """
import socket, sys, time
to = ("127.0.0.1", int(sys.argv[1]))
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
from pymavlink import mavutil
while True:
    source = mavutil.mavlink_connection(sys.argv[2])
    while (message := source.recv_match()) is not None:
        link.sendto(message.get_msgbuf(), to)
        if message.get_type() == "GLOBAL_POSITION_INT":
            time.sleep(0.01)
"""


@contextmanager
def sending(log, port):
    """The log sent to a port by a process that gets SIGKILL at the end, amid what it does."""
    process = subprocess.Popen([sys.executable, "-c", SENDER, str(port), str(log)])
    try:
        yield
        assert process.poll() is None
    finally:
        process.kill()
        process.wait(LIMIT)
    assert process.returncode == -signal.SIGKILL


def values(status):
    return {pair.key: pair.value for pair in status.values}


def is_up(telemetry, reboots):
    """Whether the status of telemetry says that all is well, after so many reboots."""
    told = values(telemetry)
    return (
        told["link state"] == "up: system 1, component 1, fixed wing"
        and telemetry.level != DiagnosticStatus.ERROR
        and int(told.get("link.time_steps.reboot", 0)) >= reboots
    )


def test_sender_may_be_killed_and_come_back_and_the_node_predicts_again(
    tmp_path, drone_log, drone_table
):
    port = free_port()
    parameters = {
        "mavlink.url": f"udpin:127.0.0.1:{port}",
        "table.file": quoted(str(drone_table)),
        "limits.stale_after": 0.5,
        "diagnostics.period": 0.1,
    }
    with RunningNode(tmp_path, parameters) as node:
        poses = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", 1000)
        records = node.messages(String, "/predictor/prediction", 1000)
        markers = node.messages(MarkerArray, "/predictor/cable", 100)
        arrays = node.messages(DiagnosticArray, "/diagnostics")
        node.wait_until_ready()

        def telemetry():
            return arrays[-1].status[0]

        node.wait_until(lambda: arrays and "nothing received yet" in telemetry().message)
        for reboots in range(3):
            with sending(drone_log, port):
                before = len(poses)
                node.wait_until(lambda: len(poses) > before + 20 and markers)  # noqa: B023
                node.wait_until(lambda: is_up(telemetry(), reboots))  # noqa: B023
            # Gone: told of telemetry, orbit and prediction, and no prediction is left standing.
            node.wait_until(lambda: "link lost: nothing received" in telemetry().message)
            assert "STALE_TELEMETRY" in telemetry().message
            assert {s.level for s in arrays[-1].status} == {DiagnosticStatus.ERROR}
            node.wait_until(
                lambda: {marker.action for marker in markers[-1].markers} == {Marker.DELETE}
            )
            counts = []
            for _ in range(2):  # what had come before may still wait at the first
                arrays.clear()
                node.wait_until(lambda: len(arrays) > 3)
                counts.append(values(telemetry())["valid predictions"])
            assert counts[0] == counts[1]
        assert node.end() == 0, node.output
    valid = [record for record in map(json.loads, (r.data for r in records)) if record["valid"]]
    assert np.all(np.diff([record["vehicle_time_s"] for record in valid]) > 0)
    assert len({record["flight"] for record in valid}) >= 3
    radius = np.median([record["orbit_radius_m"] for record in valid])
    assert radius == pytest.approx(RADIUS, rel=0.02)
