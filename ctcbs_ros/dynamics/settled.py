"""What a motion comes to: the end mass over the last orbit, the extremes of the whole run, and
whether one orbit after another is the same.
"""

from dataclasses import dataclass
from math import atan2, pi

import numpy as np

from ctcbs_ros.dynamics.cable import Drive, Motion
from ctcbs_ros.dynamics.line import Line
from ctcbs_ros.dynamics.loads import loads


@dataclass(frozen=True)
class Outcome:
    """Figures of a motion, in the units it was simulated in.

    Attributes
    ----------
    radius, least_radius, greatest_radius : float
        Mean and extremes of the end mass's distance from the axis, over the last period.
    depth, least_depth, greatest_depth : float
        The same of its depth below the tow point.
    phase_lag : float
        Mean angle by which the tow point is ahead over the last period, in [0, 2 pi).
    mean_position : (3,) ndarray
        Of the end mass over the last period.
    settled : bool
        Whether radius and depth differ from those of the period before by less than a thousandth
        of the cable's length, all the way.
    greatest_tension : float
        Of all segments at all times given.
    lowest : float
        Least height of any node at any of these times.
    greatest_excursion : float
        Greatest distance of the end mass from the axis at any of these times.
    slack : float
        Share of the times at which some segment is slack.
    """

    radius: float
    least_radius: float
    greatest_radius: float
    depth: float
    least_depth: float
    greatest_depth: float
    phase_lag: float
    mean_position: np.ndarray
    settled: bool
    greatest_tension: float
    lowest: float
    greatest_excursion: float
    slack: float


def outcome(line: Line, driven: Drive, motion: Motion, period: float) -> Outcome:
    """What a motion comes to.

    Parameters
    ----------
    line : Line
    driven : Drive
    motion : Motion
        At evenly spaced times, at least 8 a period.
    period : float
        Of the tow point's orbit, about the z axis.
    """
    end, top = motion.positions[:, 0], motion.positions[:, -1]
    radius = np.hypot(end[:, 0], end[:, 1])
    depth = top[:, 2] - end[:, 2]
    each = round(period / (motion.times[1] - motion.times[0]))
    last = slice(max(0, len(radius) - each), None)
    before = slice(max(0, len(radius) - 2 * each), max(0, len(radius) - each))
    ahead = (top[last, 0] + 1j * top[last, 1]) * (end[last, 0] - 1j * end[last, 1])
    mean = np.mean(ahead / np.maximum(np.abs(ahead), 1e-300))
    settled = len(radius) >= 2 * each and all(
        np.abs(q[last] - q[before]).max() < 1e-3 * line.length for q in (radius, depth)
    )
    found = loads(line, driven, motion)
    return Outcome(
        radius=float(radius[last].mean()),
        least_radius=float(radius[last].min()),
        greatest_radius=float(radius[last].max()),
        depth=float(depth[last].mean()),
        least_depth=float(depth[last].min()),
        greatest_depth=float(depth[last].max()),
        phase_lag=atan2(mean.imag, mean.real) % (2.0 * pi),
        mean_position=end[last].mean(axis=0),
        settled=settled,
        greatest_tension=float(found.tensions.max()),
        lowest=float(motion.positions[..., 2].min()),
        greatest_excursion=float(radius.max()),
        slack=float(np.mean((found.tensions == 0.0).any(axis=1))),
    )


@dataclass(frozen=True)
class Passage:
    """Figures of a motion along any path, in the units it was simulated in.

    Attributes
    ----------
    end_mass : (3,) ndarray
        Where it is at the end.
    least_depth, greatest_depth : float
        Of the end mass below the tow point.
    least_distance, greatest_distance : float
        Of the end mass from the tow point, horizontally.
    greatest_tension, lowest, slack : float
        As in `Outcome`.
    """

    end_mass: np.ndarray
    least_depth: float
    greatest_depth: float
    least_distance: float
    greatest_distance: float
    greatest_tension: float
    lowest: float
    slack: float


def passage(line: Line, driven: Drive, motion: Motion) -> Passage:
    """What a motion along any path comes to."""
    away = motion.positions[:, -1] - motion.positions[:, 0]
    distance = np.hypot(away[:, 0], away[:, 1])
    found = loads(line, driven, motion)
    return Passage(
        end_mass=motion.positions[-1, 0],
        least_depth=float(away[:, 2].min()),
        greatest_depth=float(away[:, 2].max()),
        least_distance=float(distance.min()),
        greatest_distance=float(distance.max()),
        greatest_tension=float(found.tensions.max()),
        lowest=float(motion.positions[..., 2].min()),
        slack=float(np.mean((found.tensions == 0.0).any(axis=1))),
    )


# Extremes the same, to a part of their range, over three spans of so many orbits: an oscillation.
SPAN, _SAME = 10, 0.1


def approached(orbits, left: float) -> bool:
    """Whether orbit after orbit comes to the same, up to what is left of the approach.

    Parameters
    ----------
    orbits : (k, n, 3) ndarray
        The end mass at the same n times of k orbits.
    left : float
        Greatest distance along an axis that may be left, by the geometric series that the last
        two changes from orbit to orbit begin.
    """
    if len(orbits) < 3:
        return False
    last, before = (np.abs(orbits[-k] - orbits[-k - 1]).max() for k in (1, 2))
    if last >= left:
        return False
    # Where it does not come nearer the approach never ends.
    share = last / max(before, 1e-300)
    return bool(last < 0.1 * left or (share < 1.0 and last / (1.0 - share) < left))


def oscillates(orbits, least: float) -> bool:
    """Whether it keeps oscillating: the extremes of radius and height stay, its orbits do not.

    Parameters
    ----------
    orbits : (k, n, 3) ndarray
        As in `approached`, about the circle's centre; not approached.
    least : float
        Range of radius or height from which on it is an oscillation.
    """
    if len(orbits) < 3 * SPAN:
        return False
    late = orbits[-3 * SPAN :]
    figures = np.stack([np.hypot(late[..., 0], late[..., 1]), late[..., 2]]).reshape(2, 3, -1)
    low, high = figures.min(axis=2), figures.max(axis=2)
    size = (high - low).max(axis=1)
    return bool(
        size.max() > least
        and np.all(np.maximum(np.ptp(low, axis=1), np.ptp(high, axis=1)) < _SAME * size.max())
    )


def settled_after(orbits, within: float) -> int:
    """Index, in orbits times n, from which on every orbit is the last one to within a distance.

    Parameters
    ----------
    orbits : (k, n, 3) ndarray
        As in `approached`.
    within : float
    """
    away = np.linalg.norm(orbits - orbits[-1], axis=2).ravel()
    outside = np.flatnonzero(away > within)
    return int(outside[-1]) + 1 if outside.size else 0
