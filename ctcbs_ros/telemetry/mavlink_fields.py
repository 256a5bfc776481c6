"""Fields of MAVLink messages in SI units and ENU; nan or None where a message says "not known".

docs/telemetry.md has the table of what each message is used for. Here MAVLink's scaled integers
become numbers with a unit; what logs have in common with them is in `conventions.py`.
"""

from math import cos, isfinite, nan, pi, radians, sin

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry import conventions
from ctcbs_ros.telemetry.conventions import enu_angle
from ctcbs_ros.telemetry.sample import Vector

UNKNOWN_8, UNKNOWN_16 = 0xFF, 0xFFFF
UNKNOWN_32 = 0x7FFFFFFF  # of signed fields
AIRSPEED_SENSOR = dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE


def scaled(value: int, scale: float) -> float:
    """A signed 32-bit field in units of 1/`scale`; nan where it is 0x7FFFFFFF, "not known"."""
    return nan if value == UNKNOWN_32 else value / scale


def heading_of_position(message) -> float:
    """Where the nose points by GLOBAL_POSITION_INT, ENU angle [deg]."""
    return nan if message.hdg == UNKNOWN_16 else enu_angle(message.hdg / 100)


def heading_of_attitude(message) -> float:
    """Where the nose points by ATTITUDE, ENU angle [deg]."""
    return enu_angle(message.yaw * 180 / pi)


def receiver_velocity(message, climb: float) -> Vector | None:
    """Velocity of GPS_RAW_INT, ENU [m/s], with the climb [m/s] it does not send."""
    if UNKNOWN_16 in (message.vel, message.cog):
        return None
    speed, course = message.vel / 100, radians(message.cog / 100)
    return speed * sin(course), speed * cos(course), climb if isfinite(climb) else 0.0


def wind_of_wind(message) -> Vector | None:
    """The wind of WIND, ENU velocity [m/s] of the air.

    `direction` is where it blows from, clockwise from north; speed_z points down. A speed of
    exactly 0 is that of an estimator that has not begun.
    """
    return _wind_from(message.direction, message.speed, message.speed_z)


def wind_of_wind_cov(message) -> Vector | None:
    """The wind of WIND_COV, a NED velocity of the air, as ENU [m/s]."""
    return conventions.wind_of_ned(message.wind_x, message.wind_y, message.wind_z)


def wind_accuracy(message) -> float:
    """One standard deviation of a horizontal component of WIND_COV [m/s]; nan where not sent."""
    if 0.0 < message.horiz_accuracy < 100.0:
        return message.horiz_accuracy
    # PX4 leaves that field 0 and sends the sum of both variances.
    return conventions.wind_deviation(message.var_horiz)


def wind_of_high_latency(message) -> Vector | None:
    """The wind of HIGH_LATENCY2, whose direction ArduPilot takes as "from" and PX4 as "to"."""
    if message.autopilot == dialect.MAV_AUTOPILOT_ARDUPILOTMEGA:
        direction = message.wind_heading * 2.0
    elif message.autopilot == dialect.MAV_AUTOPILOT_PX4:
        direction = message.wind_heading * 2.0 + 180.0
    else:
        return None
    return _wind_from(direction, message.windspeed / 5, 0.0)


def _wind_from(direction: float, speed: float, speed_down: float) -> Vector | None:
    if not (isfinite(direction) and isfinite(speed)) or speed == 0.0:
        return None
    angle = radians(direction)
    return (
        -speed * sin(angle),
        -speed * cos(angle),
        -speed_down if isfinite(speed_down) else 0.0,
    )


def density_of_pressure(message) -> float:
    """Density of the air [kg/m^3] by SCALED_PRESSURE; nan where it is none."""
    return conventions.density_of_pressure(message.press_abs * 100, message.temperature / 100)


def has_airspeed_sensor(message) -> bool:
    """Whether SYS_STATUS says that an airspeed sensor is used and works."""
    return bool(
        message.onboard_control_sensors_present
        & message.onboard_control_sensors_enabled
        & message.onboard_control_sensors_health
        & AIRSPEED_SENSOR
    )


def high_latency_accuracy(message) -> float:
    """Horizontal accuracy of HIGH_LATENCY2 [m]; ArduPilot sends 0, PX4 255 for not known."""
    return nan if message.eph in (0, UNKNOWN_8) else message.eph / 10
