"""A measured position less a candidate one: predicted, simulated, or any other."""

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

# Squared distance in standard deviations within which 95 % of three normal errors lie: chi-squared
# of 3 degrees of freedom.
REGION_95 = 7.814727903251178


@dataclass(frozen=True)
class Difference:
    """Measured minus candidate.

    Attributes
    ----------
    enu : (3,) ndarray
        East, north, up [m].
    covariance : (3, 3) ndarray
        Of it, were the candidate right [m^2].
    distance : float
        Its length in standard deviations (Mahalanobis distance).
    """

    enu: np.ndarray
    covariance: np.ndarray
    distance: float

    @property
    def horizontal(self) -> float:
        """[m]"""
        return hypot(self.enu[0], self.enu[1])

    @property
    def inside_95(self) -> bool:
        """Whether it lies in the region that ought to hold 95 % of them."""
        return self.distance**2 <= REGION_95


def difference(measured, candidate, covariance) -> Difference:
    """Measured minus candidate position.

    Parameters
    ----------
    measured, candidate : (3,) array_like
        East, north, up in one frame, at one time [m].
    covariance : (3, 3) array_like
        Of measured and candidate together, positive definite [m^2].
    """
    enu = np.asarray(measured, float) - np.asarray(candidate, float)
    covariance = np.asarray(covariance, float)
    distance = sqrt(max(0.0, float(enu @ np.linalg.solve(covariance, enu))))
    return Difference(enu, covariance, distance)
