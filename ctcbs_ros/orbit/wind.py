"""A horizontal wind with its covariance, by whomever it is told, and when two contradict."""

from dataclasses import dataclass
from enum import Enum
from math import atan2, degrees, hypot, log, sqrt

import numpy as np

# Standard deviation of a wind along an axis where nobody knows it [m/s]. Wind speeds mostly have a
# Rayleigh distribution, of mean 1.25 times that: over land, 80 m up, it is 4.5 m/s (Archer and
# Jacobson, Evaluation of global wind power, J. Geophys. Res. 110, D12110, 2005), more higher up.
CLIMATE = 4.0
# Squared distance of two winds, in units of its covariance, that chance does not explain.
# chi^2 of two components is exponential: the quantile of 0.999.
CONTRADICTION = -2.0 * log(1.0 - 0.999)


class WindSource(Enum):
    """Who says what the wind is."""

    AUTOPILOT = "autopilot"
    FLIGHT = "flight"
    PARAMETER = "parameter"


@dataclass(frozen=True)
class Wind:
    """A horizontal wind, uniform over the orbit.

    Attributes
    ----------
    velocity : (2,) ndarray
        Of the air, towards east and north [m/s].
    covariance : (2, 2) ndarray
        [(m/s)^2]
    source : WindSource
    note : str
        What the source rests on, and who says otherwise.
    """

    velocity: np.ndarray
    covariance: np.ndarray
    source: WindSource
    note: str = ""

    @property
    def speed(self) -> float:
        """[m/s]"""
        return float(np.hypot(*self.velocity))

    @property
    def from_direction(self) -> float:
        """Where it blows from, clockwise from north [deg], from 0 to below 360."""
        # Rounded first: a hair to the west of north is north, not 360.
        return round(degrees(atan2(-self.velocity[0], -self.velocity[1])), 6) % 360.0

    @property
    def sigma(self) -> float:
        """Standard deviation along the axis that is known worst [m/s]."""
        return worst_sigma(self.covariance)


def contradict(one, other) -> bool:
    """Whether two winds with covariances differ by more than chance explains."""
    return squared_distance(one, other) > CONTRADICTION


def squared_distance(one, other) -> float:
    """Square of the difference of two winds in units of its covariance."""
    off = one.velocity - other.velocity
    return float(off @ np.linalg.solve(one.covariance + other.covariance, off))


def worst_sigma(covariance: np.ndarray) -> float:
    """Standard deviation along the axis of a (2, 2) covariance that is known worst."""
    middle = 0.5 * (covariance[0, 0] + covariance[1, 1])
    apart = hypot(0.5 * (covariance[0, 0] - covariance[1, 1]), covariance[0, 1])
    return sqrt(max(middle + apart, 0.0))
