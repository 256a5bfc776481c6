"""What a vehicle tells between two position reports, for the sample of the second.

Heading, airspeed and wind are told once, with the next sample; the density of the air holds for
30 s. What held before a reboot says nothing about now.
"""

from math import isfinite, nan, sqrt
from typing import Any

from ctcbs_ros.atmosphere import SEA_LEVEL_DENSITY, standard_atmosphere_density
from ctcbs_ros.telemetry.sample import Vector

DENSITY_VALID_US = 30_000_000


class BetweenSamples:
    """Takes in heading, airspeed, wind and density of the air, in SI units and ENU.

    Values that are no numbers, and an airspeed of 0, are not taken in: the sender knows none.

    Attributes
    ----------
    wind : tuple of 3 floats or None
        Newest wind of the autopilot: velocity of the air towards east, north, up [m/s].
    """

    def __init__(self):
        self.wind: Vector | None = None
        self._flight = 0
        self.forget()

    def keep_to(self, flight: int) -> None:
        """Begin anew where that is another flight than before."""
        if flight != self._flight:
            self._flight = flight
            self.forget()

    def forget(self) -> None:
        """Begin anew, as after a reboot."""
        self._density, self._density_us = nan, 0
        self._tell_anew()

    def _tell_anew(self) -> None:
        self._heading = self._true_airspeed = self._indicated_airspeed = nan
        self._new_wind: Vector | None = None
        self._wind_accuracy = nan

    def hear_heading(self, heading: float) -> None:
        """Where the nose points, ENU angle [deg]."""
        if isfinite(heading):
            self._heading = heading

    def hear_true_airspeed(self, airspeed: float) -> None:
        """By a sensor [m/s]."""
        if isfinite(airspeed) and airspeed > 0.0:
            self._true_airspeed = airspeed

    def hear_indicated_airspeed(self, airspeed: float) -> None:
        """By a sensor [m/s]; it becomes a true one by the density at the next sample."""
        if isfinite(airspeed) and airspeed > 0.0:
            self._indicated_airspeed = airspeed

    def hear_density(self, density: float, time_us: int) -> None:
        """Density of the air [kg/m^3], and when it was measured [us]."""
        if isfinite(density):
            self._density, self._density_us = density, time_us

    def hear_wind(self, wind: Vector | None, accuracy: float = nan) -> None:
        """Wind (ENU velocity of the air) and one standard deviation of a component [m/s]."""
        if wind is not None:
            self.wind = self._new_wind = wind
            self._wind_accuracy = accuracy

    def tell(self, time_us: int, altitude_amsl: float = nan) -> dict[str, Any]:
        """Fields of the sample of that time [us] and altitude [m].

        The time is of the clock that the densities were timed by.
        """
        density = self._density if time_us - self._density_us <= DENSITY_VALID_US else nan
        told = {
            "airspeed": self._airspeed(density, altitude_amsl),
            "heading": self._heading,
            "wind": self._new_wind,
            "wind_accuracy": self._wind_accuracy,
            "air_density": density,
        }
        self._tell_anew()
        return told

    def _airspeed(self, density: float, altitude_amsl: float) -> float:
        """True airspeed [m/s]."""
        if isfinite(self._true_airspeed) or not isfinite(self._indicated_airspeed):
            return self._true_airspeed
        if not isfinite(density):
            density = standard_atmosphere_density(altitude_amsl)
        return self._indicated_airspeed * sqrt(SEA_LEVEL_DENSITY / density)
