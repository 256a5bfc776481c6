"""DataFlash logs: built here message by message, damaged, and truncated."""

import random
import struct
from datetime import datetime, timedelta, timezone
from math import inf, isnan, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.DFReader import FORMAT_TO_STRUCT, DFReader_binary
from test_telemetry_source import flight_log

from ctcbs_ros.telemetry.dataflash import DataflashDecoder
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode

# Ids and layouts as ArduPilot 4.5 writes them (FMT messages of plane_sitl_guided_loiter.BIN).
LAYOUTS = {
    "GPS": (
        130, "QBBIHBcLLeffffB",
        "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
    ),
    "GPA": (131, "QBCCCCfBIHf", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,Und"),
    "POS": (132, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "PARM": (133, "QNff", "TimeUS,Name,Value,Default"),
    "MSG": (134, "QZ", "TimeUS,Message"),
    "XKF2": (
        135, "QBccccchhhhhhfff", "TimeUS,C,AX,AY,AZ,VWN,VWE,MN,ME,MD,MX,MY,MZ,IDX,IDY,IS",
    ),
    "XKF4": (
        136, "QBcccccfffHBIHb", "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI",
    ),
    "IMU": (137, "Qf", "TimeUS,AccX"),
    "ATT": (
        138, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF",
    ),
    "AHR2": (139, "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4"),
    "ARSP": (
        140, "QBffcffBBffB",
        "TimeUS,I,Airspeed,DiffPress,Temp,RawPress,Offset,U,H,Hp,TR,Pri",
    ),
    "BARO": (141, "QBffcfIffB", "TimeUS,I,Alt,Press,Temp,CRt,SMS,Offset,GndTemp,Health"),
}  # fmt: skip
# GPS time counts from 1980-01-06 without leap seconds, of which there were 18 in 2023.
WEEK, WEEK_MS = 2261, 394_343_600
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=timezone.utc)
UNIX = (GPS_EPOCH + timedelta(weeks=WEEK, milliseconds=WEEK_MS, seconds=-18)).timestamp()


def declarations():
    log = b""
    for name, (kind, layout, columns) in LAYOUTS.items():
        length = 3 + struct.calcsize("<" + "".join(FORMAT_TO_STRUCT[c][0] for c in layout))
        log += b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", kind, length, name.encode(), layout.encode(), columns.encode()
        )
    return log


def message(name, **fields):
    """Bytes of one message; fields not given are 0."""
    kind, layout, columns = LAYOUTS[name]
    log = bytes([0xA3, 0x95, kind])
    for column, code in zip(columns.split(","), layout, strict=True):
        packed, multiplier, _ = FORMAT_TO_STRUCT[code]
        value = fields.get(column, b"" if code in "nNZ" else 0)
        log += struct.pack("<" + packed, round(value / multiplier) if multiplier else value)
    return log


def gps(time_us, **fields):
    values = {
        "Status": 3, "NSats": 10, "HDop": 1.2, "Lat": -35.3632621, "Lng": 149.1652374,
        "Alt": 584.09, "Spd": 20.0, "GCrs": 90.0, "VZ": -2.0, "U": 1, "GWk": WEEK,
        "GMS": WEEK_MS + time_us // 1000,
    } | fields  # fmt: skip
    return message("GPS", TimeUS=time_us, **values)


def decode(*parts):
    decoder = DataflashDecoder()
    return list(decoder.feed(declarations() + b"".join(parts), last=True)), decoder


def test_gps_message_becomes_si_degrees_and_enu():
    (sample,), _ = decode(message("POS", RelHomeAlt=61.5), gps(25_000_000, NSats=9))
    assert sample.time == 25.0
    assert (sample.latitude, sample.longitude) == (-35.3632621, 149.1652374)
    assert (sample.altitude_amsl, sample.height_above_home) == (584.09, 61.5)
    assert sample.velocity == pytest.approx((20.0, 0.0, 2.0))  # course 90 deg, VZ down
    assert (sample.fix_type, sample.satellites) == (3, 9)
    assert sample.horizontal_accuracy == pytest.approx(3.6)  # dilution 1.2 times 3 m
    assert isnan(sample.altitude_ellipsoid)


def test_course_that_is_no_number_gives_a_velocity_that_is_none():
    for course in (inf, nan):
        (sample,), _ = decode(gps(25_000_000, GCrs=course))
        assert isnan(sample.velocity[0])
        assert Screen().check(sample) is SkipCode.NOT_FINITE


def test_accuracies_and_geoid_come_from_the_same_receiver():
    parts = [
        message("GPA", I=0, HAcc=1.7, SAcc=0.3, Und=-20.0),  # AMSL less ellipsoidal height
        message("GPA", I=1, HAcc=9.0, SAcc=2.0),
        gps(25_000_000),
    ]
    (sample,), _ = decode(*parts)
    assert (sample.horizontal_accuracy, sample.speed_accuracy) == pytest.approx((1.7, 0.3))
    assert sample.altitude_ellipsoid == pytest.approx(604.09)


def test_only_the_receiver_in_use_gives_samples():
    parts = [gps(10_000_000, I=0, U=0, Lat=1.0), gps(10_100_000, I=1, U=1, Lat=2.0)]
    samples, _ = decode(*parts)
    assert [s.latitude for s in samples] == [2.0]


def test_unix_time_is_tied_once_to_the_first_gps_time():
    parts = [gps(0), gps(200_000, GMS=WEEK_MS + 230), gps(400_000, GWk=0, GMS=0)]
    samples, _ = decode(*parts)
    assert samples[0].stamp_ns == round(UNIX * 1e9)
    assert [s.stamp_ns - samples[0].stamp_ns for s in samples] == [0, 200_000_000, 400_000_000]


def test_samples_before_gps_time_take_the_tie_they_are_given():
    log = declarations() + gps(1_000_000, Status=1, GWk=0, GMS=0) + gps(61_000_000)
    first = DataflashDecoder()
    list(first.feed(log, last=True))
    second = DataflashDecoder(unix_anchor=first.unix_anchor)
    samples = list(second.feed(log, last=True))
    assert samples[1].stamp_ns == round(UNIX * 1e9) + 61 * 10**9
    assert samples[1].stamp_ns - samples[0].stamp_ns == 60 * 10**9


def test_clock_that_starts_again_begins_a_flight():
    samples, decoder = decode(gps(90_000_000), gps(3_000_000))
    assert [s.flight for s in samples] == [0, 1]
    assert samples[1].time > samples[0].time
    assert decoder.link.time_steps == {"reboot": 1}


def test_wind_is_that_of_the_primary_core_alone():
    parts = [
        message("XKF2", C=0, VWN=1.0, VWE=2.0),
        message("XKF4", C=0, PI=1),
        message("XKF2", C=0, VWN=9.0, VWE=9.0),
        message("XKF2", C=1, VWN=3.0, VWE=-4.0),
    ]
    _, decoder = decode(*parts[:1])
    assert decoder.wind == (2.0, 1.0, 0.0)
    samples, decoder = decode(*parts, gps(1_000_000), gps(1_200_000))
    assert decoder.wind == (-4.0, 3.0, 0.0)
    assert [s.wind for s in samples] == [(-4.0, 3.0, 0.0), None]  # told once


def test_wind_of_an_estimator_not_in_use_is_left_out():
    parts = [message("PARM", Name=b"AHRS_EKF_TYPE", Value=2.0), message("XKF2", VWN=1.0)]
    _, decoder = decode(*parts)
    assert decoder.wind is None


def test_wind_of_exactly_nought_is_that_of_a_filter_that_has_not_begun():
    (sample,), decoder = decode(message("XKF2", VWN=0.0, VWE=0.0), gps(1_000_000))
    assert sample.wind is decoder.wind is None


# --- heading, airspeed and air ------------------------------------------------------------------


def barometer(time_us, pascal=79_501.0, celsius=2.004, **fields):
    # U.S. Standard Atmosphere, 1976, Table I: at 2000 m 795.01 hPa, 275.154 K, 1.0066 kg/m^3
    values = {"Press": pascal, "Temp": celsius, "Health": 1} | fields
    return message("BARO", TimeUS=time_us, **values)


def airspeed(indicated, **fields):
    return message("ARSP", Airspeed=indicated, **{"U": 1, "H": 1} | fields)


def test_heading_is_an_enu_angle_of_the_newest_attitude_told_once():
    parts = [message("ATT", Yaw=0.0), message("ATT", Yaw=270.0), gps(1), gps(200_000)]
    samples, _ = decode(*parts)
    assert samples[0].heading == -180.0
    assert isnan(samples[1].heading)


def test_backup_attitude_tells_the_heading_only_where_there_is_no_other():
    parts = [message("AHR2", Yaw=90.0), gps(1), message("ATT", Yaw=0.0)]
    samples, _ = decode(*parts, message("AHR2", Yaw=90.0), gps(200_000))
    assert [s.heading for s in samples] == [0.0, 90.0]


def test_indicated_airspeed_becomes_true_airspeed():
    # At 5000 m the standard density is 0.73643 kg/m^3, of 1.2250 at sea level (ICAO).
    (sample,), _ = decode(airspeed(20.0), gps(1_000_000, Alt=5000.0))
    assert sample.airspeed == pytest.approx(20.0 * (1.2250 / 0.73643) ** 0.5, rel=1e-3)
    (sample,), _ = decode(airspeed(20.0), barometer(900_000), gps(1_000_000, Alt=5000.0))
    assert sample.airspeed == pytest.approx(20.0 * (1.2250 / 1.0066) ** 0.5, rel=1e-4)


@pytest.mark.parametrize(
    "sensor", [{"U": 0}, {"H": 0}, {"I": 1}, {"I": 0, "Pri": 1}, {"Airspeed": 0.0}]
)
def test_airspeed_is_told_only_by_the_primary_sensor_in_use_and_healthy(sensor):
    (sample,), _ = decode(message("ARSP", **{"Airspeed": 20.0, "U": 1, "H": 1} | sensor), gps(1))
    assert isnan(sample.airspeed)


def test_density_is_by_the_gas_law_and_holds_for_thirty_seconds():
    parts = [barometer(1_000_000), gps(1_200_000), gps(30_900_000), gps(31_100_000)]
    samples, _ = decode(*parts)
    assert samples[1].air_density == pytest.approx(1.0066, rel=1e-4)
    assert [isnan(s.air_density) for s in samples] == [False, False, True]


@pytest.mark.parametrize("pascal", [nan, 0.0, 795.01, 200_000.0])
def test_pressure_that_is_none_gives_no_density(pascal):
    (sample,), _ = decode(barometer(1, pascal), gps(1))
    assert isnan(sample.air_density)


def test_density_is_that_of_the_primary_barometer_while_it_is_healthy():
    other = barometer(1, 60_000.0)
    parts = [barometer(1, I=1), barometer(1, 60_000.0), barometer(1, 60_000.0, I=1, Health=0)]
    (sample,), _ = decode(message("PARM", Name=b"BARO_PRIMARY", Value=1.0), *parts, gps(1))
    assert sample.air_density == pytest.approx(1.0066, rel=1e-4)
    (sample,), _ = decode(other, *parts[:1], gps(1))
    assert sample.air_density == pytest.approx(60_000 / (287.05287 * 275.154), rel=1e-4)


def test_nothing_that_was_told_before_a_reboot_is_told_after_it():
    told = [barometer(90_000_000), airspeed(20.0), message("ATT", Yaw=0.0)]
    samples, _ = decode(gps(90_000_000), *told, message("XKF2", VWN=1.0), gps(3_000_000))
    last = samples[1]
    assert (last.flight, last.wind) == (1, None)
    assert all(map(isnan, (last.heading, last.airspeed, last.air_density)))


def test_recorded_flight_in_still_air_has_the_simulators_airspeed_and_heading():
    source = flight_log("plane_sitl_guided_loiter.BIN")
    reader, told = DFReader_binary(str(source.path)), {"SIM": [], "SIM2": []}
    while (truth := reader.recv_match(type=list(told))) is not None:
        value = truth.Yaw if truth.get_type() == "SIM" else truth.As
        told[truth.get_type()].append((truth.TimeUS / 1e6, value))
    samples = [s for s in source if s.time > 30.0]  # past the launch
    time = [s.time for s in samples]
    yaw, speed = (np.array(told[kind]).T for kind in ("SIM", "SIM2"))
    # 28 degC by the barometer, in air that the simulator takes for standard: 1.7 % of speed
    ratio = np.array([s.airspeed for s in samples]) / np.interp(time, *speed)
    assert np.all(abs(ratio - 1.0) < 0.03)
    compass = np.interp(time, yaw[0], np.unwrap(yaw[1], period=360.0))
    turned = 90.0 - compass - np.array([s.heading for s in samples])
    assert np.all(abs((turned + 180.0) % 360.0 - 180.0) < 1.5)
    assert np.all(np.hypot(*np.array([s.wind for s in samples]).T[:2])[100:] < 0.2)


def test_vehicle_is_named_by_its_parameters_and_firmware():
    parts = [
        message("PARM", Name=b"SYSID_THISMAV", Value=7.0),
        message("MSG", Message=b"ArduPlane V4.5.0"),
    ]
    _, decoder = decode(*parts)
    assert decoder.vehicle == Vehicle(7, 1, "ArduPlane")


def flight(count):
    return [
        part
        for i in range(count)
        for part in (gps(25_000_000 + 200_000 * i), message("IMU", TimeUS=i, AccX=1.0))
    ]


def test_garbage_between_messages_is_counted_and_passed_over():
    parts = flight(50)
    noise = random.Random(2)
    garbage = [noise.randbytes(noise.randrange(1, 60)) if i % 10 == 5 else b"" for i in range(100)]
    samples, decoder = decode(*(g + p for g, p in zip(garbage, parts, strict=True)))
    # The message before a piece of garbage cannot be told from one that was cut: it goes too.
    assert 40 <= len(samples) <= 50
    assert decoder.link.bad_runs == 10
    assert decoder.link.bad_bytes >= sum(map(len, garbage))
    assert all(s.latitude == -35.3632621 for s in samples)


@pytest.mark.parametrize("chunk", [1, 13, 1000])
def test_messages_are_found_however_the_bytes_arrive(chunk):
    log = declarations() + b"".join(flight(10))
    decoder, samples = DataflashDecoder(), []
    for start in range(0, len(log), chunk):
        samples += decoder.feed(log[start : start + chunk])
    samples += decoder.feed(b"", last=True)
    assert len(samples) == 10
    assert decoder.link.bad_bytes == 0


def test_log_may_end_at_any_byte():
    log = declarations() + b"".join(flight(3))
    for length in range(len(log)):
        decoder = DataflashDecoder()
        samples = list(decoder.feed(log[:length], last=True))
        assert [s.time for s in samples] == [25.0, 25.2, 25.4][: len(samples)]


@settings(max_examples=300)
@given(st.data())
def test_no_damage_makes_it_raise(data):
    log = bytearray(declarations() + b"".join(flight(3)) + message("MSG", Message=b"ArduPlane"))
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(log)))
        log[at : at + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=30))
    list(DataflashDecoder().feed(bytes(log), last=True))
