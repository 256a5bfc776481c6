"""What a design must meet, and which of it a point does not."""

from dataclasses import dataclass
from enum import Enum
from math import inf, isfinite

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.way_in import DEPLOYMENT


class Criterion(Enum):
    """What can be wrong with a point; named like the flight's warnings where there is one."""

    NO_SOLUTION = "NO_SOLUTION"
    MULTIPLE_SOLUTIONS = "MULTIPLE_SOLUTIONS"
    JUMPED = "JUMPED"
    UNSTABLE = "UNSTABLE"
    LOW_MARGIN = "LOW_MARGIN"
    TENSION_LIMIT = "TENSION_LIMIT"
    END_MASS_RADIUS = "END_MASS_RADIUS"


@dataclass(frozen=True)
class Requirements:
    """Limits of a design; one steady state, and a stable one, is always required.

    Attributes
    ----------
    end_mass_radius : float
        Largest end-mass radius [m]; inf for no limit.
    end_mass_radius_share : float
        Largest end-mass radius over the tow radius; inf for no limit.
    margin : float
        Least decay rate of the least damped mode [1/s]; 0 for just stable.
    tension : float
        Largest tension in the cable over its breaking tension.
    way_in : str
        "deployment": the cable is paid out on the circle; "entry": in straight flight, and then
        the circle is tightened.
    """

    end_mass_radius: float = inf
    end_mass_radius_share: float = inf
    margin: float = 0.0
    tension: float = 0.5
    way_in: str = DEPLOYMENT

    def radius_limit(self, tow_radius: float) -> float:
        """Largest end-mass radius [m] on a tow radius [m]."""
        return min(self.end_mass_radius, self.end_mass_radius_share * tow_radius)

    @property
    def limits_radius(self) -> bool:
        """Whether the end-mass radius has a limit at all."""
        return isfinite(self.radius_limit(1.0))


def tension_limit(configuration: Configuration, requirements: Requirements) -> float:
    """Largest tension allowed [N]; inf where the breaking tension is not known."""
    return requirements.tension * configuration.cable.breaking_tension


def violations(
    point: DesignPoint, configuration: Configuration, requirements: Requirements, paid_out: bool
) -> tuple[Criterion, ...]:
    """What a point does not meet.

    Parameters
    ----------
    point : DesignPoint
    configuration : Configuration
    requirements : Requirements
    paid_out : bool
        Whether all of the cable is out. Before, the end mass is on its way in from the tow
        circle: its radius and margin have no limit, but it must be stable.
    """
    if point.state is None:
        return (Criterion.NO_SOLUTION,)
    found = []
    if point.solutions > 1:
        found.append(Criterion.MULTIPLE_SOLUTIONS)
    if paid_out and _jump_inside(point, configuration):
        found.append(Criterion.JUMPED)
    if not point.stable:
        found.append(Criterion.UNSTABLE)
    elif paid_out and point.margin < requirements.margin:
        found.append(Criterion.LOW_MARGIN)
    if point.tension > tension_limit(configuration, requirements):
        found.append(Criterion.TENSION_LIMIT)
    if paid_out and point.end_mass_radius > requirements.radius_limit(point.flight.radius):
        found.append(Criterion.END_MASS_RADIUS)
    return tuple(found)


def _jump_inside(point: DesignPoint, configuration: Configuration) -> bool:
    """Whether the branch ends inside the envelope, be it between the points of a grid."""
    slow, fast = configuration.envelope.speed
    small, large = configuration.envelope.radius
    return slow <= point.jump_in_speed <= fast or small <= point.jump_in_radius <= large
