"""The points of the flight envelope at full cable length, and the worst of them between the grid.

A grid of tow radius and speed, and for each figure that has a limit a closer look around its worst
point: a window of flutter can be narrower than a cell.
"""

from collections.abc import Iterable

import numpy as np

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.design.point import DesignPoint, design_point
from ctcbs_ros.scaling import flight_point

# Each closer look halves the spacing.
_LOOKS = 2


def grid_lines(limits: tuple[float, float], count: int) -> list[float]:
    """Equally spaced values of a range, both ends included."""
    return np.linspace(*limits, count).tolist()


def envelope_row(
    configuration: Configuration, density: float, radius: float, speeds: Iterable[float]
) -> tuple[DesignPoint, ...]:
    """The points of one tow radius, for air of a density [kg/m^3]."""
    reach = configuration.limits.near_jump
    return tuple(
        design_point(flight_point(configuration, radius, speed, density), reach)
        for speed in speeds
    )


def closer_look(
    configuration: Configuration, density: float, rows: tuple[tuple[DesignPoint, ...], ...]
) -> tuple[DesignPoint, ...]:
    """More points around those of least margin, largest tension and largest end-mass radius.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    rows : tuple of tuple of DesignPoint
        The grid, a row for each tow radius.

    Returns
    -------
    tuple of DesignPoint
        In the order found, none twice.
    """
    radii = np.array([row[0].flight.radius for row in rows])
    speeds = np.array([point.flight.speed for point in rows[0]])
    steps = np.array([np.diff(radii).max(initial=0.0), np.diff(speeds).max(initial=0.0)])
    known = {(p.flight.radius, p.flight.speed): p for row in rows for p in row}
    grid = set(known)
    for worst in (_least_margin, _largest_tension, _largest_radius):
        for look in range(1, _LOOKS + 1):
            flown = [p for p in known.values() if p.state is not None]
            if not flown:
                break
            centre = worst(flown).flight
            for i, j in np.ndindex(3, 3):
                radius = centre.radius + (i - 1) * steps[0] / 2**look
                speed = centre.speed + (j - 1) * steps[1] / 2**look
                inside = radii[0] <= radius <= radii[-1] and speeds[0] <= speed <= speeds[-1]
                if inside and (radius, speed) not in known:
                    (known[radius, speed],) = envelope_row(
                        configuration, density, radius, (speed,)
                    )
    return tuple(point for where, point in known.items() if where not in grid)


def _least_margin(points) -> DesignPoint:
    return min(points, key=lambda point: point.margin)


def _largest_tension(points) -> DesignPoint:
    return max(points, key=lambda point: point.tension)


def _largest_radius(points) -> DesignPoint:
    return max(points, key=lambda point: point.end_mass_radius_share)
