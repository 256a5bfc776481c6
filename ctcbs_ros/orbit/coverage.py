"""Whether true values lie in the 95 % regions stated of them, for the studies of estimates."""

from math import sqrt

import numpy as np
from scipy.stats import chi2

LEVEL = 0.95
# The bars are meant for this many runs; fewer scatter more.
RUNS = 1000


def in_region(error: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether an error (n,) lies in the 95 % region of its covariance (n, n)."""
    return bool(error @ np.linalg.solve(covariance, error) < chi2.ppf(LEVEL, len(error)))


def coverage_bounds(runs: int, bar: tuple[float, float]) -> tuple[float, float]:
    """Least and most share inside the region of so many runs, for a bar meant for 1000.

    Of fewer, three standard deviations of what that adds are allowed for.
    """
    extra = 3.0 * sqrt(LEVEL * (1.0 - LEVEL) * max(1.0 / runs - 1.0 / RUNS, 0.0))
    return max(bar[0] - extra, 0.0), min(bar[1] + extra, 1.0)


def missed_coverage(what: str, share: float, runs: int, bar: tuple[float, float]) -> list[str]:
    """A sentence where a share inside the region misses its bar; none if it holds."""
    least, most = coverage_bounds(runs, bar)
    if least <= share <= most:
        return []
    return [f"{what} inside the 95 % region in {share:.1%}"]
