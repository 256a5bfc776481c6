"""PX4's ULog files (.ulg) to samples.

Positions are those of the receiver in use (vehicle_gps_position, else one sensor_gps at a time)
with its own word on its fix; only a log without a receiver gives the estimator's
(vehicle_global_position, else vehicle_local_position). The heading is the estimator's, the
airspeed that of the sensor the autopilot has chosen.
"""

from collections.abc import Iterator
from math import asin, atan2, cos, degrees, hypot, isfinite, nan, radians, sin

from ctcbs_ros.telemetry.between_samples import BetweenSamples
from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.conventions import (
    density_of_pressure,
    enu_angle,
    wind_deviation,
    wind_of_ned,
)
from ctcbs_ros.telemetry.evidence import FIX_3D, NO_FIX
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.ulog_messages import Data, UlogSplitter, Values

# Sources of the position, best first.
POSITIONS = (
    "vehicle_gps_position", "sensor_gps", "vehicle_global_position", "vehicle_local_position",
)  # fmt: skip
AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
EXTRAPOLATED = 8  # PX4's own fix type: dead reckoning, where MAVLink numbers PPP
# Another receiver is followed once the one in use has been silent for this long [us].
RECEIVER_SILENT_US = 2_000_000
# A velocity belongs to a position when their times are no farther apart than this [us].
SAME_TIME_US = 100_000
AIRSPEED_SENSORS = (1, 2, 3)  # in airspeed_source; the others are worked out
NOT_MEASURED = 0  # of temperature_source: 15 degC at any height
EARTH_RADIUS = 6_371_000.0  # m, of the sphere on which PX4 projects its local frame


class UlogDecoder:
    """Samples out of a stream of ULog bytes, one for each message of the position in use.

    Time is the autopilot's (`timestamp`, since boot). A flight is tied to Unix time by the first
    receiver's message with `time_utc_usec`, or by `unix_anchor`.

    Parameters
    ----------
    vehicle, unix_anchor
        As for `ctcbs_ros.telemetry.dataflash.DataflashDecoder`.
    position_topic : str, optional
        Topic whose positions are used until a better one has a fix, where known already.

    Attributes
    ----------
    vehicle : Vehicle or None
        System id (MAV_SYS_ID) and the system's name ("PX4"), once read.
    position_topic : str or None
        As the parameter; None as long as none has had a fix.
    """

    def __init__(
        self,
        vehicle: Vehicle | None = None,
        unix_anchor: tuple[int, int] | None = None,
        position_topic: str | None = None,
    ):
        self.link = LinkStatistics()
        self._between = BetweenSamples()
        self.position_topic = position_topic
        self._vehicle = vehicle
        self._clock = VehicleClock(time_steps=self.link.time_steps, unix_anchor=unix_anchor)
        self._boot_us = 0  # of the newest position
        self._topic = position_topic  # the one in use; also before it has a fix
        self._is_local: bool | None = None
        self._frames = 0  # changes between geodetic and local positions
        # by topic, the receiver followed and the time of its newest fix
        self._receivers: dict[str, tuple[int, int]] = {}
        self._home_altitude = nan
        self._velocity: Vector | None = None
        self._velocity_us = 0
        self._speed_accuracy = nan
        self._wind_topic = "wind_estimate"
        self._airspeed_topic = "airspeed"
        self._handlers = {
            "vehicle_gps_position": self._gps,
            "sensor_gps": self._gps,
            "vehicle_global_position": self._global_position,
            "vehicle_local_position": self._local_position,
            "home_position": self._home,
            "wind": self._wind,
            "wind_estimate": self._wind,
            "vehicle_air_data": self._air_data,
            "airspeed": self._airspeed,
            "airspeed_validated": self._airspeed,
        }
        self._messages = UlogSplitter(self.link, self._handlers)

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle, by the log's information and parameters."""
        facts = self._messages.facts
        if self._vehicle is None and "sys_name" in facts:
            return Vehicle(facts.get("MAV_SYS_ID", 1), AUTOPILOT, facts["sys_name"])
        return self._vehicle

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the estimator, towards east, north, up [m/s]."""
        return self._between.wind

    @property
    def unix_anchor(self) -> tuple[int, int] | None:
        """What ties the clock to Unix time, once known."""
        return self._clock.unix_anchor

    def feed(self, data: bytes, last: bool = False) -> Iterator[Sample]:
        """Samples completed by more bytes, as they are decoded; with `last` no more follow."""
        for message in self._messages.split(data, last):
            if "timestamp" in message.values:
                sample = self._handlers[message.topic](message)
                if sample is not None:
                    yield sample

    def _gps(self, message: Data) -> Sample | None:
        values = message.values
        fix_type = values.get("fix_type", NO_FIX)
        has_fix = FIX_3D <= fix_type < EXTRAPOLATED
        if not self._is_receiver_used(message, has_fix) or not self._is_used(message, has_fix):
            return None
        if "latitude_deg" in values:
            latitude, longitude = values["latitude_deg"], values.get("longitude_deg", nan)
            amsl = values.get("altitude_msl_m", nan)
            ellipsoid = values.get("altitude_ellipsoid_m", nan)
        else:
            latitude, longitude = values.get("lat", nan) / 1e7, values.get("lon", nan) / 1e7
            amsl, ellipsoid = values.get("alt", nan) / 1e3, values.get("alt_ellipsoid", nan) / 1e3
        velocity = None
        if values.get("vel_ned_valid"):
            velocity = _enu(values, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s")

        time_us = self._advance(values["timestamp"])
        unix_us = values.get("time_utc_usec", 0)
        if unix_us > 0:
            relative_us = values.get("timestamp_time_relative", 0)
            self._clock.set_unix(time_us + relative_us, unix_us)
        return self._sample(
            time_us,
            latitude=latitude,
            longitude=longitude,
            altitude_amsl=amsl,
            altitude_ellipsoid=ellipsoid or nan,  # 0 where the receiver does not tell
            height_above_home=amsl - self._home_altitude,
            velocity=velocity,
            fix_type=NO_FIX if fix_type == EXTRAPOLATED else fix_type,
            satellites=values.get("satellites_used"),
            horizontal_accuracy=values.get("eph", nan) or nan,
            # a standard deviation, whatever its name says
            speed_accuracy=values.get("s_variance_m_s", nan) or nan,
        )

    def _global_position(self, message: Data) -> Sample | None:
        values = message.values
        is_valid = values.get("lat_lon_valid", True) and not values.get("dead_reckoning", False)
        if message.instance or not self._is_used(message, is_valid):
            return None
        time_us = self._advance(values["timestamp"])
        velocity, speed_accuracy = _enu(values, "vel_n", "vel_e", "vel_d"), nan
        if velocity is None and abs(values["timestamp"] - self._velocity_us) <= SAME_TIME_US:
            velocity, speed_accuracy = self._velocity, self._speed_accuracy
        amsl = values.get("alt", nan)
        return self._sample(
            time_us,
            latitude=values.get("lat", nan),
            longitude=values.get("lon", nan),
            altitude_amsl=amsl,
            altitude_ellipsoid=values.get("alt_ellipsoid", nan) or nan,
            height_above_home=amsl - self._home_altitude,
            velocity=velocity,
            fix_type=None if is_valid else NO_FIX,
            horizontal_accuracy=values.get("eph", nan) or nan,
            speed_accuracy=speed_accuracy,
        )

    def _local_position(self, message: Data) -> Sample | None:
        values = message.values
        if message.instance:
            return None
        self._velocity = None
        if values.get("v_xy_valid", True):
            self._velocity = _enu(values, "vx", "vy", "vz")
        self._velocity_us = values["timestamp"]
        self._speed_accuracy = values.get("evh", nan) or nan
        # It was called yaw up to PX4 1.10.
        self._between.hear_heading(
            enu_angle(degrees(values.get("heading", values.get("yaw", nan))))
        )
        is_valid = values.get("xy_valid", True) and values.get("z_valid", True)
        if not self._is_used(message, is_valid):
            return None
        time_us = self._advance(values["timestamp"])
        north, east, down = (values.get(name, nan) for name in "xyz")
        if values.get("xy_global") and values.get("z_global"):
            reference = values.get("ref_lat", nan), values.get("ref_lon", nan)
            latitude, longitude = unprojected(*reference, north, east)
            amsl = values.get("ref_alt", nan) - down
            place = {
                "latitude": latitude,
                "longitude": longitude,
                "altitude_amsl": amsl,
                "height_above_home": amsl - self._home_altitude,
            }
        else:
            place = {"local_position": (east, north, -down)}
        return self._sample(
            time_us,
            velocity=self._velocity,
            fix_type=None if is_valid else NO_FIX,
            horizontal_accuracy=values.get("eph", nan) or nan,
            speed_accuracy=self._speed_accuracy,
            **place,
        )

    def _home(self, message: Data) -> None:
        if message.values.get("valid_alt", True):
            self._home_altitude = message.values.get("alt", nan)

    def _wind(self, message: Data) -> None:
        # `wind` took the place of `wind_estimate`; instances but the first are of single sensors.
        if message.topic == "wind":
            self._wind_topic = "wind"
        if message.topic != self._wind_topic or message.instance:
            return
        values = message.values
        wind = wind_of_ned(values.get("windspeed_north", nan), values.get("windspeed_east", nan))
        variances = values.get("variance_north", nan) + values.get("variance_east", nan)
        self._between.hear_wind(wind, wind_deviation(variances))

    def _air_data(self, message: Data) -> None:
        values = message.values
        celsius = values.get("ambient_temperature", values.get("baro_temp_celcius", nan))
        if values.get("temperature_source") == NOT_MEASURED:
            celsius = nan
        density = density_of_pressure(values.get("baro_pressure_pa", nan), celsius)
        self._between.hear_density(density, values["timestamp"])

    def _airspeed(self, message: Data) -> None:
        # Validated airspeeds took the place of the sensors' own.
        if message.topic == "airspeed_validated":
            self._airspeed_topic = "airspeed_validated"
        if message.topic != self._airspeed_topic or message.instance:
            return
        values = message.values
        source = values.get("airspeed_source", values.get("selected_airspeed_index", 1))
        if source in AIRSPEED_SENSORS:
            self._between.hear_true_airspeed(values.get("true_airspeed_m_s", nan))

    def _is_receiver_used(self, message: Data, has_fix: bool) -> bool:
        """Whether it is of the one receiver followed; another takes over from a lost one."""
        now = message.values["timestamp"]
        followed, fixed_us = self._receivers.get(message.topic, (None, 0))
        silent = abs(now - fixed_us) > RECEIVER_SILENT_US
        if message.instance != followed and (followed is None or (has_fix and silent)):
            followed = message.instance
        if message.instance != followed:
            return False
        self._receivers[message.topic] = followed, now if has_fix else fixed_us
        return True

    def _is_used(self, message: Data, is_placed: bool) -> bool:
        """Whether its topic is the one whose positions are used, from now on or as before."""
        topic = message.topic
        if self._topic is None:
            self._topic = topic
        elif is_placed and topic != self._topic:
            better = POSITIONS.index(topic) < POSITIONS.index(self._topic)
            if better or self.position_topic is None:
                self._topic = topic
        used = topic == self._topic
        if used and is_placed:
            self.position_topic = topic
        return used

    def _advance(self, boot_us: int) -> int:
        self._boot_us = boot_us
        time_us = self._clock.advance(boot_us)
        self._between.keep_to(self._clock.flight)
        return time_us

    def _sample(self, time_us: int, **fields) -> Sample:
        is_local = "local_position" in fields
        if self._is_local not in (None, is_local):
            self._frames += 1  # another frame: another flight
        self._is_local = is_local
        return Sample(
            time=time_us / 1e6,
            stamp_ns=self._clock.stamp_ns(time_us),
            flight=self._clock.flight + self._frames,
            **self._between.tell(self._boot_us, fields.get("altitude_amsl", nan)),
            **fields,
        )


def unprojected(
    latitude: float, longitude: float, north: float, east: float
) -> tuple[float, float]:
    """Geodetic position of a point of PX4's local frame, an azimuthal equidistant projection.

    Parameters
    ----------
    latitude, longitude : float
        Of the frame's origin [deg].
    north, east : float
        Of the point [m].

    Returns
    -------
    (float, float)
        Latitude and longitude [deg], the latter from -180 to below 180; nan where an argument is
        not finite.
    """
    if not all(map(isfinite, (latitude, longitude, hypot(north, east)))):
        return nan, nan
    arc, course, origin = hypot(north, east) / EARTH_RADIUS, atan2(east, north), radians(latitude)
    sine = sin(origin) * cos(arc) + cos(origin) * sin(arc) * cos(course)
    turn = atan2(sin(course) * sin(arc) * cos(origin), cos(arc) - sin(origin) * sine)
    across = (longitude + degrees(turn) + 180.0) % 360.0 - 180.0
    return degrees(asin(max(-1.0, min(1.0, sine)))), across


def _enu(values: Values, north: str, east: str, down: str) -> Vector | None:
    """Velocity towards east, north, up of one towards north, east, down; None if not logged."""
    if north not in values or east not in values:
        return None
    return values[east], values[north], -values.get(down, 0.0)
