"""What a receiver itself (GPS_RAW_INT, GPS2_RAW) says of positions that its autopilot sends."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite, nan

NO_FIX, FIX_3D = 1, 3  # MAVLink GPS_FIX_TYPE
UNKNOWN_32, UNKNOWN_16, UNKNOWN_8 = 0xFFFFFFFF, 0xFFFF, 0xFF
# Receivers that state no accuracy state a dilution of precision: one standard deviation of the
# position is the dilution times that of a range, which for single-frequency GPS is some 3 m.
RANGE_ERROR = 3.0
VALID_US = 10_000_000
# Until its filter knows its origin, an autopilot sends heights about 0 as heights above sea level.
UNINITIALISED_HEIGHT = 200.0  # m


@dataclass(frozen=True, slots=True)
class Evidence:
    """The newest word of the receiver; None and nan where it did not say.

    Attributes
    ----------
    time_us : int or None
        The vehicle's continuous clock when it was received; None while that is not known.
    fix_type, satellites, horizontal_accuracy, speed_accuracy
        As in `Sample`.
    altitude : float
        AMSL of the receiver's own 3D fix [m].
    geoid_height : float
        Ellipsoidal height less AMSL [m], of the newest message that had both.
    """

    time_us: int | None = None
    fix_type: int | None = None
    satellites: int | None = None
    horizontal_accuracy: float = nan
    speed_accuracy: float = nan
    altitude: float = nan
    geoid_height: float = nan

    def updated(self, message, time_us: int | None) -> "Evidence":
        """The evidence after a message of its receiver.

        Zeros in the fields that MAVLink 2 added are fields not sent.
        """
        has_fix = message.fix_type >= FIX_3D
        geoid_height = self.geoid_height
        if has_fix and message.alt_ellipsoid not in (0, UNKNOWN_32 >> 1):
            geoid_height = (message.alt_ellipsoid - message.alt) / 1000
        accuracy = nan
        if message.h_acc not in (0, UNKNOWN_32):
            accuracy = message.h_acc / 1000
        elif message.eph not in (0, UNKNOWN_16):
            accuracy = message.eph / 100 * RANGE_ERROR
        satellites = message.satellites_visible
        return Evidence(
            time_us=time_us,
            fix_type=message.fix_type,
            satellites=None if satellites == UNKNOWN_8 else satellites,
            horizontal_accuracy=accuracy,
            speed_accuracy=nan if message.vel_acc in (0, UNKNOWN_32) else message.vel_acc / 1000,
            altitude=message.alt / 1000 if has_fix else nan,
            geoid_height=geoid_height,
        )

    @property
    def has_fix(self) -> bool:
        """Whether the receiver says that it has a 3D fix."""
        return self.fix_type is not None and self.fix_type >= FIX_3D

    def at(self, time_us: int) -> "Evidence":
        """What is left of it at a later time.

        After 10 s of silence the geoid's height alone; but a receiver that had no fix then has
        none until it says so.
        """
        if self.time_us is None:
            return replace(self, time_us=time_us)
        if time_us - self.time_us <= VALID_US or self.fix_type is None:
            return self
        if self.has_fix:
            return Evidence(geoid_height=self.geoid_height)
        return Evidence(self.time_us, self.fix_type, geoid_height=self.geoid_height)

    def fix_type_of(self, altitude: float) -> int | None:
        """Fix type of a position estimate at that AMSL [m].

        An estimate 200 m in height from the receiver's own fix has not been initialised: no fix.
        """
        if abs(altitude - self.altitude) > UNINITIALISED_HEIGHT:
            return NO_FIX
        return self.fix_type


def better(receivers: Iterable[Evidence]) -> Evidence:
    """Of several receivers that with the better fix, then the better accuracy.

    An autopilot flies by the better one too. The geoid's height comes from whichever knows it.
    """
    receivers = list(receivers)
    best = max(
        receivers,
        key=lambda told: (
            -1 if told.fix_type is None else told.fix_type,
            -told.horizontal_accuracy if isfinite(told.horizontal_accuracy) else float("-inf"),
        ),
        default=Evidence(),
    )
    if not isfinite(best.geoid_height):
        heights = (told.geoid_height for told in receivers)
        return replace(best, geoid_height=next(filter(isfinite, heights), nan))
    return best
