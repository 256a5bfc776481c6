"""What a wind that nobody knows may do to the end mass: its share in the pose's covariance.

In still air the end mass is where its steady state has it. A wind moves it in proportion, for as
long as it is weak: by how much, the periodic motion in a little wind shows. Of the wind itself
only its climate is known.
"""

from dataclasses import dataclass, replace
from math import floor, inf, log

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.periodic.fourier import resampled
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.newton import newton
from ctcbs_ros.periodic.solve import still_air_motion
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED, TowPath
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState
from ctcbs_ros.twin.simulated_cable import elastic

# Standard deviation of a wind along an axis where nobody knows it [m/s]. Wind speeds mostly have a
# Rayleigh distribution, of mean 1.25 times that: over land, 80 m up, it is 4.5 m/s (Archer and
# Jacobson, Evaluation of global wind power, J. Geophys. Res. 110, D12110, 2005), more higher up.
CLIMATE = 4.0
# The little wind, over the tow speed, and the times of a turn that its motion is solved at: orders
# 0 and 2 in the plane and 1 in height are all that moves in proportion, but at constant airspeed.
_LITTLE, _TIMES = 0.02, 7
# Angles of a turn that the displacement is kept at, straight between them: to 0.3 %.
_ANGLES = 96
# Error in still air that the number of elements is for [a].
_ERROR = 1e-3
# The drift in an orbit's covariance, see `orbit.ESTIMATED`.
_DRIFT = slice(7, 9)
# How far the flight may move, in ln of any parameter or of the end-mass radius.
_NEARBY = 0.05
# What is not in proportion to the wind, over what is: of the place, in any direction, and of yaw.
_ANY_WAY, _MORE_TURNED = 0.6, 3.0
# By how much more than in proportion the end mass is displaced in a wind of two deviations.
_MORE = 1.2
# Displacement per wind, in tow radii and tow speeds, where no motion is found: about the most.
_MOST = 12.0


@dataclass(frozen=True)
class Response:
    """What a little wind does.

    Attributes
    ----------
    state : SteadyState
    displaced : (2, n + 1, 3) ndarray or None
        By which it moves the end mass, downwind, to the left of that and up, over the tow radius
        and the wind over the tow speed: as ground speed or airspeed is constant round an
        anticlockwise circle, with the tow point at evenly spaced angles from downwind, both ends
        included. None where no motion is found.
    turned : float
        Change of the end mass's velocity over that, per wind: root mean square over a turn.
    """

    state: SteadyState
    displaced: np.ndarray | None
    turned: float


def response(state: SteadyState) -> Response:
    """What a little wind does to a steady state."""
    state = replace(state, parameters=elastic(state.parameters))
    try:
        values = still_air_motion(state, _ERROR)
        if values is None:
            return Response(state, None, inf)
        p, values, motions = state.parameters, resampled(values, _TIMES), []
        paths = [TowPath(GROUND_SPEED, 0.0)]
        paths += [TowPath(kind, _LITTLE) for kind in (GROUND_SPEED, AIRSPEED)]
        for path in paths:
            found = newton(p, path, values)
            if found is None:
                return Response(state, None, inf)
            motions.append(PeriodicMotion(p, path, found.values, _ERROR, found.least_tension))
    except (ArithmeticError, InputError):
        return Response(state, None, inf)
    still, *moved = motions
    displaced = np.stack([_displaced(still, motion) for motion in moved])
    return Response(state, displaced, max(_turned(still, motion) for motion in moved))


def wind_share(known: Response, orbit: Orbit, moment: np.ndarray) -> np.ndarray:
    """Covariance of east, north, up and yaw by the wind, (4, 4).

    Parameters
    ----------
    known : Response
        Of the state flown, or one nearby.
    orbit : Orbit
    moment : (2, 2) ndarray
        Mean square of the air's velocity past the circle, east and north [m^2/s^2].
    """
    share = np.zeros((4, 4))
    if known.displaced is not None:
        # By winds towards east and north, (2, 3, 2): at constant ground speed, at airspeed.
        ways = np.stack([_moves(known, orbit, way) for way in (0.0, 0.5 * np.pi)], axis=-1)
        # Which of the two is flown nobody knows without the wind: the worse counts.
        either = ways @ moment @ np.swapaxes(ways, 1, 2)
        share[:3, :3] = max(either, key=np.trace)
        share[3, 3] = (_MORE_TURNED * known.turned / orbit.speed) ** 2 * np.trace(moment)
    else:
        share[:3, :3] = 0.5 * (_MOST / orbit.angular_rate) ** 2 * np.trace(moment) * np.eye(3)
        share[3, 3] = np.pi**2
    # What is not in proportion goes any way, up above all.
    share[:3, :3] += _ANY_WAY**2 * np.trace(share[:3, :3]) / 3.0 * np.eye(3)
    share[:3, :3] *= _MORE**2
    return share


def _moves(known: Response, orbit: Orbit, downwind: float) -> np.ndarray:
    """East, north and up [m] per m/s of a wind towards an angle from east, (2, 3)."""
    # The solver's frame: x downwind, the circle anticlockwise, time and angle 0 downwind.
    turns = orbit.sense * (orbit.phase - downwind) / (2.0 * np.pi)
    at, part = divmod((turns - floor(turns)) * _ANGLES, 1.0)
    at = min(int(at), _ANGLES - 1)
    here = known.displaced[:, at] + part * (known.displaced[:, at + 1] - known.displaced[:, at])
    flat = (here[:, 0] + 1j * orbit.sense * here[:, 1]) * np.exp(1j * downwind)
    return orbit.radius / orbit.speed * np.stack([flat.real, flat.imag, here[:, 2]], axis=1)


def _displaced(still: PeriodicMotion, moved: PeriodicMotion) -> np.ndarray:
    """One of `Response.displaced`, (n + 1, 3)."""
    angles = np.linspace(0.0, 2.0 * np.pi, _ANGLES + 1)
    place = moved.end_mass(moved.path.times(angles)) - still.end_mass(angles)
    return place / moved.path.air_velocity


def _turned(still: PeriodicMotion, moved: PeriodicMotion) -> float:
    """See `Response.turned`, of one motion."""
    times = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    before, after = still.end_mass_velocity(times), moved.end_mass_velocity(times)
    change = np.sqrt(np.mean(np.sum((after - before)[:, :2] ** 2, axis=1)))
    return float(change / np.hypot(*before[0, :2]) / moved.path.air_velocity)


def past_the_circle(wind: Wind, orbit: Orbit) -> tuple[np.ndarray, np.ndarray]:
    """Velocity of the air past the circle, east and north (2,) [m/s], and its covariance."""
    of_drift = orbit.covariance[_DRIFT, _DRIFT]
    if not np.isfinite(of_drift).all():
        # Not seen yet: anything from a circle that stands still to one that the wind takes.
        of_drift = np.outer(wind.velocity, wind.velocity) / 3.0
    return wind.velocity - orbit.drift, wind.covariance + of_drift


def mean_square(wind: Wind | None, orbit: Orbit) -> np.ndarray:
    """Mean square of the air's velocity past the circle, by the climate where nobody knows it."""
    if wind is None:
        return CLIMATE**2 * np.eye(2)
    velocity, covariance = past_the_circle(wind, orbit)
    return covariance + np.outer(velocity, velocity)


def spread(share: np.ndarray) -> float:
    """Greatest standard deviation in the plane [m]."""
    return float(np.sqrt(np.linalg.eigvalsh(share[:2, :2])[-1]))


class Responses:
    """The response of the state flown, solved anew only where the flight has moved."""

    def __init__(self):
        self._known: Response | None = None

    def update(self, state: SteadyState) -> Response:
        """Of a state."""
        if self._known is None or _moved(self._known.state, state) > _NEARBY:
            self._known = response(state)
        return self._known


def _moved(known: SteadyState, state: SteadyState) -> float:
    def of(s: SteadyState):
        p: Parameters = s.parameters
        return p.omega, p.length, p.end_mass, p.cable_drag, p.drag_ratio, s.end_mass_radius

    return max(
        0.0 if a == b else abs(log(b / a)) if a > 0.0 and b > 0.0 else inf
        for a, b in zip(of(known), of(state), strict=True)
    )
