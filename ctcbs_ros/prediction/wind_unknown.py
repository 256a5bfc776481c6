"""What a wind that nobody knows may do to the end mass: its share in the pose's covariance.

In still air the end mass is where its steady state has it. A wind moves it, about in proportion,
and lifts it by the square: by how much, the periodic motion in a wind of about the climate's
strength shows. Of the wind itself only its climate is known.
"""

from dataclasses import dataclass, replace
from math import floor, inf, log

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import CLIMATE, Wind
from ctcbs_ros.periodic.fourier import resampled
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.newton import newton
from ctcbs_ros.periodic.solve import still_air_motion
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState
from ctcbs_ros.twin.simulated_cable import elastic

# Winds over the tow speed, one after the other, and the times of a turn that their motions are
# solved at: orders 0 to 3. The last is about the climate's: drag is quadratic, and where the end
# mass moves slowly in still air a tenth of the speed moves it twice as far in proportion.
_WINDS, _TIMES = (0.02, 0.05, 0.1), 7
# Angles of a turn that the displacement is kept at, straight between them: to 0.3 %.
_ANGLES = 96
# Error in still air that the number of elements is for [a].
_ERROR = 1e-3
# The drift in an orbit's covariance, see `orbit.ESTIMATED`.
_DRIFT = slice(7, 9)
# How far the flight may move, in ln of any parameter or of the end-mass radius.
_NEARBY = 0.05
# What is not in proportion to the wind, over what is: of the place, in any direction, and of yaw.
_ANY_WAY, _MORE_TURNED = 0.3, 3.0
# By how much the covariance is widened. Of cables flown in time, 96 to 99 % of the climate's winds
# then leave the end mass within the stated 95 %, and all up to 8 m/s: both examples, 40 to 300 m.
_MORE = 1.2
# The most that it rises, over its depth: as for the rest, root mean square.
_MOST_RISE = 0.5
# Displacement per wind, in tow radii and tow speeds, where no motion is found: about the most.
_MOST = 12.0


@dataclass(frozen=True)
class Response:
    """What a wind does.

    Attributes
    ----------
    state : SteadyState
    displaced : (n + 1, 3) ndarray or None
        By which it moves the end mass, downwind, to the left of that and up, over the tow radius
        and the wind over the tow speed: on an anticlockwise circle at constant ground speed, with
        the tow point at evenly spaced angles from downwind, both ends included; without `raised`.
        None where no motion is found.
    raised : float
        By which it lifts the end mass, mean over a turn, over the square of the wind.
    turned : float
        Change of the end mass's velocity over that, per wind: root mean square over a turn.
    """

    state: SteadyState
    displaced: np.ndarray | None
    raised: float
    turned: float


def response(state: SteadyState) -> Response:
    """What a wind does to a steady state."""
    state = replace(state, parameters=elastic(state.parameters))
    try:
        found = _in_still_air_and_wind(state)
    except (ArithmeticError, InputError):
        found = None
    if found is None:
        return Response(state, None, inf, inf)
    still, moved = found
    wind, times = moved.path.air_velocity, np.linspace(0.0, 2.0 * np.pi, _ANGLES + 1)
    displaced = (moved.end_mass(times) - still.end_mass(times)) / wind
    raised = displaced[:-1, 2].mean()
    displaced[:, 2] -= raised
    return Response(state, displaced, raised / wind, _turned(still, moved))


def _in_still_air_and_wind(state: SteadyState) -> tuple[PeriodicMotion, PeriodicMotion] | None:
    """The motions in still air and in the strongest of `_WINDS` in which one is found."""
    p, motions = state.parameters, []
    values = still_air_motion(state, _ERROR)
    if values is None:
        return None
    guess = resampled(values, _TIMES)
    for wind in (0.0, *_WINDS):
        path = TowPath(GROUND_SPEED, wind)
        found = newton(p, path, guess)
        if found is None:
            break
        here = PeriodicMotion(p, path, found.values, _ERROR, found.least_tension)
        guess = here.values
        if motions:
            before = motions[-1]
            later = _WINDS[min(len(motions), len(_WINDS) - 1)]
            share = (later - wind) / (wind - before.path.wind)
            guess = guess + share * (guess - before.values)
        motions.append(here)
    return (motions[0], motions[-1]) if len(motions) > 1 else None


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
        # By winds towards east and north, (3, 2).
        ways = np.stack([_moves(known, orbit, way) for way in (0.0, 0.5 * np.pi)], axis=-1)
        share[:3, :3] = ways @ moment @ ways.T
        share[3, 3] = (_MORE_TURNED * known.turned / orbit.speed) ** 2 * np.trace(moment)
    else:
        share[:3, :3] = 0.5 * (_MOST / orbit.angular_rate) ** 2 * np.trace(moment) * np.eye(3)
        share[3, 3] = np.pi**2
    # What is not in proportion goes any way,
    share[:3, :3] += _ANY_WAY**2 * np.trace(share[:3, :3]) / 3.0 * np.eye(3)
    if known.displaced is not None:
        # and up: the mean of the square of the square is that of a normal distribution.
        square = np.sqrt(np.trace(moment) ** 2 + 2.0 * np.trace(moment @ moment))
        rise = known.raised * square / orbit.speed**2
        share[2, 2] += (orbit.radius * min(abs(rise), _MOST_RISE * known.state.depth)) ** 2
    share[:3, :3] *= _MORE**2
    return share


def _moves(known: Response, orbit: Orbit, downwind: float) -> np.ndarray:
    """East, north and up [m] per m/s of a wind towards an angle from east, (3,)."""
    # The solver's frame: x downwind, the circle anticlockwise, time and angle 0 downwind.
    turns = orbit.sense * (orbit.phase - downwind) / (2.0 * np.pi)
    at, part = divmod((turns - floor(turns)) * _ANGLES, 1.0)
    at = min(int(at), _ANGLES - 1)
    here = known.displaced[at] + part * (known.displaced[at + 1] - known.displaced[at])
    flat = (here[0] + 1j * orbit.sense * here[1]) * np.exp(1j * downwind)
    return orbit.radius / orbit.speed * np.array([flat.real, flat.imag, here[2]])


def _turned(still: PeriodicMotion, moved: PeriodicMotion) -> float:
    """See `Response.turned`."""
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
