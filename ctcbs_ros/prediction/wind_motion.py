"""The end mass's motion in the wind near a flight for which it was solved.

A circle held over the ground in a wind leaves the end mass no steady place: it moves periodically
(`ctcbs_ros.periodic`). Near a flight that motion is linear in radius, rate and wind, and so is
what their errors do to the end mass.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import atan2, hypot, log

import numpy as np

from ctcbs_ros.dynamics.cable import CableState
from ctcbs_ros.errors import InputError
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.periodic.elements import at_arc_lengths
from ctcbs_ros.periodic.factors import Storage
from ctcbs_ros.periodic.fourier import at_times, fourier
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.newton import newton_steps
from ctcbs_ros.periodic.solve import (
    Effort,
    coarse_search,
    followed_search,
    motion_search,
    refined_search,
)
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.prediction.pose import CABLE_POINTS
from ctcbs_ros.prediction.prediction import MotionInWind, MotionSource
from ctcbs_ros.prediction.wind_reasons import ALONE, NO_STRETCH, not_found
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState
from ctcbs_ros.twin.decay import Decay

# What the wind's own uncertainty leaves worth knowing: 0.1 m of a radius of 100 m, at most 2 m,
# and 6 m where only a coarse motion is found; the covariance has it.
EFFORT = Effort(
    1e-3, 2e-2, most_times=49, most_elements=24, most_memory=22_000_000,
    ladder=((9, 1e-4), (17, 1e-4), (21, 1e-5)),
)  # fmt: skip
_COARSE = 6e-2
# Steps of the derivatives: in ln of radius and rate, and in wind over the tow speed.
_STEP = 0.01
# Error of the linear motion over the square of the distance [a], until one is seen: on tight
# circles it is 20 times that.
_CURVATURE = 7.0
# What is seen of it is doubled: it may bend more farther on.
_BENDS_MORE = 2.0
_PATH_POINTS = 72
# Least wind in which "downwind" is a direction to take derivatives by [m/s].
_LEAST_WIND = 0.05
# Step in the fraction of the airspeed.
_FASTER = 1e-4

Scaled = Callable[[float, float], Parameters]


@dataclass(frozen=True)
class Flight:
    """What the motion depends on.

    Attributes
    ----------
    radius, rate, wind : float
        Of the circle [m], [rad/s]; of the air past it [m/s].
    kind : str
        What is constant round the circle, see `TowPath`.
    cable : tuple of float
        Length, end mass and drag in any units.
    """

    radius: float
    rate: float
    wind: float
    kind: str
    cable: tuple[float, float, float]

    @classmethod
    def of(cls, orbit: Orbit, wind: float, kind: str, p: Parameters) -> "Flight":
        """The flight on an orbit, of the parameters that it has."""
        a = orbit.radius
        cable = p.length * a, p.end_mass * a, p.cable_drag / a
        return cls(a, orbit.angular_rate, wind, kind, cable)

    @property
    def path(self) -> TowPath:
        """In the solver's units; InputError where the wind is as fast as the aircraft."""
        return TowPath.of_air_velocity(self.kind, self.wind / (self.radius * self.rate))

    def distance(self, other: "Flight") -> float:
        """To another flight: greatest change of ln of anything, of wind over the tow speed."""
        return max(self.moved(other), self.altered(other))

    def moved(self, other: "Flight") -> float:
        """The same of radius, rate and wind alone."""
        return max(
            abs(log(other.radius / self.radius)), abs(log(other.rate / self.rate)),
            abs(other.wind - self.wind) / (self.radius * self.rate),
        )  # fmt: skip

    def altered(self, other: "Flight") -> float:
        """The same of the cable alone."""
        return max(abs(log(b / a)) for a, b in zip(self.cable, other.cable, strict=True))


@dataclass(frozen=True)
class LinearMotion:
    """A motion with its derivatives by ln radius, ln rate and wind [m/s].

    Attributes
    ----------
    flight : Flight
        For which it was solved.
    motion : PeriodicMotion
    waves : (orders, 4, 3, n) ndarray
        Of the motion and of its three derivatives.
    curvature : float
        Error of the end mass over the square of the distance [a], see `after`.
    source : MotionSource
    state : CableState or None
        Of a motion in time, at a turn's end.
    beside : tuple of (PeriodicMotion, float)
        Those that the derivatives are from, each with its step in ln radius, ln rate or wind.
    known_as : PeriodicMotion or None
        The motion as well as those beside it are known, where that is not `motion`.
    decay : Decay or None
        Of a motion in time, as its turns came to the same.
    """

    flight: Flight
    motion: PeriodicMotion = field(repr=False)
    waves: np.ndarray = field(repr=False)
    curvature: float = _CURVATURE
    source: MotionSource = MotionSource.PERIODIC
    state: CableState | None = field(default=None, repr=False)
    beside: tuple[tuple[PeriodicMotion, float], ...] = field(default=(), repr=False)
    known_as: PeriodicMotion | None = field(default=None, repr=False)
    decay: Decay | None = None

    def at(self, flight: Flight, columns=slice(None)) -> np.ndarray:
        """The waves of a flight nearby, with their derivatives, (orders, 4, 3, columns)."""
        there = self.flight
        away = np.array([
            log(flight.radius / there.radius), log(flight.rate / there.rate),
            flight.wind - there.wind,
        ])  # fmt: skip
        waves = self.waves[..., columns]
        moved = waves.copy()
        moved[:, 0] += np.tensordot(waves[:, 1:], away, axes=(1, 0))
        return moved

    @property
    def coarse(self) -> bool:
        """Whether it may be known better: one in time is as well known as its segments let it."""
        return self.source is MotionSource.PERIODIC and self.motion.residual > EFFORT.accuracy

    def error(self, flight: Flight) -> float:
        """By how much the end mass of a flight nearby may be off [a]."""
        there = self.flight
        nonlinear = self.curvature * there.moved(flight) ** 2
        return hypot(self.motion.residual, nonlinear + there.altered(flight))

    def after(self, before: "LinearMotion") -> "LinearMotion":
        """This motion with the curvature that one solved nearby before shows by its error here.

        Where that lies too near to show any, with what was known there.
        """
        moved = before.flight.moved(self.flight)
        times = np.linspace(0.0, 2.0 * np.pi, _PATH_POINTS, endpoint=False)
        foreseen, solved = before.at(self.flight, 0)[:, 0], self.waves[:, 0, :, 0]
        off = np.linalg.norm(at_times(foreseen, times) - at_times(solved, times), axis=-1).max()
        known = before.flight.altered(self.flight) + before.motion.residual + self.motion.residual
        if moved**2 * before.curvature <= known:
            return replace(self, curvature=max(before.curvature, self.curvature))
        seen = _BENDS_MORE * max(0.0, off - known) / moved**2
        return replace(self, curvature=max(seen, 0.5 * before.curvature, _CURVATURE))


def linear_motion_search(
    flight: Flight, scaled: Scaled, state: SteadyState, before: PeriodicMotion | None,
    storage: Storage | None = None,
) -> Generator[float, None, LinearMotion | str]:  # fmt: skip
    """The motion with its derivatives, or why there is none; yields work (`newton_steps`).

    Parameters
    ----------
    flight : Flight
    scaled : callable
        Parameters at a tow radius [m] and a speed [m/s].
    state : SteadyState
        In still air, on the branch flown.
    before : PeriodicMotion or None
        Of the same cable nearby, to begin with.
    storage : Storage, optional
        Where the factors of Newton's method are made.
    """
    if not state.parameters.elastic:
        return NO_STRETCH
    try:
        path = flight.path
        if before is not None:
            parameters = scaled(flight.radius, flight.radius * flight.rate)
            found = yield from followed_search(
                before, parameters, path, _COARSE, 0.2, storage
            )
            if found.motion is not None:
                solved = yield from _with_derivatives(found.motion, flight, scaled, storage)
                if solved is not None:
                    return solved
        found = yield from coarse_search(state, path, _COARSE, storage)
        if found.motion is None:
            return not_found(found, flight.wind, flight.radius * flight.rate)
        solved = yield from _with_derivatives(found.motion, flight, scaled, storage)
    except InputError as error:
        return str(error)
    return solved or ALONE


def finer_motion_search(
    coarse: LinearMotion, flight: Flight, scaled: Scaled, state: SteadyState,
    storage: Storage | None = None,
) -> Generator[float, None, LinearMotion | str]:  # fmt: skip
    """A motion as well as it is worth knowing, from a coarse one or else from still air.

    It is that of the coarse one's flight, or else of `flight`; the parameters are those of
    `linear_motion_search`.
    """
    try:
        found = yield from refined_search(coarse.motion, EFFORT, storage)
        if found.motion is not None:
            flight = coarse.flight
        else:
            found = yield from motion_search(state, flight.path, EFFORT, storage)
        if found.motion is None:
            return found.reason
        solved = yield from _with_derivatives(found.motion, flight, scaled, storage)
    except InputError as error:
        return str(error)
    return solved or ALONE


def beside(flight: Flight, steps) -> Flight:
    """The flight steps off, (3,): parts of the radius and the rate, wind over the tow speed."""
    return replace(
        flight, radius=flight.radius * (1.0 + steps[0]), rate=flight.rate * (1.0 + steps[1]),
        wind=flight.wind + steps[2] * flight.radius * flight.rate,
    )  # fmt: skip


def _with_derivatives(
    motion: PeriodicMotion, flight: Flight, scaled: Scaled, storage: Storage | None
):
    """By one-sided differences; None where they lead nowhere."""
    waves, factors = fourier(motion.values), motion.factors
    found, speed, others = [waves], flight.radius * flight.rate, []
    for steps in np.eye(3):
        # By a shorter radius, a lower rate and less wind where more of them lead nowhere.
        for step in (_STEP, -_STEP):
            there = beside(flight, step * steps)
            if there.wind < 0.0:
                continue
            parameters = scaled(there.radius, there.radius * there.rate)
            guess = motion.values * (parameters.length / motion.parameters.length)
            solved = yield from newton_steps(parameters, there.path, guess, factors, storage)
            if solved is not None:
                factors = solved.factors
                unit = step * speed if steps[2] else log(1.0 + step)
                other = PeriodicMotion(
                    parameters, there.path, solved.values, motion.residual, solved.least_tension
                )
                others.append((other, unit))
                found.append((fourier(solved.values) - waves) / unit)
                break
        else:
            return None
    return LinearMotion(flight, motion, np.stack(found, axis=1), beside=tuple(others))


def motion_in_wind(
    solved: LinearMotion, orbit: Orbit, flight: Flight, velocity, covariance: np.ndarray
) -> MotionInWind:
    """Where the end mass is on an orbit near the one for which its motion was solved.

    Parameters
    ----------
    solved : LinearMotion
    orbit : Orbit
    flight : Flight
        On it.
    velocity : (2,) ndarray
        Of the air past the circle, towards east and north [m/s].
    covariance : (2, 2) ndarray
        Of that.

    Raises
    ------
    InputError
        If the wind is as fast as the aircraft.
    """
    east, north = (float(v) for v in velocity)
    downwind, path = atan2(north, east), flight.path
    # The solver's frame: x downwind, the circle anticlockwise, time and angle 0 downwind.
    angle = orbit.sense * (orbit.phase - downwind)
    time = float(path.times(np.array(angle)))
    waves = solved.at(flight)
    cable = at_times(waves[:, 0], time) @ _cable_points(waves.shape[-1])
    waves = waves[..., 0]
    here = _Instant(path, angle, time, *(at_times(waves, time, order) for order in range(3)))
    times = time + np.linspace(0.0, 2.0 * np.pi, _PATH_POINTS, endpoint=False)
    turn = path.motion(times)[0] + at_times(waves[:, 0], times)
    jacobian = _jacobian(here, orbit, max(flight.wind, _LEAST_WIND), downwind)
    errors = np.zeros((10, 10))
    errors[:6, :6] = orbit.covariance[:6, :6]
    errors[6:8, 6:8] = covariance
    if orbit.drift.any():  # it is in that of the air past the circle as well
        errors[:6, 8:] = orbit.covariance[:6, 7:9]
        errors[8:, :6] = errors[:6, 8:].T
        errors[:6, 6:8] = -errors[:6, 8:]
        errors[6:8, :6] = errors[:6, 6:8].T
        errors[8:, 8:] = orbit.covariance[7:9, 7:9]
        errors[6:8, 8:] = errors[8:, 6:8] = -errors[8:, 8:]
    toward = _plane(here.velocity, orbit.sense) * np.exp(1j * downwind)
    toward += complex(*orbit.drift) / orbit.speed
    off = solved.error(flight)
    with np.errstate(all="ignore"):
        known = jacobian @ errors @ jacobian.T
        # Its velocity over the tow speed is off by as much as its place over the tow radius is.
        known += off**2 * np.diag([orbit.radius**2] * 3 + [1.0 / np.abs(toward) ** 2])
    return MotionInWind(
        position=_in_field(here.position, orbit, downwind),
        yaw=float(np.angle(toward)),
        covariance=0.5 * (known + known.T),
        cable=_in_field(cable.T + here.tow_point, orbit, downwind),
        path=_in_field(turn, orbit, downwind),
        motion=solved.motion,
        source=solved.source,
    )


@lru_cache(maxsize=16)
def _cable_points(functions: int) -> np.ndarray:
    """What turns coefficients of the functions into points along the cable, (n, CABLE_POINTS)."""
    arc = np.linspace(0.0, 1.0, CABLE_POINTS)
    return at_arc_lengths(np.eye(functions), 1.0, arc)


def _in_field(vectors: np.ndarray, orbit: Orbit, downwind: float) -> np.ndarray:
    """East, north, up [m] of positions about the centre in the solver's frame, (..., 3)."""
    flat = (vectors[..., 0] + 1j * orbit.sense * vectors[..., 1]) * np.exp(1j * downwind)
    return orbit.center + orbit.radius * np.stack([flat.real, flat.imag, vectors[..., 2]], axis=-1)


class _Instant:
    """The end mass at one time in the solver's frame, and what it changes by."""

    def __init__(self, path, angle, time, place, rate, pushed):
        self.path, self.angle, self.time = path, angle, time
        self.place, self.rate, self.pushed = place, rate, pushed  # (4, 3): and derivatives
        self.tow_point, self.tow_velocity, self.tow_acceleration = path.motion(np.array(time))
        self.position = place[0] + self.tow_point
        self.velocity = rate[0] + self.tow_velocity


def _jacobian(here: _Instant, orbit: Orbit, wind: float, downwind: float) -> np.ndarray:
    """Of east, north, up and yaw, (4, 10).

    By centre, radius, rate, phase, air past the circle and drift of that, east and north.
    """
    path, sense = here.path, orbit.sense
    cosine, sine = np.cos(downwind), np.sin(downwind)
    # By radius, rate, phase, wind east, wind north: what each changes,
    steps = np.zeros((5, 3))  # ln radius, ln rate, wind
    steps[0, 0], steps[1, 1] = 1.0 / orbit.radius, 1.0 / orbit.angular_rate
    steps[3, 2], steps[4, 2] = cosine, sine
    turned = np.array([0.0, 0.0, 0.0, -sine / wind, cosine / wind])
    angles = sense * (np.array([0.0, 0.0, 1.0, 0.0, 0.0]) - turned)
    fraction = steps @ [-wind, -wind, 1.0] / orbit.speed
    along = np.array([-here.tow_point[1], here.tow_point[0], 0.0])
    times, tow_velocity = angles, np.zeros((5, 3))
    if path.kind != GROUND_SPEED:
        # Where the tow point is when, and how fast, changes with the wind.
        low, high = (
            TowPath(path.kind, max(path.wind + sign * _FASTER, 0.0)) for sign in (-1.0, 1.0)
        )
        fraction = fraction / (high.air_velocity - low.air_velocity)  # of the airspeed, in steps
        at = np.array(here.angle)
        later = float(high.times(at) - low.times(at))
        times = angles / (here.tow_velocity @ along) + later * fraction
        at = np.array(here.time)
        tow_velocity = np.outer(fraction, high.motion(at)[1] - low.motion(at)[1])
    position = np.outer(times, here.rate[0]) + steps @ here.place[1:] + np.outer(angles, along)
    velocity = np.outer(times, here.pushed[0] + here.tow_acceleration) + tow_velocity
    velocity += steps @ here.rate[1:]
    # In the field: turned downwind, mirrored for a clockwise circle.
    turn = np.exp(1j * downwind)
    place, moves = (_plane(v, sense) * turn for v in (here.position, here.velocity))
    flat = orbit.radius * (_plane(position, sense) * turn + 1j * turned * place)
    flat[0] += place
    # Over the ground: the yaw is the direction of the sum of two velocities.
    drift = complex(*orbit.drift) / orbit.speed
    changes = _plane(velocity, sense) * turn + 1j * turned * moves
    changes -= drift * (steps[:, 0] + steps[:, 1])
    yaw = np.imag(changes / (moves + drift))
    up = orbit.radius * position[:, 2]
    up[0] += here.position[2]
    jacobian = np.zeros((4, 10))
    jacobian[:3, :3] = np.eye(3)
    jacobian[:, 3:8] = flat.real, flat.imag, up, yaw
    jacobian[3, 8:] = np.imag(np.array([1.0, 1j]) / orbit.speed / (moves + drift))
    return jacobian


def _plane(vectors: np.ndarray, sense: int) -> np.ndarray:
    """Horizontal parts as complex numbers, mirrored for a clockwise circle."""
    return vectors[..., 0] + 1j * sense * vectors[..., 1]
