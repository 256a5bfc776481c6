"""Replays through the node in its own process, by the command line."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from processes import (
    LIMIT,
    children,
    is_running,
    read_to_end,
    read_until,
    start_on_terminal,
    wait_for,
)

from ctcbs_ros.replay import through_node
from ctcbs_ros.replay.through_node import free_domain, quoted

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"


def command(log, table, *arguments):
    """`ctcbs replay --through node`."""
    replay = [sys.executable, "-m", "ctcbs_ros", "replay", log, "--config", DRONE]
    return list(map(str, [*replay, "--table", table, *arguments]))


def both_ways(log, table, folder):
    """Summaries of a log through core and node; their tables are in the folder."""
    summaries = []
    for way in ("core", "node"):
        done = subprocess.run(
            command(log, table, "--through", way, "--out", folder / way, "--json"),
            capture_output=True, text=True, timeout=LIMIT,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        summaries.append(json.loads(done.stdout))
    return summaries


def assert_same(log, table, folder):
    core, node = both_ways(log, table, folder)
    assert core.pop("wall_s") > 0.0
    assert node.pop("wall_s") > 0.0
    assert node == core
    for name in ("predictions.csv", "samples.csv"):
        assert (folder / "node" / name).read_text() == (folder / "core" / name).read_text()
    return core


def test_simulated_flight_comes_through_the_node_as_through_the_core(
    drone_log, drone_table, tmp_path
):
    assert assert_same(drone_log, drone_table, tmp_path)["predictions"] > 150


def test_recorded_flight_comes_through_the_node_as_through_the_core(drone_table, tmp_path):
    log = FLIGHTS / "plane_sitl_loiter.tlog"
    if not log.is_file():
        pytest.skip(f"recorded flight not here: {log}")
    assert assert_same(log, drone_table, tmp_path)["predictions"] > 80


def test_log_of_any_name_is_taken_by_the_node(drone_log, drone_table, tmp_path):
    log = tmp_path / "it's: a \"flight\" [1]"
    log.write_bytes(drone_log.read_bytes())
    done = subprocess.run(
        command(log.name, drone_table, "--through", "node", "--json"),
        capture_output=True, text=True, cwd=tmp_path, timeout=LIMIT,
        env=os.environ | {"PYTHONPATH": str(DRONE.parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["predictions"] > 150


NODE = "ctcbs_ros.nodes.predictor"  # in the command of the node's process


def amid_a_log(log, table, out):
    """A paced replay with the first of its log through the node: process, terminal, node's id."""
    process, terminal = start_on_terminal(
        command(log, table, "--through", "node", "--rate", "1", "--out", out)
    )
    read_until(terminal, r"replay: +[1-9]\d* %")
    (node,) = children(process.pid, NODE)
    return process, terminal, node


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)]
)
def test_node_ends_with_the_command_that_started_it(
    drone_log, drone_table, tmp_path, number, code
):
    process, terminal, node = amid_a_log(drone_log, drone_table, tmp_path / "out")
    assert list(tmp_path.glob("out/.*/samples.csv"))
    process.send_signal(number)
    errors = read_to_end(terminal)
    assert process.wait(LIMIT) == code
    assert "Traceback" not in errors
    wait_for(lambda: not is_running(node), "the end of the node")
    if number != signal.SIGKILL:
        assert list(tmp_path.iterdir()) == []


def test_node_that_dies_is_told_in_one_line(drone_log, drone_table, tmp_path):
    process, terminal, node = amid_a_log(drone_log, drone_table, tmp_path / "out")
    os.kill(node, signal.SIGKILL)
    errors = read_to_end(terminal)
    assert process.wait(LIMIT) == 1
    assert errors.splitlines()[-1].startswith("ctcbs: error: the node ended by SIGKILL: ")
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_node_may_take_any_time_to_be_ready_and_is_given_up_if_silent_after_that(monkeypatch):
    class Clock:
        """A clock that only the receiver's waiting moves on, by 50 s each time."""

        now = 0.0

        def monotonic(self):
            return self.now

        def spin_once(self, timeout_sec):
            self.now += 50.0

    clock = Clock()
    monkeypatch.setattr(through_node, "time", clock)
    waiting = SimpleNamespace(_executor=clock, _messages=0, _complete=False, _summary=None)
    with pytest.raises(through_node.NodeFailure, match="not heard within 120 s"):
        through_node._Receiver.receive(waiting, lambda: clock.now > 1000.0)
    assert 1120.0 < clock.now <= 1200.0


def test_without_ros_the_way_to_get_it_is_named(drone_log, drone_table):
    code = (
        "import importlib.util, sys\n"
        "find = importlib.util.find_spec\n"
        "importlib.util.find_spec = lambda name: None if name == 'rclpy' else find(name)\n"
        "from ctcbs_ros.cli.main import main; sys.exit(main())"
    )
    arguments = command(drone_log, drone_table, "--through", "node")[3:]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "ctcbs_ros[ros]" in done.stderr.splitlines()[-1]


def test_domains_are_free_and_within_the_ports_of_linux():
    assert 1 <= free_domain() <= 101


def test_quoted_text_stays_text_for_ros():
    assert quoted("it's 12") == "'it''s 12'"
