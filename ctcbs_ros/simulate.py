"""Flight logs without a flight: a simulated one in the MAVLink messages that an autopilot sends.

flight = simulate_flight(radius=80.0, speed=20.0, turns=6.0)
write_tlog("flight.tlog", flight, latitude=47.4, longitude=8.5, position_noise=1.5)
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, pi, radians
from pathlib import Path
from typing import BinaryIO

import numpy as np
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file
from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.simulated_flight import SimulatedFlight, simulate_flight
from ctcbs_ros.simulated_payload import SimulatedPayload, simulate_payload

__all__ = [
    "SimulatedBeacon", "SimulatedFlight", "SimulatedPayload", "simulate_flight",
    "simulate_payload", "write_tlog",
]  # fmt: skip

# Nothing in the file depends on when it was made: the flight begins 2026-01-01 12:00 UTC, a minute
# after the autopilot's start.
EPOCH_US = 1_767_268_800_000_000
BOOT_MS = 60_000
LINK_DELAY_US = 40_000
# A beacon is switched on well before, and is another radio's.
BEACON_BOOT_MS = 11_000_000
BEACON_DELAY_US = 60_000
# Accuracies that the receiver states at least [m], [m/s]: no real one claims none.
LEAST_POSITION_ACCURACY, LEAST_SPEED_ACCURACY = 0.1, 0.05


@dataclass(frozen=True)
class SimulatedBeacon:
    """The beacon of a simulated payload, a MAVLink system of its own.

    Attributes
    ----------
    payload : SimulatedPayload
    system : int
        Its MAVLink system id, other than the aircraft's 1.
    offset : (float, float, float)
        By which its positions are wrong: east, north, up [m].
    noise : float
        Standard deviation of the white noise on each axis of its positions [m].
    tells_unix_time : bool
        Whether it sends SYSTEM_TIME.
    """

    payload: SimulatedPayload
    system: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: float = 0.0
    tells_unix_time: bool = True


def write_tlog(
    path: str | Path,
    flight: SimulatedFlight,
    *,
    latitude: float,
    longitude: float,
    home_altitude: float = 100.0,
    geoid_height: float = 47.0,
    position_noise: float = 0.0,
    velocity_noise: float = 0.0,
    gap: tuple[float, float] | None = None,
    seed: int = 0,
    beacon: SimulatedBeacon | None = None,
) -> int:
    """Write a flight as MAVLink 2 with receive stamps; the same arguments give the same bytes.

    At each sample GPS_RAW_INT, ATTITUDE and GLOBAL_POSITION_INT; once a second HEARTBEAT (fixed
    wing, system 1, component 1), SYSTEM_TIME, VFR_HUD and, where there is wind, WIND. A beacon
    sends its GPS_RAW_INT and GLOBAL_POSITION_INT, HEARTBEAT and SYSTEM_TIME by its own clock.

    Parameters
    ----------
    path : str or Path
        File to be written; it appears, or is replaced, when it is complete.
    flight : SimulatedFlight
    latitude, longitude : float
        Of the circle's centre, above home [deg].
    home_altitude : float
        Height of home above mean sea level [m].
    geoid_height : float
        Ellipsoidal height less that above mean sea level [m].
    position_noise, velocity_noise : float
        Standard deviation of the white noise on each axis [m], [m/s].
    gap : (float, float), optional
        Start, in seconds from the first sample, and duration [s] of a loss of everything.
    seed : int
        Of the noise.
    beacon : SimulatedBeacon, optional

    Returns
    -------
    int
        Position messages of the aircraft written.

    Raises
    ------
    InputError
        If an argument is out of range or the file cannot be written.
    """
    _refuse("latitude", latitude, -90.0, 90.0)
    _refuse("longitude", longitude, -180.0, 180.0)
    _refuse("position noise", position_noise, 0.0, 1e3)
    _refuse("velocity noise", velocity_noise, 0.0, 1e2)
    _refuse("seed", seed, 0, 2**64)
    gap_start, gap_duration = gap or (0.0, 0.0)
    _refuse("gap start", gap_start, 0.0, 1e6)
    _refuse("gap duration", gap_duration, 0.0, 1e6)

    random = np.random.default_rng(seed)
    position = flight.position + random.normal(0.0, position_noise, flight.position.shape)
    velocity = flight.velocity + random.normal(0.0, velocity_noise, flight.velocity.shape)
    home = Datum(latitude, longitude, home_altitude + geoid_height, True)
    measured = _Measured(
        *to_geodetic(home, *position.T), velocity, home_altitude, geoid_height,
        horizontal_accuracy=max(position_noise, LEAST_POSITION_ACCURACY),
        speed_accuracy=max(velocity_noise, LEAST_SPEED_ACCURACY),
    )  # fmt: skip

    def received(time):
        return np.flatnonzero((time < gap_start) | (time >= gap_start + gap_duration))

    samples = received(flight.time)
    sent = list(_of_aircraft(flight, measured, samples))
    if beacon is not None:
        sent += _of_beacon(beacon, home, home_altitude, geoid_height, received, seed)
        sent.sort(key=lambda one: one[0])
    with atomic_file(path, "wb") as log:
        _write(log, sent)
    return len(samples)


@dataclass(frozen=True)
class _Measured:
    """What the autopilot makes of the flight: degrees, metres above the ellipsoid, ENU m/s."""

    latitude: np.ndarray
    longitude: np.ndarray
    altitude: np.ndarray
    velocity: np.ndarray
    home_altitude: float
    geoid_height: float
    horizontal_accuracy: float
    speed_accuracy: float


class _StampedFile:
    """Puts the receive stamp before each frame written."""

    def __init__(self, log: BinaryIO):
        self._log = log
        self.stamp_us = 0

    def write(self, frame: bytes) -> None:
        self._log.write(struct.pack(">Q", self.stamp_us) + frame)


# When a message is received [us], the system that sent it, and the message.
_Sent = tuple[int, int, dialect.MAVLink_message]


def _write(log: BinaryIO, sent: list[_Sent]) -> None:
    stamped = _StampedFile(log)
    senders = {
        system: dialect.MAVLink(stamped, srcSystem=system, srcComponent=1)
        for system in {system for _, system, _ in sent}
    }
    for stamp_us, system, message in sent:
        stamped.stamp_us = stamp_us
        senders[system].send(message)


def _of_aircraft(flight: SimulatedFlight, measured: _Measured, samples) -> Iterator[_Sent]:
    second = None
    for i in samples:
        time_ms = round(flight.time[i] * 1000)
        messages = []
        if time_ms // 1000 != second:
            second = time_ms // 1000
            messages += _each_second(flight, measured, i, time_ms)
        messages += _each_sample(flight, measured, i, time_ms)
        for message in messages:
            yield EPOCH_US + time_ms * 1000 + LINK_DELAY_US, 1, message


def _of_beacon(
    beacon: SimulatedBeacon, home: Datum, home_altitude: float, geoid_height: float, received,
    seed: int,
) -> Iterator[_Sent]:  # fmt: skip
    if not 2 <= beacon.system <= 255:
        raise InputError(f"beacon {beacon.system}: must be a system id from 2 to 255; 1 flies")
    _refuse("beacon noise", beacon.noise, 0.0, 1e3)
    for off in beacon.offset:
        _refuse("beacon offset", off, -1e5, 1e5)
    payload, random = beacon.payload, np.random.default_rng([seed, beacon.system])
    noise = random.normal(0.0, beacon.noise, payload.position.shape)
    position = payload.position + beacon.offset + noise
    latitude, longitude, altitude = to_geodetic(home, *position.T)
    accuracy = max(beacon.noise, LEAST_POSITION_ACCURACY)
    second = None
    for i in received(payload.time):
        time_ms = round(payload.time[i] * 1000)
        unix_us, boot_ms = EPOCH_US + time_ms * 1000, BEACON_BOOT_MS + time_ms
        east, north, up = payload.velocity[i]
        where = {
            "lat": round(latitude[i] * 1e7),
            "lon": round(longitude[i] * 1e7),
            "alt": round((altitude[i] - geoid_height) * 1000),
        }
        messages = []
        if time_ms // 1000 != second:
            second = time_ms // 1000
            messages.append(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_GENERIC, dialect.MAV_AUTOPILOT_INVALID, 0, 0,
                    dialect.MAV_STATE_ACTIVE, 3,
                )
            )  # fmt: skip
            if beacon.tells_unix_time:
                messages.append(dialect.MAVLink_system_time_message(unix_us, boot_ms))
        messages += [
            dialect.MAVLink_gps_raw_int_message(
                time_usec=boot_ms * 1000, fix_type=dialect.GPS_FIX_TYPE_3D_FIX, **where,
                eph=80, epv=120, vel=round(np.hypot(east, north) * 100),
                cog=round(_compass(np.arctan2(north, east)) * 100) % 36000,
                satellites_visible=14, alt_ellipsoid=round(altitude[i] * 1000),
                h_acc=round(accuracy * 1000), v_acc=round(accuracy * 1500),
                vel_acc=round(LEAST_SPEED_ACCURACY * 1000),
            ),
            dialect.MAVLink_global_position_int_message(
                time_boot_ms=boot_ms, **where,
                relative_alt=where["alt"] - round(home_altitude * 1000),
                vx=round(north * 100), vy=round(east * 100), vz=round(-up * 100), hdg=65535,
            ),
        ]  # fmt: skip
        for message in messages:
            yield unix_us + BEACON_DELAY_US, beacon.system, message


def _each_second(flight: SimulatedFlight, measured: _Measured, i: int, time_ms: int) -> list:
    east, north, up = measured.velocity[i]
    messages = [
        dialect.MAVLink_heartbeat_message(
            type=dialect.MAV_TYPE_FIXED_WING,
            autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode=dialect.MAV_MODE_FLAG_SAFETY_ARMED
            | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            custom_mode=dialect.PLANE_MODE_LOITER,
            system_status=dialect.MAV_STATE_ACTIVE,
            mavlink_version=3,
        ),
        dialect.MAVLink_system_time_message(
            time_unix_usec=EPOCH_US + time_ms * 1000, time_boot_ms=BOOT_MS + time_ms
        ),
        dialect.MAVLink_vfr_hud_message(
            airspeed=flight.airspeed,
            groundspeed=float(np.hypot(east, north)),
            heading=round(_compass(flight.heading[i])) % 360,
            throttle=50,
            alt=measured.altitude[i] - measured.geoid_height,
            climb=up,
        ),
    ]
    if flight.wind.any():
        messages.append(
            dialect.MAVLink_wind_message(
                direction=_compass(np.arctan2(*-flight.wind[::-1])),
                speed=float(np.hypot(*flight.wind)),
                speed_z=0.0,
            )
        )
    return messages


def _each_sample(flight: SimulatedFlight, measured: _Measured, i: int, time_ms: int) -> list:
    east, north, up = measured.velocity[i]
    boot_ms = BOOT_MS + time_ms
    position = {
        "lat": round(measured.latitude[i] * 1e7),
        "lon": round(measured.longitude[i] * 1e7),
    }
    ellipsoidal_mm = round(measured.altitude[i] * 1000)
    amsl_mm = round((measured.altitude[i] - measured.geoid_height) * 1000)
    yaw = _compass(flight.heading[i])
    bank, yaw_rate = flight.bank[i], -flight.turn_rate[i]
    return [
        dialect.MAVLink_gps_raw_int_message(
            time_usec=boot_ms * 1000,
            fix_type=dialect.GPS_FIX_TYPE_3D_FIX,
            **position,
            alt=amsl_mm,
            eph=80,
            epv=120,
            vel=round(np.hypot(east, north) * 100),
            cog=round(_compass(np.arctan2(north, east)) * 100) % 36000,
            satellites_visible=14,
            alt_ellipsoid=ellipsoidal_mm,
            h_acc=round(measured.horizontal_accuracy * 1000),
            v_acc=round(measured.horizontal_accuracy * 1500),
            vel_acc=round(measured.speed_accuracy * 1000),
        ),
        dialect.MAVLink_attitude_message(
            time_boot_ms=boot_ms,
            roll=bank,
            pitch=0.0,
            yaw=(radians(yaw) + pi) % (2 * pi) - pi,
            rollspeed=0.0,
            pitchspeed=yaw_rate * np.sin(bank),
            yawspeed=yaw_rate * np.cos(bank),
        ),
        dialect.MAVLink_global_position_int_message(
            time_boot_ms=boot_ms,
            **position,
            alt=amsl_mm,
            relative_alt=amsl_mm - round(measured.home_altitude * 1000),
            vx=round(north * 100),
            vy=round(east * 100),
            vz=round(-up * 100),
            hdg=round(yaw * 100) % 36000,
        ),
    ]


def _compass(angle: float) -> float:
    """Degrees clockwise from north, 0 to 360, of an ENU angle [rad]."""
    return degrees(pi / 2 - angle) % 360


def _refuse(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InputError(f"{name} {value:g}: must be from {low:g} to {high:g}")
