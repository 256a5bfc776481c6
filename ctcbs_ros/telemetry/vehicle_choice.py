"""Whose messages are followed on a link that several senders share.

Ground stations, radios, cameras, gimbals, trackers and traffic send heartbeats too; one of them
even claims to be an autopilot. Only aircraft are followed unasked.
"""

from collections import Counter

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.link import Vehicle

# Positions of one sender until it is followed though it sends no heartbeat.
POSITIONS_WITHOUT_HEARTBEAT = 20
UNKNOWN_TYPE = "unknown type"

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
NEVER_TOWING = {
    dialect.MAV_TYPE_GCS,
    dialect.MAV_TYPE_ANTENNA_TRACKER,
    dialect.MAV_TYPE_ONBOARD_CONTROLLER,
    dialect.MAV_TYPE_GIMBAL,
    dialect.MAV_TYPE_ADSB,
    dialect.MAV_TYPE_CAMERA,
}


class VehicleChoice:
    """Chooses one vehicle, and tells its messages from all others.

    It is the one asked for, by system, component or both; else the first that sends the heartbeat
    of an aircraft's autopilot; else, where positions come without such a heartbeat, the first to
    have sent 20 of them. Asked for by its system, it may be other than an aircraft.

    On a live link nobody knows what heartbeats will follow, and the twentieth position decides.
    Of the head of a log, `looking_ahead`, all heartbeats come first: positions decide in
    `choose_any`.

    Parameters
    ----------
    system, component : int, optional
        MAVLink ids of the vehicle wanted.
    vehicle : Vehicle, optional
        The vehicle, where it is known already.
    looking_ahead : bool
        Whether positions alone decide no sooner than in `choose_any`.

    Attributes
    ----------
    vehicle : Vehicle or None
        The vehicle followed.
    """

    def __init__(
        self,
        system: int | None = None,
        component: int | None = None,
        vehicle: Vehicle | None = None,
        looking_ahead: bool = False,
    ):
        if system is not None and component is not None:
            vehicle = Vehicle(system, component, UNKNOWN_TYPE)
        self.vehicle = vehicle
        self._wanted = (system, component)
        self._looking_ahead = looking_ahead
        self._positions_heard: Counter[tuple[int, int]] = Counter()
        self._sent_enough: list[tuple[int, int]] = []
        self._not_aircraft: set[tuple[int, int]] = set()

    def follows(self, source: tuple[int, int]) -> bool:
        """Whether a sender, (system, component), is the vehicle followed."""
        vehicle = self.vehicle
        return vehicle is not None and source == (vehicle.system, vehicle.component)

    def hear_heartbeat(self, source: tuple[int, int], mav_type: int, autopilot: int) -> None:
        """Take in a sender's word on what it is: its MAV_TYPE and MAV_AUTOPILOT."""
        if self.follows(source):
            self.vehicle = Vehicle(*source, type_name(mav_type))
        elif self.vehicle is None and self._is_wanted(source):
            may_tow = mav_type in AIRCRAFT
            if self._wanted[0] is not None:
                may_tow = mav_type not in NEVER_TOWING
            if may_tow and autopilot != dialect.MAV_AUTOPILOT_INVALID:
                self.vehicle = Vehicle(*source, type_name(mav_type))
            elif mav_type != dialect.MAV_TYPE_GENERIC:
                self._not_aircraft.add(source)

    def hear_position(self, source: tuple[int, int]) -> None:
        """Take in that a sender sent a position."""
        if self.vehicle is None and self._is_wanted(source) and source not in self._not_aircraft:
            self._positions_heard[source] += 1
            if self._positions_heard[source] == POSITIONS_WITHOUT_HEARTBEAT:
                self._sent_enough.append(source)
                if not self._looking_ahead:
                    self.vehicle = Vehicle(*source, UNKNOWN_TYPE)

    def choose_any(self) -> None:
        """Follow the first to have sent 20 positions, else the first sender of any."""
        senders = [
            source
            for source in (*self._sent_enough, *self._positions_heard)
            if source not in self._not_aircraft
        ]
        if self.vehicle is None and senders:
            self.vehicle = Vehicle(*senders[0], UNKNOWN_TYPE)

    def _is_wanted(self, source: tuple[int, int]) -> bool:
        return all(want in (None, have) for want, have in zip(self._wanted, source, strict=True))


def type_name(mav_type: int) -> str:
    """A MAV_TYPE in words, "fixed wing"."""
    entry = dialect.enums["MAV_TYPE"].get(mav_type)
    name = entry.name.removeprefix("MAV_TYPE_") if entry else f"type {mav_type}"
    return name.replace("_", " ").lower()
