"""Simulated flights of an autopilot that converges onto its circle, with known truth.

The aircraft of `tracks.py` is on its circle from one sample to the next. One with an autopilot is
not: it steers towards the circle, in still air or in wind, and comes onto it within a turn or so.
"""

from dataclasses import dataclass
from math import atan2, cos, exp, hypot, pi, sin

import numpy as np

GRAVITY = 9.81
_STEP = 0.02  # s
_STEEPEST = 1.5 * GRAVITY * 3.0**0.5  # lateral acceleration [m/s^2]: banked by 69 degrees


@dataclass(frozen=True)
class Loiter:
    """A circle to be held over the ground, until a time.

    Attributes
    ----------
    until : float
        [s]
    center : (float, float)
        [m]
    radius : float
        [m]
    sense : int
        +1 anticlockwise.
    """

    until: float
    center: tuple[float, float]
    radius: float
    sense: int


@dataclass(frozen=True)
class Straight:
    """A course to be held over the ground [rad], until a time [s]."""

    until: float
    course: float


@dataclass(frozen=True)
class Autopilot:
    """How an aircraft is steered.

    Attributes
    ----------
    airspeed : float
        [m/s]
    period, damping : float
        Of its approach to a circle or a course [s].
    roll_time : float
        In which its bank follows [s].
    wind : (float, float)
        Velocity of the air [m/s].
    """

    airspeed: float
    period: float = 20.0
    damping: float = 0.75
    roll_time: float = 0.6
    wind: tuple[float, float] = (0.0, 0.0)


def guided(autopilot: Autopilot, legs: list, position, course: float) -> tuple:
    """Fly one leg after another.

    To a circle it steers as to its centre while that asks for less of a turn than the circle
    (S. Park, J. Deyst and J. P. How, A new nonlinear guidance logic for trajectory tracking, AIAA
    2004-4900), and about it with the acceleration of the circle, and in proportion to the distance
    from it and its rate.

    Parameters
    ----------
    autopilot : Autopilot
    legs : list of Loiter or Straight
    position : (2,)
        At time nought [m].
    course : float
        Of the air velocity then [rad].

    Returns
    -------
    time : (n,) ndarray
        [s]
    position, velocity : (n, 2) ndarray
        Over the ground [m], [m/s].
    """
    v, (we, wn) = autopilot.airspeed, autopilot.wind
    kept = exp(-_STEP / autopilot.roll_time)
    (x, y), lateral = position, 0.0
    count = int(legs[-1].until / _STEP)
    rows = np.empty((count, 4))
    leg = 0
    for i in range(count):
        if i * _STEP >= legs[leg].until:
            leg += 1
        ve, vn = v * cos(course) + we, v * sin(course) + wn
        rows[i] = x, y, ve, vn
        wanted = _lateral(autopilot, legs[leg], x, y, ve, vn)
        wanted = min(max(wanted, -_STEEPEST), _STEEPEST)
        lateral = wanted + (lateral - wanted) * kept
        middle = course + 0.5 * lateral / v * _STEP
        x += (v * cos(middle) + we) * _STEP
        y += (v * sin(middle) + wn) * _STEP
        course += lateral / v * _STEP
    return _STEP * np.arange(count), rows[:, :2], rows[:, 2:]


def _lateral(autopilot, leg, x, y, ve, vn) -> float:
    """Acceleration to the left of the velocity [m/s^2]."""
    omega = 2.0 * pi / autopilot.period
    ground = hypot(ve, vn)
    if isinstance(leg, Straight):
        off = (leg.course - atan2(vn, ve) + pi) % (2.0 * pi) - pi
        return 2.0 * autopilot.damping * omega * ground * sin(min(max(off, -0.5 * pi), 0.5 * pi))
    dx, dy = x - leg.center[0], y - leg.center[1]
    distance = max(hypot(dx, dy), 1e-6)
    out = (ve * dx + vn * dy) / distance
    along = leg.sense * (vn * dx - ve * dy) / distance
    off = distance - leg.radius
    about = along * along / max(distance, 0.5 * leg.radius)
    held = off * omega**2 + out * 2.0 * autopilot.damping * omega
    if out > 0.0 and along < 0.0:
        held = max(held, 0.0)
    about += held
    if off <= 0.0:
        return leg.sense * about
    # To the centre, at the distance that the period asks for.
    reach = autopilot.damping * autopilot.period * ground / pi
    angle = atan2(-(ve * dy - vn * dx), -(ve * dx + vn * dy))
    angle = min(max(angle, -0.5 * pi), 0.5 * pi)
    towards = 4.0 * autopilot.damping**2 * ground**2 / reach * sin(angle)
    return towards if leg.sense * towards < about else leg.sense * about
