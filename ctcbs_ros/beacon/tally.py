"""Counts and figures over the reports of a beacon; each report counts once."""

from collections import Counter
from typing import Any

from ctcbs_ros.beacon.comparison import Comparison, Standing, Unmatched
from ctcbs_ros.beacon.statistics import DifferenceStatistics
from ctcbs_ros.telemetry.skip_code import SkipCode


class BeaconTally:
    """Gathers what reports came to, in constant memory.

    Attributes
    ----------
    reports : int
    outcomes : Counter
        By `Comparison.outcome`.
    times_by : Counter
        What tied the clocks of the reports that were compared.
    newest : Comparison or None
        The newest that was compared.
    predicted, simulated : dict
        `DifferenceStatistics` by `Standing`: those settled are the prediction's error, and the
        simulation's, which follows the aircraft off its circle and is never unconfirmed.
    """

    def __init__(self):
        self.reports = 0
        self.outcomes: Counter = Counter()
        self.times_by: Counter[str] = Counter()
        self.newest: Comparison | None = None
        self.predicted = {standing: DifferenceStatistics() for standing in Standing}
        self.simulated = {
            standing: DifferenceStatistics()
            for standing in Standing
            if standing is not Standing.UNCONFIRMED
        }

    def add(self, comparison: Comparison) -> None:
        """Take in one more."""
        self.reports += 1
        self.outcomes[comparison.outcome] += 1
        if comparison.predicted is not None:
            self.predicted[comparison.outcome].add(comparison.predicted)
        if comparison.simulated is not None:
            self.simulated[comparison.simulated_standing].add(comparison.simulated)
        if comparison.predicted is not None or comparison.simulated is not None:
            self.times_by[comparison.time_by] += 1
            self.newest = comparison

    def as_dict(self) -> dict[str, Any]:
        """Counts and figures as the summary has them."""
        return {
            "reports": self.reports,
            "skipped": self._counts(SkipCode),
            "not_compared": self._counts(Unmatched),
            "times_by": dict(self.times_by),
            "measured_minus_predicted": _by_standing(self.predicted),
            "measured_minus_simulated": _by_standing(self.simulated),
        }

    def _counts(self, codes) -> dict[str, int]:
        return {code.value: self.outcomes[code] for code in codes if self.outcomes[code]}


def _by_standing(statistics: dict[Standing, DifferenceStatistics]) -> dict[str, Any]:
    return {standing.value: found.as_dict() for standing, found in statistics.items()}
