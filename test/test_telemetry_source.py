"""Logs opened by content, streamed, refused where they are none; and the recorded flights."""

import io
import random
from collections import Counter
from math import atan2, degrees, hypot
from pathlib import Path

import pytest
from mavlink_bytes import START_US, Sender, gps_raw, heartbeat, position, stamped

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.source import open_log

FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"


def flight_log(name):
    if not (FLIGHTS / name).exists():
        pytest.skip(f"the recorded flight {FLIGHTS / name} is not here")
    return open_log(FLIGHTS / name)


def screened(source):
    """Samples that are believed, and the count of each skip."""
    screen, believed, skips = Screen(), [], Counter()
    for sample in source:
        code = screen.check(sample)
        if code is None:
            believed.append(sample)
        else:
            skips[code] += 1
    return believed, skips


def frames(count=40):
    send = Sender()
    for i in range(count):
        if i % 10 == 0:
            yield send(heartbeat())
            yield send(gps_raw())
        yield send(position(60_000 + 200 * i, lon=8.5 + 1e-6 * i))


def test_log_with_and_without_stamps_is_told_by_content(tmp_path):
    for name, data in (("a.bin", stamped(frames())), ("b.tlog", b"".join(frames()))):
        path = tmp_path / name
        path.write_bytes(data)
        source = open_log(path)
        assert source.vehicle == Vehicle(1, 1, "fixed wing")
        assert [round(s.time, 3) for s in source] == [round(60 + 0.2 * i, 3) for i in range(40)]
        assert source.link.bad_bytes == 0
        assert source.size == len(data)


def test_log_can_be_read_twice_and_counts_only_once(tmp_path):
    path = tmp_path / "flight.tlog"
    path.write_bytes(stamped(frames()))
    source = open_log(path)
    assert source.progress == 0.0
    first, second = list(source), list(source)
    assert str(first) == str(second)  # nan is not equal to itself
    assert source.link.messages == 48
    assert source.progress == 1.0


def test_log_is_streamed_not_loaded(tmp_path, monkeypatch):
    path = tmp_path / "long.tlog"
    path.write_bytes(stamped(list(frames(20_000))))
    largest = 0

    class Watched(io.FileIO):
        def read(self, size=-1):
            nonlocal largest
            data = super().read(size)
            largest = max(largest, len(data))
            return data

    source = open_log(path)
    monkeypatch.setattr("builtins.open", lambda file, mode: Watched(file, mode.replace("b", "")))
    seen = []
    for count, _ in enumerate(source):
        if count % 5000 == 0:
            seen.append(source.progress)
    assert largest < path.stat().st_size / 10
    assert seen == sorted(seen)
    assert 0.2 < seen[1] < 0.3


def test_vehicle_is_known_before_its_first_heartbeat(tmp_path):
    one, other = Sender(9, 1), Sender(3, 1)
    path = tmp_path / "late_heartbeat.tlog"
    sent = [one(position(1000 + 200 * i)) for i in range(30)] + [other(heartbeat())]
    sent += [other(position(5000 + 200 * i, lat=10.0)) for i in range(5)]
    path.write_bytes(stamped(sent))
    source = open_log(path, system=9)
    assert len(list(source)) == 30
    assert source.link.other_positions == 5


@pytest.mark.parametrize("positions", [25, 1000])
def test_in_a_log_an_aircrafts_heartbeat_comes_before_any_number_of_positions(tmp_path, positions):
    silent, plane = Sender(9, 1), Sender(3, 1)
    sent = [silent(position(1000 + 200 * i)) for i in range(positions)] + [plane(heartbeat())]
    sent += [plane(position(5000 + 200 * i, lat=10.0)) for i in range(5)]
    path = tmp_path / "silent_sender.tlog"
    path.write_bytes(stamped(sent))
    source = open_log(path)
    assert source.vehicle == Vehicle(3, 1, "fixed wing")
    assert [sample.latitude for sample in source] == [10.0] * 5
    assert source.link.other_positions == positions


def test_without_any_heartbeat_the_first_to_send_twenty_positions_is_followed(tmp_path):
    few, many, more = Sender(5, 1), Sender(6, 1), Sender(7, 1)
    sent = [few(position(1000 + 200 * i)) for i in range(19)]
    sent += [many(position(1000 + 200 * i)) for i in range(20)]
    sent += [more(position(1000 + 200 * i)) for i in range(40)]
    path = tmp_path / "silent_senders.tlog"
    path.write_bytes(stamped(sent))
    assert open_log(path).vehicle == Vehicle(6, 1, "unknown type")


def test_short_log_without_any_heartbeat_gives_its_positions(tmp_path):
    send = Sender(4, 1)
    path = tmp_path / "short.tlog"
    path.write_bytes(stamped([send(position(1000 + 200 * i)) for i in range(3)]))
    assert len(list(open_log(path))) == 3


# --- what is no log -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"time,lat,lon\n0.0,47.4,8.5\n" * 100,
        bytes(100_000),
        random.Random(1).randbytes(300_000),
        b"\xfe" * 100_000,
        b"\xa3\x95\x80",
        b"\xa3\x95\x80" + bytes(5000),
        stamped(frames(1))[:20],
    ],
    ids=["empty", "text", "zeros", "noise", "magic", "head", "head and zeros", "cut short"],
)
def test_file_without_a_message_is_refused_by_name(tmp_path, content):
    path = tmp_path / "not_a_flight.tlog"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"not_a_flight\.tlog"):
        open_log(path)


def test_absent_file_and_directory_are_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"absent\.tlog.*No such file"):
        open_log(tmp_path / "absent.tlog")
    with pytest.raises(InputError, match=str(tmp_path)):
        open_log(tmp_path)


def test_file_of_one_message_is_a_log(tmp_path):
    path = tmp_path / "one.tlog"
    path.write_bytes(stamped([Sender()(position(1000))]))
    (sample,) = open_log(path)
    assert sample.stamp_ns == START_US * 1000


def test_log_cut_at_any_byte_gives_the_samples_before_the_cut(tmp_path):
    sent = list(frames(4))
    data, path = stamped(sent), tmp_path / "cut.tlog"
    path.write_bytes(data)
    whole = list(open_log(path))
    for length in range(len(stamped(sent[:1])), len(data)):
        path.write_bytes(data[:length])
        got = list(open_log(path))
        assert str(got) == str(whole[: len(got)])
    assert len(got) == 3


# --- recorded flights; what they are stands in their README ------------------------------------


@pytest.mark.parametrize(
    ("name", "vehicle", "samples", "flights", "bad", "zero"),
    [
        ("plane_sitl_loiter.tlog", Vehicle(1, 1, "fixed wing"), 502, 1, 4, 22),
        ("plane_sitl_guided_loiter.BIN", Vehicle(1, 1, "ArduPlane"), 307, 1, 0, 0),
        ("plane_real_wind.tlog", Vehicle(1, 1, "fixed wing"), 3011, 1, 0, 296),
        ("copter_two_sessions.tlog", Vehicle(10, 1, "quadrotor"), 1151, 3, 33, 108),
        ("copter_reboot.tlog", Vehicle(1, 1, "quadrotor"), 2833, 2, 266, 149),
        ("plane_sitl_corrupt.tlog", Vehicle(1, 1, "fixed wing"), 45, 1, 39, 6),
    ],
)
def test_recorded_flight_reads_whole_with_each_skip_explained(
    name, vehicle, samples, flights, bad, zero
):
    source = flight_log(name)
    believed, counts = screened(source)
    assert source.vehicle == vehicle
    assert len(believed) + counts.total() == samples
    assert counts == Counter({SkipCode.BAD_FIX: bad, SkipCode.ZERO_POSITION: zero})
    assert not believed or believed[-1].flight == flights - 1
    times = [s.time for s in believed]
    assert times == sorted(times)
    for flight in range(flights):
        of_flight = [s for s in believed if s.flight == flight]
        offsets = {round(s.stamp_ns - s.time * 1e9, -4) for s in of_flight}
        assert len(offsets) <= 2  # one tie to Unix time a flight, give or take the rounding


def test_no_start_up_position_of_the_simulator_is_believed():
    believed, _ = screened(flight_log("plane_sitl_loiter.tlog"))
    # Home of ArduPilot's simulator: -35.3632621, 149.1652374, 584 m.
    assert min(s.altitude_amsl for s in believed) > 583.0
    assert all(abs(s.latitude + 35.363) < 0.01 for s in believed)
    assert all(abs(s.longitude - 149.165) < 0.01 for s in believed)
    assert believed[0].time < 9.5


def test_air_of_the_simulator_is_the_standard_atmosphere_but_for_its_warm_board():
    densities = [s.air_density for s in flight_log("plane_sitl_loiter.tlog")][1:]
    # ICAO: 945.0 hPa at 584 m, 933.7 hPa 100 m higher; its barometer warms from 25.4 to 34 degC.
    assert densities[0] == pytest.approx(94_500 / (287.05287 * 298.5), rel=1e-3)
    assert all(93_000 / (287.05287 * 310.0) < rho <= densities[0] + 1e-3 for rho in densities)


def test_wind_of_the_real_plane_is_what_its_messages_say():
    source = flight_log("plane_real_wind.tlog")
    winds = [source.wind for s in source if s.time >= 1090]
    east = sum(w[0] for w in winds) / len(winds)
    north = sum(w[1] for w in winds) / len(winds)
    # README: about 7 m/s from 211 deg by its WIND. (Its ground velocities lie on a circle about
    # -4.9, -5.5: this firmware of 2012 sent the direction that the wind blows to.)
    assert hypot(east, north) == pytest.approx(7.0, abs=0.7)
    assert degrees(atan2(-east, -north)) % 360 == pytest.approx(211, abs=20)


def test_dataflash_log_agrees_with_pymavlink_and_carries_unix_time():
    source = flight_log("plane_sitl_guided_loiter.BIN")
    samples = list(source)
    from pymavlink.DFReader import DFReader_binary

    reader = DFReader_binary(str(source.path))
    for sample in samples:
        gps = reader.recv_match(type="GPS", strict=True)
        assert (sample.latitude, sample.longitude) == (gps.Lat, gps.Lng)
        assert sample.altitude_amsl == gps.Alt
        assert sample.time == pytest.approx(gps.TimeUS / 1e6, abs=1e-9)
        # pymavlink ties its clock to the first GPS message of the log as well
        assert sample.stamp_ns / 1e9 == pytest.approx(gps._timestamp, abs=1e-3)
    assert reader.recv_match(type="GPS", strict=True) is None
    assert samples[-1].height_above_home == pytest.approx(61.4, abs=0.1)
    assert samples[-1].horizontal_accuracy == pytest.approx(0.3)


def test_corrupt_log_gives_more_messages_than_pymavlink_finds():
    source = flight_log("plane_sitl_corrupt.tlog")
    list(source)
    assert source.link.messages > 2125  # found by pymavlink 2.4.50
    assert source.link.bad_runs > 100
    assert source.link.lost[1, 1] > 100
