"""One simulated flight in every log format: the same samples, the same predictions, one wind."""

import json
import subprocess
import sys
from math import atan2, degrees, hypot, radians
from pathlib import Path

import pytest
import test_telemetry_dataflash as dataflash
from bags import FIX, ODOM, POSE, TWIST, WIND, fix, odometry, pose, twist, wind, write_bag
from replays import replayed
from ulog_bytes import UlogWriter, gps

from ctcbs_ros.cli.main import main
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.source import open_log

# U.S. Standard Atmosphere, 1976, Table I: at 500 m.
PRESSURE, CELSIUS, DENSITY = 95_461.0, 11.75, 1.1673
DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
AIR = (4.0, -3.0, 0.0)  # east, north, up: 5 m/s towards the south-east
FORMATS = ("ulg", "db3", "mcap", "folder", "BIN")


def through_the_air(velocity):
    """True airspeed [m/s] and heading by compass [deg] of a ground velocity, towards ENU."""
    east, north = velocity[0] - AIR[0], velocity[1] - AIR[1]
    return hypot(east, north), degrees(atan2(east, north)) % 360.0


def ulog_of(samples):
    writer = UlogWriter()
    log = writer.start + writer.log("home_position", alt=100.0, valid_alt=True)
    log += writer.log("wind", windspeed_north=AIR[1], windspeed_east=AIR[0])
    for s in samples:
        east, north, up = s.velocity
        values = {
            "latitude_deg": s.latitude, "longitude_deg": s.longitude,
            "altitude_msl_m": s.altitude_amsl, "altitude_ellipsoid_m": s.altitude_ellipsoid,
            "vel_n_m_s": north, "vel_e_m_s": east, "vel_d_m_s": -up,
            "eph": s.horizontal_accuracy, "s_variance_m_s": s.speed_accuracy,
            "satellites_used": s.satellites, "time_utc_usec": s.stamp_ns // 1000,
        }  # fmt: skip
        airspeed, heading = through_the_air(s.velocity)
        log += writer.log(
            "vehicle_air_data", timestamp=round(s.time * 1e6), baro_pressure_pa=PRESSURE,
            ambient_temperature=CELSIUS, temperature_source=1,
        )  # fmt: skip
        log += writer.log("vehicle_local_position", heading=radians(heading))
        log += writer.log("airspeed_validated", true_airspeed_m_s=airspeed, airspeed_source=1)
        log += writer.log("vehicle_gps_position", **gps(round(s.time * 1e6), **values))
    return log


def dataflash_of(samples):
    log = dataflash.declarations()
    log += dataflash.message("XKF2", VWN=AIR[1], VWE=AIR[0])
    unix = samples[0].stamp_ns // 10**6 + 18_000 - 315_964_800_000  # GPS time [ms]
    for s in samples:
        east, north, up = s.velocity
        week, ms = divmod(unix + round((s.time - samples[0].time) * 1000), 604_800_000)
        airspeed, heading = through_the_air(s.velocity)
        log += dataflash.barometer(round(s.time * 1e6), PRESSURE, CELSIUS)
        log += dataflash.message("ATT", Yaw=heading)
        log += dataflash.airspeed(airspeed * (DENSITY / 1.2250) ** 0.5)
        log += dataflash.message("POS", RelHomeAlt=s.height_above_home)
        log += dataflash.message(
            "GPA", HAcc=s.horizontal_accuracy, SAcc=s.speed_accuracy,
            Und=s.altitude_amsl - s.altitude_ellipsoid,
        )  # fmt: skip
        log += dataflash.gps(
            round(s.time * 1e6), Lat=s.latitude, Lng=s.longitude, Alt=s.altitude_amsl,
            Spd=hypot(east, north), GCrs=degrees(atan2(east, north)), VZ=-up,
            NSats=s.satellites, GWk=week, GMS=ms,
        )  # fmt: skip
    return log


def bag_messages(samples):
    yield WIND, wind(samples[0].stamp_ns, AIR)
    for s in samples:
        yield ODOM, odometry(s.stamp_ns, s.velocity, speed_accuracy=s.speed_accuracy)
        place = s.latitude, s.longitude, s.altitude_ellipsoid, s.horizontal_accuracy
        yield FIX, fix(s.stamp_ns, *place)


def poses_of(samples):
    frame = LocalFrame()
    for s in samples:
        yield TWIST, twist(s.stamp_ns, s.velocity)
        yield POSE, pose(s.stamp_ns, frame.localize(s).position)


@pytest.fixture(scope="module")
def logs(drone_log, tmp_path_factory):
    """The samples of the flight, and its log in each format."""
    folder = tmp_path_factory.mktemp("formats")
    samples = list(open_log(drone_log))
    (folder / "flight.ulg").write_bytes(ulog_of(samples))
    (folder / "flight.BIN").write_bytes(dataflash_of(samples))
    found = {"ulg": folder / "flight.ulg", "BIN": folder / "flight.BIN"}
    for kind in ("db3", "mcap"):
        bag = write_bag(folder / kind, bag_messages(samples), kind)
        (found[kind],) = bag.glob(f"*.{kind}")
    found["folder"] = folder / "db3"
    return samples, found


@pytest.mark.parametrize("kind", FORMATS)
def test_same_flight_gives_the_same_samples(logs, kind):
    samples, found = logs
    got = list(open_log(found[kind]))
    assert len(got) == len(samples)
    is_bag = kind in ("db3", "mcap", "folder")
    for a, b in zip(got, samples, strict=True):
        assert a.stamp_ns == pytest.approx(b.stamp_ns, abs=1000)
        assert a.time - got[0].time == pytest.approx(b.time - samples[0].time, abs=2e-6)
        assert (a.latitude, a.longitude) == pytest.approx((b.latitude, b.longitude), abs=2e-7)
        assert a.altitude_ellipsoid == pytest.approx(b.altitude_ellipsoid, abs=0.02)
        assert a.velocity == pytest.approx(b.velocity, abs=2e-3)
        assert a.fix_type == b.fix_type
        assert a.horizontal_accuracy == pytest.approx(b.horizontal_accuracy, abs=0.01)
        assert a.speed_accuracy == pytest.approx(b.speed_accuracy, abs=0.01)
        assert a.flight == b.flight
        if not is_bag:  # NavSatFix knows neither
            assert a.altitude_amsl == pytest.approx(b.altitude_amsl, abs=0.02)
            assert a.height_above_home == pytest.approx(b.height_above_home, abs=0.02)
            assert a.satellites == b.satellites


@pytest.mark.parametrize("kind", FORMATS)
def test_wind_is_where_the_air_goes_in_every_format(logs, kind):
    source = open_log(logs[1][kind])
    next(iter(source))
    assert source.wind == pytest.approx(AIR)


@pytest.fixture(scope="module")
def windy_log(tmp_path_factory):
    """MAVLink log of a simulated flight in that wind, which its WIND gives as 5 m/s from 307."""
    file = tmp_path_factory.mktemp("windy") / "flight.tlog"
    flight = "--radius 60 --speed 20 --turns 2 --center=47.4,8.5 --wind 5,306.87"
    assert main(f"simulate --config {DRONE} {flight} -o {file}".split()) == 0
    return file


@pytest.mark.parametrize("kind", ["ulg", "BIN", "tlog"])
def test_ground_velocity_is_the_airspeed_along_the_heading_plus_the_wind(logs, windy_log, kind):
    samples = list(open_log(windy_log if kind == "tlog" else logs[1][kind]))
    wind = next(s.wind for s in samples if s.wind is not None)
    assert wind == pytest.approx(AIR, abs=1e-3)
    for s in samples[1:]:
        east, north = s.velocity[0] - wind[0], s.velocity[1] - wind[1]
        airspeed = hypot(east, north)
        if kind != "tlog":  # there it is worked out, and so is not told
            assert s.airspeed == pytest.approx(airspeed, rel=1e-4)
            assert s.air_density == pytest.approx(DENSITY, rel=1e-4)
        off = degrees(atan2(north, east)) - s.heading
        assert (off + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("kind", FORMATS)
def test_same_flight_gives_the_same_predictions(logs, core_replay, drone_table, kind):
    expected, summary = core_replay
    records, got = replayed(logs[1][kind], drone_table)
    assert got["predictions"] == summary["predictions"] > 50
    assert got["skipped"] == summary["skipped"]
    for a, b in zip(records, expected, strict=True):
        assert a["valid"] == b["valid"]
        if b["valid"]:
            for name in ("orbit_radius_m", "orbit_speed_m_s", "end_mass_depth_m"):
                assert a[name] == pytest.approx(b[name], rel=1e-3)
            # 47 m between the two heights that set the density of the air
            assert a["end_mass_radius_m"] == pytest.approx(b["end_mass_radius_m"], rel=0.01)
            # In the wind that these logs tell, and the other does not, it is elsewhere.
            if a["pose_holds"] and not a["wind_modelled"]:
                assert a["end_mass_latitude_deg"] == pytest.approx(
                    b["end_mass_latitude_deg"], abs=1e-6
                )


def test_poses_with_twists_alone_give_the_same_orbit(logs, drone_table, tmp_path):
    samples, _ = logs
    bag = write_bag(tmp_path / "poses", poses_of(samples))
    (orbit,) = replayed(bag, drone_table)[1]["orbits"]
    assert orbit["radius_m"] == pytest.approx(60.0, abs=0.6)  # drone_log of conftest.py
    assert orbit["speed_m_s"] == pytest.approx(20.0, abs=0.2)
    assert orbit["sense"] == "cw"


@pytest.mark.parametrize("kind", ["ulg", "folder"])
def test_replay_command_takes_the_log_and_prints_json_alone(logs, drone_table, kind):
    command = [sys.executable, "-m", "ctcbs_ros", "replay", logs[1][kind], "--config", DRONE]
    done = subprocess.run(
        [*map(str, command), "--table", str(drone_table), "--through", "core", "--json"],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["predictions"] > 50


def test_replay_command_ends_with_two_and_one_line_where_nothing_can_be_read(tmp_path):
    for name, content in (("a.ulg", b"ULog\x01\x12\x35\x01"), ("b.mcap", b"\x89MCAP0\r\n")):
        path = tmp_path / name
        path.write_bytes(content)
        done = subprocess.run(
            [sys.executable, "-m", "ctcbs_ros", "replay", str(path), "--config", str(DRONE)],
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert name in done.stderr
