"""Quantities as autopilots have them, whatever the message or the log: to SI units and ENU.

Angles of autopilots are clockwise from north, their velocities towards north, east, down. A wind
is the velocity of the air, where it blows to; only MAVLink's WIND and HIGH_LATENCY2 say where it
comes from (`mavlink_fields.py`).
"""

from math import isfinite, nan, sqrt

from ctcbs_ros.atmosphere import GAS_CONSTANT, standard_temperature_at_pressure
from ctcbs_ros.telemetry.sample import Vector

ZERO_CELSIUS = 273.15  # K
# A barometer's own warmth can be told from the air's only where it is beyond any weather.
WEATHER = 40.0  # K
PRESSURES = (3_000.0, 110_000.0)  # Pa; the first is 23 km up


def enu_angle(compass: float) -> float:
    """ENU angle [deg], -180 to 180, of a compass direction [deg]; nan for what is none."""
    return (90.0 - compass + 180.0) % 360.0 - 180.0 if isfinite(compass) else nan


def wind_of_ned(north: float, east: float, down: float = 0.0) -> Vector | None:
    """Wind as an ENU velocity [m/s] of one towards north, east, down; None for what is none."""
    if not (isfinite(north) and isfinite(east)):
        return None
    return east, north, 0.0 - down if isfinite(down) else 0.0


def wind_deviation(variances: float) -> float:
    """One standard deviation of a wind's component [m/s] by the sum of both variances.

    nan where that is not sent (0) or no number.
    """
    return sqrt(variances / 2) if 0.0 < variances < 1e4 else nan


def density_of_pressure(pressure: float, celsius: float) -> float:
    """Density of the air [kg/m^3] by a barometer; nan where it is none.

    The temperature is the barometer's own, which its case warms by some kelvin (each 3 K are 1 %
    of density); where it is more than 40 K from the standard atmosphere's at that pressure, or
    nan, that one is taken.

    Parameters
    ----------
    pressure : float
        [Pa]
    celsius : float
        Temperature [degC].
    """
    if not PRESSURES[0] <= pressure <= PRESSURES[1]:
        return nan
    standard = standard_temperature_at_pressure(pressure)
    temperature = celsius + ZERO_CELSIUS
    if not abs(temperature - standard) <= WEATHER:
        temperature = standard
    return pressure / (GAS_CONSTANT * temperature)
