"""Counts over the predictions of a flight."""

from collections import Counter
from typing import Any

from ctcbs_ros.prediction.prediction import Prediction


class Tally:
    """Counts over predictions.

    Attributes
    ----------
    samples, predictions : int
        Samples taken in, and the valid predictions among what they gave.
    skipped, warnings : Counter
        Samples not used by skip code, and predictions with each warning by warning code.
    """

    def __init__(self):
        self.samples = 0
        self.predictions = 0
        self.skipped: Counter[str] = Counter()
        self.warnings: Counter[str] = Counter()

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self.samples += 1
        self.predictions += prediction.valid
        if prediction.skip is not None:
            self.skipped[prediction.skip.value] += 1
        self.warnings.update({warning.code.value for warning in prediction.warnings})

    def as_dict(self) -> dict[str, Any]:
        """The counts as the summary has them."""
        return {
            "samples": self.samples,
            "predictions": self.predictions,
            "skipped": dict(self.skipped),
            "warnings": dict(self.warnings),
        }
