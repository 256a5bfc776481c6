"""Running figures of differences, in constant memory."""

from collections import Counter
from math import ceil, floor, log, sqrt
from typing import Any

import numpy as np

from ctcbs_ros.beacon.difference import Difference

# Classes of lengths: each longer by this part, from _LEAST [m] on.
_STEP = log(1.01)
_LEAST = 1e-3


class Lengths:
    """Quantiles of lengths to 1 %, from a count of classes."""

    def __init__(self):
        self._counts: Counter[int] = Counter()

    def add(self, length: float) -> None:
        """Take in one more, not negative."""
        self._counts[floor(log(max(length, _LEAST) / _LEAST) / _STEP)] += 1

    def quantile(self, share: float) -> float | None:
        """The length that this share of them does not exceed; None before any."""
        left = ceil(share * self._counts.total())
        for number in sorted(self._counts):
            left -= self._counts[number]
            if left <= 0:
                return _LEAST * 1.01 ** (number + 0.5)
        return None


class DifferenceStatistics:
    """Mean, rms and 95 % of differences, and the share of them where 95 % ought to be.

    The mean's stated error is the root mean square of the differences': what makes them up (orbit,
    wind, what is left of the entry, the receivers' biases) is much the same from report to report,
    so that many of them make it no smaller.
    """

    def __init__(self):
        self.count = 0
        self._inside = 0
        self._sum = np.zeros(3)
        self._squares = np.zeros(3)
        self._variances = np.zeros(3)
        self._horizontal, self._vertical = Lengths(), Lengths()

    def add(self, found: Difference) -> None:
        """Take in one more."""
        self.count += 1
        self._inside += found.inside_95
        self._sum += found.enu
        self._squares += found.enu**2
        self._variances += np.diag(found.covariance)
        self._horizontal.add(found.horizontal)
        self._vertical.add(abs(float(found.enu[2])))

    def as_dict(self) -> dict[str, Any]:
        """The figures, None where there are none: metres, east, north, up; shares 0 to 1."""
        if not self.count:
            return {"count": 0} | dict.fromkeys(_FIGURES)
        mean, squares = self._sum / self.count, self._squares / self.count
        return {
            "count": self.count,
            "mean_m": mean.tolist(),
            "mean_std_m": np.sqrt(self._variances / self.count).tolist(),
            "rms_horizontal_m": sqrt(squares[0] + squares[1]),
            "rms_up_m": sqrt(squares[2]),
            "horizontal_95_m": self._horizontal.quantile(0.95),
            "vertical_95_m": self._vertical.quantile(0.95),
            "share_inside_95": self._inside / self.count,
        }


_FIGURES = (
    "mean_m", "mean_std_m", "rms_horizontal_m", "rms_up_m", "horizontal_95_m", "vertical_95_m",
    "share_inside_95",
)  # fmt: skip
