"""MAVLink messages of one vehicle to samples; docs/telemetry.md has the table of messages.

A position message becomes a sample, with what other messages have told since the one before:
the receivers' evidence, heading, airspeed, wind, density of the air. All is timed by the vehicle's
clock, which every message with a time since boot moves on.
"""

from enum import IntEnum
from math import nan

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry import mavlink_fields as fields
from ctcbs_ros.telemetry.between_samples import BetweenSamples
from ctcbs_ros.telemetry.clock import VehicleClock, is_unix
from ctcbs_ros.telemetry.conventions import enu_angle
from ctcbs_ros.telemetry.evidence import NO_FIX, Evidence, better
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.vehicle_choice import VehicleChoice

BOOT_WRAP_US = 2**32 * 1000  # time_boot_ms is a 32-bit counter
# GPS_RAW_INT without one GLOBAL_POSITION_INT until it is taken for the position itself.
RAW_WITHOUT_ESTIMATE = 10
# Of LOCAL_POSITION_NED alone until it is taken; at the slowest rates others come every second.
LOCAL_ALONE_US = 5_000_000
CLIMB_VALID_US = 2_000_000


class Positions(IntEnum):
    """The messages that positions are taken from, the better the higher."""

    HIGH_LATENCY2 = 1
    LOCAL_POSITION_NED = 2
    GPS_RAW_INT = 3
    GLOBAL_POSITION_INT = 4


class VehicleDecoder:
    """Samples of one vehicle out of the messages of a link.

    Positions come from GLOBAL_POSITION_INT; where a vehicle sends none (among its first 10
    GPS_RAW_INT), from GPS_RAW_INT; without a receiver, from LOCAL_POSITION_NED, in its own frame;
    else from HIGH_LATENCY2.

    Parameters
    ----------
    system, component, vehicle
        Whom to follow, see `VehicleChoice`.
    link : LinkStatistics, optional
    choice : VehicleChoice, optional
        Another way to choose whom to follow.
    """

    def __init__(
        self,
        system: int | None = None,
        component: int | None = None,
        vehicle: Vehicle | None = None,
        link: LinkStatistics | None = None,
        choice: VehicleChoice | None = None,
    ):
        self.link = link or LinkStatistics()
        self._choice = choice or VehicleChoice(system, component, vehicle)
        self._clock = VehicleClock(BOOT_WRAP_US, self.link.time_steps)
        self._clock_is_boot_time = True
        self._clock_flight = 0
        self._changes = 0  # of the clock or the frame, each of which begins a flight
        self._time_us: int | None = None  # continuous clock of the newest message that tells
        self._positions: Positions | None = None
        self._raw_without_estimate = 0
        self._local_since_us: int | None = None
        self._between = BetweenSamples()
        self._forget()
        self._handlers = {
            "GLOBAL_POSITION_INT": self._global_position,
            "GPS_RAW_INT": self._gps_raw,
            "GPS2_RAW": self._gps2_raw,
            "LOCAL_POSITION_NED": self._local_position,
            "HIGH_LATENCY2": self._high_latency,
            "SYSTEM_TIME": self._system_time,
            "ATTITUDE": self._attitude,
            "VFR_HUD": self._vfr_hud,
            "SYS_STATUS": self._sys_status,
            "SCALED_PRESSURE": self._scaled_pressure,
            "WIND": self._wind,
            "WIND_COV": self._wind_cov,
        }

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle followed."""
        return self._choice.vehicle

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the autopilot (WIND, WIND_COV, HIGH_LATENCY2).

        Velocity of the air towards east, north, up [m/s].
        """
        return self._between.wind

    @property
    def unix_offset(self) -> float | None:
        """Unix time less the samples' time, as the vehicle told last in this flight [s]."""
        told = self._clock.told_unix_offset_us
        return None if told is None else told / 1e6

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
        source = _source(message)
        is_position = kind in Positions.__members__
        if kind in ("HEARTBEAT", "HIGH_LATENCY2"):
            self._choice.hear_heartbeat(source, message.type, message.autopilot)
        elif is_position and self.vehicle is None:
            self._choice.hear_position(source)
        if not self._choice.follows(source):
            if is_position:
                self.link.positions_of_others[source[0]] += 1
            return None
        handler = self._handlers.get(kind)
        return handler(message, receive_us) if handler else None

    def follows(self, message) -> bool:
        """Whether a message is of the vehicle followed."""
        return self._choice.follows(_source(message))

    def choose_any(self) -> None:
        """Follow the first sender of positions now, however few they were."""
        self._choice.choose_any()

    # --- time -----------------------------------------------------------------------------------

    def _advance(self, counter_us: int, receive_us: int | None) -> int:
        self._time_us = self._clock.advance(counter_us, receive_us)
        if self._clock.flight != self._clock_flight:
            self._clock_flight = self._clock.flight
            self._forget()
        return self._time_us

    def _advance_boot(self, boot_ms: int, receive_us: int | None) -> None:
        if self._clock_is_boot_time:
            self._advance(boot_ms * 1000, receive_us)

    def _forget(self) -> None:
        """What held before a reboot says nothing about now."""
        self._receivers: dict[str, Evidence] = {}
        self._airspeed_is_measured = False
        self._climb, self._climb_us = nan, 0
        self._between.forget()

    def _is_newer_than(self, time_us: int, valid_us: int) -> bool:
        return self._time_us is not None and self._time_us - time_us <= valid_us

    def _system_time(self, message, receive_us: int | None) -> None:
        if self._clock_is_boot_time:
            time_us = self._advance(message.time_boot_ms * 1000, receive_us)
            self._clock.set_unix(time_us, message.time_unix_usec)

    # --- positions ------------------------------------------------------------------------------

    def _uses(self, positions: Positions) -> bool:
        """Whether positions are taken from that message, now that it could be."""
        before = self._positions
        if before is None or positions > before:
            self._positions = positions
            was_local = before is Positions.LOCAL_POSITION_NED
            if before is not None and (was_local or positions is Positions.LOCAL_POSITION_NED):
                self._changes += 1
        return positions >= self._positions

    def _global_position(self, message, receive_us: int | None) -> Sample:
        self._raw_without_estimate = -1
        self._uses(Positions.GLOBAL_POSITION_INT)
        self._advance_boot(message.time_boot_ms, receive_us)
        self._between.hear_heading(fields.heading_of_position(message))
        return self._geodetic(
            message,
            receive_us,
            height_above_home=fields.scaled(message.relative_alt, 1000),
            velocity=(message.vy / 100, message.vx / 100, -message.vz / 100),
        )

    def _gps_raw(self, message, receive_us: int | None) -> Sample | None:
        if self._raw_without_estimate >= 0:
            self._raw_without_estimate += 1
        if self._raw_without_estimate <= RAW_WITHOUT_ESTIMATE:
            self._hear_receiver(message)
            return None
        self._uses(Positions.GPS_RAW_INT)
        if self._clock_is_boot_time and is_unix(message.time_usec):
            # Of another origin than time since boot: from here on this is the clock.
            self._clock_is_boot_time = False
            self._changes += self._clock.flight
            self._clock_flight = 0
            self._clock = VehicleClock(BOOT_WRAP_US, self.link.time_steps)
        time_us = self._advance(message.time_usec % BOOT_WRAP_US, receive_us)
        self._hear_receiver(message)
        self._clock.set_unix(time_us, message.time_usec)
        climb = self._climb if self._is_newer_than(self._climb_us, CLIMB_VALID_US) else 0.0
        velocity = fields.receiver_velocity(message, climb)
        return self._geodetic(message, receive_us, velocity=velocity)

    def _gps2_raw(self, message, receive_us: int | None) -> None:
        self._hear_receiver(message)

    def _hear_receiver(self, message) -> None:
        before = self._receivers.get(message.get_type(), Evidence())
        self._receivers[message.get_type()] = before.updated(message, self._time_us)

    def _local_position(self, message, receive_us: int | None) -> Sample | None:
        self._advance_boot(message.time_boot_ms, receive_us)
        if self._local_since_us is None:
            self._local_since_us = self._time_us
        has_receiver = any(receiver.has_fix for receiver in self._receivers.values())
        is_alone = self._raw_without_estimate >= 0 and not has_receiver
        if not is_alone or self._time_us - self._local_since_us < LOCAL_ALONE_US:
            return None
        if not self._uses(Positions.LOCAL_POSITION_NED):
            return None
        return self._sample(
            receive_us,
            nan,
            local_position=(message.y, message.x, -message.z),
            velocity=(message.vy, message.vx, -message.vz),
        )

    def _high_latency(self, message, receive_us: int | None) -> Sample | None:
        self._between.hear_wind(fields.wind_of_high_latency(message))
        if not self._uses(Positions.HIGH_LATENCY2):
            return None
        self._advance_boot(message.timestamp, receive_us)
        self._between.hear_heading(enu_angle(message.heading * 2.0))
        no_fix = message.failure_flags & dialect.HL_FAILURE_FLAG_GPS
        return self._sample(
            receive_us,
            float(message.altitude),
            latitude=fields.scaled(message.latitude, 1e7),
            longitude=fields.scaled(message.longitude, 1e7),
            fix_type=NO_FIX if no_fix else None,
            horizontal_accuracy=fields.high_latency_accuracy(message),
        )

    def _geodetic(self, message, receive_us: int | None, **others) -> Sample:
        """The sample with what both geodetic messages have in common."""
        altitude = fields.scaled(message.alt, 1000)
        time_us = self._time_us
        self._receivers = {kind: told.at(time_us) for kind, told in self._receivers.items()}
        evidence = better(self._receivers.values())
        return self._sample(
            receive_us,
            altitude,
            latitude=fields.scaled(message.lat, 1e7),
            longitude=fields.scaled(message.lon, 1e7),
            altitude_ellipsoid=altitude + evidence.geoid_height,
            fix_type=evidence.fix_type_of(altitude),
            satellites=evidence.satellites,
            horizontal_accuracy=evidence.horizontal_accuracy,
            speed_accuracy=evidence.speed_accuracy,
            **others,
        )

    def _sample(self, receive_us: int | None, altitude_amsl: float, **others) -> Sample:
        """The sample with what other messages have told."""
        time_us = self._time_us
        return Sample(
            time=time_us / 1e6,
            stamp_ns=self._clock.stamp_ns(time_us, receive_us),
            flight=self._clock.flight + self._changes,
            altitude_amsl=altitude_amsl,
            **self._between.tell(time_us, altitude_amsl),
            **others,
        )

    # --- what goes with them --------------------------------------------------------------------

    def _attitude(self, message, receive_us: int | None) -> None:
        self._advance_boot(message.time_boot_ms, receive_us)
        self._between.hear_heading(fields.heading_of_attitude(message))

    def _sys_status(self, message, receive_us: int | None) -> None:
        self._airspeed_is_measured = fields.has_airspeed_sensor(message)

    def _vfr_hud(self, message, receive_us: int | None) -> None:
        self._climb, self._climb_us = message.climb, self._time_us or 0
        if self._airspeed_is_measured:
            self._between.hear_indicated_airspeed(message.airspeed)

    def _scaled_pressure(self, message, receive_us: int | None) -> None:
        self._advance_boot(message.time_boot_ms, receive_us)
        self._between.hear_density(fields.density_of_pressure(message), self._time_us)

    def _wind(self, message, receive_us: int | None) -> None:
        self._between.hear_wind(fields.wind_of_wind(message))

    def _wind_cov(self, message, receive_us: int | None) -> None:
        wind = fields.wind_of_wind_cov(message)
        self._between.hear_wind(wind, fields.wind_accuracy(message))


def _source(message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()
