"""A log replayed through the core, as several tests look at it."""

import subprocess
import sys
from pathlib import Path

import pytest

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.replay.core import replay_through_core
from ctcbs_ros.table.provide import table_for
from ctcbs_ros.telemetry.source import open_log

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"


def recorded(name):
    """Path of a recorded flight; the test is skipped where there is none."""
    path = FLIGHTS / name
    if not path.is_file():
        pytest.skip(f"recorded flight not here: {path}")
    return path


def ctcbs(*arguments, **options):
    """The command `ctcbs` in a process of its own, ended."""
    command = [sys.executable, "-m", "ctcbs_ros", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, **options)


def replayed(log, table):
    """Records and summary of a log."""
    configuration = load_configuration(DRONE)
    predictor = Predictor(configuration, table_for(configuration, table), with_twin=True)
    records = []
    summary = replay_through_core(
        open_log(log), predictor, 0.0, lambda record, progress: records.append(record)
    )
    return records, summary
