"""ArduPilot's DataFlash logs (.BIN) to samples.

The format describes itself: FMT messages give each type's length, fields and scaling, which
pymavlink applies; the stream is cut into messages here, so that a log of any size is read as it
comes.

Positions are those of the one receiver in use (GPS); the height above home is that of the
autopilot's one published position (POS). Of estimator cores, barometers and airspeed sensors
only the primary one is listened to, and of the sensors only while it is healthy.
"""

import struct
from collections.abc import Iterator
from math import cos, isfinite, nan, radians, sin

from pymavlink.DFReader import FORMAT_TO_STRUCT, DFFormat, DFMessage

from ctcbs_ros.telemetry.between_samples import BetweenSamples
from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.conventions import density_of_pressure, enu_angle, wind_of_ned
from ctcbs_ros.telemetry.evidence import RANGE_ERROR
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.splitter import MessageSplitter

HEAD = b"\xa3\x95"
FMT = 0x80
START = HEAD + bytes([FMT])
FMT_FORMAT = DFFormat(FMT, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")

# Messages that are decoded, with the fields without which they say nothing to us.
WANTED = {
    "GPS": {"TimeUS", "Status", "Lat", "Lng", "Alt"},
    "GPA": {"HAcc", "SAcc"},
    "POS": {"RelHomeAlt"},
    "PARM": {"Name", "Value"},
    "MSG": {"Message"},
    "ATT": {"Yaw"},
    "AHR2": {"Yaw"},
    "ARSP": {"Airspeed", "U"},
    "BARO": {"TimeUS", "Press", "Temp"},
    "XKF2": {"VWN", "VWE"},
    "XKF4": {"PI"},
    "NKF2": {"VWN", "VWE"},
    "NKF4": {"PI"},
}

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
GPS_EPOCH_UNIX = 315_964_800  # 1980-01-06 [s]
LEAP_SECONDS = 18  # GPS time less UTC since 2017; stamps of older logs are up to 3 s early
WEEK = 604_800  # [s]


class DataflashSplitter(MessageSplitter):
    """Cuts a stream into DataFlash messages, by the formats that the stream itself declares.

    Parameters
    ----------
    link : LinkStatistics
        Where messages and bad bytes are counted.
    """

    LOOK_AHEAD = 2

    def __init__(self, link: LinkStatistics):
        super().__init__(link)
        self._lengths = {FMT: FMT_FORMAT.len}
        self._formats = {FMT: FMT_FORMAT}

    def _end(self, buffer: bytes, position: int) -> int:
        if not buffer.startswith(HEAD, position):
            return position
        return position + self._lengths.get(buffer[position + 2], 0)

    def _is_whole(self, buffer: bytes, position: int, end: int) -> bool:
        return end <= len(buffer) and HEAD.startswith(buffer[end : end + 2])

    def _next_head(self, buffer: bytes, position: int) -> int:
        found = buffer.find(HEAD, position + 1)
        return found if found >= 0 else len(buffer) - 1

    def _decode(self, buffer: bytes, position: int, end: int) -> DFMessage | None:
        layout = self._formats.get(buffer[position + 2])
        if layout is None:
            return None
        elements = list(struct.unpack(layout.msg_struct, buffer[position + 3 : end]))
        message = DFMessage(layout, elements, True, None)
        if layout is not FMT_FORMAT:
            return message
        self._declare(message)
        return None

    def _declare(self, declared: DFMessage) -> None:
        """Take in an FMT message, the format of another type."""
        if declared.Type == FMT or declared.Length < 3:
            return
        self._lengths[declared.Type] = declared.Length
        self._formats.pop(declared.Type, None)
        columns = declared.Columns.split(",")
        usable = WANTED.get(declared.Name, {None}).issubset(columns)
        if not usable or len(columns) != len(declared.Format):
            return
        if FORMAT_TO_STRUCT.keys() >= set(declared.Format):
            layout = DFFormat(
                declared.Type, declared.Name, declared.Length, declared.Format, declared.Columns
            )
            if struct.calcsize(layout.msg_struct) + 3 == layout.len:
                self._formats[declared.Type] = layout


class DataflashDecoder:
    """Samples out of a stream of DataFlash bytes, one for each GPS message of the receiver in use.

    Time is the autopilot's (TimeUS). A flight is tied to Unix time by the first GPS message of the
    log that has GPS time, or by `unix_anchor`.

    Parameters
    ----------
    vehicle : Vehicle, optional
        The vehicle, where it is known already.
    unix_anchor : (int, int), optional
        An instant of the autopilot's clock [us] and its Unix time [us], where known already.
    splitter : type, optional
        What cuts the stream into messages; default `DataflashSplitter`.

    Attributes
    ----------
    vehicle : Vehicle or None
        System id (SYSID_THISMAV) and firmware ("ArduPlane"), once read.
    """

    def __init__(
        self,
        vehicle: Vehicle | None = None,
        unix_anchor: tuple[int, int] | None = None,
        splitter: type | None = None,
    ):
        self.link = LinkStatistics()
        self.vehicle = vehicle
        self._between = BetweenSamples()
        self._clock = VehicleClock(time_steps=self.link.time_steps, unix_anchor=unix_anchor)
        self._system = 1
        self._estimator = "XKF"
        self._primary_core = 0
        self._primary_barometer = 0
        self._has_attitude = False
        self._height_above_home = nan
        self._accuracy: dict[int, DFMessage] = {}  # newest by receiver
        self._handlers = {
            "GPS": self._gps,
            "GPA": self._gps_accuracy,
            "POS": self._position,
            "PARM": self._parameter,
            "MSG": self._text,
            "ATT": self._attitude,
            "AHR2": self._backup_attitude,
            "ARSP": self._airspeed,
            "BARO": self._barometer,
            "XKF2": self._wind,
            "NKF2": self._wind,
            "XKF4": self._estimator_status,
            "NKF4": self._estimator_status,
        }
        self._messages = (splitter or DataflashSplitter)(self.link)

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the primary estimator core, towards east, north, up [m/s]."""
        return self._between.wind

    @property
    def unix_anchor(self) -> tuple[int, int] | None:
        """What ties the clock to Unix time, once known."""
        return self._clock.unix_anchor

    def feed(self, data: bytes, last: bool = False) -> Iterator[Sample]:
        """Samples completed by more bytes, as they are decoded; with `last` no more follow."""
        for message in self._messages.split(data, last):
            sample = self._handlers[message.get_type()](message)
            if sample is not None:
                yield sample

    def _gps(self, gps: DFMessage) -> Sample | None:
        receiver = getattr(gps, "I", 0)
        if not getattr(gps, "U", receiver == 0):
            return None
        time_us = self._clock.advance(gps.TimeUS)
        self._between.keep_to(self._clock.flight)
        if getattr(gps, "GWk", 0) > 0:
            unix_us = (GPS_EPOCH_UNIX + gps.GWk * WEEK - LEAP_SECONDS) * 10**6 + gps.GMS * 1000
            self._clock.set_unix(time_us, unix_us)

        accuracy = self._accuracy.get(receiver)
        by_dilution = getattr(gps, "HDop", nan) * RANGE_ERROR
        # ArduPilot's sign: AMSL less ellipsoidal height; 0 is not known.
        undulation = getattr(accuracy, "Und", 0.0)
        return Sample(
            time=time_us / 1e6,
            stamp_ns=self._clock.stamp_ns(time_us),
            flight=self._clock.flight,
            latitude=gps.Lat,
            longitude=gps.Lng,
            altitude_amsl=gps.Alt,
            altitude_ellipsoid=gps.Alt - undulation if undulation else nan,
            height_above_home=self._height_above_home,
            velocity=_velocity(gps),
            fix_type=gps.Status,  # numbered as GPS_FIX_TYPE
            satellites=getattr(gps, "NSats", None),
            horizontal_accuracy=getattr(accuracy, "HAcc", 0.0) or by_dilution,
            speed_accuracy=getattr(accuracy, "SAcc", 0.0) or nan,
            **self._between.tell(gps.TimeUS, gps.Alt),
        )

    def _gps_accuracy(self, accuracy: DFMessage) -> None:
        self._accuracy[getattr(accuracy, "I", 0)] = accuracy

    def _position(self, position: DFMessage) -> None:
        self._height_above_home = position.RelHomeAlt

    def _parameter(self, parameter: DFMessage) -> None:
        if parameter.Name in ("SYSID_THISMAV", "MAV_SYSID") and isfinite(parameter.Value):
            self._system = int(parameter.Value)
        elif parameter.Name == "AHRS_EKF_TYPE":
            self._estimator = "NKF" if parameter.Value == 2 else "XKF"
        elif parameter.Name in ("BARO_PRIMARY", "GND_PRIMARY"):
            self._primary_barometer = parameter.Value

    def _text(self, text: DFMessage) -> None:
        if self.vehicle is None and text.Message.startswith("Ardu"):
            self.vehicle = Vehicle(self._system, AUTOPILOT, text.Message.split()[0])

    def _estimator_status(self, status: DFMessage) -> None:
        if status.get_type().startswith(self._estimator):
            self._primary_core = status.PI

    def _wind(self, wind: DFMessage) -> None:
        primary = getattr(wind, "C", 0) == self._primary_core
        if not primary or not wind.get_type().startswith(self._estimator):
            return
        # VWN, VWE: where the air moves to. Exactly 0 is that of a filter that has not begun.
        if wind.VWN or wind.VWE:
            self._between.hear_wind(wind_of_ned(wind.VWN, wind.VWE))

    def _attitude(self, attitude: DFMessage) -> None:
        self._has_attitude = True
        self._between.hear_heading(enu_angle(attitude.Yaw))

    def _backup_attitude(self, attitude: DFMessage) -> None:
        if not self._has_attitude:
            self._between.hear_heading(enu_angle(attitude.Yaw))

    def _airspeed(self, sensor: DFMessage) -> None:
        primary = getattr(sensor, "I", 0) == getattr(sensor, "Pri", 0)
        if primary and sensor.U and _is_healthy(sensor):
            self._between.hear_indicated_airspeed(sensor.Airspeed)

    def _barometer(self, sensor: DFMessage) -> None:
        primary = getattr(sensor, "I", self._primary_barometer) == self._primary_barometer
        if primary and _is_healthy(sensor):
            density = density_of_pressure(sensor.Press, sensor.Temp)
            self._between.hear_density(density, sensor.TimeUS)


def _is_healthy(sensor: DFMessage) -> bool:
    """Whether a sensor is, as far as it says; the field changed its name."""
    return bool(getattr(sensor, "H", getattr(sensor, "Health", True)))


def _velocity(gps: DFMessage) -> Vector | None:
    """East, north, up [m/s]; 0 upwards where the log has no vertical velocity."""
    if not (hasattr(gps, "Spd") and hasattr(gps, "GCrs")):
        return None
    course = radians(gps.GCrs) if isfinite(gps.GCrs) else nan
    return gps.Spd * sin(course), gps.Spd * cos(course), -getattr(gps, "VZ", 0.0)
