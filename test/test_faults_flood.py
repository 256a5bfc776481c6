"""A flood of datagrams at the node: it answers, its memory stays, and every drop is counted."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray
from links import free_port
from processes import LIMIT
from rcl_interfaces.srv import GetParameters
from running_node import RunningNode
from soak import resident_mb
from std_msgs.msg import String

from ctcbs_ros.telemetry.live import CAPACITY

RATE = 5_000  # datagrams a second


def vehicle_time(record):
    return json.loads(record.data)["vehicle_time_s"]


def flooded(folder, table, duration):
    """Flood the node; returns its last report, what was sent, answers got, and memory [MB]."""
    port = free_port()
    parameters = {
        "mavlink.url": f"udpin:{port}", "table.file": table, "diagnostics.period": 0.5,
    }  # fmt: skip
    with RunningNode(folder, parameters) as node:
        reports = node.messages(DiagnosticArray, "/diagnostics")
        records = node.messages(String, "/predictor/prediction")
        node.wait_until_ready()
        node.wait_until(lambda: reports and reports[-1].status)
        command = [sys.executable, Path(__file__).with_name("flood.py"), port, RATE, duration]
        sender = subprocess.Popen(
            list(map(str, command)), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        try:
            node.wait_until(lambda: records)
            answers, memory, begun = 0, [], time.monotonic()
            while answers == 0 or time.monotonic() - begun < duration:
                # The sender goes on meanwhile: it waits for the line below.
                request = GetParameters.Request(names=["cable.length"])
                answer = node.call(GetParameters, "/predictor/get_parameters", request)
                assert answer.values[0].double_value == 150.0
                answers += 1
                memory.append(resident_mb(node.process.pid))
                node.spin(0.2)
            told, _ = sender.communicate("enough\n", timeout=LIMIT)
            sent, last = int(told.split()[0]), float(told.split()[1])
        finally:
            sender.kill()
            sender.wait()
        # The newest one of all has come through, and is the last.
        node.wait_until(lambda: vehicle_time(records[-1]) == pytest.approx(last))
        seen = len(reports)
        node.wait_until(lambda: len(reports) > seen + 1)
    (told,) = [s for s in reports[-1].status if s.name.endswith("telemetry")]
    return {pair.key: pair.value for pair in told.values}, sent, answers, memory


def assert_counted(told, sent):
    messages = int(told["link.messages"])
    # Each datagram was a message read, or was counted by the system.
    assert messages + int(told["datagrams dropped by the system"]) == sent
    # Each position among them was predicted from or skipped, or gave way; two were none.
    samples = int(told["samples"])
    assert samples + int(told["dropped because the node was late"]) == messages - 2
    skipped = sum(int(value) for key, value in told.items() if key.startswith("skipped "))
    assert skipped <= samples


def test_flood_is_answered_through_and_every_drop_is_counted(drone_table, tmp_path):
    told, sent, answers, _ = flooded(tmp_path, drone_table, 1.0)
    assert sent > CAPACITY
    assert answers > 0
    assert_counted(told, sent)


@pytest.mark.slow
def test_flood_of_a_minute_leaves_the_memory_flat(drone_table, tmp_path):
    told, sent, answers, memory = flooded(tmp_path, drone_table, 60.0)
    print(told, sent, answers, memory)
    assert sent > 0.9 * 60.0 * RATE
    assert answers > 10
    assert_counted(told, sent)
    # Flat once the queue has been full.
    assert max(memory[len(memory) // 4 :]) - memory[len(memory) // 4] < 5.0
