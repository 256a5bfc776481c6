"""Real MAVLink bytes, made with pymavlink, for tests of what reads them."""

import struct

from pymavlink.dialects.v20 import all as dialect

START_US = 1_700_000_000_000_000  # 2023-11-14


class Sender:
    """One MAVLink node; calling it with a message gives the frame's bytes."""

    def __init__(self, system=1, component=1, version=2):
        self._mav = dialect.MAVLink(None, system, component)
        self._force_1 = version == 1

    def __call__(self, message):
        frame = message.pack(self._mav, force_mavlink1=self._force_1)
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame


def stamped(frames, start_us=START_US, step_us=200_000):
    """A .tlog of frames received at equal intervals, or of (receive time in us, frame)."""
    log = b""
    for i, frame in enumerate(frames):
        if isinstance(frame, tuple):
            receive_us, frame = frame
        else:
            receive_us = start_us + i * step_us
        log += struct.pack(">Q", receive_us) + frame
    return log


def heartbeat(type=dialect.MAV_TYPE_FIXED_WING, autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA):
    return dialect.MAVLink_heartbeat_message(type, autopilot, 0, 0, 4, 3)


def position(boot_ms, lat=47.4, lon=8.5, **fields):
    """GLOBAL_POSITION_INT; 500 m AMSL, 400 m above home, 20 m/s north unless told otherwise."""
    values = {
        "alt": 500_000, "relative_alt": 400_000, "vx": 2000, "vy": 0, "vz": 0, "hdg": 0,
    } | fields  # fmt: skip
    return dialect.MAVLink_global_position_int_message(
        boot_ms % 2**32, round(lat * 1e7), round(lon * 1e7), **values
    )


def gps_raw(fix_type=3, **fields):
    """GPS_RAW_INT that agrees with `position`; MAVLink 2 fields are sent only if given."""
    values = {
        "time_usec": 0, "lat": 474000000, "lon": 85000000, "alt": 500_000, "eph": 90, "epv": 120,
        "vel": 2000, "cog": 0, "satellites_visible": 12,
    } | fields  # fmt: skip
    return dialect.MAVLink_gps_raw_int_message(fix_type=fix_type, **values)


def system_time(unix_us, boot_ms):
    return dialect.MAVLink_system_time_message(unix_us, boot_ms)
