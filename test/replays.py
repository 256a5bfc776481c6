"""A log replayed through the core, as several tests look at it."""

from pathlib import Path

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.replay.core import replay_through_core
from ctcbs_ros.table.provide import table_for
from ctcbs_ros.telemetry.source import open_log

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"


def replayed(log, table):
    """Records and summary of a log."""
    configuration = load_configuration(DRONE)
    predictor = Predictor(configuration, table_for(configuration, table), with_twin=True)
    records = []
    summary = replay_through_core(
        open_log(log), predictor, 0.0, lambda record, progress: records.append(record)
    )
    return records, summary
