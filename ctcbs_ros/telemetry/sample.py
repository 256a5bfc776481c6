"""The telemetry sample: what every reader yields and the orbit estimator takes in."""

from dataclasses import dataclass
from math import nan

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Sample:
    """One position report of the tow aircraft, in SI units, angles in degrees, velocity in ENU.

    A reader converts units and frames and judges nothing: whether the report can be believed is
    decided by `ctcbs_ros.telemetry.screen`.

    Attributes
    ----------
    time : float
        Seconds of the vehicle's clock, made continuous over clock wraps; after a reboot the clock
        goes on from where the receive stamps say it should, and `flight` has risen by one.
    stamp_ns : int
        The same instant as nanoseconds since the Unix epoch, for message stamps.
    flight : int
        Number of the flight in the source; rises by one at each reboot or large clock step.
    latitude, longitude : float
        Geodetic position [deg]; nan where the source knows only a local frame.
    altitude_amsl, altitude_ellipsoid, height_above_home : float
        The three heights that sources mix up [m]; nan for each that is not sent.
    local_position : tuple of 3 floats, optional
        East, north, up [m] in the source's own local frame, for sources without geodetic position.
    velocity : tuple of 3 floats, optional
        East, north, up [m/s]; None where not sent.
    fix_type : int, optional
        MAVLink GPS_FIX_TYPE (3 and above is a 3D fix); None where the source sends none.
    satellites : int, optional
        Satellites used; None where not sent.
    horizontal_accuracy : float
        One standard deviation of the horizontal position, as stated [m]; nan unknown.
    speed_accuracy : float
        One standard deviation of the velocity [m/s]; nan unknown.
    airspeed : float
        True airspeed by a sensor, since the sample before [m/s]; nan where none came, or where the
        autopilot has no such sensor and sends what it works out.
    heading : float
        ENU angle of where the nose points [deg], since the sample before; nan where none came.
    wind : tuple of 3 floats, optional
        Wind by the autopilot, since the sample before: velocity of the air towards east, north, up
        [m/s]; None where none came.
    wind_accuracy : float
        One standard deviation of its horizontal components [m/s]; nan unknown.
    air_density : float
        By the vehicle's own pressure and temperature [kg/m^3]; nan where not sent for long.
    """

    time: float
    stamp_ns: int
    flight: int = 0
    latitude: float = nan
    longitude: float = nan
    altitude_amsl: float = nan
    altitude_ellipsoid: float = nan
    height_above_home: float = nan
    local_position: Vector | None = None
    velocity: Vector | None = None
    fix_type: int | None = None
    satellites: int | None = None
    horizontal_accuracy: float = nan
    speed_accuracy: float = nan
    airspeed: float = nan
    heading: float = nan
    wind: Vector | None = None
    wind_accuracy: float = nan
    air_density: float = nan
