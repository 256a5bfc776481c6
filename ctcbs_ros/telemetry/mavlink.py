"""A stream of MAVLink bytes to samples, of a log or of a live link.

Bytes become frames (frames.py), a frame a message (pymavlink), and the messages of the one vehicle
that is followed become samples (vehicle_messages.py), beside those of a beacon where there is one
(beacon_messages.py).
"""

from collections.abc import Callable, Iterator

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted
from ctcbs_ros.telemetry.beacon_messages import BeaconDecoder
from ctcbs_ros.telemetry.frames import FrameSplitter
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.own_messages import OwnMessages
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.transport import open_transport
from ctcbs_ros.telemetry.vehicle_choice import VehicleChoice
from ctcbs_ros.telemetry.vehicle_messages import VehicleDecoder


class MavlinkDecoder:
    """Samples out of a stream of MAVLink bytes.

    Parameters
    ----------
    stamped : bool
        Whether the stream is a .tlog, with a receive stamp before each message.
    system, component, vehicle, looking_ahead
        Whom to follow, see `VehicleChoice`.
    hear : callable, optional
        Called with each message of the vehicle followed.
    beacon : BeaconWanted, optional
        The system whose positions are the payload's.
    """

    def __init__(
        self,
        stamped: bool,
        system: int | None = None,
        component: int | None = None,
        vehicle: Vehicle | None = None,
        hear: Callable | None = None,
        beacon: BeaconWanted | None = None,
        looking_ahead: bool = False,
    ):
        self.link = LinkStatistics()
        self._beacon = None if beacon is None else BeaconDecoder(beacon)
        choice = VehicleChoice(system, component, vehicle, looking_ahead)
        self._messages = VehicleDecoder(link=self.link, choice=choice)
        self._hear = hear
        self._frames = FrameSplitter(frame_decoder(), stamped, self.link)

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle followed."""
        return self._messages.vehicle

    @property
    def beacon(self) -> Vehicle | None:
        """The beacon, once heard."""
        return None if self._beacon is None else self._beacon.vehicle

    @property
    def beacon_link(self) -> LinkStatistics | None:
        """Counts of the beacon's messages alone; None without one."""
        return None if self._beacon is None else self._beacon.link

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the autopilot, velocity towards east, north, up [m/s]."""
        return self._messages.wind

    def choose_any(self) -> None:
        """See `VehicleDecoder.choose_any`."""
        self._messages.choose_any()

    def feed(
        self, data: bytes, receive_us: int | None = None, last: bool = False
    ) -> Iterator[Sample | BeaconSample]:
        """Samples completed by more bytes, as they are decoded.

        `receive_us` is when unstamped bytes were received; with `last` no more will follow.
        """
        for stamp_us, message in self._frames.split(data, last):
            received = receive_us if stamp_us is None else stamp_us
            if self._beacon is not None and self._beacon.sends(message):
                measured = self._beacon.decode(message, received)
                if measured is not None:
                    yield measured
                continue
            sample = self._messages.decode(message, received)
            if self._hear is not None and self._messages.follows(message):
                self._hear(message)
            if sample is not None:
                if self._beacon is not None:
                    self._beacon.hear_aircraft(sample, received, self._messages.unix_offset)
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
    url: str,
    baud: int = 57600,
    system: int | None = None,
    component: int | None = None,
    heartbeat: bool = False,
    request_rate: float = 0.0,
    beacon: BeaconWanted | None = None,
) -> LiveSource:
    """Open a live MAVLink link.

    Parameters
    ----------
    url : str
        `udpin:[HOST:]PORT` or `tcpin:[HOST:]PORT` (listens; on loopback unless HOST says
        otherwise), `udpout:HOST:PORT` (sends heartbeats there, so that the peer answers),
        `tcp:HOST:PORT`, or a serial device.
    baud : int
        Rate of a serial device.
    system, component : int, optional
        MAVLink ids of the vehicle wanted; see `VehicleChoice`.
    heartbeat : bool
        Whether to send a heartbeat each second on any link.
    request_rate : float
        Rate of position messages to ask the vehicle for [1/s]; 0 to ask for nothing.
    beacon : BeaconWanted, optional
        A second system on the link, whose positions are the payload's; nothing is asked of it.

    Raises
    ------
    InputError
        If the url is malformed, the port is taken or the device cannot be opened.
    """
    own = OwnMessages(heartbeat or url.startswith("udpout:"), request_rate)
    transport = open_transport(url, baud)
    decoder = MavlinkDecoder(False, system, component, hear=own.hear, beacon=beacon)
    return LiveSource(transport, decoder, own)
