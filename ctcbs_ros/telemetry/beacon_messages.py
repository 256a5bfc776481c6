"""MAVLink messages of the payload's beacon to its samples, apart from the aircraft's.

The same decoder as the aircraft's, with a clock, evidence and counts of its own. Whatever the
beacon says it is (many claim to be an aircraft), its system is never chosen as the aircraft.
"""

from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted, CommonTime
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.vehicle_choice import UNKNOWN_TYPE, type_name
from ctcbs_ros.telemetry.vehicle_messages import VehicleDecoder


class BeaconChoice:
    """Follows the component asked for, or the first of the system to send a position.

    Its interface is that of `VehicleChoice`.
    """

    def __init__(self, wanted: BeaconWanted):
        self._wanted = wanted
        self._types: dict[int, str] = {}  # by component
        self.vehicle: Vehicle | None = None

    def follows(self, source: tuple[int, int]) -> bool:
        """Whether a sender, (system, component), is the beacon."""
        return self.vehicle is not None and source == (
            self.vehicle.system, self.vehicle.component
        )  # fmt: skip

    def hear_heartbeat(self, source: tuple[int, int], mav_type: int, autopilot: int) -> None:
        """Take in what a sender says it is; that decides nothing."""
        self._types[source[1]] = type_name(mav_type)
        if self.follows(source):
            self.vehicle = Vehicle(*source, self._types[source[1]])

    def hear_position(self, source: tuple[int, int]) -> None:
        """Take in that a sender sent a position."""
        if self.vehicle is None and self._wanted.component in (None, source[1]):
            self.vehicle = Vehicle(*source, self._types.get(source[1], UNKNOWN_TYPE))

    def choose_any(self) -> None:
        """Nothing: the first position has chosen."""


class BeaconDecoder:
    """Samples of the beacon out of the messages of its system.

    Attributes
    ----------
    link : LinkStatistics
        Of the beacon alone: steps of its clock, positions of other components of its system.
    """

    def __init__(self, wanted: BeaconWanted):
        self.link = LinkStatistics()
        self._system = wanted.system
        self._messages = VehicleDecoder(link=self.link, choice=BeaconChoice(wanted))
        self._time = CommonTime()

    @property
    def vehicle(self) -> Vehicle | None:
        """The beacon, once it has sent a position."""
        return self._messages.vehicle

    def sends(self, message) -> bool:
        """Whether a message is of the beacon's system."""
        return message.get_srcSystem() == self._system

    def hear_aircraft(
        self, sample: Sample, receive_us: int | None, unix_offset: float | None
    ) -> None:
        """Take in a sample of the aircraft, see `CommonTime.hear_aircraft`."""
        self._time.hear_aircraft(sample, _seconds(receive_us), unix_offset)

    def decode(self, message, receive_us: int | None) -> BeaconSample | None:
        """Take in one message of the beacon's system, see `VehicleDecoder.decode`."""
        sample = self._messages.decode(message, receive_us)
        if sample is None:
            return None
        return self._time.tie(sample, _seconds(receive_us), self._messages.unix_offset)


def _seconds(receive_us: int | None) -> float | None:
    return None if receive_us is None else receive_us / 1e6
