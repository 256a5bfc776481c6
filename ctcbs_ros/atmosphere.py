"""Density of the standard atmosphere, for air given by altitude instead of by a figure."""

from math import exp, nan

# International Standard Atmosphere, ICAO Doc 7488 (3rd ed., 1993).
GRAVITY = 9.80665  # m/s^2
GAS_CONSTANT = 287.05287  # J/(kg K), of dry air
EARTH_RADIUS = 6_356_766.0  # m, for geopotential altitude
SEA_LEVEL_TEMPERATURE = 288.15  # K
SEA_LEVEL_PRESSURE = 101_325.0  # Pa
LAPSE_RATE = 0.0065  # K/m, troposphere
TROPOPAUSE = 11_000.0  # geopotential m
SEA_LEVEL_DENSITY = SEA_LEVEL_PRESSURE / (GAS_CONSTANT * SEA_LEVEL_TEMPERATURE)  # kg/m^3
LOWEST, HIGHEST = -5_000.0, 20_000.0  # m, what the two layers below cover


def standard_atmosphere_density(altitude_m: float) -> float:
    """Air density of the International Standard Atmosphere, troposphere and lower stratosphere.

    Parameters
    ----------
    altitude_m : float
        Geometric altitude above mean sea level [m].

    Returns
    -------
    float
        Density [kg/m^3]; nan outside -5 to 20 km.

    References
    ----------
    ICAO Doc 7488, Manual of the ICAO Standard Atmosphere, 3rd ed., 1993.
    """
    if not LOWEST <= altitude_m <= HIGHEST:
        return nan
    geopotential = EARTH_RADIUS * altitude_m / (EARTH_RADIUS + altitude_m)
    in_troposphere = min(geopotential, TROPOPAUSE)
    temperature = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * in_troposphere
    exponent = GRAVITY / (GAS_CONSTANT * LAPSE_RATE)
    pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE) ** exponent
    above = geopotential - in_troposphere  # in the isothermal layer
    pressure *= exp(-GRAVITY * above / (GAS_CONSTANT * temperature))
    return pressure / (GAS_CONSTANT * temperature)


def standard_temperature_at_pressure(pressure: float) -> float:
    """Temperature of the standard atmosphere where it has a pressure [Pa], in kelvin."""
    ratio = (pressure / SEA_LEVEL_PRESSURE) ** (GAS_CONSTANT * LAPSE_RATE / GRAVITY)
    return max(SEA_LEVEL_TEMPERATURE * ratio, SEA_LEVEL_TEMPERATURE - LAPSE_RATE * TROPOPAUSE)
