"""PX4's ULog files (.ulg) to samples.

The format describes itself: F messages give the fields of each topic, A messages number the
topics that follow, D messages hold their data. pyulog loads a log whole, so the stream is cut
into messages here, and a log of any size is read as it comes.

Positions are those of the receiver in use (vehicle_gps_position, else one sensor_gps at a time)
with its own word on its fix; only a log without a receiver gives the estimator's
(vehicle_global_position, else vehicle_local_position).
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import asin, atan2, cos, degrees, hypot, isfinite, nan, radians, sin
from typing import Any, NamedTuple

from pyulog import ULog

from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.evidence import FIX_3D, NO_FIX
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector

START = ULog.HEADER_BYTES
SYNC = ULog.SYNC_BYTES
HEADER = 16  # bytes: magic, version, time stamp

# Sources of the position, best first.
POSITIONS = (
    "vehicle_gps_position", "sensor_gps", "vehicle_global_position", "vehicle_local_position",
)  # fmt: skip
TOPICS = {*POSITIONS, "home_position", "wind", "wind_estimate"}
FACTS = ("sys_name", "MAV_SYS_ID")

CODES = {
    "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i",
    "uint32_t": "I", "int64_t": "q", "uint64_t": "Q", "float": "f", "double": "d",
    "bool": "?", "char": "x",
}  # fmt: skip
INTEGERS = {
    "timestamp", "time_utc_usec", "timestamp_time_relative", "fix_type", "satellites_used",
}  # fmt: skip
# Message types, with the bytes that each has at least.
LEAST = {
    ord(kind): size
    for kind, size in {
        "B": 40, "F": 3, "I": 4, "M": 5, "P": 4, "Q": 5, "A": 4, "R": 2, "D": 2, "L": 9,
        "C": 11, "S": 8, "O": 2,
    }.items()
}  # fmt: skip
# What the beginning of a message can look like, for finding the next one after damage.
HEAD = re.compile(rb"(?s)(?=..[BFIMPQARDLCSO])")
TEXT = re.compile(rb"[\x20-\x7e]+")
LARGEST_UNKNOWN = 10_000  # bytes of a message of a type that came after this was written

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
EXTRAPOLATED = 8  # PX4's own fix type: dead reckoning, where MAVLink numbers PPP
# Another receiver is followed once the one in use has been silent for this long [us].
RECEIVER_SILENT_US = 2_000_000
# A velocity belongs to a position when their times are no farther apart than this [us].
SAME_TIME_US = 100_000
EARTH_RADIUS = 6_371_000.0  # m, of the sphere on which PX4 projects its local frame

Values = dict[str, Any]


class Data(NamedTuple):
    """One message of a topic; several receivers or estimators number themselves by instance."""

    topic: str
    instance: int
    values: Values


@dataclass(frozen=True)
class Layout:
    """Where the plain fields of a topic stand; arrays are passed over."""

    names: tuple[str, ...]
    fields: struct.Struct
    largest: int  # bytes with the padding at the end, which the logger leaves out


class MessageSplitter:
    """Cuts a ULog stream into messages, by the topics that the stream itself declares.

    There are no checksums: a message counts where it is formed as its type demands and another
    head, or the end, follows it.

    Parameters
    ----------
    link : LinkStatistics
        Where messages and bad bytes are counted.

    Attributes
    ----------
    facts : dict
        Of the log's information and parameters those in `FACTS`.
    """

    def __init__(self, link: LinkStatistics):
        self.facts: Values = {}
        self._link = link
        self._rest = b""
        self._in_header = True
        self._layouts: dict[str, Layout | None] = {}
        self._topics: dict[int, tuple[str, int]] = {}

    def split(self, data: bytes, last: bool = False) -> Iterator[Data]:
        """Wanted messages completed by more bytes; with `last` nothing follows them."""
        buffer = self._rest + data
        position = 0
        if self._in_header:
            if len(buffer) < HEADER and not last:
                self._rest = buffer
                return
            self._in_header = False
            position = HEADER if buffer.startswith(START) else 0
        while position + 3 <= len(buffer):
            end = position + 3 + int.from_bytes(buffer[position : position + 2], "little")
            is_head = self._is_head(buffer, position, self._link.in_step)
            # Whether it is intact shows in the head that follows it.
            if is_head and end + 5 > len(buffer) and not last:
                break
            if not is_head or not self._is_whole(buffer, position, end):
                found = HEAD.search(buffer, position + 1)
                resume = found.start() if found else max(position + 1, len(buffer) - 2)
                self._link.count_bad_bytes(resume - position)
                position = resume
                continue
            self._link.count_message()
            message = self._decode(buffer[position + 2], buffer[position + 3 : end])
            position = end
            if message is not None:
                yield message
        self._rest = buffer[position:]
        if last:
            self._link.count_bad_bytes(len(self._rest))
            self._rest = b""

    def _is_head(self, buffer: bytes, position: int, in_step: bool) -> bool:
        """Whether a message can begin there, as far as its first 5 bytes are there to tell.

        In step with what comes before, also one of a type or a topic that is not known.
        """
        if position + 3 > len(buffer):
            return True
        size, kind = struct.unpack_from("<HB", buffer, position)
        if kind not in LEAST:
            return in_step and 65 <= kind <= 90 and 0 < size <= LARGEST_UNKNOWN
        if size < LEAST[kind]:
            return False
        if kind == ord("D") and position + 5 <= len(buffer):
            number = int.from_bytes(buffer[position + 3 : position + 5], "little")
            if number not in self._topics:
                return in_step
            layout = self._layouts.get(self._topics[number][0])
            return layout is None or layout.fields.size <= size - 2 <= layout.largest
        return True

    def _is_whole(self, buffer: bytes, position: int, end: int) -> bool:
        if end > len(buffer) or not self._is_head(buffer, end, True):
            return False
        kind, content = chr(buffer[position + 2]), buffer[position + 3 : end]
        if kind == "S":
            return content == SYNC
        if kind in "FA":
            return TEXT.fullmatch(content[3 if kind == "A" else 0 :]) is not None
        if kind in "IMPQ":
            key = _key(content[kind in "MQ" :])
            return key is not None and TEXT.fullmatch(key) is not None
        if kind in "LC":
            return content[:1] in b"01234567"
        return len(content) == 2 if kind == "O" else True

    def _decode(self, kind: int, content: bytes) -> Data | None:
        match chr(kind):
            case "F":
                self._declare(content)
            case "A":
                instance, number = struct.unpack_from("<BH", content)
                self._topics[number] = content[3:].decode(), instance
            case "R":
                self._topics.pop(int.from_bytes(content[:2], "little"), None)
            case "I" | "P":
                self._take_fact(content)
            case "D":
                return self._data(content)
        return None

    def _declare(self, content: bytes) -> None:
        """Take in the fields of a topic; one that cannot be read is not decoded."""
        name = content.split(b":")[0].decode()
        if name not in TOPICS:
            return
        try:
            self._layouts[name] = _layout(ULog.MessageFormat(content, None).fields)
        except (KeyError, ValueError, IndexError, struct.error):
            self._layouts[name] = None

    def _take_fact(self, content: bytes) -> None:
        key = _key(content)
        kind, _, name = key.decode().partition(" ")
        if name not in FACTS:
            return
        value = content[1 + len(key) :]
        if kind.startswith("char["):
            self.facts[name] = value.decode(errors="replace").rstrip("\0")
        elif kind == "int32_t" and len(value) == 4:
            self.facts[name] = int.from_bytes(value, "little", signed=True)

    def _data(self, content: bytes) -> Data | None:
        topic, instance = self._topics.get(int.from_bytes(content[:2], "little"), ("", 0))
        layout = self._layouts.get(topic)
        if layout is None or len(content) - 2 < layout.fields.size:
            return None
        values = layout.fields.unpack_from(content, 2)
        return Data(topic, instance, dict(zip(layout.names, values, strict=True)))


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
    wind : tuple of 3 floats or None
        Newest wind of the estimator: velocity of the air towards east, north, up [m/s].
    unix_anchor : (int, int) or None
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
        self.wind: Vector | None = None
        self.unix_anchor = unix_anchor
        self.position_topic = position_topic
        self._vehicle = vehicle
        self._clock = VehicleClock(time_steps=self.link.time_steps)
        if unix_anchor is not None:
            self._clock.set_unix(*unix_anchor)
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
        self._handlers = {
            "vehicle_gps_position": self._gps,
            "sensor_gps": self._gps,
            "vehicle_global_position": self._global_position,
            "vehicle_local_position": self._local_position,
            "home_position": self._home,
            "wind": self._wind,
            "wind_estimate": self._wind,
        }
        self._messages = MessageSplitter(self.link)

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle, by the log's information and parameters."""
        facts = self._messages.facts
        if self._vehicle is None and "sys_name" in facts:
            return Vehicle(facts.get("MAV_SYS_ID", 1), AUTOPILOT, facts["sys_name"])
        return self._vehicle

    def feed(self, data: bytes, last: bool = False) -> Iterator[Sample]:
        """Samples completed by more bytes, as they are decoded; with `last` no more follow."""
        for message in self._messages.split(data, last):
            if "timestamp" in message.values:
                sample = self._handlers[message.topic](message)
                if sample is not None:
                    yield sample

    def choose_any(self) -> None:
        """A ULog is of one vehicle: there is nothing to choose."""

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

        time_us = self._clock.advance(values["timestamp"])
        unix_us = values.get("time_utc_usec", 0)
        if unix_us > 0:
            tie = time_us + values.get("timestamp_time_relative", 0), unix_us
            self._clock.set_unix(*tie)
            self.unix_anchor = self.unix_anchor or tie
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
        time_us = self._clock.advance(values["timestamp"])
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
        is_valid = values.get("xy_valid", True) and values.get("z_valid", True)
        if not self._is_used(message, is_valid):
            return None
        time_us = self._clock.advance(values["timestamp"])
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
        north, east = (message.values.get(f"windspeed_{to}", nan) for to in ("north", "east"))
        used = message.topic == self._wind_topic and message.instance == 0
        if used and isfinite(north) and isfinite(east):
            self.wind = (east, north, 0.0)

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

    def _sample(self, time_us: int, **fields) -> Sample:
        is_local = "local_position" in fields
        if self._is_local not in (None, is_local):
            self._frames += 1  # another frame: another flight
        self._is_local = is_local
        return Sample(
            time=time_us / 1e6,
            stamp_ns=self._clock.stamp_ns(time_us),
            flight=self._clock.flight + self._frames,
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
        Latitude and longitude [deg]; nan where an argument is not finite.
    """
    if not all(map(isfinite, (latitude, longitude, hypot(north, east)))):
        return nan, nan
    arc, course, origin = hypot(north, east) / EARTH_RADIUS, atan2(east, north), radians(latitude)
    sine = sin(origin) * cos(arc) + cos(origin) * sin(arc) * cos(course)
    turn = atan2(sin(course) * sin(arc) * cos(origin), cos(arc) - sin(origin) * sine)
    return degrees(asin(max(-1.0, min(1.0, sine)))), longitude + degrees(turn)


def _layout(fields: list[tuple[str, int, str]]) -> Layout:
    """Layout of (type, array size, name); KeyError for a type that is a topic itself."""
    names, formats, trailing = [], "<", ""
    for kind, count, name in fields:
        code = CODES[kind]
        if name.startswith("_padding"):
            trailing += f"{struct.calcsize('<' + code) * (count or 1)}x"
            continue
        formats += trailing
        trailing = ""
        if count:
            formats += f"{struct.calcsize('<' + code) * count}x"
        elif code == "x":
            formats += code
        elif name in INTEGERS and code in "fd?":
            raise ValueError(f"{name}: {kind}")
        else:
            names.append(name)
            formats += code
    largest = struct.calcsize(formats + trailing)
    return Layout(tuple(names), struct.Struct(formats), largest)


def _key(content: bytes) -> bytes | None:
    """The "type name" of an information or a parameter; None where it is cut short."""
    key = content[1 : 1 + content[0]]
    return key if len(key) == content[0] and b" " in key else None


def _enu(values: Values, north: str, east: str, down: str) -> Vector | None:
    """Velocity towards east, north, up of one towards north, east, down; None if not logged."""
    if north not in values or east not in values:
        return None
    return values[east], values[north], -values.get(down, 0.0)
