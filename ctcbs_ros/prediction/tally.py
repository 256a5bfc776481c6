"""Counts over the predictions of a flight."""

from collections import Counter
from typing import Any

from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.warnings import WIND_NOT_KNOWN
from ctcbs_ros.prediction.wind_reasons import kind_of_reason


class Tally:
    """Counts over predictions.

    Attributes
    ----------
    samples, predictions : int
        Samples taken in, and the valid predictions among what they gave.
    skipped, warnings : Counter
        Samples not used by skip code, and predictions with each warning by warning code.
    wind_unmodelled_because : dict
        Of the predictions in a wind without the motion in it: how many for each reason, in its
        newest words.
    wind_seen : int
        Predictions whose WIND_UNMODELLED says that there is wind, not that it is not known.
    """

    def __init__(self):
        self.samples = 0
        self.predictions = 0
        self.skipped: Counter[str] = Counter()
        self.warnings: Counter[str] = Counter()
        self.wind_seen = 0
        self._because: dict[str, tuple[str, int]] = {}  # by kind: newest words, predictions

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self.samples += 1
        self.predictions += prediction.valid
        if prediction.skip is not None:
            self.skipped[prediction.skip.value] += 1
        self.warnings.update({warning.code.value for warning in prediction.warnings})
        self.wind_seen += any(
            warning.code is WarningCode.WIND_UNMODELLED
            and not warning.text.startswith(WIND_NOT_KNOWN)
            for warning in prediction.warnings
        )

        if prediction.end_mass is not None and prediction.end_mass.unmodelled_because:
            because = prediction.end_mass.unmodelled_because
            kind = kind_of_reason(because)
            self._because[kind] = because, self._because.get(kind, ("", 0))[1] + 1

    @property
    def wind_unmodelled_because(self) -> dict[str, int]:
        """See above."""
        return dict(self._because.values())

    def as_dict(self) -> dict[str, Any]:
        """The counts as the summary has them."""
        return {
            "samples": self.samples,
            "predictions": self.predictions,
            "skipped": dict(self.skipped),
            "warnings": dict(self.warnings),
            "wind_seen": self.wind_seen,
            "wind_unmodelled_because": self.wind_unmodelled_because,
        }
