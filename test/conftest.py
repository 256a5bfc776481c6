"""The small drone's table and a flight of it, made once for all tests that need them."""

import os
from pathlib import Path

import pytest

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"


@pytest.fixture(scope="session", autouse=True)
def ros_log_folder(tmp_path_factory):
    """ROS's log files of all tests, which need no home folder for it."""
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))


@pytest.fixture(scope="session")
def drone_table(tmp_path_factory):
    """File of a coarse table of config/small_drone.yaml."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.table.build import build_table
    from ctcbs_ros.table.storage import save_table

    configuration = load_configuration(DRONE)
    file = tmp_path_factory.mktemp("table") / "drone.npz"
    save_table(build_table(configuration, nodes=5, progress=False), configuration, file)
    return file


@pytest.fixture(scope="session")
def drone_log(tmp_path_factory):
    """Log of a simulated flight: 2.5 turns clockwise at 60 m and 20 m/s, a gap of 4 s in them."""
    from ctcbs_ros.cli.main import main

    file = tmp_path_factory.mktemp("log") / "flight.tlog"
    flight = "--radius 60 --speed 20 --turns 2.5 --sense cw --center=47.4,8.5"
    noise = "--position-noise 1 --velocity-noise 0.2 --gap 50,4 --seed 3"
    arguments = f"simulate --config {DRONE} {flight} {noise} -o {file}"
    assert main(arguments.split()) == 0
    return file


@pytest.fixture(scope="session")
def core_replay(drone_log, drone_table):
    """Records and summary of the log through the core; to be read only."""
    from replays import replayed

    return replayed(drone_log, drone_table)
