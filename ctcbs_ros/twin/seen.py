"""What the twin takes in with a sample: the sample, and what the predictor made of it."""

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
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
    """

    sample: Sample
    tow_point: np.ndarray
    orbit: Orbit | None = None
    wind: Wind | None = None
    air_density: float = nan
    end_mass_radius: float = nan
    settling_time: float = inf
