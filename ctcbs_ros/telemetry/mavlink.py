"""MAVLink messages to samples: one decoder for logs and live links.

Bytes become frames (frames.py), a frame a message (pymavlink), and the messages of the one vehicle
that is followed become samples (`VehicleDecoder`): positions from GLOBAL_POSITION_INT, the
evidence for them from the newest GPS_RAW_INT before. Here NED becomes ENU and scaled integers SI.
"""

from collections import Counter
from collections.abc import Iterator
from math import cos, isfinite, radians, sin

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.evidence import Evidence
from ctcbs_ros.telemetry.frames import FrameSplitter
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.transport import open_transport

BOOT_WRAP_US = 2**32 * 1000  # time_boot_ms is a 32-bit counter
POSITIONS = ("GLOBAL_POSITION_INT", "GPS_RAW_INT")
# Positions of one sender until it is followed though it sends no heartbeat.
POSITIONS_WITHOUT_HEARTBEAT = 20
# GPS_RAW_INT without one GLOBAL_POSITION_INT until it is taken for the position itself.
RAW_WITHOUT_ESTIMATE = 10
UNKNOWN_16 = 0xFFFF

AIRCRAFT = {
    dialect.MAV_TYPE_FIXED_WING,
    dialect.MAV_TYPE_QUADROTOR,
    dialect.MAV_TYPE_COAXIAL,
    dialect.MAV_TYPE_HELICOPTER,
    dialect.MAV_TYPE_AIRSHIP,
    dialect.MAV_TYPE_HEXAROTOR,
    dialect.MAV_TYPE_OCTOROTOR,
    dialect.MAV_TYPE_TRICOPTER,
    dialect.MAV_TYPE_FLAPPING_WING,
    dialect.MAV_TYPE_KITE,
    # seven kinds of VTOL, the last four "reserved" before they were named
    *range(dialect.MAV_TYPE_VTOL_DUOROTOR, dialect.MAV_TYPE_VTOL_RESERVED5 + 1),
    dialect.MAV_TYPE_PARAFOIL,
    dialect.MAV_TYPE_DODECAROTOR,
    dialect.MAV_TYPE_DECAROTOR,
    dialect.MAV_TYPE_GENERIC_MULTIROTOR,
    dialect.MAV_TYPE_VTOL_GYRODYNE,
}


class VehicleDecoder:
    """Samples of one vehicle out of the messages of a link.

    The vehicle is the one asked for, by system, component or both; else the first that sends the
    heartbeat of an aircraft's autopilot; else, where positions come without such a heartbeat, the
    first to have sent 20 of them.

    GPS_RAW_INT yields samples itself for a vehicle that sends no GLOBAL_POSITION_INT (none among
    its first 10 GPS_RAW_INT). Its vertical velocity is not known and taken as 0.

    Parameters
    ----------
    system, component : int, optional
        MAVLink ids of the vehicle wanted.
    vehicle : Vehicle, optional
        The vehicle, where it is known already.
    link : LinkStatistics, optional

    Attributes
    ----------
    vehicle : Vehicle or None
        The vehicle followed.
    wind : tuple of 3 floats or None
        Newest wind of the autopilot (WIND, WIND_COV): the velocity of the air towards east, north,
        up [m/s].
    """

    def __init__(
        self,
        system: int | None = None,
        component: int | None = None,
        vehicle: Vehicle | None = None,
        link: LinkStatistics | None = None,
    ):
        if system is not None and component is not None:
            vehicle = Vehicle(system, component, "unknown type")
        self.vehicle = vehicle
        self.wind: Vector | None = None
        self.link = link or LinkStatistics()
        self._wanted = (system, component)
        self._positions_heard: Counter[tuple[int, int]] = Counter()
        self._not_aircraft: set[tuple[int, int]] = set()
        self._clock = VehicleClock(BOOT_WRAP_US, self.link.time_steps)
        self._flight = 0
        self._time_us: int | None = None  # continuous clock of the newest message that tells
        self._evidence = Evidence()
        self._raw_without_estimate = 0
        self._handlers = {
            "GLOBAL_POSITION_INT": self._global_position,
            "GPS_RAW_INT": self._gps_raw,
            "SYSTEM_TIME": self._system_time,
            "WIND": self._wind,
            "WIND_COV": self._wind_cov,
        }

    def decode(self, message, receive_us: int | None = None) -> Sample | None:
        """Take in one message of the link.

        Parameters
        ----------
        message : pymavlink message
        receive_us : int, optional
            When it was received, microseconds since the Unix epoch.

        Returns
        -------
        Sample or None
            The sample that the message completes.
        """
        kind = message.get_type()
        source = (message.get_srcSystem(), message.get_srcComponent())
        if kind == "HEARTBEAT":
            self._heartbeat(message, source)
        elif kind in POSITIONS and self.vehicle is None:
            self._consider(source)
        vehicle = self.vehicle
        if vehicle is None or source != (vehicle.system, vehicle.component):
            self.link.other_positions += kind in POSITIONS
            return None
        handler = self._handlers.get(kind)
        return handler(message, receive_us) if handler else None

    def choose_any(self) -> None:
        """Follow the first sender of positions now, however few they were."""
        senders = [source for source in self._positions_heard if source not in self._not_aircraft]
        if self.vehicle is None and senders:
            self.vehicle = Vehicle(*senders[0], "unknown type")

    def _heartbeat(self, message, source: tuple[int, int]) -> None:
        has_autopilot = message.autopilot != dialect.MAV_AUTOPILOT_INVALID
        vehicle = Vehicle(*source, _type_name(message.type))
        if self.vehicle is None and self._is_wanted(source):
            if has_autopilot and message.type in AIRCRAFT:
                self.vehicle = vehicle
            elif message.type != dialect.MAV_TYPE_GENERIC:
                self._not_aircraft.add(source)
        elif self.vehicle is not None and source == (self.vehicle.system, self.vehicle.component):
            self.vehicle = vehicle

    def _consider(self, source: tuple[int, int]) -> None:
        if self._is_wanted(source) and source not in self._not_aircraft:
            self._positions_heard[source] += 1
            if self._positions_heard[source] == POSITIONS_WITHOUT_HEARTBEAT:
                self.vehicle = Vehicle(*source, "unknown type")

    def _is_wanted(self, source: tuple[int, int]) -> bool:
        return all(want in (None, have) for want, have in zip(self._wanted, source, strict=True))

    def _advance(self, boot_us: int, receive_us: int | None) -> int:
        time_us = self._clock.advance(boot_us, receive_us)
        if self._clock.flight != self._flight:
            self._flight = self._clock.flight
            self._evidence = Evidence()  # what held before a reboot says nothing about now
        self._time_us = time_us
        return time_us

    def _system_time(self, message, receive_us: int | None) -> None:
        time_us = self._advance(message.time_boot_ms * 1000, receive_us)
        self._clock.set_unix(time_us, message.time_unix_usec)

    def _global_position(self, message, receive_us: int | None) -> Sample:
        self._raw_without_estimate = -1
        time_us = self._advance(message.time_boot_ms * 1000, receive_us)
        return self._sample(
            time_us,
            receive_us,
            message,
            height_above_home=message.relative_alt / 1000,
            velocity=(message.vy / 100, message.vx / 100, -message.vz / 100),
        )

    def _gps_raw(self, message, receive_us: int | None) -> Sample | None:
        if self._raw_without_estimate >= 0:
            self._raw_without_estimate += 1
        if self._raw_without_estimate <= RAW_WITHOUT_ESTIMATE:
            self._evidence = self._evidence.updated(message, self._time_us)
            return None
        # time_usec is since boot or since 1970; `set_unix` takes the latter only.
        time_us = self._advance(message.time_usec % BOOT_WRAP_US, receive_us)
        self._evidence = self._evidence.updated(message, self._time_us)
        self._clock.set_unix(time_us, message.time_usec)
        velocity = None
        if UNKNOWN_16 not in (message.vel, message.cog):
            speed, course = message.vel / 100, radians(message.cog / 100)
            velocity = (speed * sin(course), speed * cos(course), 0.0)
        return self._sample(time_us, receive_us, message, velocity=velocity)

    def _sample(self, time_us: int, receive_us: int | None, message, **fields) -> Sample:
        """The sample with what both position messages have in common."""
        altitude = message.alt / 1000
        evidence = self._evidence = self._evidence.at(time_us)
        return Sample(
            time=time_us / 1e6,
            stamp_ns=self._clock.stamp_ns(time_us, receive_us),
            flight=self._clock.flight,
            latitude=message.lat / 1e7,
            longitude=message.lon / 1e7,
            altitude_amsl=altitude,
            altitude_ellipsoid=altitude + evidence.geoid_height,
            fix_type=evidence.fix_type_of(altitude),
            satellites=evidence.satellites,
            horizontal_accuracy=evidence.horizontal_accuracy,
            speed_accuracy=evidence.speed_accuracy,
            **fields,
        )

    def _wind(self, message, receive_us: int | None) -> None:
        # `direction` is where it blows from, clockwise from north; speed_z points down.
        direction, speed = radians(message.direction), message.speed
        if isfinite(direction) and isfinite(speed):
            up = -message.speed_z if isfinite(message.speed_z) else 0.0
            self.wind = (-speed * sin(direction), -speed * cos(direction), up)

    def _wind_cov(self, message, receive_us: int | None) -> None:
        north, east, down = message.wind_x, message.wind_y, message.wind_z
        if isfinite(north) and isfinite(east):
            self.wind = (east, north, -down if isfinite(down) else 0.0)


class MavlinkDecoder:
    """Samples out of a stream of MAVLink bytes.

    Parameters
    ----------
    stamped : bool
        Whether the stream is a .tlog, with a receive stamp before each message.
    system, component, vehicle
        As for `VehicleDecoder`.
    """

    def __init__(
        self,
        stamped: bool,
        system: int | None = None,
        component: int | None = None,
        vehicle: Vehicle | None = None,
    ):
        self.link = LinkStatistics()
        self._messages = VehicleDecoder(system, component, vehicle, self.link)
        self._frames = FrameSplitter(frame_decoder(), stamped, self.link)

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle followed."""
        return self._messages.vehicle

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the autopilot, velocity towards east, north, up [m/s]."""
        return self._messages.wind

    def choose_any(self) -> None:
        """See `VehicleDecoder.choose_any`."""
        self._messages.choose_any()

    def feed(
        self, data: bytes, receive_us: int | None = None, last: bool = False
    ) -> Iterator[Sample]:
        """Samples completed by more bytes, as they are decoded.

        `receive_us` is when unstamped bytes were received; with `last` no more will follow.
        """
        for stamp_us, message in self._frames.split(data, last):
            sample = self._messages.decode(message, receive_us if stamp_us is None else stamp_us)
            if sample is not None:
                yield sample


def frame_decoder():
    """Function that decodes one frame's bytes by pymavlink; None where the checksum fails."""
    parser = dialect.MAVLink(None)

    def decode(frame: bytes):
        try:
            return parser.decode(bytearray(frame))
        except dialect.MAVError:
            return None

    return decode


def open_link(
    url: str, baud: int = 57600, system: int | None = None, component: int | None = None
) -> LiveSource:
    """Open a live MAVLink link.

    Parameters
    ----------
    url : str
        `udpin:[HOST:]PORT` (listens; on loopback unless HOST says otherwise), `udpout:HOST:PORT`
        (sends heartbeats there, so that the peer answers), `tcp:HOST:PORT`, or a serial device.
    baud : int
        Rate of a serial device.
    system, component : int, optional
        MAVLink ids of the vehicle wanted; see `VehicleDecoder`.

    Raises
    ------
    InputError
        If the url is malformed, the port is taken or the device cannot be opened.
    """
    transport = open_transport(url, baud, own_heartbeats())
    return LiveSource(transport, MavlinkDecoder(False, system, component))


def own_heartbeats() -> Iterator[bytes]:
    """Heartbeats of this program, which is no autopilot and no ground station, without end."""
    sender = dialect.MAVLink(None, 255, dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
    while True:
        yield sender.heartbeat_encode(
            dialect.MAV_TYPE_ONBOARD_CONTROLLER,
            dialect.MAV_AUTOPILOT_INVALID,
            base_mode=0,
            custom_mode=0,
            system_status=dialect.MAV_STATE_ACTIVE,
        ).pack(sender)
        sender.seq = (sender.seq + 1) % 256


def _type_name(mav_type: int) -> str:
    """A MAV_TYPE in words, "fixed wing"."""
    entry = dialect.enums["MAV_TYPE"].get(mav_type)
    name = entry.name.removeprefix("MAV_TYPE_") if entry else f"type {mav_type}"
    return name.replace("_", " ").lower()
