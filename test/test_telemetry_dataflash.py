"""DataFlash logs: built here message by message, damaged, and truncated."""

import random
import struct
from datetime import datetime, timedelta, timezone
from math import inf, isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.DFReader import FORMAT_TO_STRUCT

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


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_no_damage_makes_it_raise(data):
    log = bytearray(declarations() + b"".join(flight(3)) + message("MSG", Message=b"ArduPlane"))
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(log)))
        log[at : at + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=30))
    list(DataflashDecoder().feed(bytes(log), last=True))
