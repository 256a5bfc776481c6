"""ULog files written message by message, by the format's description at docs.px4.io."""

import struct

MAGIC = b"ULog\x01\x12\x35\x01"
SYNC = bytes.fromhex("2f731320250cbb12")
CODES = {
    "int8_t": "b", "uint8_t": "B", "int32_t": "i", "uint32_t": "I", "uint64_t": "Q", "float": "f",
    "double": "d", "bool": "?",
}  # fmt: skip

# Fields as PX4's message files have them: 1.14 and later in double degrees, before in integers.
GPS = (
    "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;"
    "double altitude_msl_m;double altitude_ellipsoid_m;float s_variance_m_s;float eph;float epv;"
    "float vel_m_s;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "int32_t timestamp_time_relative;uint8_t fix_type;bool vel_ned_valid;"
    "uint8_t satellites_used;uint8_t[5] _padding0;"
)
OLD_GPS = (
    "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;"
    "int32_t alt_ellipsoid;float s_variance_m_s;float eph;float epv;float vel_m_s;"
    "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;int32_t timestamp_time_relative;"
    "uint8_t fix_type;bool vel_ned_valid;uint8_t satellites_used;uint8_t[5] _padding0;"
)
FORMATS = {
    "vehicle_gps_position": GPS,
    "sensor_gps": GPS,
    "vehicle_global_position": (
        "uint64_t timestamp;double lat;double lon;float alt;float alt_ellipsoid;float eph;"
        "float epv;bool dead_reckoning;uint8_t[3] _padding0;"
    ),
    "vehicle_local_position": (
        "uint64_t timestamp;double ref_lat;double ref_lon;float x;float y;float z;"
        "float[2] delta_xy;float vx;float vy;float vz;float ref_alt;float eph;float evh;"
        "bool xy_valid;bool z_valid;bool v_xy_valid;bool xy_global;bool z_global;float heading;"
    ),
    "home_position": "uint64_t timestamp;double lat;double lon;float alt;bool valid_alt;",
    "wind": (
        "uint64_t timestamp;float windspeed_north;float windspeed_east;float variance_north;"
        "float variance_east;"
    ),
    "wind_estimate": "uint64_t timestamp;float windspeed_north;float windspeed_east;",
    "vehicle_air_data": (
        "uint64_t timestamp;uint64_t timestamp_sample;uint32_t baro_device_id;"
        "float baro_alt_meter;float baro_pressure_pa;float ambient_temperature;"
        "uint8_t temperature_source;float rho;uint8_t calibration_count;uint8_t[3] _padding0;"
    ),
    "airspeed": (
        "uint64_t timestamp;uint64_t timestamp_sample;float indicated_airspeed_m_s;"
        "float true_airspeed_m_s;float confidence;"
    ),
    "airspeed_validated": (
        "uint64_t timestamp;float indicated_airspeed_m_s;float calibrated_airspeed_m_s;"
        "float true_airspeed_m_s;int8_t airspeed_source;"
    ),
    "cpuload": "uint64_t timestamp;float load;float[3] per_core;",
}


def message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


def keyed(kind, key, value):
    return message(kind, bytes([len(key)]) + key.encode() + value)


class UlogWriter:
    """Bytes of a log; `log` gives those of one topic's message, subscribing where needed."""

    def __init__(self, formats=FORMATS, system=1, name=b"PX4"):
        self._formats = formats
        self._numbers = {}
        self.start = MAGIC + struct.pack("<Q", 1_000)
        self.start += message("B", bytes(40))
        self.start += keyed("I", f"char[{len(name)}] sys_name", name)
        self.start += b"".join(
            message("F", f"{topic}:{fields}".encode()) for topic, fields in formats.items()
        )
        self.start += keyed("P", "int32_t MAV_SYS_ID", struct.pack("<i", system))

    def log(self, topic, instance=0, **values):
        log = b""
        if (topic, instance) not in self._numbers:
            number = self._numbers[topic, instance] = len(self._numbers)
            log = message("A", struct.pack("<BH", instance, number) + topic.encode())
        content = struct.pack("<H", self._numbers[topic, instance])
        for field in self._formats[topic].rstrip(";").split(";"):
            kind, name = field.split(" ")
            if name.startswith("_padding"):
                continue  # the logger leaves it out at the end
            kind, _, count = kind.rstrip("]").partition("[")
            items = [values.get(name, 0)] * int(count or 1)
            content += struct.pack(f"<{len(items)}{CODES[kind]}", *items)
        return log + message("D", content)


def gps(time_us, **values):
    """Fields of a receiver's message, `GPS` by default good ones."""
    return {
        "timestamp": time_us, "time_utc_usec": 1_767_268_800_000_000 + time_us,
        "latitude_deg": 47.4, "longitude_deg": 8.5, "altitude_msl_m": 500.0,
        "altitude_ellipsoid_m": 547.0, "s_variance_m_s": 0.25, "eph": 1.5, "vel_n_m_s": 3.0,
        "vel_e_m_s": 4.0, "vel_d_m_s": -2.0, "fix_type": 3, "vel_ned_valid": True,
        "satellites_used": 12,
    } | values  # fmt: skip
