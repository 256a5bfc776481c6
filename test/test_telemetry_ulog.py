"""PX4 logs: written here message by message, checked with pyulog, damaged, and truncated."""

import io
import random
import struct
from itertools import pairwise
from math import asin, atan2, cos, degrees, hypot, inf, isnan, nan, radians, sin, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyulog import ULog
from ulog_bytes import CODES, FORMATS, OLD_GPS, SYNC, UlogWriter, gps, keyed, message

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.source import open_log
from ctcbs_ros.telemetry.ulog import UlogDecoder, unprojected

UNIX_US = 1_767_268_800_000_000


def decode(log):
    decoder = UlogDecoder()
    return list(decoder.feed(log, last=True)), decoder


def gps_log(count, writer=None):
    """A log of a receiver's messages every 0.2 s, and where each of them ends."""
    writer = writer or UlogWriter()
    log, ends = writer.start, []
    for i in range(count):
        log += writer.log(
            "vehicle_gps_position", **gps(10_000_000 + 200_000 * i, longitude_deg=8.5 + 1e-5 * i)
        )
        ends.append(len(log))
    return log, ends


# --- what a sample is made of -------------------------------------------------------------------


def test_receiver_message_becomes_si_degrees_and_enu():
    writer = UlogWriter()
    log = writer.start + writer.log("home_position", alt=440.0, valid_alt=True)
    (sample,), decoder = decode(log + writer.log("vehicle_gps_position", **gps(25_000_000)))
    assert (sample.time, sample.stamp_ns) == (25.0, (UNIX_US + 25_000_000) * 1000)
    assert (sample.latitude, sample.longitude) == (47.4, 8.5)
    assert (sample.altitude_amsl, sample.altitude_ellipsoid) == (500.0, 547.0)
    assert sample.height_above_home == 60.0
    assert sample.velocity == (4.0, 3.0, 2.0)  # east, north, up
    assert (sample.fix_type, sample.satellites) == (3, 12)
    assert (sample.horizontal_accuracy, sample.speed_accuracy) == (1.5, 0.25)
    assert decoder.link.bad_bytes == 0


def test_integers_of_older_logs_become_degrees_and_metres():
    writer = UlogWriter(FORMATS | {"vehicle_gps_position": OLD_GPS})
    values = gps(1) | {"lat": -353632621, "lon": 1491652374, "alt": 584090, "alt_ellipsoid": 0}
    (sample,), _ = decode(writer.start + writer.log("vehicle_gps_position", **values))
    assert (sample.latitude, sample.longitude) == (-35.3632621, 149.1652374)
    assert sample.altitude_amsl == 584.09
    assert isnan(sample.altitude_ellipsoid)  # 0 is not told


def test_velocity_and_fix_are_believed_only_as_the_receiver_says():
    writer = UlogWriter()
    log = writer.start + b"".join(
        writer.log("vehicle_gps_position", **gps(1_000_000 * i, **values))
        for i, values in enumerate([{"vel_ned_valid": False}, {"fix_type": 2}, {"fix_type": 8}])
    )
    samples, _ = decode(log)
    assert samples[0].velocity is None
    assert [s.fix_type for s in samples] == [3, 2, 1]  # 8 is PX4's dead reckoning


def test_unix_time_belongs_to_the_instant_that_the_message_names():
    writer = UlogWriter()
    late = gps(25_000_000, timestamp_time_relative=-80_000)
    (sample,), _ = decode(writer.start + writer.log("vehicle_gps_position", **late))
    # UTC was UNIX + 25 s at 24.92 s of the boot clock.
    assert sample.stamp_ns == (UNIX_US + 25_080_000) * 1000


def test_of_several_receivers_one_is_followed_until_it_is_lost():
    writer = UlogWriter()
    log = writer.start
    for i in range(40):
        fix_type = 3 if i < 20 else 0
        log += writer.log("sensor_gps", 0, **gps(200_000 * i, fix_type=fix_type))
        log += writer.log("sensor_gps", 1, **gps(200_000 * i + 1, longitude_deg=8.50001))
    samples, _ = decode(log)
    assert {s.longitude for s in samples[:20]} == {8.5}
    assert samples[-1].longitude == 8.50001
    believed = [s for s in samples if s.fix_type == 3]
    gaps = [b.time - a.time for a, b in pairwise(believed)]
    assert max(gaps) < 2.5  # taken over after 2 s
    assert len(samples) == 41  # both when it is taken over


def test_selected_receiver_takes_over_from_single_ones():
    writer = UlogWriter()
    log = writer.start + writer.log("sensor_gps", **gps(1_000_000, longitude_deg=8.0))
    log += writer.log("vehicle_gps_position", **gps(1_200_000))
    log += writer.log("sensor_gps", **gps(1_400_000, longitude_deg=8.0))
    log += writer.log("vehicle_global_position", timestamp=1_500_000, lat=1.0, lon=1.0)
    samples, _ = decode(log)
    assert [s.longitude for s in samples] == [8.0, 8.5]


def test_estimate_is_used_where_there_is_no_receiver_with_the_velocity_of_the_same_time():
    writer = UlogWriter()
    local = {"vx": 3.0, "vy": 4.0, "vz": -2.0, "evh": 0.5, "v_xy_valid": True}
    place = {"lat": 47.4, "lon": 8.5, "alt": 500.0, "alt_ellipsoid": 547.0, "eph": 0.75}
    log = writer.start + writer.log("vehicle_gps_position", **gps(0, fix_type=0))
    log += writer.log("vehicle_local_position", timestamp=1_000_000, **local)
    log += writer.log("vehicle_global_position", timestamp=1_050_000, **place)
    log += writer.log("vehicle_global_position", timestamp=1_250_000, **place)
    log += writer.log(
        "vehicle_global_position", timestamp=1_450_000, dead_reckoning=True, **place
    )
    samples, _ = decode(log)
    assert [s.fix_type for s in samples] == [0, None, None, 1]
    assert samples[1].velocity == (4.0, 3.0, 2.0)
    assert samples[1].speed_accuracy == 0.5
    assert samples[2].velocity is None
    assert (samples[1].altitude_amsl, samples[1].horizontal_accuracy) == (500.0, 0.75)


def test_log_that_gets_its_fix_late_uses_the_receiver_from_then_on(tmp_path):
    writer = UlogWriter()
    place = {"lat": 47.4, "lon": 8.5, "alt": 500.0}
    log = writer.start + writer.log("vehicle_gps_position", **gps(1, fix_type=0))
    log += writer.log("vehicle_global_position", timestamp=1_000_000, **place)
    log += b"".join(writer.log("cpuload", load=0.5) for _ in range(50_000))  # beyond the head
    log += writer.log("vehicle_gps_position", **gps(2_000_000))
    log += writer.log("vehicle_global_position", timestamp=2_100_000, **place)
    path = tmp_path / "late.ulg"
    path.write_bytes(log)
    assert [s.time for s in open_log(path)] == [1.0, 2.0]


def test_local_positions_alone_are_local_or_geodetic_as_they_say():
    writer = UlogWriter()
    local = {
        "x": 30.0, "y": 40.0, "z": -50.0, "xy_valid": True, "z_valid": True,
        "v_xy_valid": True, "vx": 3.0, "vy": 4.0, "vz": -2.0,
    }  # fmt: skip
    origin = {"ref_lat": 47.4, "ref_lon": 8.5, "ref_alt": 450.0}
    origin |= {"xy_global": True, "z_global": True}
    log = writer.start + writer.log("vehicle_local_position", timestamp=1_000_000, **local)
    log += writer.log("vehicle_local_position", timestamp=1_200_000, **local, **origin)
    log += writer.log("vehicle_local_position", timestamp=1_400_000, **local | {"xy_valid": False})
    first, second, third = decode(log)[0]
    assert first.local_position == (40.0, 30.0, 50.0)
    assert first.velocity == (4.0, 3.0, 2.0)
    assert second.flight == first.flight + 1  # another frame
    assert second.local_position is None
    assert second.altitude_amsl == 500.0
    assert second.latitude > 47.4
    assert third.fix_type == 1


@pytest.mark.parametrize(
    ("north", "east"), [(30.0, 40.0), (-2000.0, 500.0), (1e5, -3e5), (0.0, 2e3)]
)
def test_unprojected_point_lies_at_its_distance_and_bearing_on_the_sphere(north, east):
    latitude, longitude = unprojected(47.4, 179.99, north, east)
    assert -180.0 <= longitude < 180.0
    a, b, turn = radians(47.4), radians(latitude), radians(longitude - 179.99)
    # haversine distance and initial bearing, PX4's radius
    arc = 2 * asin(sqrt(sin((b - a) / 2) ** 2 + cos(a) * cos(b) * sin(turn / 2) ** 2))
    bearing = atan2(sin(turn) * cos(b), cos(a) * sin(b) - sin(a) * cos(b) * cos(turn))
    assert 6_371_000.0 * arc == pytest.approx(hypot(north, east), rel=1e-6)
    assert all(map(isnan, unprojected(47.4, 8.5, 1.7e308, 1.7e308)))
    assert degrees(bearing) == pytest.approx(degrees(atan2(east, north)), abs=1e-4)


def test_wind_is_where_the_air_goes_and_the_newer_topic_wins():
    writer = UlogWriter()
    log = writer.start + writer.log("wind_estimate", windspeed_north=1.0, windspeed_east=2.0)
    assert decode(log)[1].wind == (2.0, 1.0, 0.0)
    log += writer.log("wind", windspeed_north=-3.0, windspeed_east=4.0)
    log += writer.log("wind", 1, windspeed_north=9.0, windspeed_east=9.0)
    log += writer.log("wind_estimate", windspeed_north=9.0, windspeed_east=9.0)
    log += writer.log("wind", windspeed_north=nan, windspeed_east=9.0)
    log += writer.log("vehicle_gps_position", **gps(1_000_000))
    log += writer.log("vehicle_gps_position", **gps(1_200_000))
    samples, decoder = decode(log)
    assert decoder.wind == (4.0, -3.0, 0.0)
    assert [s.wind for s in samples] == [(4.0, -3.0, 0.0), None]  # told once


@pytest.mark.parametrize(("variances", "expected"), [((0.3, 0.7), 0.5**0.5), ((0.0, 0.0), nan)])
def test_accuracy_of_the_wind_is_from_its_variances(variances, expected):
    writer = UlogWriter()
    values = {"variance_north": variances[0], "variance_east": variances[1]}
    log = writer.start + writer.log("wind", windspeed_north=1.0, windspeed_east=2.0, **values)
    (sample,), _ = decode(log + writer.log("vehicle_gps_position", **gps(1_000_000)))
    assert sample.wind_accuracy == pytest.approx(expected, nan_ok=True)


def test_heading_is_the_estimators_as_an_enu_angle():
    writer = UlogWriter()
    log = writer.start + writer.log("vehicle_gps_position", **gps(800_000))
    log += writer.log("vehicle_local_position", heading=0.0)
    log += writer.log("vehicle_local_position", heading=-radians(90.0))
    log += writer.log("vehicle_gps_position", **gps(1_000_000))
    samples, _ = decode(log + writer.log("vehicle_gps_position", **gps(1_200_000)))
    assert samples[1].heading == pytest.approx(-180.0)
    assert isnan(samples[2].heading)  # told once
    old = FORMATS["vehicle_local_position"].replace("heading", "yaw")  # up to 1.10
    writer = UlogWriter(FORMATS | {"vehicle_local_position": old})
    log = writer.start + writer.log("vehicle_gps_position", **gps(800_000))
    log += writer.log("vehicle_local_position", yaw=radians(45.0))
    (_, sample), _ = decode(log + writer.log("vehicle_gps_position", **gps(1_000_000)))
    assert sample.heading == pytest.approx(45.0)


def test_airspeed_is_the_true_one_of_a_sensor():
    writer = UlogWriter()
    log = writer.start
    for i, source in enumerate((1, 3, 0, 4, -1)):
        values = {"true_airspeed_m_s": 20.0 + i, "airspeed_source": source}
        log += writer.log("airspeed_validated", **values)
        log += writer.log("vehicle_gps_position", **gps(1_000_000 + 200_000 * i))
    samples, _ = decode(log)
    # 0 is ground speed less wind, 4 a model of the aircraft, -1 none
    assert [s.airspeed for s in samples] == pytest.approx([20.0, 21.0, nan, nan, nan], nan_ok=True)


def test_airspeed_of_older_logs_is_validated_by_the_number_of_the_sensor():
    fields = "uint64_t timestamp;float true_airspeed_m_s;int8_t selected_airspeed_index;"
    writer = UlogWriter(FORMATS | {"airspeed_validated": fields})
    log = writer.start
    for i, sensor in enumerate((1, 0)):
        values = {"true_airspeed_m_s": 20.0, "selected_airspeed_index": sensor}
        log += writer.log("airspeed_validated", **values)
        log += writer.log("vehicle_gps_position", **gps(1_000_000 + 200_000 * i))
    samples, _ = decode(log)
    assert [isnan(s.airspeed) for s in samples] == [False, True]


def test_sensors_own_airspeed_counts_until_it_is_validated():
    writer = UlogWriter()
    sensor = writer.log("airspeed", true_airspeed_m_s=20.0)
    log = writer.start + sensor + writer.log("vehicle_gps_position", **gps(1_000_000))
    log += writer.log("airspeed_validated", true_airspeed_m_s=nan, airspeed_source=-1) + sensor
    samples, _ = decode(log + writer.log("vehicle_gps_position", **gps(1_200_000)))
    assert samples[0].airspeed == 20.0
    assert isnan(samples[1].airspeed)


# U.S. Standard Atmosphere, 1976, Table I: at 2000 m 795.01 hPa, 275.154 K, 1.0066 kg/m^3
@pytest.mark.parametrize(
    ("celsius", "source", "expected"),
    [
        (2.004, 1, 1.0066),
        (15.0, 0, 1.0066),  # not measured: 15 degC at any height
        (15.0, 1, 1.0066 * 275.154 / 288.15),
        (85.0, 1, 1.0066),  # beyond any weather
    ],
)
def test_density_is_by_the_gas_law(celsius, source, expected):
    writer = UlogWriter()
    air = {"baro_pressure_pa": 79_501.0, "ambient_temperature": celsius, "rho": 9.0}
    log = writer.start + writer.log(
        "vehicle_air_data", timestamp=900_000, temperature_source=source, **air
    )
    for us in (1_000_000, 30_800_000, 31_000_000):
        log += writer.log("vehicle_gps_position", **gps(us))
    samples, _ = decode(log)
    assert [s.air_density for s in samples] == pytest.approx(
        [expected, expected, nan], rel=1e-4, nan_ok=True
    )


def test_nothing_that_was_told_before_a_reboot_is_told_after_it():
    writer = UlogWriter()
    log = writer.start + writer.log("vehicle_gps_position", **gps(90_000_000))
    log += writer.log("vehicle_air_data", timestamp=90_000_000, baro_pressure_pa=9e4)
    log += writer.log("airspeed", true_airspeed_m_s=20.0) + writer.log("wind", windspeed_east=2.0)
    log += writer.log("vehicle_local_position", timestamp=90_000_000, heading=1.0)
    last = decode(log + writer.log("vehicle_gps_position", **gps(3_000_000)))[0][-1]
    assert (last.flight, last.wind) == (1, None)
    assert all(map(isnan, (last.heading, last.airspeed, last.air_density)))


def test_vehicle_is_named_by_information_and_parameters():
    log, _ = gps_log(1, UlogWriter(system=7))
    assert decode(log)[1].vehicle == Vehicle(7, 1, "PX4")


def test_clock_that_starts_again_begins_a_flight():
    writer = UlogWriter()
    log = writer.start + b"".join(
        writer.log("vehicle_gps_position", **gps(us)) for us in (90_000_000, 3_000_000)
    )
    samples, decoder = decode(log)
    assert [s.flight for s in samples] == [0, 1]
    assert decoder.link.time_steps == {"reboot": 1}


def test_values_that_are_not_numbers_are_screened():
    writer = UlogWriter()
    bad = [{"latitude_deg": nan}, {"longitude_deg": inf}, {"vel_n_m_s": nan}, {"vel_d_m_s": inf}]
    log = writer.start + b"".join(
        writer.log("vehicle_gps_position", **gps(1_000_000 * (i + 1), **values))
        for i, values in enumerate(bad)
    )
    screen = Screen()
    assert [screen.check(s).value for s in decode(log)[0]] == ["NOT_FINITE"] * len(bad)


@pytest.mark.parametrize("kind", ["char", "double", "float", "bool", "int8_t", "uint64_t"])
@pytest.mark.parametrize("topic", ["vehicle_gps_position", "vehicle_local_position"])
def test_fields_declared_as_another_type_raise_nothing(topic, kind):
    fields = FORMATS[topic].rstrip(";").split(";")
    size = struct.calcsize({"char": "c", **CODES}[kind])
    for value in (b"\xff" * size, b"\x01" * size, struct.pack("<d", 1e308)[-size:]):
        for i in range(len(fields)):
            declared = list(fields)
            declared[i] = f"{kind} {fields[i].split(' ')[1]}"
            writer = UlogWriter(FORMATS | {topic: ";".join(declared)})
            log = writer.start + message("A", b"\0\0\0" + topic.encode())
            log += message("D", b"\0\0" + value * 30)
            for j in range(20, 200):
                log += message("D", b"\0\0" + (value * 200)[:j])
            for sample in decode(log)[0]:
                Screen().check(sample)


# --- the file -----------------------------------------------------------------------------------


def test_pyulog_reads_the_same_values(tmp_path):
    log, _ = gps_log(50)
    path = tmp_path / "flight.tlog"  # told by content
    path.write_bytes(log)
    data = ULog(io.BytesIO(log)).get_dataset("vehicle_gps_position").data
    samples = list(open_log(path))
    assert [s.time for s in samples] == pytest.approx(data["timestamp"] / 1e6)
    assert [s.longitude for s in samples] == list(data["longitude_deg"])
    assert [s.velocity[0] for s in samples] == list(data["vel_e_m_s"])


def test_log_is_read_alike_in_pieces_of_any_size():
    log, _ = gps_log(20)
    whole = str(decode(log)[0])
    for size in (1, 7, 100, 5000):
        decoder, samples = UlogDecoder(), []
        for i in range(0, len(log), size):
            samples += decoder.feed(log[i : i + size])
        samples += decoder.feed(b"", last=True)
        assert str(samples) == whole
        assert decoder.link.bad_bytes == 0


def test_all_other_messages_are_passed_over():
    writer = UlogWriter()
    log = writer.start + writer.log("cpuload", load=0.5)
    log += message("S", SYNC) + message("O", b"\x10\x00") + message("L", b"6" + bytes(8) + b"Hi")
    log += message("C", b"6" + bytes(10) + b"Hi") + keyed("P", "float MC_P", bytes(4))
    log += message("Z", b"of a later version") + message("R", b"\x00\x00")
    log += writer.log("vehicle_gps_position", **gps(1))
    samples, decoder = decode(log)
    assert len(samples) == 1
    assert decoder.link.bad_bytes == 0


def test_truncated_anywhere_it_gives_every_whole_message_and_counts_the_rest(tmp_path):
    log, ends = gps_log(6)
    whole = decode(log)[0]
    path = tmp_path / "cut.ulg"
    for length in range(1, len(log)):
        complete = sum(end <= length for end in ends)
        samples, decoder = decode(log[:length])
        assert str(samples) == str(whole[:complete])
        if complete and length not in ends:
            assert decoder.link.bad_bytes == length - ends[complete - 1]
        if length % 7 == 0:
            path.write_bytes(log[:length])
            try:
                assert len(list(open_log(path))) == complete
            except InputError as error:
                assert complete == 0
                assert str(path) in str(error)  # noqa: PT017, either is right


def test_damage_costs_only_the_messages_that_it_hits():
    log, ends = gps_log(60)
    damaged = bytearray(log)
    start = ends[20] - 40
    damaged[start : start + 300] = random.Random(2).randbytes(300)
    samples, decoder = decode(bytes(damaged))
    assert 54 <= len(samples) <= 60
    assert decoder.link.bad_runs >= 1
    del damaged[start : start + 150]  # a hole
    samples, decoder = decode(bytes(damaged))
    assert len(samples) >= 50
    assert samples[-1].time == pytest.approx(10 + 59 * 0.2)


def test_damaged_declarations_cost_their_topic_only():
    writer = UlogWriter()
    for broken in ("uint64_t timestamp;oops lat", "timestamp", "", "uint64_t[99999999] timestamp"):
        writer = UlogWriter(FORMATS)
        log = writer.start + message("F", f"home_position:{broken}".encode())
        log += writer.log("home_position", alt=3.0) + writer.log("sensor_gps", **gps(1))
        samples, _ = decode(log)
        assert len(samples) == 1


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=400), st.integers(0, 1500), st.integers(0, 60))
def test_random_damage_raises_nothing(junk, position, hole):
    log, _ = gps_log(8)
    damaged = log[:position] + junk + log[position + hole :]
    samples, decoder = decode(damaged)
    assert decoder.link.bad_bytes <= len(damaged)
    for sample in samples:
        Screen().check(sample)


@pytest.mark.parametrize("rest", [b"", bytes(5000), random.Random(3).randbytes(5000)])
def test_header_without_messages_is_refused_by_name(tmp_path, rest):
    path = tmp_path / "nothing.ulg"
    path.write_bytes(UlogWriter().start[:16] + rest)
    with pytest.raises(InputError, match=r"nothing\.ulg"):
        open_log(path)


def test_wrong_header_is_refused_by_name(tmp_path):
    path = tmp_path / "wrong.ulg"
    path.write_bytes(b"ULoG" + gps_log(10)[0][4:])
    with pytest.raises(InputError, match=r"wrong\.ulg"):
        open_log(path)
