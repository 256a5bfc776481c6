"""A log replayed through the core, without ROS."""

import time
from collections.abc import Callable
from typing import Any

from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import Record, prediction_record
from ctcbs_ros.replay.summary import Summary, source_counts
from ctcbs_ros.telemetry.source import LogSource


def replay_through_core(
    log: LogSource, predictor: Predictor, rate: float, take: Callable[[Record, float], None]
) -> dict[str, Any]:
    """Replay a log.

    Parameters
    ----------
    log : LogSource
    predictor : Predictor
    rate : float
        Speed over the log's own clock; 0 for as fast as it goes.
    take : callable
        Called with the record of each sample's prediction and the part of the log read (0 to 1).

    Returns
    -------
    dict
        The summary, see `ctcbs_ros.replay.summary`.
    """
    summary = Summary(predictor)
    started = None  # time.monotonic() less the log's time over the rate
    for sample in log:
        if rate:
            if started is None:
                started = time.monotonic() - sample.time / rate
            time.sleep(max(0.0, started + sample.time / rate - time.monotonic()))
        prediction = predictor.update(sample)
        summary.add(prediction)
        take(prediction_record(prediction), log.progress)
    return summary.finish() | source_counts(log)
