"""Simulated flights: their physics, and that their logs give the truth back."""

import argparse
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil

from ctcbs_ros import simulated_payload
from ctcbs_ros.cli import simulate as command
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.geodesy import Datum, to_enu
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.simulate import simulate_flight, simulate_payload, write_tlog
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.source import open_log

CONFIG = Path(__file__).parents[1] / "config" / "small_drone.yaml"
GRAVITY = 9.80665


def turning(flight):
    """Boolean mask of the samples on the circle."""
    return np.isfinite(flight.radius)


def derivative(flight, values):
    return np.gradient(values, flight.time, axis=0)


# --- the flight ---------------------------------------------------------------------------------


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-4.0, 6.0)])
@pytest.mark.parametrize("sense", [1, -1])
def test_turns_are_on_the_circle_in_the_sense_asked_for(wind, sense):
    flight = simulate_flight(80.0, 20.0, 3.0, sense=sense, wind=wind, rate=10.0)
    on = turning(flight)
    np.testing.assert_allclose(flight.radius[on], 80.0, rtol=1e-9)
    angle = np.unwrap(np.arctan2(flight.position[on, 1], flight.position[on, 0]))
    assert (sense * np.diff(angle) > 0).all()
    assert sense * (angle[-1] - angle[0]) / (2 * np.pi) == pytest.approx(3.0, abs=0.05)
    # banked into the turn: to the left, negative, when anticlockwise
    assert (sense * flight.bank[on] < 0).all()


def test_still_air_circle_takes_its_time_and_bank():
    flight = simulate_flight(80.0, 20.0, 3.0, rate=10.0)
    on = turning(flight)
    assert np.ptp(flight.time[on]) == pytest.approx(3 * 2 * np.pi * 80 / 20, abs=0.2)
    np.testing.assert_allclose(np.abs(flight.bank[on]), np.arctan(20**2 / 80 / GRAVITY))
    assert flight.time[~on].size / 10 == pytest.approx(30.0, abs=0.3)


def test_wind_triangle_closes_at_constant_airspeed():
    wind = np.array([-4.0, 6.0])
    flight = simulate_flight(80.0, 20.0, 2.0, wind=tuple(wind), rate=10.0)
    air = flight.velocity[:, :2] - wind
    np.testing.assert_allclose(np.hypot(*air.T), 20.0, rtol=1e-12)
    np.testing.assert_allclose(np.cos(flight.heading), air[:, 0] / 20.0, atol=1e-9)
    # Downwind and upwind the triangle is flat: airspeed and wind add, and subtract.
    speed = np.hypot(*flight.velocity[turning(flight), :2].T)
    assert speed.max() == pytest.approx(20 + np.hypot(*wind), abs=0.05)
    assert speed.min() == pytest.approx(20 - np.hypot(*wind), abs=0.05)


def test_velocity_turn_rate_and_bank_are_the_derivatives_of_the_path():
    flight = simulate_flight(
        80.0, 20.0, 5.0, wind=(3.0, -5.0), radius_change=(110.0, 2.0), rate=100
    )
    np.testing.assert_allclose(
        derivative(flight, flight.position)[1:-1], flight.velocity[1:-1], atol=0.03
    )
    inside = np.flatnonzero(turning(flight))[2:-2]
    np.testing.assert_allclose(
        derivative(flight, np.unwrap(flight.heading))[inside], flight.turn_rate[inside], atol=2e-3
    )
    # A coordinated turn at constant airspeed: the acceleration is g tan(bank) across the airflow.
    acceleration = np.hypot(*derivative(flight, flight.velocity)[inside, :2].T)
    np.testing.assert_allclose(
        acceleration, GRAVITY * np.abs(np.tan(flight.bank[inside])), atol=0.05
    )


@pytest.mark.parametrize("new_radius", [50.0, 70.0, 90.0, 110.0, 160.0])
def test_radius_changes_smoothly_at_a_flyable_bank(new_radius):
    flight = simulate_flight(80.0, 20.0, 5.0, radius_change=(new_radius, 2.0), rate=20.0)
    on = turning(flight)
    assert flight.radius[on][0] == pytest.approx(80.0)
    assert flight.radius[on][-1] == pytest.approx(new_radius)
    step = np.linalg.norm(np.diff(flight.position, axis=0), axis=1)
    assert step.max() <= 20.0 / 20 + 1e-6
    steepest = np.arctan(20**2 / min(80.0, new_radius) / GRAVITY)
    assert np.abs(flight.bank).max() < np.arctan(1.26 * np.tan(steepest))
    assert (flight.bank[on] <= 0).all()  # never to the other side
    changing = (
        on & (np.abs(flight.radius - 80) > 0.01) & (np.abs(flight.radius - new_radius) > 0.01)
    )
    angle = np.unwrap(np.arctan2(flight.position[changing, 1], flight.position[changing, 0]))
    assert np.ptp(angle) <= np.pi


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"radius": 0.0}, "radius 0 m"),
        ({"radius": -80.0}, "radius -80"),
        ({"radius": float("nan")}, "radius nan"),
        ({"radius": 6.0}, r"bank of 8\d deg"),
        ({"speed": 0.0}, "speed 0"),
        ({"speed": float("inf")}, "speed inf"),
        ({"turns": -6.0}, "^turns -6: must be above 0"),
        ({"rate": 0.0}, "rate 0"),
        ({"height": float("nan")}, "height nan"),
        ({"wind": (12.0, 16.0)}, "wind 20 m/s.*less than the airspeed"),
        ({"wind": (float("nan"), 0.0)}, "wind nan"),
        ({"radius_change": (0.0, 2.0)}, "radius change 0"),
        ({"radius_change": (100.0, 9.0)}, "after 9"),
        ({"radius_change": (100.0, 5.9)}, "too little"),
        ({"radius_change": (6.0, 2.0)}, "bank"),
    ],
)
def test_flight_that_cannot_be_flown_is_refused(change, said):
    arguments = {"radius": 80.0, "speed": 20.0, "turns": 6.0} | change
    with pytest.raises(InputError, match=said):
        simulate_flight(**arguments)


# --- its log ------------------------------------------------------------------------------------


@pytest.mark.parametrize("center", [(47.4, 8.5), (-35.4, 149.2), (0.5, -179.9995), (-77.8, 166.7)])
@pytest.mark.parametrize("sense", [1, -1])
def test_log_gives_the_truth_back_to_the_resolution_of_mavlink(tmp_path, center, sense):
    flight = simulate_flight(80.0, 20.0, 2.0, sense=sense, wind=(3.0, -5.0), height=250.0)
    path = tmp_path / "flight.tlog"
    count = write_tlog(path, flight, latitude=center[0], longitude=center[1])
    source = open_log(path)
    samples = list(source)
    assert source.vehicle == Vehicle(1, 1, "fixed wing")
    assert count == len(samples) == len(flight.time)
    assert (source.link.bad_bytes, source.link.lost) == (0, {(1, 1): 0})

    time = np.array([s.time for s in samples])
    np.testing.assert_allclose(time - time[0], flight.time, atol=1e-9)
    stamps = np.array([s.stamp_ns for s in samples])
    assert (stamps - stamps[0] == np.round(flight.time * 1e3).astype(int) * 10**6).all()

    home = Datum(*center, 147.0, True)  # 100 m above the sea, geoid 47 m above the ellipsoid
    ellipsoidal = [s.altitude_ellipsoid for s in samples]
    position = np.column_stack(
        to_enu(home, [s.latitude for s in samples], [s.longitude for s in samples], ellipsoidal)
    )
    half_unit = 0.5e-7 * 111_700  # m; a degree of arc is at most 111.7 km
    np.testing.assert_allclose(position[:, :2], flight.position[:, :2], atol=1.001 * half_unit)
    np.testing.assert_allclose(position[:, 2], flight.position[:, 2], atol=0.0006)
    velocity = np.array([s.velocity for s in samples])
    np.testing.assert_allclose(velocity, flight.velocity, atol=0.005 + 1e-9)
    for s in samples:
        assert s.altitude_ellipsoid - s.altitude_amsl == pytest.approx(47.0, abs=1e-6)
        assert s.altitude_amsl - s.height_above_home == pytest.approx(100.0, abs=1e-6)
        assert (s.fix_type, s.satellites) == (3, 14)
        assert (s.horizontal_accuracy, s.speed_accuracy) == (0.1, 0.05)
    assert source.wind == pytest.approx((3.0, -5.0, 0.0), abs=1e-5)
    screen = Screen()
    assert {screen.check(s) for s in samples} == {None}


def test_log_holds_the_messages_of_an_autopilot_in_agreement(tmp_path):
    flight = simulate_flight(80.0, 20.0, 2.0, sense=-1, wind=(3.0, -5.0))
    write_tlog(tmp_path / "flight.tlog", flight, latitude=47.4, longitude=8.5)
    log = mavutil.mavlogfile(str(tmp_path / "flight.tlog"))
    found = {}
    while (message := log.recv_msg()) is not None:
        found.setdefault(message.get_type(), []).append(message)
    assert set(found) == {
        "HEARTBEAT", "SYSTEM_TIME", "GPS_RAW_INT", "ATTITUDE", "GLOBAL_POSITION_INT", "VFR_HUD",
        "WIND",
    }  # fmt: skip
    assert len(found["HEARTBEAT"]) == pytest.approx(flight.time[-1], abs=1.5)
    roll = np.array([m.roll for m in found["ATTITUDE"]])
    np.testing.assert_allclose(roll, flight.bank, atol=1e-6)
    assert roll.max() > 0.3  # clockwise: to the right
    yaw = np.array([m.yaw for m in found["ATTITUDE"]])
    np.testing.assert_allclose(np.sin(yaw), np.cos(flight.heading), atol=1e-6)  # from north
    np.testing.assert_allclose(np.cos(yaw), np.sin(flight.heading), atol=1e-6)
    assert {round(m.airspeed, 6) for m in found["VFR_HUD"]} == {20.0}
    # Blowing towards 3 east, -5 north is blowing from 329 degrees.
    assert found["WIND"][0].direction == pytest.approx(329.04, abs=0.01)
    unix = [m.time_unix_usec / 1e3 - m.time_boot_ms for m in found["SYSTEM_TIME"]]
    assert np.ptp(unix) == 0
    received = np.array([m._timestamp for m in found["GLOBAL_POSITION_INT"]])
    sent = (np.array([m.time_boot_ms for m in found["GLOBAL_POSITION_INT"]]) + unix[0]) / 1e3
    assert (received > sent).all()


def test_noise_has_the_size_asked_for_and_is_stated_as_accuracy(tmp_path):
    flight = simulate_flight(80.0, 20.0, 6.0)
    path = tmp_path / "flight.tlog"
    write_tlog(
        path, flight, latitude=47.4, longitude=8.5, position_noise=1.5, velocity_noise=0.3, seed=4
    )
    samples = list(open_log(path))
    home = Datum(47.4, 8.5, 147.0, True)
    position = np.array(
        [to_enu(home, s.latitude, s.longitude, s.altitude_ellipsoid) for s in samples]
    )
    velocity = np.array([s.velocity for s in samples])
    # Standard deviations of some 900 values lie within 2.4 % (one sigma) of the true ones.
    np.testing.assert_allclose((position - flight.position).std(axis=0), 1.5, rtol=0.1)
    np.testing.assert_allclose((velocity - flight.velocity).std(axis=0), 0.3, rtol=0.1)
    assert (samples[0].horizontal_accuracy, samples[0].speed_accuracy) == (1.5, 0.3)


def test_gap_is_a_silence_of_that_length(tmp_path):
    flight = simulate_flight(80.0, 20.0, 3.0)
    path = tmp_path / "flight.tlog"
    write_tlog(path, flight, latitude=47.4, longitude=8.5, gap=(30.0, 5.0))
    time = np.array([s.time for s in open_log(path)])
    time -= time[0]
    assert not ((time >= 30.0) & (time < 35.0)).any()
    assert len(time) == len(flight.time) - 25
    assert np.diff(time).max() == pytest.approx(5.2)


def test_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path):
    flight = simulate_flight(80.0, 20.0, 1.0)

    def written(seed):
        write_tlog(
            tmp_path / "f", flight, latitude=0.0, longitude=0.2, position_noise=1.0, seed=seed
        )
        return (tmp_path / "f").read_bytes()

    assert written(1) == written(1) != written(2)


def test_nothing_is_left_of_a_log_that_could_not_be_finished(tmp_path, monkeypatch):
    target = tmp_path / "flight.tlog"
    target.write_bytes(b"before")
    flight = simulate_flight(80.0, 20.0, 1.0)
    flight.velocity[50] = 1e9  # does not fit the message: packing it raises
    with pytest.raises(Exception, match=r"short|format"):
        write_tlog(target, flight, latitude=47.4, longitude=8.5)
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


# --- the command --------------------------------------------------------------------------------


def run(*arguments):
    parser = argparse.ArgumentParser()
    command.add_parser(parser.add_subparsers())
    args = parser.parse_args(["simulate", "--config", str(CONFIG), *arguments])
    return args.run(args)


BASIC = ("--radius", "80", "--speed", "20", "--turns", "2")


def test_command_writes_the_flight_it_describes(tmp_path, capsys):
    path = tmp_path / "flight.tlog"
    code = run(
        *BASIC, "--sense", "cw", "--center", "-35.4,149.2", "--height", "321", "--rate", "10",
        "--wind", "5,90", "--gap", "20,3", "--radius-change", "100,1", "--position-noise", "1",
        "--velocity-noise", "0.2", "--seed", "7", "-o", str(path),
    )  # fmt: skip
    assert code == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert str(path) in err
    source = open_log(path)
    samples = list(source)
    assert source.wind == pytest.approx((-5.0, 0.0, 0.0), abs=1e-6)
    assert samples[100].height_above_home == pytest.approx(321, abs=5)
    assert samples[1].time - samples[0].time == pytest.approx(0.1)
    east, north, _ = to_enu(
        Datum(-35.4, 149.2, 0.0, False), samples[150].latitude, samples[150].longitude, 0.0
    )
    assert np.hypot(east, north) < 400
    expected = simulate_flight(
        80.0, 20.0, 2.0, sense=-1, height=321.0, rate=10.0, radius_change=(100.0, 1.0),
        wind=(-5.0 * sin(pi / 2), -5.0 * cos(pi / 2)),
    )  # fmt: skip
    again = tmp_path / "again.tlog"
    write_tlog(
        again, expected, latitude=-35.4, longitude=149.2, position_noise=1.0, velocity_noise=0.2,
        gap=(20.0, 3.0), seed=7,
    )  # fmt: skip
    assert path.read_bytes() == again.read_bytes()


def test_command_notes_a_flight_outside_the_envelope_and_flies_it(tmp_path, capsys):
    path = tmp_path / "flight.tlog"
    assert run("--radius", "150", "--speed", "30", "--turns", "1", "-o", str(path)) == 0
    err = capsys.readouterr().err
    assert "radius 150 m is outside" in err
    assert "speed 30 m/s is outside" in err
    assert path.exists()


def test_height_is_above_the_cable_unless_told_otherwise(tmp_path):
    path = tmp_path / "flight.tlog"
    run(*BASIC, "-o", str(path))
    sample = next(iter(open_log(path)))
    assert sample.height_above_home == pytest.approx(250, abs=0.1)  # the cable has 150 m


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--center", "47.4"), "--center 47.4.*LAT,LON"),
        (("--center", "47.4,8.5,3"), "LAT,LON"),
        (("--center", "91,8.5"), "latitude 91"),
        (("--center", "nan,8.5"), "latitude nan"),
        (("--wind", "5"), "--wind 5.*FROM_DEG"),
        (("--wind", "-5,90"), "--wind -5,90.*negative"),
        (("--wind", "25,90"), "less than the airspeed"),
        (("--wind", "5,nan"), "--wind 5,nan: from nan deg"),
        (("--wind", "5,400"), "--wind 5,400: from 400 deg.* must be 0 to 360"),
        (("--wind", "5,-1"), "from -1 deg"),
        (("--wind", "inf,90"), "must be finite"),
        (("--gap", "a,b"), "--gap a,b.*START,DURATION"),
        (("--gap", "-1,5"), "gap start -1"),
        (("--radius-change", "100"), "RADIUS,AFTER_TURNS"),
        (("--position-noise", "-1"), "position noise -1"),
        (("--velocity-noise", "nan"), "velocity noise nan"),
        (("--seed", "-1"), "seed -1"),
        (("--beacon", "1"), "beacon 1: must be a system id from 2 to 255"),
        (("--beacon", "256"), "beacon 256"),
        (("--beacon", "42", "--beacon-offset", "1,2"), "--beacon-offset 1,2.*3 numbers, E,N,U"),
        (("--beacon", "42", "--beacon-offset", "1,2,nan"), "beacon offset nan"),
        (("--beacon", "42", "--beacon-noise", "-1"), "beacon noise -1"),
        (("--beacon-noise", "1"), "--beacon-noise: only with --beacon"),
        (("-o", "/no/such/folder/flight.tlog"), "/no/such/folder.*No such file"),
    ],
)
def test_command_refuses_what_it_cannot_do_by_name(tmp_path, arguments, said):
    with pytest.raises(InputError, match=said):
        run(*BASIC, "-o", str(tmp_path / "flight.tlog"), *arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_payload_is_simulated_a_piece_at_a_time_so_that_an_interrupt_is_heard(monkeypatch):
    configuration = load_configuration(CONFIG)
    flight = simulate_flight(80.0, 20.0, 1.0, height=250.0)
    parts = []
    pieces = simulate_payload(configuration, flight, tell=parts.append)
    assert len(parts) == -(-len(pieces.time) // 64)
    assert parts[-1] == 1.0

    def interrupt(part):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_payload(configuration, flight, tell=interrupt)
    monkeypatch.setattr(simulated_payload, "_PIECE", len(pieces.time))
    whole = simulate_payload(configuration, flight)
    assert np.array_equal(whole.time, pieces.time)
    np.testing.assert_allclose(pieces.position, whole.position, atol=0.01)
    np.testing.assert_allclose(pieces.velocity, whole.velocity, atol=0.02)


def test_a_beacon_leaves_the_aircrafts_messages_as_they_are_and_tells_the_truth(tmp_path):
    path, plain = tmp_path / "beacon.tlog", tmp_path / "plain.tlog"
    noisy = ("--position-noise", "1", "--turns", "4")
    run(*BASIC, *noisy, "-o", str(plain))
    run(*BASIC, *noisy, "--beacon", "42", "--beacon-offset", "5,-6,7", "-o", str(path))
    samples = list(open_log(path, beacon=BeaconWanted(42)))
    reports = [one.sample for one in samples if isinstance(one, BeaconSample)]
    aircraft = [one for one in samples if not isinstance(one, BeaconSample)]
    assert repr(aircraft) == repr(list(open_log(plain)))
    # Once it has settled the end mass is on the solver's circle, which the cable in time is not
    # made of; at 80 m and 20 m/s nothing of the entry is left after three turns.
    point = flight_point(load_configuration(CONFIG), 80.0, 20.0, 1.225)
    (state,) = steady_states(point.parameters).states
    last = [one for one in reports if 85.0 < one.time - reports[0].time < 110.0]
    home = Datum(47.4, 8.5, 100.0, False)
    enu = np.array([to_enu(home, r.latitude, r.longitude, r.altitude_amsl) for r in last])
    enu -= (5.0, -6.0, 7.0)
    radius = state.end_mass_radius * 80.0
    np.testing.assert_allclose(np.hypot(*enu[:, :2].T), radius, atol=0.15)
    np.testing.assert_allclose(enu[:, 2], 250.0 - state.depth * 80.0, atol=0.15)
    speed = [np.hypot(*one.velocity[:2]) for one in last]
    np.testing.assert_allclose(speed, radius * 20.0 / 80.0, atol=0.1)
