"""What the twin takes in with a sample: the sample, and what the predictor made of it."""

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.telemetry.sample import Sample


@dataclass(frozen=True)
class Seen:
    """A believed sample.

    Attributes
    ----------
    sample : Sample
    tow_point : (3,) ndarray
        Its position in the local frame, east, north, up [m].
    orbit : Orbit or None
        Flown; None while not orbiting.
    wind : Wind or None
        Believed; None where nobody tells.
    air_density : float
        nan where it is not known [kg/m^3].
    end_mass_radius : float
        Of the steady state in still air that is flown [m]; nan where there is none.
    settling_time : float
        In which a small disturbance of it decays to 5 % [s].
    motion : PeriodicMotion or None
        What it is in the wind, of a flight nearby; None where that is not known.
    errors : (4, 4) ndarray or None
        Covariance of east, north, up and yaw of where the end mass is predicted.
    searching : bool
        Whether that motion is being solved.
    at_airspeed : bool
        Whether a circle is flown at constant airspeed or at constant ground speed.
    """

    sample: Sample
    tow_point: np.ndarray
    orbit: Orbit | None = None
    wind: Wind | None = None
    air_density: float = nan
    end_mass_radius: float = nan
    settling_time: float = inf
    motion: PeriodicMotion | None = None
    errors: np.ndarray | None = None
    searching: bool = False
    at_airspeed: bool = True
