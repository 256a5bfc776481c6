"""Replays through the node in its own process, by the command line."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

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
            capture_output=True, text=True, timeout=200,
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
    assert assert_same(log, drone_table, tmp_path)["predictions"] > 100


def test_log_of_any_name_is_taken_by_the_node(drone_log, drone_table, tmp_path):
    log = tmp_path / "it's: a \"flight\" [1]"
    log.write_bytes(drone_log.read_bytes())
    done = subprocess.run(
        command(log.name, drone_table, "--through", "node", "--json"),
        capture_output=True, text=True, cwd=tmp_path, timeout=200,
        env=os.environ | {"PYTHONPATH": str(DRONE.parents[1])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["predictions"] > 150


def started(log, table, folder):
    """A process that replays a log through the node, slowly."""
    slowly = command(log, table, "--through", "node", "--rate", "5", "--out", folder)
    return subprocess.Popen(slowly, stderr=subprocess.PIPE, text=True)


def children(process):
    """Process ids of the children of a process."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return [int(number) for number in listed.split()]


def is_running(number):
    """Whether a process runs; one that has ended and is not waited for yet does not."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)]
)
def test_node_ends_with_the_command_that_started_it(
    drone_log, drone_table, tmp_path, number, code
):
    process = started(drone_log, drone_table, tmp_path / "out")
    deadline = time.monotonic() + 60.0
    while not (samples := list(tmp_path.glob("out/.*/samples.csv"))) or not children(process):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    (node,) = children(process)
    time.sleep(1.0)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == code
    assert "Traceback" not in errors
    while is_running(node):
        assert time.monotonic() < deadline, "the node outlived the command"
        time.sleep(0.05)
    if number != signal.SIGKILL:
        assert not samples[0].exists()
        assert list(tmp_path.iterdir()) == []


def test_node_that_dies_is_told_in_one_line(drone_log, drone_table, tmp_path):
    process = started(drone_log, drone_table, tmp_path / "out")
    deadline = time.monotonic() + 60.0
    while not children(process):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    time.sleep(2.0)
    os.kill(children(process)[0], signal.SIGKILL)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 1
    assert errors.splitlines()[-1].startswith("ctcbs: error: the node ended by SIGKILL: ")
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


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
