"""The two ways into a circle with all of the cable out, followed quasi-statically.

Deployment: the cable is paid out while the aircraft circles (thesis, Fig. 5.3). Entry: it is paid
out in straight flight, and then the circle is tightened at constant speed. Where the branch flown
ends in a fold the end mass jumps; elsewhere it may flutter.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import exp, log, nan, sqrt

import numpy as np

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.design.path import Stretch, WayJump, follow_way, on_way, stretch_at
from ctcbs_ros.design.point import DesignPoint, point_of
from ctcbs_ros.scaling import FlightPoint, flight_point
from ctcbs_ros.solver.family import RADIUS_AT_SPEED, Family
from ctcbs_ros.solver.steady_state import steady_states

DEPLOYMENT, ENTRY = "deployment", "entry"
CABLE_LENGTH = Family("cable_length", length=1.0)
# What varies on each way, and whether it rises or falls.
_FAMILIES = {DEPLOYMENT: (CABLE_LENGTH, 1), ENTRY: (RADIUS_AT_SPEED, -1)}
# The first length of a deployment, over the whole: with less the end mass is at the tow point.
_SHORTEST = 0.01
# The first tow radius of an entry, over the cable's length: nearly straight flight.
_FAR = 20.0
# A change of stability is located to this relative error.
_ERROR = 1e-6


@dataclass(frozen=True)
class Jump:
    """A fold on the way in.

    Attributes
    ----------
    radius, cable_length : float
        Tow radius and cable out there [m].
    before, after : float
        End-mass radius [m]; `after` is nan where no stable state remains.
    """

    radius: float
    cable_length: float
    before: float
    after: float


@dataclass(frozen=True)
class StabilityChange:
    """Where the state flown becomes stable or unstable on the way in.

    Attributes
    ----------
    radius, cable_length : float
        Tow radius and cable out there [m].
    becomes_stable : bool
    frequency : float
        Of the mode [rad/s], in the rotating frame; 0 for a divergence.
    """

    radius: float
    cable_length: float
    becomes_stable: bool
    frequency: float


@dataclass(frozen=True)
class WayIn:
    """A deployment or an entry.

    Attributes
    ----------
    kind : str
        "deployment" or "entry".
    radius, speed : float
        The tow radius it leads to [m], and the speed [m/s].
    points : tuple of DesignPoint
        In the order flown.
    jumps : tuple of Jump
    changes : tuple of StabilityChange
    """

    kind: str
    radius: float
    speed: float
    points: tuple[DesignPoint, ...]
    jumps: tuple[Jump, ...]
    changes: tuple[StabilityChange, ...]


def deploy(
    configuration: Configuration, density: float, radius: float, speed: float, count: int
) -> WayIn:
    """Pay out all of the cable on one circle.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    radius, speed : float
        Of the tow point [m], [m/s].
    count : int
        Number of lengths, equally spaced; a very short one comes before them.
    """
    flight = _deployed(configuration, density, radius, speed)
    full = configuration.cable.length
    lengths = [_SHORTEST * full, *np.linspace(0.0, full, count + 1)[1:].tolist()]
    return _way_in(DEPLOYMENT, flight, lengths)


def deployment_jumps(
    configuration: Configuration, density: float, radius: float, speed: float
) -> tuple[Jump, ...]:
    """Only the jumps of `deploy`, which cost little."""
    full = configuration.cable.length
    flight = _deployed(configuration, density, radius, speed)
    return _branch(DEPLOYMENT, flight, _SHORTEST * full, full)[1]


def enter(
    configuration: Configuration, density: float, radius: float, speed: float, count: int
) -> WayIn:
    """Tighten from nearly straight flight with all of the cable out.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    radius : float
        The tow radius that it leads to [m].
    speed : float
        [m/s]
    count : int
        Number of tow radii, equally spaced in their logarithm.
    """
    def flight(at: float) -> FlightPoint:
        return flight_point(configuration, at, speed, density)

    far = max(_FAR * configuration.cable.length, 2.0 * radius)
    return _way_in(ENTRY, flight, np.geomspace(far, radius, count).tolist())


def _deployed(configuration, density, radius, speed) -> Callable[[float], FlightPoint]:
    return lambda length: flight_point(
        configuration, radius, speed, density, cable_length=length
    )


def _branch(
    kind: str, flight: Callable[[float], FlightPoint], first: float, last: float
) -> tuple[tuple[Stretch, ...], tuple[Jump, ...]]:
    """The branch flown from the first value of what varies to the last, and its jumps."""
    states = steady_states(flight(first).parameters).states
    if not states:
        return (), ()
    family, direction = _FAMILIES[kind]
    # Where there are several: with hardly any cable the end mass follows the tow point, and in
    # straight flight the cable trails behind; both are the state of largest radius.
    stretches, jumps = follow_way(states[-1], family, direction, abs(log(last / first)))

    def in_metres(jump: WayJump) -> Jump:
        there = flight(first * exp(direction * jump.way))
        after = nan if jump.landed is None else jump.landed.end_mass_radius * there.radius
        return Jump(there.radius, there.cable_length, jump.end_mass_radius * there.radius, after)

    return stretches, tuple(in_metres(jump) for jump in jumps)


def _way_in(kind: str, flight: Callable[[float], FlightPoint], values: list[float]) -> WayIn:
    stretches, jumps = _branch(kind, flight, values[0], values[-1])

    def way(value: float) -> float:
        return abs(log(value / values[0]))

    def point(value: float) -> DesignPoint:
        here = flight(value)
        found = steady_states(here.parameters)
        return point_of(here, found, on_way(stretches, way(value), found.states))

    points = [point(value) for value in values]
    changes = [
        _stability_change(point, *ends)
        for ends, (a, b) in zip(pairwise(values), pairwise(points), strict=True)
        if a.margin * b.margin < 0.0
        and stretch_at(stretches, way(ends[0])) is stretch_at(stretches, way(ends[1]))
    ]
    last = points[-1].flight
    return WayIn(kind, last.radius, last.speed, tuple(points), jumps, tuple(changes))


def _stability_change(
    point: Callable[[float], DesignPoint], a: float, b: float
) -> StabilityChange:
    """Where the margin is zero between two neighbouring values, by bisection."""
    before, after = point(a), point(b)
    while abs(log(b / a)) > _ERROR:
        middle = sqrt(a * b)
        there = point(middle)
        if there.stable == after.stable:
            b, after = middle, there
        else:
            a, before = middle, there
    unstable = before if after.stable else after
    flight, damping = unstable.flight, unstable.damping
    frequency = nan if damping is None else damping.frequency * flight.angular_rate
    return StabilityChange(flight.radius, flight.cable_length, after.stable, frequency)
