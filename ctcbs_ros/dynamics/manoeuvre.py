"""Ways into a circle: what the tow point flies, what is paid out, and where the cable begins.

All non-dimensional by the circle that is entered: its radius, 1/Omega and mu a. The circle is
about the origin, anticlockwise, at height 0; speeds are over the ground. Time 0 is the beginning.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import atan, cos, log, tan

import numpy as np
from scipy.interpolate import CubicSpline

from ctcbs_ros.dynamics.cable import hanging
from ctcbs_ros.dynamics.equilibrium import equilibrium, trailing
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState, steady_states

# Knots of the way into a turn.
_FINE = 1001


@dataclass(frozen=True)
class Manoeuvre:
    """A way into the circle.

    Attributes
    ----------
    duration : float
        From when on the circle is flown at its rate, with all cable out.
    place : callable
        Of times (k,), the tow point's position, (k, 3).
    length : callable or None
        Of times (k,), the length paid out, (k, 1); None where all of it always is.
    begin : callable
        Of the number of segments and the wind, (3,), the cable at time 0.
    settles_first : bool
        Whether it begins on a circle, where wind must have been felt for a while.
    """

    duration: float
    place: Callable
    length: Callable | None
    begin: Callable
    settles_first: bool


def hanging_below(parameters: Parameters) -> Manoeuvre:
    """On the circle at once, the cable hanging vertically and moving with the tow point."""

    def begin(segments, _wind):
        return hanging(line_of(parameters), segments, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))

    return Manoeuvre(0.0, _on_circle(lambda t: t), None, begin, False)


def from_straight(parameters: Parameters, bank_rate: float) -> Manoeuvre:
    """From straight flight at the circle's speed, banking at a constant rate.

    Parameters
    ----------
    parameters : Parameters
    bank_rate : float
        [rad] in 1/Omega. The bank of the circle is atan(omega^2), that of a turn that does not
        slip in still air.
    """
    bank = atan(parameters.omega**2)
    duration = bank / bank_rate
    turned = -log(cos(bank)) / (bank_rate * tan(bank))
    # Backwards from the circle, which is joined at (1, 0, 0).
    times = np.linspace(0.0, duration, _FINE)
    heading = 0.5 * np.pi - turned - np.log(np.cos(bank_rate * times)) / (bank_rate * tan(bank))
    velocity = np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=-1)
    way = CubicSpline(times, velocity).antiderivative()
    first = np.array([1.0, 0.0, 0.0]) - way(duration)
    circling = _on_circle(lambda t: t - duration)

    def place(t):
        before = first + way(np.clip(t, 0.0, duration))
        return np.where(t[:, None] < duration, before, circling(t))

    def begin(segments, wind):
        return trailing(line_of(parameters), segments, first, velocity[0], wind)

    return Manoeuvre(duration, place, None, begin, False)


def paying_out(parameters: Parameters, deployed: float, rate: float) -> Manoeuvre:
    """On the circle all the time, paying out or hauling in from a length, smoothly.

    Parameters
    ----------
    parameters : Parameters
    deployed : float
        Length at first.
    rate : float
        Greatest rate of the length, over the tow speed.

    Raises
    ------
    InputError
        If there is no steady state to begin with.
    """
    whole = parameters.length - deployed
    # A cubic in time: its greatest rate is 1.5 times the mean.
    duration = 1.5 * abs(whole) / rate
    first = _steady(replace(_elastic(parameters), length=deployed), "at the length paid out first")

    def length(t):
        part = np.clip(t / duration, 0.0, 1.0)[:, None]
        return deployed + whole * part * part * (3.0 - 2.0 * part)

    return Manoeuvre(
        duration, _on_circle(lambda t: t), length, lambda n, _wind: equilibrium(first, n), True
    )


def changing_speed(parameters: Parameters, speed: float, acceleration: float) -> Manoeuvre:
    """On the circle, from another speed at a constant acceleration.

    Parameters
    ----------
    parameters : Parameters
    speed : float
        At first, over the circle's.
    acceleration : float
        In a Omega^2, without sign.
    """
    rate = acceleration if speed < 1.0 else -acceleration
    duration = (1.0 - speed) / rate
    first = _steady(ANGULAR_RATE.at(_elastic(parameters), log(speed)), "at the first speed")

    def angle(t):
        s = np.clip(t, 0.0, duration)
        return speed * np.minimum(t, duration) + 0.5 * rate * s * s + np.maximum(t - duration, 0.0)

    def begin(segments, _wind):
        state = equilibrium(first, segments)
        return replace(state, velocities=speed * state.velocities)

    return Manoeuvre(duration, _on_circle(angle), None, begin, True)


def changing_radius(parameters: Parameters, radius: float, rate: float) -> Manoeuvre:
    """From another radius at the circle's speed, spiralling at a constant rate.

    Parameters
    ----------
    parameters : Parameters
    radius : float
        At first, over the circle's.
    rate : float
        Of the radius, over the tow speed, without sign; below 1.

    Raises
    ------
    InputError
        If the rate is not below the tow speed, or there is no steady state to begin with.
    """
    if not rate < 1.0:
        raise InputError(f"rate of the radius: {rate:g} of the tow speed, it must be below 1")
    slope = rate if radius < 1.0 else -rate
    duration = (1.0 - radius) / slope
    first = _steady(
        RADIUS_AT_SPEED.at(_elastic(parameters), log(radius)), "at the first radius"
    )
    along = (1.0 - slope**2) ** 0.5

    def size(t):
        return radius + slope * np.clip(t, 0.0, duration)

    def angle(t):
        spiral = along * np.log(size(t) / radius) / slope
        return np.minimum(t, 0.0) / radius + spiral + np.maximum(t - duration, 0.0)

    def begin(segments, _wind):
        state = equilibrium(first, segments)
        return replace(state, positions=radius * state.positions)

    return Manoeuvre(duration, _on_circle(angle, size), None, begin, True)


def _on_circle(angle, size=None):
    def place(t):
        t = np.asarray(t, float)
        turned = np.stack([np.cos(angle(t)), np.sin(angle(t)), 0.0 * t], axis=-1)
        return turned if size is None else size(t)[:, None] * turned

    return place


def _elastic(parameters: Parameters) -> Parameters:
    """With the vibration's elasticity where there is none: a cable in time always stretches."""
    if parameters.elastic:
        return parameters
    return replace(parameters, elasticity=parameters.vibration_elasticity)


def _steady(parameters: Parameters, where: str) -> SteadyState:
    """The steady state with the smallest end-mass radius."""
    found = steady_states(parameters)
    if not found.states:
        raise InputError(f"no steady state to begin with {where}: {found.reason}")
    return min(found.states, key=lambda s: s.end_mass_radius)
