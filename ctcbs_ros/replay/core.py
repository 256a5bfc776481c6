"""A log replayed through the core, without ROS."""

import time
from collections.abc import Callable
from typing import Any

from ctcbs_ros.beacon.comparer import BeaconComparer
from ctcbs_ros.beacon.record import comparison_record
from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import Record, prediction_record
from ctcbs_ros.replay.summary import Summary, beacon_counts, source_counts
from ctcbs_ros.telemetry.beacon import BeaconSample
from ctcbs_ros.telemetry.source import LogSource


def replay_through_core(
    log: LogSource,
    predictor: Predictor,
    rate: float,
    take: Callable[[Record, float], None],
    comparer: BeaconComparer | None = None,
    take_comparison: Callable[[Record], None] = lambda record: None,
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
    comparer : BeaconComparer, optional
        Of a log opened with a beacon.
    take_comparison : callable
        Called with the record of each report of the beacon.

    Returns
    -------
    dict
        The summary, see `ctcbs_ros.replay.summary`.
    """
    summary = Summary(predictor)
    tally = None if comparer is None else BeaconTally()

    def compared(comparisons):
        for comparison in comparisons:
            tally.add(comparison)
            take_comparison(comparison_record(comparison))

    started = None  # time.monotonic() less the log's time over the rate
    for sample in log:
        if isinstance(sample, BeaconSample):
            compared(comparer.add(sample))
            continue
        if rate:
            if started is None:
                started = time.monotonic() - sample.time / rate
            time.sleep(max(0.0, started + sample.time / rate - time.monotonic()))
        prediction = predictor.update(sample)
        summary.add(prediction)
        take(prediction_record(prediction), log.progress)
        if comparer is not None:
            compared(comparer.hear(prediction))
    if comparer is not None:
        compared(comparer.finish())
    return summary.finish() | source_counts(log) | beacon_counts(log, tally)
