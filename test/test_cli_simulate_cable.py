"""`ctcbs simulate-cable`: what it prints and writes, in both systems of units, and bad input."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from points import STRETCHED, design, parameters

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import TOLERANCE
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.telemetry.source import open_log
from ctcbs_ros.telemetry.tow_track import read_tow_track

SHARED = Path(__file__).parents[2] / "shared"
POINT = "--omega 1.6 --length 3 --end-mass 50 --cable-drag 10 --drag-ratio 1 --segments 20"
FLIGHT = "--config config/design_example.yaml --radius 250 --speed 50 --segments 20"


def run(arguments, capsys):
    assert main(["simulate-cable", *arguments.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)["end"]


def test_what_is_printed_says_about_which_axis_and_in_which_axes(capsys):
    drone = "simulate-cable --config config/small_drone.yaml --radius 60 --speed 20 --segments 5"
    assert main(f"{drone} --orbits 1".split()) == 0
    assert "beside the axis" not in capsys.readouterr().out
    assert main(f"{drone} --wind 3,0 --orbits 3 --json".split()) == 0
    x, y, z = json.loads(capsys.readouterr().out)["end"]["mean_position"]
    assert main(f"{drone} --wind 3,0 --orbits 3".split()) == 0
    told = capsys.readouterr().out
    assert "m about the tow circle's axis, from" in told
    assert f"mean     x {x:.5g}, y {y:.5g}, z {z:.5g} m" in told
    assert f"{np.hypot(x, y):.4g} m beside the axis" in told


def test_from_hanging_the_mass_settles_in_the_steady_state(capsys):
    end = run(f"{POINT} --start hanging --orbits 45 --damping 0.005", capsys)
    (state,) = steady_states(parameters(STRETCHED)).states
    assert end["settled"]
    assert end["radius"] == pytest.approx(state.end_mass_radius, abs=1e-3)
    assert end["depth"] == pytest.approx(state.depth, abs=1e-3)
    assert end["phase_lag"] == pytest.approx(state.phase_lag, abs=1e-2)


def test_reeled_out_in_si_the_mass_ends_in_the_steady_state_of_the_new_length(capsys):
    end = run(f"{FLIGHT} --cable-length 700 --reel-to 1000 --reel-rate 3 --orbits 14", capsys)
    # docs/thesis.md: 0.0800 of 250 m at 1000 m of cable
    (state,) = steady_states(parameters(design(250.0))).states
    assert end["radius"] == pytest.approx(250.0 * state.end_mass_radius, abs=0.25)
    assert end["depth"] == pytest.approx(250.0 * state.depth, abs=0.5)


def test_a_wind_of_a_twentieth_moves_the_design_examples_mass_far_downwind(capsys):
    # physics of still air against wind: 2.5 m/s move it by about 0.6 of the tow radius
    end = run(f"{FLIGHT} --wind 2.5,0 --orbits 20", capsys)
    assert end["mean_position"][0] == pytest.approx(0.58 * 250.0, rel=0.1)


def test_a_stretching_cable_near_resonance_goes_upwind(capsys):
    # MoorDyn finds the same (docs/thesis.md); a stiff cable goes downwind
    soft = run(f"{POINT} --wind 0.1,0 --orbits 50 --elasticity 600", capsys)
    stiff = run(f"{POINT} --wind 0.1,0 --orbits 50 --elasticity 60000", capsys)
    assert soft["mean_position"][0] < -0.02
    assert stiff["mean_position"][0] > 0.02


def test_a_rough_entry_misses_a_stable_steady_state(tmp_path, capsys):
    # m 3.5, l 3, f 0.1, d_n 1.33, omega 2.4, gamma 600: steady at 0.32, and stable
    light = "--omega 2.4 --length 3 --end-mass 3.5 --cable-drag 1.33 --drag-ratio 0.1"
    rough = f"{light} --elasticity 600 --segments 15 --orbits 25 --tolerance 1e-3"
    out = tmp_path / "rough.csv"
    end = run(f"{rough} --start hanging -o {out}", capsys)
    assert not end["settled"]
    with open(out, newline="") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    # It is chaotic: where one orbit's extremes lie hangs on the last digit, those of eight do not.
    last = rows[-1]["t"] - 8.0 * 2.0 * np.pi / 2.4
    radius = [np.hypot(row["end_mass_x"], row["end_mass_y"]) for row in rows if row["t"] > last]
    assert 1.1 < min(radius) < 1.5
    assert 2.3 < max(radius) < 2.8
    gentle = run(rough, capsys)
    assert gentle["settled"]
    assert gentle["radius"] == pytest.approx(0.32, abs=0.01)


def test_a_track_is_flown_and_the_csv_tells_where_everything_was(tmp_path, capsys):
    track, out = tmp_path / "track.csv", tmp_path / "out.csv"
    t = np.linspace(0.0, 100.0, 201)
    with open(track, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow("txyz")
        writer.writerows(zip(t, 250.0 + 20.0 * t, 0.0 * t, 500.0 + 0.0 * t, strict=True))
    run(f"{FLIGHT} --track {track} -o {out}", capsys)
    with open(out, newline="") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    assert rows[-1]["t"] == pytest.approx(100.0)
    assert rows[-1]["tow_point_x"] == pytest.approx(2250.0)
    assert rows[-1]["end_mass_x"] < 2000.0  # trails behind
    assert rows[0]["tension_tow_point"] > 9.8


DRONE = "--config config/small_drone.yaml"


@pytest.fixture(scope="module")
def flight_log(tmp_path_factory):
    """Eight turns of 60 m at 20 m/s from a straight entry, with a receiver's noise."""
    file = tmp_path_factory.mktemp("flight") / "flight.tlog"
    noise = "--position-noise 0.5 --velocity-noise 0.1"
    flown = f"simulate {DRONE} --radius 60 --speed 20 --turns 8 {noise} -o {file}"
    assert main(flown.split()) == 0
    return file


def test_towed_along_a_noisy_log_the_mass_settles_in_the_steady_state(
    flight_log, tmp_path, capsys
):
    out = tmp_path / "out.csv"
    end = run(f"{DRONE} --track {flight_log} --to 160 --segments 20 -o {out}", capsys)
    rows = np.genfromtxt(out, delimiter=",", names=True)
    turn = rows[rows["t"] > 160.0 - 2.0 * np.pi * 60.0 / 20.0]
    centre = [np.mean([turn[f"tow_point_{a}"].max(), turn[f"tow_point_{a}"].min()]) for a in "xy"]
    radius = np.hypot(turn["end_mass_x"] - centre[0], turn["end_mass_y"] - centre[1])
    flight = flight_point(load_configuration("config/small_drone.yaml"), 60.0, 20.0, 1.225)
    (state,) = steady_states(flight.parameters).states
    assert radius.mean() == pytest.approx(60.0 * state.end_mass_radius, rel=0.02)
    assert end["greatest_tension"] < 10.0  # 4.5 N at rest: noise does not jerk at the cable


def test_a_log_is_flown_in_its_autopilots_wind(tmp_path, capsys):
    log = SHARED / "flights" / "plane_real_wind.tlog"
    if not log.exists():
        pytest.skip("no recorded flights here")
    few = f"{DRONE} --track {log} --from 905 --to 935 --segments 10"
    blown = run(f"{few} --wind log", capsys)
    calm = run(few, capsys)
    moved = np.subtract(blown["end_mass"], calm["end_mass"])
    assert 5.0 < np.hypot(*moved[:2]) < 150.0


@pytest.mark.parametrize("name", ["plane_sitl_guided_loiter.BIN", "plane_sitl_loiter.tlog"])
def test_any_log_that_replay_reads_is_a_track(name, capsys):
    log = SHARED / "flights" / name
    if not log.exists():
        pytest.skip("no recorded flights here")
    end = run(f"{DRONE} --track {log} --from 20 --to 50 --segments 10", capsys)
    assert 20.0 < end["least_depth"] < end["greatest_depth"] < 152.0


def test_wind_of_a_track_that_tells_none_is_refused_with_what_to_give_instead(tmp_path, capsys):
    track = tmp_path / "track.csv"
    track.write_text("t,x,y,z\n" + "".join(f"{t},{20 * t},0,100\n" for t in range(20)))
    arguments = f"simulate-cable {DRONE} --track {track} --wind log"
    assert main(arguments.split()) == 2
    error = capsys.readouterr().err
    assert f"nobody tells the wind in {track}" in error
    assert "give --wind X,Y" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (f"{POINT} --wind 2,0", "below the tow speed"),
        (f"{POINT} --wind nowhere.csv", "neither X,Y[,Z] nor a file"),
        (f"{POINT} --wind log", "only with a --track"),
        (f"{POINT} --from 3", "only with --track"),
        (f"{POINT} --wind nan,0", "--wind nan,0"),
        (f"{POINT} --reel-to -1 --reel-rate 1", "--reel-to"),
        (f"{POINT} --reel-to 0.001 --reel-rate 1", "at least 0.01 must stay out"),
        (f"{POINT} --reel-to 6 --reel-rate 1000", "--reel-rate: 1000 is not allowed, it must be"),
        (f"{POINT} --reel-to 4", "only together"),
        (f"{POINT} --new-end-mass 0 --new-after 1", "--new-end-mass"),
        (f"{POINT} --track nowhere.csv", "nowhere.csv"),
        (f"{POINT} --radius 3", "only with --config"),
    ],
)
def test_bad_input_is_one_line_and_2(arguments, message, capsys):
    assert main(["simulate-cable", *arguments.split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [(lambda x: x[:10] + x[60:], "a gap"),
     (lambda x: [*x[:10], (5.0, 9e4, 0, 0), *x[11:]], "jump"),
     (lambda x: x[:40] + [(t, x + 60.0, y, z) for t, x, y, z in x[40:]], "a jump after t = 19.5"),
     (lambda x: [*x[:10], x[5], *x[10:]], "times must rise"),
     (lambda x: [*x[:10], (5.0, float("nan"), 0, 0), *x[11:]], "finite"),
     (lambda x: x[:2], "not enough"), (lambda x: [("a", 0, 0, 0)], "numbers")],
)  # fmt: skip
def test_a_track_with_a_gap_or_a_jump_is_refused(change, message, tmp_path, capsys):
    rows = [(0.5 * i, 10.0 * i, 0.0, 0.0) for i in range(100)]
    file = tmp_path / "track.csv"
    with open(file, "w", newline="") as handle:
        csv.writer(handle).writerows([("t", "x", "y", "z"), *change(rows)])
    assert main(["simulate-cable", *FLIGHT.split(), "--track", str(file)]) == 2
    assert message in capsys.readouterr().err


def test_a_log_with_a_gap_or_a_jump_is_flown_beside_it_only(flight_log, tmp_path, capsys):
    whole = read_tow_track(open_log(flight_log)).stretches
    assert len(whole) == 1
    samples = list(open_log(flight_log))
    gap = read_tow_track(s for s in samples if not 60.0 < s.time - samples[0].time < 64.0)
    assert [s.ended_by for s in gap.stretches] == ["a gap of 4.0 s", ""]
    jump = read_tow_track(
        replace(s, latitude=s.latitude + 2e-3 * (s.time - samples[0].time > 60.0)) for s in samples
    )
    assert [s.ended_by for s in jump.stretches] == ["a jump", ""]
    reboot = read_tow_track(
        replace(s, flight=int(s.time - samples[0].time > 60.0)) for s in samples
    )
    assert [s.ended_by for s in reboot.stretches] == ["another flight begins", ""]
    # to the command: a log whose link was lost for 10 s
    file = tmp_path / "gap.tlog"
    lost = f"simulate {DRONE} --radius 60 --speed 20 --turns 3 --gap 30,10 -o {file}"
    assert main(lost.split()) == 0
    track = f"simulate-cable {DRONE} --track {file}"
    assert main(f"{track} --from 10 --to 50".split()) == 2
    assert "a gap of 10" in capsys.readouterr().err
    assert main(f"{track} --segments 5".split()) == 0
    assert "2 stretches without gap or jump" in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"no log", b"a,b\n1,2\n"])
def test_a_track_that_is_neither_log_nor_csv_is_refused(content, tmp_path, capsys):
    file = tmp_path / "track"
    file.write_bytes(content)
    assert main(["simulate-cable", *DRONE.split(), "--track", str(file)]) == 2
    error = capsys.readouterr().err
    assert "no CSV file with a column t" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("command", ["simulate-cable --wind 0.1,0", "entry --from hanging"])
def test_a_motion_that_cannot_be_followed_is_one_line_and_1(command, capsys, monkeypatch):
    monkeypatch.setattr("ctcbs_ros.dynamics.cable.simulate.__defaults__", (TOLERANCE, 20))
    assert main([*command.split(), *POINT.split()]) == 1
    error = capsys.readouterr().err
    assert "cannot be followed past" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    "rough",
    [
        "--wind 0.99,0 --orbits 3", "--new-end-mass 1e-6 --new-after 1 --orbits 2",
        "--tolerance 1e-2 --elasticity 1e7 --start hanging --orbits 2",
    ],
)  # fmt: skip
def test_whatever_is_simulated_stays_finite(rough, tmp_path, capsys):
    out = tmp_path / "out.csv"
    run(f"{POINT} {rough} -o {out}", capsys)
    assert np.all(np.isfinite(np.genfromtxt(out, delimiter=",", skip_header=1)))
