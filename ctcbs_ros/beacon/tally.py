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
    predicted : dict
        `DifferenceStatistics` by `Standing`: those settled are the prediction's error.
    simulated : DifferenceStatistics
    """

    def __init__(self):
        self.reports = 0
        self.outcomes: Counter = Counter()
        self.times_by: Counter[str] = Counter()
        self.newest: Comparison | None = None
        self.predicted = {standing: DifferenceStatistics() for standing in Standing}
        self.simulated = DifferenceStatistics()

    def add(self, comparison: Comparison) -> None:
        """Take in one more."""
        self.reports += 1
        self.outcomes[comparison.outcome] += 1
        if comparison.predicted is not None:
            self.predicted[comparison.outcome].add(comparison.predicted)
        if comparison.simulated is not None:
            self.simulated.add(comparison.simulated)
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
            "measured_minus_predicted": {
                standing.value: found.as_dict() for standing, found in self.predicted.items()
            },
            "measured_minus_simulated": self.simulated.as_dict(),
        }

    def _counts(self, codes) -> dict[str, int]:
        return {code.value: self.outcomes[code] for code in codes if self.outcomes[code]}
