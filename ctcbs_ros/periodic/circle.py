"""A circle as it is flown, in either sense and any wind, and where the end mass is on it.

The solver knows one wind and one sense: air towards +x, anticlockwise. Other winds are turned to
that one, clockwise circles mirrored in the vertical plane of the wind.
"""

from dataclasses import dataclass
from math import atan2, hypot, isfinite

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.solve import ACCURACY, Found, followed, periodic_motion
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, PATHS, TowPath
from ctcbs_ros.solver.steady_state import SteadyState

ANTICLOCKWISE, CLOCKWISE = 1, -1
# The circle moves with the air: in the air's frame there is no wind.
DRIFT = "drift"


@dataclass(frozen=True)
class Circle:
    """A tow circle in a steady wind.

    Attributes
    ----------
    radius : float
        [m]
    angular_rate : float
        Mean over a turn, above 0 [rad/s].
    sense : int
        1 anticlockwise from above, -1 clockwise.
    wind_east, wind_north : float
        Where the air moves to [m/s].
    path : str
        "ground-speed" or "airspeed", what is constant round a circle over the ground; or "drift",
        a circle that moves with the air.

    Raises
    ------
    InputError
        If a value makes no sense, or the air is as fast as the aircraft.
    """

    radius: float
    angular_rate: float
    sense: int
    wind_east: float
    wind_north: float
    path: str = GROUND_SPEED

    def __post_init__(self):
        """Refuse what no aircraft flies."""
        for name in ("radius", "angular_rate"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise InputError(f"{name}: {value:g} is not allowed, above 0 and finite is")
        for name in ("wind_east", "wind_north"):
            if not isfinite(getattr(self, name)):
                raise InputError(f"{name}: {getattr(self, name):g} is not allowed")
        if self.sense not in (ANTICLOCKWISE, CLOCKWISE):
            raise InputError(f"sense: {self.sense!r} is not allowed, it must be 1 or -1")
        if self.path not in (*PATHS, DRIFT):
            allowed = ", ".join((*PATHS, DRIFT))
            raise InputError(f"path: {self.path!r} is not allowed, one of {allowed} is")
        _ = self.tow_path

    @property
    def tow_path(self) -> TowPath:
        """The circle in its own units, as the solver knows it."""
        if self.path == DRIFT:
            return TowPath(GROUND_SPEED, 0.0)
        speed = hypot(self.wind_east, self.wind_north)
        return TowPath.of_air_velocity(self.path, speed / (self.radius * self.angular_rate))

    @property
    def _downwind(self) -> float:
        """Angle from east that the wind blows to; any will do where there is none."""
        return 0.0 if self.path == DRIFT else atan2(self.wind_north, self.wind_east)

    def time_at(self, angle: float) -> float:
        """The motion's time when the tow point is at an angle, anticlockwise from east [rad]."""
        return float(self.tow_path.times(np.array(self.sense * (angle - self._downwind))))

    def in_field(self, vectors) -> np.ndarray:
        """Vectors of the motion, (..., 3), as east, north, up."""
        vectors = np.asarray(vectors, float)
        flat = vectors[..., 0] + 1j * self.sense * vectors[..., 1]
        flat = flat * np.exp(1j * self._downwind)
        return np.stack([flat.real, flat.imag, vectors[..., 2]], axis=-1)


def motion_on(
    circle: Circle,
    state: SteadyState,
    before: PeriodicMotion | None = None,
    accuracy: float = ACCURACY,
) -> Found:
    """The periodic motion on a circle.

    Parameters
    ----------
    circle : Circle
    state : SteadyState
        Flown in still air at the circle's radius and mean angular rate.
    before : PeriodicMotion, optional
        On a circle nearby: then one Newton iteration from there is tried first.
    accuracy : float
        As `periodic_motion` has it; of a motion followed it is that of the one before.
    """
    path = circle.tow_path
    if before is not None:
        found = followed(before, state.parameters, path)
        if found.motion is not None:
            return found
    return periodic_motion(state, path, accuracy)


def end_mass_position(circle: Circle, motion: PeriodicMotion, angle: float) -> np.ndarray:
    """Where the end mass is when the tow point is at an angle.

    Parameters
    ----------
    circle : Circle
    motion : PeriodicMotion
        On that circle.
    angle : float
        Of the tow point about the centre, anticlockwise from east [rad].

    Returns
    -------
    (3,) ndarray
        East, north, up of the circle's centre at the tow point's height [m]; a circle that drifts
        takes its centre along.
    """
    return circle.radius * circle.in_field(motion.end_mass(circle.time_at(angle)))


def end_mass_velocity(circle: Circle, motion: PeriodicMotion, angle: float) -> np.ndarray:
    """How fast the end mass moves then, over the circle's centre: east, north, up [m/s]."""
    speed = circle.radius * circle.angular_rate
    return speed * circle.in_field(motion.end_mass_velocity(circle.time_at(angle)))
