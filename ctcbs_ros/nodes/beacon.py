"""The payload's beacon in the node: its reports compared, published, counted and told of."""

import time
from collections import Counter
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from ctcbs_ros.beacon.comparer import BeaconComparer
from ctcbs_ros.beacon.comparison import Comparison, Standing, Unmatched
from ctcbs_ros.beacon.reach import LENGTH_HINT, share_out_of_reach
from ctcbs_ros.beacon.record import comparison_record
from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.configuration import Configuration
from ctcbs_ros.nodes.diagnostics import key_values
from ctcbs_ros.nodes.outputs import Outputs
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import Record
from ctcbs_ros.replay.text import UNMATCHED
from ctcbs_ros.telemetry.beacon import STAMPS, BeaconSample, CommonTime, stamp_offset
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.skip_code import SKIPS
from ctcbs_ros.telemetry.topics import TopicSamples

# Standard deviations off that chance leaves one in a thousand.
UNEXPLAINED = 4.0
# As far off as this, a wind that is not modelled is hardly the reason.
FAR = 100.0


class NodeBeacon:
    """Takes in the reports of the beacon beside the aircraft's predictions.

    Parameters
    ----------
    configuration : Configuration
    predictor : Predictor
        The one whose predictions are heard.
    outputs : Outputs

    Attributes
    ----------
    tally : BeaconTally
    """

    def __init__(self, configuration: Configuration, predictor: Predictor, outputs: Outputs):
        self.tally = BeaconTally()
        self._comparer = BeaconComparer(
            configuration.beacon, predictor.frame, configuration.cable.length
        )
        self._outputs = outputs
        self._samples, self._time = TopicSamples(), CommonTime(STAMPS)
        self._heard: float | None = None  # time.monotonic() at the newest report
        self._newest: Comparison | None = None
        self._cable_length = configuration.cable.length
        self._of_length: Counter = Counter()  # outcomes with this length

    def change(self, cable_length: float) -> None:
        """Take over the cable paid out [m]."""
        self._comparer.change(cable_length)
        if cable_length != self._cable_length:
            self._cable_length = cable_length
            self._of_length.clear()

    def take(self, report: BeaconSample) -> None:
        """Take in a report of the beacon."""
        self._heard = time.monotonic()
        self._publish(self._comparer.add(report))

    def take_fix(self, message: Any, received: float) -> None:
        """Take in a report by topic (NavSatFix), received at that time of the node's clock [s]."""
        sample = self._samples.fix(message, round(received * 1e6))
        self.take(self._time.tie(sample, received, stamp_offset(sample)))

    def hear(self, sample: Sample, received: float, prediction: Prediction) -> None:
        """Take in a sample of the aircraft, when it was received [s], and what it predicts."""
        self._time.hear_aircraft(sample, received, stamp_offset(sample))
        self._publish(self._comparer.hear(prediction))

    def finish(self) -> None:
        """No more is coming: tell of what still waits."""
        self._publish(self._comparer.finish())

    def _publish(self, comparisons: list[Comparison]) -> None:
        for comparison in comparisons:
            self.tally.add(comparison)
            self._of_length[comparison.outcome] += 1
            self._newest = comparison
            self._outputs.publish_comparison(comparison)

    def status(self, stale_after: float | None, figures: dict[str, Any]) -> DiagnosticStatus:
        """Status of the beacon.

        Parameters
        ----------
        stale_after : float or None
            Time without a report after which it counts as silent [s]; None for a log.
        figures : dict
            What is known about the source.
        """
        level, text = self._state(stale_after)
        status = DiagnosticStatus(level=level, name="beacon", message=text)
        newest = self.tally.newest
        record = {} if newest is None else comparison_record(newest)
        known = _without_nulls(figures | self.tally.as_dict() | {"newest": record})
        status.values = list(key_values(known))
        return status

    def _state(self, stale_after: float | None) -> tuple[bytes, str]:
        if self._heard is None:
            return DiagnosticStatus.WARN, "no report yet"
        silent = time.monotonic() - self._heard
        if stale_after is not None and silent > stale_after:
            return DiagnosticStatus.WARN, f"no report for {silent:.1f} s"
        if self._newest is None:
            return DiagnosticStatus.OK, "reports come in"
        level, text = _told(self._newest)
        share = share_out_of_reach(self._of_length)
        if share is None:
            return level, text
        doubt = f"{100.0 * share:.0f} % of the reports are out of the cable's reach: {LENGTH_HINT}"
        return DiagnosticStatus.WARN, f"{doubt}; {text}"


def _told(newest: Comparison) -> tuple[bytes, str]:
    """Level and words of one report."""
    outcome, found = newest.outcome, newest.predicted
    if found is None:
        level = DiagnosticStatus.OK
        if outcome not in (Unmatched.NO_PREDICTION, Unmatched.NO_AIRCRAFT):
            level = DiagnosticStatus.WARN
        return level, f"not compared: {outcome.value}: {(SKIPS | UNMATCHED)[outcome]}"
    text = (
        f"{found.horizontal:.1f} m beside and {found.enu[2]:+.1f} m above the prediction, "
        f"{found.distance:.1f} standard deviations ({outcome.value})"
    )
    unmodelled = outcome is Standing.UNMODELLED
    if found.distance <= (FAR if unmodelled else UNEXPLAINED):
        return DiagnosticStatus.OK, text
    why = "unless it is so for being unmodelled, " if unmodelled else ""
    return DiagnosticStatus.WARN, f"{text}; {why}check cable.length, end mass, drag and beacon"


def _without_nulls(record: Record) -> Record:
    """A record without what is None, and without the dicts in it that are then empty."""
    kept = {}
    for key, value in record.items():
        inner = _without_nulls(value) if isinstance(value, dict) else value
        if inner is not None and inner != {}:
            kept[key] = inner
    return kept
