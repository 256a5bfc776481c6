"""Planned entries: how they are flown, which state they end in, and `ctcbs entry`."""

import json
import re
from math import atan
from pathlib import Path

import numpy as np
import pytest
from points import design, figure_4_1, parameters

from ctcbs_ros.cli.main import main
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.entry import enter
from ctcbs_ros.dynamics.equilibrium import equilibrium, trailing
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.manoeuvre import (
    changing_radius,
    changing_speed,
    from_straight,
    hanging_below,
    paying_out,
)
from ctcbs_ros.dynamics.signal import linear, sampled
from ctcbs_ros.solver.steady_state import steady_states

DESIGN = parameters(design(250.0))
# stable at 0.32, and a rough entry misses it
LIGHT = parameters({**figure_4_1(1.33, 2.4), "gamma": 600.0})
FLIGHT = "config/design_example.yaml --radius 250 --speed 50 --segments 15"


def flown(manoeuvre, first, last):
    """Times, speeds and curvatures of a way in, by differences."""
    t = np.linspace(first, last, 20001)
    velocity = np.gradient(manoeuvre.place(t), t, axis=0)[2:-2]
    speed = np.linalg.norm(velocity, axis=1)
    turned = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    return t[4:-4], speed[2:-2], np.gradient(turned, t[2:-2])[2:-2] / speed[2:-2]


def test_from_straight_the_bank_rises_at_its_rate_up_to_that_of_the_circle():
    way = from_straight(DESIGN, 0.2)
    t, speed, curvature = flown(way, 0.0, way.duration + 7.0)
    assert speed == pytest.approx(1.0, abs=1e-5)
    bank = np.arctan(DESIGN.omega**2 * curvature)  # of a turn without slip, V^2/(a g) = omega^2
    assert bank == pytest.approx(np.minimum(0.2 * t, atan(DESIGN.omega**2)), abs=1e-3)
    circle = way.place(t[t > way.duration])
    assert np.hypot(*circle[:, :2].T) == pytest.approx(1.0, abs=1e-9)


def test_changes_of_speed_and_radius_are_flown_at_their_rates():
    t, speed, curvature = flown(changing_speed(DESIGN, 0.8, 0.1), -3.0, 8.0)
    assert speed == pytest.approx(np.clip(0.8 + 0.1 * t, 0.8, 1.0), abs=1e-4)
    assert curvature == pytest.approx(1.0, abs=1e-4)
    for radius in (1.5, 0.7):
        way = changing_radius(DESIGN, radius, 0.1)
        t, speed, _ = flown(way, -3.0, 8.0)
        away = np.abs(t - 0.0) + np.abs(t - way.duration)
        assert speed[away > way.duration + 0.01] == pytest.approx(1.0, abs=1e-5)
        size = np.hypot(*way.place(t)[:, :2].T)
        slope = 0.1 * np.sign(1.0 - radius)
        assert size == pytest.approx(radius + slope * np.clip(t, 0.0, way.duration), abs=1e-9)


def test_paying_out_never_exceeds_its_rate():
    way = paying_out(DESIGN, 1.0, 0.2)
    t = np.linspace(0.0, way.duration, 2001)
    rate = np.gradient(way.length(t)[:, 0], t)
    assert rate.max() == pytest.approx(0.2, rel=1e-4)
    assert way.length(np.array([0.0, way.duration, 99.0]))[:, 0] == pytest.approx([1.0, 4.0, 4.0])


@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (0.1, 0.2, 0.0)])
def test_a_cable_towed_straight_rests_where_the_motion_in_time_leaves_it(wind):
    line = line_of(DESIGN)
    rest = trailing(line, 10, (0.0, 0.0, 0.0), (0.6, 0.0, 0.0), wind)
    tow = linear([-1.0, 60.0], [[-0.6, 0.0, 0.0], [36.0, 0.0, 0.0]])
    driven = drive(line, tow, linear([-1.0, 60.0], [wind, wind]))
    end = simulate(line, driven, rest, [50.0]).positions[0]
    assert end - end[-1] == pytest.approx(rest.positions, abs=1e-6)
    # at the mass the cable goes along weight and drag of the mass and half a segment
    u = np.array([0.6, 0.0, 0.0]) - wind
    pull = line.end_drag * np.linalg.norm(u) * u + [0.0, 0.0, line.end_weight]
    first = rest.positions[1] - rest.positions[0]
    assert np.cross(pull, first) == pytest.approx(0.0, abs=0.02 * np.linalg.norm(pull))


@pytest.mark.parametrize("segments", [15, pytest.param(40, marks=pytest.mark.slow)])
def test_a_rough_entry_ends_oscillating_though_the_steady_state_is_stable(segments):
    # physics: between about 1.1 and 2.8 instead of at 0.32
    found = enter(LIGHT, hanging_below(LIGHT), segments=segments)
    assert found.outcome == "oscillating"
    assert found.least_radius == pytest.approx(1.1, abs=0.2)
    assert found.greatest_radius == pytest.approx(2.8, abs=0.3)
    assert np.isnan(found.settling_time)
    (missed,) = found.states
    assert missed.end_mass_radius == pytest.approx(0.32, abs=0.005)
    assert missed.stable
    assert not missed.reached


def test_a_gentle_entry_reaches_the_same_state():
    found = enter(LIGHT, changing_speed(LIGHT, 0.99, 1e-3), segments=15)
    assert found.outcome == "steady"
    assert found.states[0].reached
    assert found.least_radius == pytest.approx(0.32, abs=0.01)


def test_settled_is_within_5_percent_of_the_steady_state_for_good():
    # the same flight simulated by hand, against the solver's state
    (state,) = steady_states(DESIGN).states
    way = changing_speed(DESIGN, 0.6, 0.02)
    found = enter(DESIGN, way, segments=40)
    slow = steady_states(parameters({**design(250.0), "omega": 0.6 * DESIGN.omega})).states[0]
    start = equilibrium(slow, 40)
    start.velocities[:] *= 0.6
    times = np.linspace(0.0, 60.0, 6001)
    line = line_of(DESIGN)
    driven = drive(line, sampled(way.place, 0.0, 60.0, 0.02))
    motion = simulate(line, driven, start, times)
    top, end = motion.positions[:, -1], motion.positions[:, 0]
    behind = np.arctan2(top[:, 1], top[:, 0]) - state.phase_lag
    there = state.end_mass_radius * np.stack([np.cos(behind), np.sin(behind)])
    away = np.linalg.norm(end - np.stack([*there, 0.0 * behind - state.depth], axis=1), axis=1)
    settled = times[np.flatnonzero(away > 0.05)[-1]]
    assert found.outcome == "steady"
    assert found.settling_time == pytest.approx(settled, abs=0.15)
    lowest = end[times <= found.simulated_time, 2].min()
    assert found.lowest == pytest.approx(lowest, abs=1e-3)


def command(arguments, capsys):
    assert main(["entry", *arguments.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_way_in_ends_in_the_steady_state_of_the_design_example(capsys):
    (state,) = steady_states(DESIGN).states
    ways = (
        "straight --bank-rate 10", "deploy --deployed 50 --reel-rate 8",
        "speed --from-speed 35 --acceleration 1", "radius --from-radius 400 --radius-rate 3",
        "hanging",
    )  # fmt: skip
    for way in ways:
        found = command(f"{FLIGHT} --from {way}", capsys)
        assert found["outcome"] == "steady"
        assert found["state"]["end_mass_radius"] == pytest.approx(250.0 * state.end_mass_radius)
        assert found["least_radius"] == pytest.approx(20.0, abs=1.0)
        assert 0.0 < found["settling_time"] < found["simulated_time"]
        assert found["lowest_height"] < -250.0 * state.depth


def test_deploying_in_wind_ends_about_where_the_wind_holds_the_mass(capsys):
    found = command(f"{FLIGHT} --from deploy --deployed 300 --reel-rate 8 --wind 2.5,0", capsys)
    assert found["outcome"] == "periodic"
    flight = FLIGHT.replace("config/", "--config config/", 1)
    arguments = f"simulate-cable {flight} --wind 2.5,0 --orbits 20 --json"
    assert main(arguments.split()) == 0
    settled = json.loads(capsys.readouterr().out)["end"]["mean_position"]
    assert found["mean_position"] == pytest.approx(settled, abs=2.0)


def test_what_an_entry_breaks_is_said(capsys):
    drone = "config/small_drone.yaml --radius 60 --speed 20 --segments 10 --from straight"
    low = command(f"{drone} --height 140", capsys)
    assert low["warnings"] == ["GROUND_PROXIMITY"]
    assert low["warnings_told"] == [
        f"GROUND_PROXIMITY: end mass {low['lowest_height']:.0f} m above the ground "
        "(limit 20 m above)"
    ]
    assert low["bank"] == pytest.approx(atan(20.0**2 / (60.0 * 9.80665)), rel=1e-3)
    found = command(f"{drone} --height 300", capsys)
    assert found["warnings"] == []
    assert found["lowest_height"] == pytest.approx(300.0 - 117.0, abs=20.0)


def test_outside_the_envelope_and_above_the_tension_limit_is_said_with_figures(tmp_path, capsys):
    text = Path("config/small_drone.yaml").read_text()
    weak = re.sub(r"breaking_tension: [\d.]+", "breaking_tension: 10.0", text)
    assert weak != text
    (tmp_path / "weak.yaml").write_text(weak)
    entry = f"entry {tmp_path}/weak.yaml --radius 60 --speed 40 --from hanging --segments 5"
    assert main(f"{entry} --orbits 2".split()) == 0
    told = capsys.readouterr().out
    assert "OUTSIDE_ENVELOPE: speed 40.0 m/s is outside 12 to 28 m/s" in told
    assert re.search(r"TENSION_LIMIT: tension [\d.]+ N is above .*the breaking tension 10 N", told)
    assert re.search(r"UNSTABLE: (the end mass keeps|nothing has settled in the [\d.]+ s)", told)
    assert "the circle takes a bank of 69.8 deg" in told  # atan(40^2/(60 g))


def test_help_says_what_the_wind_is_and_has_no_doubled_signs(capsys):
    for name, said in (
        ("entry", "velocity of the air [m/s with CONFIG"), ("periodic", "a fraction"),
        ("simulate", "direction that it blows from [deg"), ("simulate-cable", "towards +x"),
    ):  # fmt: skip
        with pytest.raises(SystemExit):
            main([name, "--help"])
        told = " ".join(capsys.readouterr().out.split())
        assert said in told
        assert "%%" not in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("config/small_drone.yaml --radius 60 --speed 200 --from hanging", "bank of 89 deg"),
        ("config/small_drone.yaml --radius 0.06 --speed 20 --from hanging", "at most 80 deg"),
        (f"{FLIGHT} --from radius --from-radius 20 --radius-rate 3", "radius 20 m at speed 50"),
        (f"{FLIGHT} --from speed --from-speed 150 --acceleration 1", "speed 150 m/s: needs a"),
        (f"{FLIGHT} --from deploy --reel-rate 5", "--deployed: needed"),
        (f"{FLIGHT} --from straight --reel-rate 5", "--reel-rate: not with"),
        (f"{FLIGHT} --from speed --from-speed 50 --acceleration 1", "nothing changes"),
        (f"{FLIGHT} --from speed --from-speed nan --acceleration 1", "--from-speed: nan"),
        (f"{FLIGHT} --from radius --from-radius 400 --radius-rate 60", "below 1"),
        (f"{FLIGHT} --from hanging --wind 60,0", "below the tow speed"),
        (f"{FLIGHT} --from hanging --wind nan,0", "--wind nan,0"),
        ("--from hanging", "missing: --omega"),
        ("nowhere.yaml --radius 250 --speed 50 --from hanging", "nowhere.yaml"),
    ],
)
def test_bad_input_is_one_line_and_2(arguments, message, capsys):
    assert main(["entry", *arguments.split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_what_is_printed_names_the_state_and_what_was_missed(capsys):
    light = "--omega 2.4 --length 3 --end-mass 3.5 --cable-drag 1.33 --drag-ratio 0.1"
    assert main(f"entry {light} --from hanging --segments 10 --orbits 2".split()) == 0
    text = capsys.readouterr().out
    assert "NOT settled" in text
    assert "stable, but missed" in text
    assert main(f"entry {FLIGHT} --from hanging".split()) == 0
    assert "ends in the steady state of radius 19.99" in capsys.readouterr().out
