"""Replays through the core: records, summary, tables, plots and files."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from math import inf, log, nan
from pathlib import Path

import numpy as np
import pytest
from processes import LIMIT, read_to_end, read_until, start_on_terminal
from replays import replayed
from sample_flights import orbiting, samples_of

from ctcbs_ros import plots
from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import SetWind, load_configuration
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import end_mass_fields, prediction_record
from ctcbs_ros.replay import core
from ctcbs_ros.replay.folder import complete_folder
from ctcbs_ros.replay.motion_kind import IN_WIND, UNKNOWN, UNMODELLED
from ctcbs_ros.replay.summary import Summary
from ctcbs_ros.replay.tables import (
    PREDICTION_COLUMNS,
    PREDICTIONS,
    SAMPLE_COLUMNS,
    SAMPLES,
    ReplayTables,
)
from ctcbs_ros.replay.text import SKIPS, WARNINGS, summary_text
from ctcbs_ros.table import table_for
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.source import open_log

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"
PLOTS = {"track.png", "margin.png", "end_mass.png"}


@pytest.fixture(scope="module")
def out(drone_log, drone_table, tmp_path_factory):
    """Folder of results of the command, and what it printed."""
    folder = tmp_path_factory.mktemp("replay") / "made" / "out"
    command = ["replay", drone_log, "--config", DRONE, "--table", drone_table, "--out", folder]
    done = run(*command)
    assert done.returncode == 0, done.stderr
    return folder, done


def run(*arguments, **options):
    """`ctcbs` in a process of its own."""
    command = [sys.executable, "-m", "ctcbs_ros", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, **options)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


# --- summary ------------------------------------------------------------------------------------


def test_summary_has_the_keys_that_other_tools_rely_on(drone_log, drone_table):
    done = run("replay", drone_log, "--config", DRONE, "--table", drone_table, "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout, parse_constant=pytest.fail)
    assert {"samples", "predictions", "skipped", "warnings", "orbits", "wall_s"} <= set(summary)
    (orbit,) = summary["orbits"]
    assert {
        "start_s", "end_s", "turns", "radius_m", "speed_m_s", "sense", "center",
        "end_mass_radius_m", "end_mass_depth_m", "margin_per_s", "wind_speed_m_s",
        "wind_from_deg", "wind_source", "end_mass_downwind_m", "end_mass_crosswind_m",
        "end_mass_horizontal_std_m", "end_mass_excursion_m", "end_mass_motion",
        "wind_unmodelled_share", "end_mass_loop_m",
    } <= set(orbit)  # fmt: skip
    assert "replay" in done.stderr  # the progress


def test_orbit_of_the_summary_is_the_one_simulated(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    # drone_log of conftest.py: 2.5 turns, 60 m, 20 m/s, clockwise, about 47.4, 8.5
    assert orbit["turns"] == pytest.approx(2.5, abs=0.3)
    assert orbit["radius_m"] == pytest.approx(60.0, abs=0.6)
    assert orbit["speed_m_s"] == pytest.approx(20.0, abs=0.2)
    assert orbit["sense"] == "cw"
    assert orbit["center"] == pytest.approx([47.4, 8.5], abs=1e-5)
    assert orbit["end_s"] - orbit["start_s"] == pytest.approx(
        orbit["turns"] * 2 * np.pi * 60.0 / 20.0, rel=0.05
    )


def test_end_mass_of_an_orbit_is_the_steady_state_of_its_own_radius_and_speed(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    done = run(
        "steady", "--config", DRONE, "--radius", orbit["radius_m"],
        "--speed", orbit["speed_m_s"], "--json",
    )  # fmt: skip
    (solution,) = json.loads(done.stdout)["solutions"]
    assert solution["si"]["end_mass_radius_m"] == pytest.approx(orbit["end_mass_radius_m"])
    assert solution["si"]["depth_m"] == pytest.approx(orbit["end_mass_depth_m"])
    assert -solution["si"]["growth_rate_per_s"] == pytest.approx(orbit["margin_per_s"])


def test_samples_are_those_used_and_those_skipped(core_replay):
    records, summary = core_replay
    assert summary["samples"] == len(records) == sum(1 for _ in records)
    used = sum(record["skip"] is None for record in records)
    assert summary["samples"] == used + sum(summary["skipped"].values())
    assert summary["predictions"] == sum(record["valid"] for record in records)
    for code, count in summary["warnings"].items():
        having = [r for r in records if code in {w["code"] for w in r["warnings"]}]
        assert count == len(having)


def test_nothing_is_predicted_on_the_straight_legs(core_replay):
    records, summary = core_replay
    (orbit,) = summary["orbits"]
    start = records[0]["vehicle_time_s"]
    for record in records:
        if record["valid"]:
            # a quarter of a turn, 4.7 s, may pass until the end is seen
            assert orbit["start_s"] <= record["vehicle_time_s"] - start <= orbit["end_s"] + 4.8


def test_text_of_the_summary_explains_each_warning_and_each_skip(core_replay):
    summary = core_replay[1] | {"wall_s": 1.0, "skipped": {"JUMP": 3, "BAD_FIX": 11}}
    text = summary_text(summary)
    assert "clockwise" in text
    for code in [*summary["warnings"], *summary["skipped"]]:
        assert re.search(rf"\d+  {code} +\w+ \w+", text), text


def test_every_code_has_an_explanation():
    assert set(SKIPS) == set(SkipCode)
    assert set(WARNINGS) == set(WarningCode)


def test_text_of_a_flight_without_orbit_says_so(core_replay):
    nothing = core_replay[1] | {"wall_s": 1.0, "orbits": [], "skipped": {}, "warnings": {}}
    assert "No orbit of 0.9 turns or more was flown; the predictions are of shorter arcs." in (
        summary_text(nothing)
    )
    assert "turns or more was flown." in summary_text(nothing | {"predictions": 0})


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (0, "wind is not known; the"), (7, "there is wind; the"),
        (3, "there is wind (3), or it is not known (4); the"),
    ],
)  # fmt: skip
def test_text_of_the_summary_tells_wind_that_is_seen_from_wind_that_is_not_known(
    core_replay, seen, said
):
    windy = core_replay[1] | {"wall_s": 1.0, "warnings": {"WIND_UNMODELLED": 7}, "wind_seen": seen}
    assert f"WIND_UNMODELLED     {said} prediction is for still air" in summary_text(windy)


def test_text_of_the_summary_says_which_orbits_were_too_short_to_settle_on(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    flown = orbit["end_s"] - orbit["start_s"]
    orbits = [orbit | {"settling_time_s": t} for t in (flown - 1.0, flown + 1.0, None)]
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": orbits})
    assert "Left before the end mass had settled: orbits 2, 3. It need" in text
    assert "Left before" not in summary_text(
        core_replay[1] | {"wall_s": 1.0, "orbits": orbits[:1]}
    )
    assert orbit["settling_time_s"] == pytest.approx(log(20.0) / orbit["margin_per_s"])


def test_text_of_the_summary_says_what_its_seconds_are(core_replay):
    records, summary = core_replay
    first = next(record for record in records if record["skip"] is None)
    assert summary["start"] == {key: first[key] for key in ("vehicle_time_s", "stamp_ns")}
    text = summary_text(summary | {"wall_s": 1.0})
    told = f"the first believed sample, at {first['vehicle_time_s']:.1f} s of the vehicle's clock."
    assert told in text
    assert "From, to: where the track came onto the circle and left it" in text
    nothing = summary | {"wall_s": 1.0, "start": {"vehicle_time_s": None, "stamp_ns": None}}
    assert "first believed sample" not in summary_text(nothing)


@pytest.mark.parametrize(
    ("skipped", "warned", "told"),
    [
        ({"JUMP": 2, "DUPLICATE": 5}, 2, "a position was not believed\n"),
        ({"JUMP": 2}, 3, "a position was not believed (2), or used after a step, with the orbit"),
        ({"DUPLICATE": 5}, 1, "a position was used after a step, with the orbit begun anew (1)"),
    ],
)
def test_text_of_the_summary_tells_positions_not_believed_from_those_after_a_step(
    core_replay, skipped, warned, told
):
    summary = core_replay[1] | {"wall_s": 1.0, "skipped": skipped, "warnings": {"BAD_FIX": warned}}
    assert f"{warned}  BAD_FIX             {told}" in summary_text(summary)


def test_wind_of_the_autopilot_that_the_flight_contradicts_is_told_in_the_summary(drone_table):
    # Its WIND says some 7 m/s, and of the direction where it blows to.
    records, summary = replayed(flight("plane_real_wind.tlog"), drone_table)
    rejected = summary["autopilot_wind_rejected"]
    notes = [r["wind_note"] for r in records if "the autopilot says" in (r.get("wind_note") or "")]
    assert rejected["samples"] == len(notes) > 100
    assert notes[-1].endswith(f"the autopilot says {rejected['newest']}")
    speed, _, _, direction, *_ = rejected["newest"].split()
    assert 5.0 < float(speed) < 9.0
    assert abs(float(direction) - 211.0) < 30.0
    text = summary_text(summary | {"wall_s": 1.0})
    assert f"rejected at {len(notes)} samples, as the flight shows another; at last" in text


def test_text_of_the_summary_gives_no_direction_of_a_wind_weaker_than_its_error(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    calm = orbit | {"wind_source": "flight", "wind_speed_m_s": 0.02, "wind_from_deg": None}
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [calm]})
    assert "Wind at the end of orbit 1: 0.0 m/s, by the flight" in text


def test_text_of_the_summary_tells_where_the_end_mass_is_in_wind(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    windy = orbit | {
        "wind_source": "flight", "wind_speed_m_s": 7.0, "wind_from_deg": 359.7,
        "end_mass_motion": IN_WIND,
        "wind_unmodelled_share": 0.25, "end_mass_least_depth_m": 80.2,
        "end_mass_greatest_depth_m": 145.4, "end_mass_lowest_above_home_m": 61.0,
        "end_mass_downwind_m": 55.2, "end_mass_crosswind_m": -27.4,
        "end_mass_horizontal_std_m": 9.1, "end_mass_excursion_m": 47.0,
    }  # fmt: skip
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [windy]})
    assert "about a place 55 m downwind and 27 m to the right of the circle's centre" in text
    assert "up to 47 m from there, 80 to 145 m below the circle, lowest 61 m above" in text
    assert "; +- 9 m" in text
    assert "7.0 m/s from 0 deg" in text
    row = next(line for line in text.splitlines() if line.startswith("    1  "))
    assert "in wind, see below" in row
    assert "In 25% of the predictions on orbit 1 the motion in its wind was not known" in text


@pytest.mark.parametrize(
    ("motion", "told"),
    [
        (UNKNOWN, "Nobody knew the wind on orbit 1"),
        (UNMODELLED, "In brackets: figures of still air, which do not hold on orbit 1"),
    ],
)
def test_text_of_the_summary_marks_figures_of_still_air(core_replay, motion, told):
    (orbit,) = core_replay[1]["orbits"]
    text = summary_text(
        core_replay[1] | {"wall_s": 1.0, "orbits": [orbit | {"end_mass_motion": motion}]}
    )
    assert told in text
    row = next(line for line in text.splitlines() if line.startswith("    1  "))
    assert (f"({orbit['end_mass_radius_m']:.2f})" in row) == (motion == UNMODELLED)


@pytest.fixture(scope="module")
def windy(tmp_path_factory):
    """Predictions, tables and summary of a turn in a wind of 3 m/s from the west."""
    configuration = replace(
        load_configuration("small_drone"), wind=SetWind(speed=3.0, from_direction=270.0)
    )
    predictor = Predictor(configuration, with_twin=False)
    summary, folder = Summary(predictor), tmp_path_factory.mktemp("windy")
    tables, predictions = ReplayTables(folder), []
    for sample in samples_of(orbiting(radius=70.0, turns=1.4, wind=(3.0, 0.0))):
        predictions.append(predictor.update(sample))
        summary.add(predictions[-1])
        tables.add(prediction_record(predictions[-1]))
    tables.close()
    return predictions, folder, summary.finish()


def test_summary_and_pictures_of_a_windy_flight_have_the_path_of_the_end_mass_in_wind(windy):
    predictions, folder, summary = windy
    (orbit,) = summary["orbits"]
    assert orbit["end_mass_motion"] == IN_WIND
    assert orbit["wind_unmodelled_share"] < 0.1
    newest = [p for p in predictions if p.pose_holds][-1]
    path = newest.end_mass.in_wind.path - newest.orbit.center
    loop = np.array(orbit["end_mass_loop_m"])
    # The summary's is at most 5 s older: the same loop, begun elsewhere.
    apart = np.linalg.norm(loop[:, None] - path[None, :, :2], axis=2)
    assert apart.min(axis=1).max() < 0.06 * 70.0
    mean = path.mean(axis=0)
    assert np.hypot(*mean[:2]) > 10.0
    assert orbit["end_mass_east_m"] == pytest.approx(orbit["end_mass_downwind_m"], abs=0.01)
    assert orbit["end_mass_north_m"] == pytest.approx(orbit["end_mass_crosswind_m"], abs=0.01)
    assert [orbit["end_mass_east_m"], orbit["end_mass_north_m"]] == pytest.approx(
        mean[:2], abs=2.0
    )
    assert orbit["end_mass_greatest_depth_m"] == pytest.approx(-path[:, 2].min(), abs=2.0)

    table, samples = plots._read(folder / PREDICTIONS), plots._read(folder / SAMPLES)
    axes = plots.track_figure(table, samples, summary["orbits"]).axes[0]
    circle, drawn = axes.lines[-2:]
    center = [np.mean(line.get_xydata()[:-1], axis=0) for line in (circle, drawn)]
    assert center[1] - center[0] == pytest.approx(loop.mean(axis=0), abs=1.5)
    distance = plots.end_mass_figure(table, samples).axes[0].lines[-1].get_ydata()
    off = np.hypot(*(newest.end_mass.position - newest.orbit.center)[:2])
    assert distance[-1] == pytest.approx(off)


def test_pictures_set_apart_what_does_not_hold_and_what_holds_without_wind(windy):
    _, folder, summary = windy
    table, samples = plots._read(folder / PREDICTIONS), plots._read(folder / SAMPLES)
    half = len(table["time_s"]) // 2
    table["pose_holds"][:half] = ["False"] * half
    table["wind_source"][half:] = [""] * (len(table["time_s"]) - half)
    for figure in (
        plots.track_figure(table, samples, summary["orbits"]),
        plots.end_mass_figure(table, samples),
    ):
        shown = {line.get_label(): line for line in figure.axes[0].lines}
        (wrong,) = [line for label, line in shown.items() if "not for the wind" in label]
        (guessed,) = [line for label, line in shown.items() if "without wind" in label]
        assert np.isfinite(wrong.get_ydata()).sum() == half
        assert np.isfinite(guessed.get_ydata()).sum() == len(table["time_s"]) - half
        assert not [line for line in shown.values() if line.get_color() == plots.MASS]


def test_summary_of_the_real_flight_has_the_end_mass_downwind_of_its_circle():
    from pathlib import Path

    from ctcbs_ros.replay.core import replay_through_core

    log = Path(__file__).parents[2] / "shared/flights/plane_real_wind.tlog"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    predictor = Predictor(load_configuration("small_drone"))
    summary = replay_through_core(open_log(log), predictor, 0.0, lambda record, progress: None)
    (orbit,) = summary["orbits"]
    # The circle is wide and slow, 1.3 turns in gusts: 45 m is what 7 m/s do to a steady one.
    assert 30.0 < orbit["end_mass_downwind_m"] < 75.0
    assert 5.0 < orbit["end_mass_horizontal_std_m"] < 30.0


def test_text_of_the_summary_counts_one_and_many(core_replay):
    link = core_replay[1]["link"] | {"lost": 1, "bad_bytes": 2, "bad_runs": 1}
    link["time_steps"] = {"reboot": 1, "wrap": 2}
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "link": link})
    assert "; 1 message lost, 2 damaged bytes in 1 place, " in text
    assert "2 wraps of the vehicle's clock, 1 reboot\n" in text


# --- records ------------------------------------------------------------------------------------


def test_records_are_json_without_infinities(core_replay):
    for record in core_replay[0]:
        json.dumps(record, allow_nan=False)


def test_figures_that_are_infinite_or_not_known_are_none(drone_log, drone_table):
    configuration = load_configuration(DRONE)
    predictor = Predictor(configuration, table_for(configuration, drone_table))
    valid = next(p for p in map(predictor.update, open_log(drone_log)) if p.valid)
    from dataclasses import replace

    end_mass = replace(
        valid.end_mass, settling_time=inf, height_above_home=nan,
        jump_in_speed=Jump(30.0, 0.5, nan),
    )  # fmt: skip
    fields = end_mass_fields(end_mass)
    assert fields["settling_time_s"] is None
    assert fields["end_mass_height_above_home_m"] is None
    assert fields["jump_speed_m_s"] == 30.0
    assert fields["jump_speed_landing_radius_m"] is None
    assert prediction_record(valid)["stamp_ns"] == valid.stamp_ns


# --- files --------------------------------------------------------------------------------------


def test_results_are_the_tables_summary_and_plots_and_nothing_else(out):
    folder, done = out
    names = {path.name for path in folder.iterdir()}
    assert names == {"predictions.csv", "samples.csv", "summary.json"} | PLOTS
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    assert str(folder) in done.stderr


def test_tables_hold_every_prediction_and_every_sample(out, core_replay):
    folder, records = out[0], core_replay[0]
    predictions, samples = rows(folder / "predictions.csv"), rows(folder / "samples.csv")
    assert tuple(predictions[0]) == PREDICTION_COLUMNS
    assert tuple(samples[0]) == SAMPLE_COLUMNS
    assert len(samples) == len(records)
    valid = [record for record in records if record["valid"]]
    assert [int(row["stamp_ns"]) for row in predictions] == [r["stamp_ns"] for r in valid]
    for row, record in zip(predictions, valid, strict=True):
        # Two processes: where one of them compiled its kernels anew, the last digit may differ.
        for name in ("end_mass_east_m", "end_mass_latitude_deg", "margin_per_s"):
            assert float(row[name]) == pytest.approx(record[name], rel=1e-11)
    assert float(predictions[0]["time_s"]) == pytest.approx(
        valid[0]["vehicle_time_s"] - records[0]["vehicle_time_s"]
    )


def test_every_figure_of_a_record_has_its_column(core_replay):
    valid = next(record for record in core_replay[0] if record["valid"])
    assert set(valid) - set(PREDICTION_COLUMNS) == {"skip", "valid", "other_solutions"}
    added = {"time_s", "other_end_mass_radii_m"}
    assert set(PREDICTION_COLUMNS) - set(valid) == added


def test_plots_are_drawn(out):
    from matplotlib.image import imread

    for name in PLOTS:
        image = imread(out[0] / name)
        assert min(image.shape[:2]) > 500
        assert np.ptp(image[..., :3]) > 0.5  # something is on it
        for edge in (image[:5], image[-5:], image[:, :5], image[:, -5:]):
            assert (edge == 1.0).all()  # and nothing is cut


def test_summary_file_is_the_summary(out, core_replay):
    summary = json.loads((out[0] / "summary.json").read_text())
    assert summary.pop("wall_s") > 0.0
    assert summary == json.loads(json.dumps(core_replay[1]))


def test_folder_is_left_as_it_was_where_the_work_fails(tmp_path):
    folder = tmp_path / "new" / "out"

    def fail(draft):
        (draft / "predictions.csv").write_text("half a")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), complete_folder(folder) as draft:
        fail(draft)
    assert list(tmp_path.iterdir()) == []

    folder.mkdir(parents=True)
    (folder / "predictions.csv").write_text("old")
    with pytest.raises(KeyboardInterrupt), complete_folder(folder) as draft:
        fail(draft)
    assert [path.read_text() for path in folder.iterdir()] == ["old"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_replay_leaves_no_files_and_no_traceback(
    tmp_path, drone_log, drone_table, number
):
    command = [sys.executable, "-m", "ctcbs_ros", "replay", drone_log, "--config", DRONE]
    command += ["--table", drone_table, "--rate", "1", "--out", tmp_path / "out"]
    process, terminal = start_on_terminal(command)
    read_until(terminal, r"replay: +[1-9]\d* %")
    assert list(tmp_path.glob("out/.*/samples.csv"))
    process.send_signal(number)
    errors = read_to_end(terminal)
    assert process.wait(LIMIT) == 128 + number
    said = f"interrupted, nothing was written to {tmp_path / 'out'}"
    if number == signal.SIGTERM:
        said = "terminated (SIGTERM)"
    assert errors.splitlines()[-1] == f"ctcbs: {said}"
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


# --- pictures -----------------------------------------------------------------------------------


def table_of(names, rows=()):
    return {name: [str(row.get(name, "")) for row in rows] for name in names}


def shown(figure, directory):
    """The figure drawn, which is what gives its parts their places."""
    figure.savefig(directory / "figure.png")
    return figure


def test_orbits_of_the_track_are_told_apart_by_their_colours(tmp_path):
    orbits = [
        {"turns": 2.0, "radius_m": 60.0 + i, "end_mass_radius_m": 30.0, "start_s": 10 * i,
         "end_s": 10 * i + 9}
        for i in range(8)
    ]  # fmt: skip
    rows = [
        {"time_s": t, "orbit_center_east_m": 100.0 * (t // 10), "orbit_center_north_m": 0.0}
        for t in range(80)
    ]
    predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
    figure = shown(plots.track_figure(predictions, samples, orbits), tmp_path)
    lines = figure.axes[0].lines
    colors = [line.get_color() for line in lines if str(line.get_label()).startswith("orbit ")]
    assert len(set(colors)) == 8
    others = {plots.TOW, plots.MASS, plots.REST, plots.BEACON_COLOR}
    assert not set(colors) & others


@pytest.mark.parametrize(
    ("rows", "why"), [([], "the log has no sample"), ([{"skip": "BAD_FIX"}], "no sample was")]
)
def test_of_a_log_without_believed_samples_no_picture_is_drawn_and_why_is_told(
    rows, why, tmp_path
):
    for name, columns, content in (
        (PREDICTIONS, PREDICTION_COLUMNS, []), (SAMPLES, SAMPLE_COLUMNS, rows),
    ):  # fmt: skip
        with open(tmp_path / name, "w", newline="") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(content)
    limits = load_configuration(DRONE).limits
    assert plots.write_plots(tmp_path, [], limits, "flight").startswith(why)
    assert not list(tmp_path.glob("*.png"))


def test_legend_of_the_track_lies_inside_the_picture_with_as_many_orbits_as_are_drawn(tmp_path):
    orbits = [
        {"turns": 112.34, "radius_m": 1000.0 + i, "end_mass_radius_m": 1000.12, "start_s": 10 * i,
         "end_s": 10 * i + 9}
        for i in range(10)
    ]  # fmt: skip
    rows = [
        {"time_s": t, "orbit_center_east_m": 0.0, "orbit_center_north_m": 0.0} for t in range(100)
    ]
    predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
    figure = shown(plots.track_figure(predictions, samples, orbits), tmp_path)
    (legend,) = figure.legends
    assert len(legend.texts) == 3 + plots.MOST_ORBITS
    place = legend.get_window_extent()
    assert figure.bbox.x0 <= place.x0
    assert place.x1 <= figure.bbox.x1
    assert figure.bbox.y0 <= place.y0
    assert place.y1 < figure.axes[0].get_window_extent().y0


def test_pictures_of_a_flight_without_a_prediction_say_so(tmp_path):
    rows = [{"time_s": t} for t in range(100)]
    predictions, samples = table_of(PREDICTION_COLUMNS), table_of(SAMPLE_COLUMNS, rows)
    figure = shown(plots.end_mass_figure(predictions, samples), tmp_path)
    assert [[t.get_text() for t in axes.texts] for axes in figure.axes] == [["no prediction"]] * 3
    limits = load_configuration(DRONE).limits
    figure = shown(plots.margin_figure(predictions, samples, limits), tmp_path)
    assert [t.get_text() for t in figure.axes[1].texts] == ["no prediction"]


def test_jumps_by_radius_alone_are_drawn_and_none_is_said_to_be_none_of_either(tmp_path):
    limits = load_configuration(DRONE).limits
    for jump, shown_as in ((-0.07, "of the tow radius, at this speed"), ("", None)):
        rows = [
            {"time_s": t, "margin_per_s": 0.1, "jump_radius_relative": jump} for t in range(100)
        ]
        predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
        axes = shown(plots.margin_figure(predictions, samples, limits), tmp_path).axes[1]
        if shown_as:
            (line,) = [line for line in axes.lines if line.get_label() == shown_as]
            assert line.get_ydata() == pytest.approx(-7.0)
        else:
            assert "no change of speed or tow radius" in axes.texts[0].get_text()


def test_what_is_predicted_before_the_end_mass_has_settled_is_drawn_fainter(tmp_path):
    rows = [
        {"time_s": t, "end_mass_radius_m": 30.0 + 0.01 * (t % 2), "end_mass_depth_m": 100.0,
         "end_mass_height_above_home_m": 50.0 + 0.1 * (t % 2), "settled": t > 40,
         "pose_holds": True, "wind_source": "flight", "orbit_center_east_m": 5.0,
         "orbit_center_north_m": 0.0, "orbit_center_up_m": 160.0, "end_mass_east_m": 35.0,
         "end_mass_north_m": 0.01 * (t % 2), "end_mass_up_m": 60.0}
        for t in range(100)
    ]  # fmt: skip
    predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
    figure = shown(plots.end_mass_figure(predictions, samples), tmp_path)
    settled, settling = figure.axes[0].lines
    assert settled.get_label() == "predicted, settled"
    assert np.isfinite(settled.get_ydata()).sum() == 59
    assert np.isfinite(settling.get_ydata()).sum() == 41
    assert settling.get_alpha() < settled.get_alpha()
    # Noise is not blown up to fill the picture.
    assert figure.axes[0].get_ylim()[0] == 0.0
    low, high = figure.axes[2].get_ylim()
    assert high - low >= plots.LEAST_SPAN


# --- bad input ----------------------------------------------------------------------------------


@pytest.fixture
def refused(tmp_path, capsys, monkeypatch):
    """Function that runs `ctcbs replay` and returns its one line on standard error."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def refusal(*arguments):
        assert main(["replay", *map(str, arguments)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("ctcbs: error: ")
        assert not (tmp_path / "cache").exists(), "a table was built first"
        return line

    return refusal


def test_absent_log_is_refused_before_a_table_is_built(refused, tmp_path):
    assert "absent.tlog" in refused(tmp_path / "absent.tlog", "--config", DRONE)


@pytest.mark.parametrize("content", [b"", b"no message in here\n" * 500, bytes(10_000)])
def test_log_without_a_message_is_refused_before_a_table_is_built(refused, tmp_path, content):
    (tmp_path / "noise.tlog").write_bytes(content)
    assert "noise.tlog" in refused(tmp_path / "noise.tlog", "--config", DRONE)


def test_absent_configuration_is_refused(refused, drone_log, tmp_path):
    assert "absent.yaml" in refused(drone_log, "--config", tmp_path / "absent.yaml")


def test_table_of_another_configuration_is_refused(refused, drone_log, drone_table, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(DRONE.read_text().replace("length: 150.0", "length: 140.0"))
    line = refused(drone_log, "--config", other, "--table", drone_table)
    assert str(drone_table) in line


def test_folder_that_cannot_be_made_is_refused(refused, drone_log, drone_table, tmp_path):
    (tmp_path / "file").write_text("in the way")
    line = refused(
        drone_log, "--config", DRONE, "--table", drone_table, "--out", tmp_path / "file" / "out"
    )
    assert str(tmp_path / "file" / "out") in line


@pytest.mark.parametrize("rate", ["-1", "nan", "inf", "fast"])
def test_rate_that_is_none_is_refused(capsys, drone_log, rate):
    with pytest.raises(SystemExit) as error:
        main(["replay", str(drone_log), "--config", str(DRONE), f"--rate={rate}"])
    assert error.value.code == 2
    assert "--rate" in capsys.readouterr().err


def test_rate_paces_the_replay(monkeypatch, drone_log, drone_table):
    class Clock:
        """A clock that only sleep moves on, and the delay of 0.5 s after the tenth sample."""

        now = 100.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += seconds

    clock, times = Clock(), []
    monkeypatch.setattr(core, "time", clock)

    def take(record, progress):
        times.append((record["vehicle_time_s"], clock.now))
        clock.now += 0.5 if len(times) == 10 else 0.0

    configuration = load_configuration(DRONE)
    predictor = Predictor(configuration, table_for(configuration, drone_table))
    core.replay_through_core(open_log(drone_log), predictor, 20.0, take)
    flown, shown = (np.array(times) - (times[0][0], 100.0)).T
    due = flown / 20.0
    due[10:] = np.maximum(due[10:], shown[9] + 0.5)  # what is late is made up for
    assert np.sum(due > flown / 20.0) > 20
    assert shown == pytest.approx(due, abs=1e-9)


# --- recorded flights ---------------------------------------------------------------------------


def flight(name):
    path = FLIGHTS / name
    if not path.is_file():
        pytest.skip(f"recorded flight not here: {path}")
    return path


def test_loiter_of_the_simulator_is_found_as_it_was_flown(drone_table):
    records, summary = replayed(flight("plane_sitl_loiter.tlog"), drone_table)
    (orbit,) = summary["orbits"]
    # shared/flights/README.md: 2 turns clockwise, 102.5 m, 23.2 m/s
    assert orbit["turns"] >= 1.8
    assert orbit["radius_m"] == pytest.approx(102.5, abs=0.5)
    assert orbit["speed_m_s"] == pytest.approx(23.2, abs=0.3)
    assert orbit["sense"] == "cw"
    start_up = [r for r in records if r["skip"] in ("BAD_FIX", "ZERO_POSITION")]
    assert start_up
    assert records.index(start_up[-1]) < len(start_up)  # the first ones, and no other


@pytest.mark.parametrize(
    "name",
    [
        "plane_sitl_guided_loiter.BIN", "plane_real_wind.tlog", "copter_two_sessions.tlog",
        "plane_sitl_corrupt.tlog",
    ],
)  # fmt: skip
def test_recorded_flight_replays_and_accounts_for_each_sample(drone_table, name):
    records, summary = replayed(flight(name), drone_table)
    used = sum(record["skip"] is None for record in records)
    assert summary["samples"] == len(records) == used + sum(summary["skipped"].values()) > 0
    assert set(summary["skipped"]) <= {code.value for code in SkipCode}
    assert summary_text(summary | {"wall_s": 1.0})
    for record in records:
        json.dumps(record, allow_nan=False)


def test_python_warnings_do_not_come_up_in_a_replay(drone_log, drone_table, tmp_path):
    environment = os.environ | {"PYTHONWARNINGS": "error::RuntimeWarning"}
    done = run(
        "replay", drone_log, "--config", DRONE, "--table", drone_table, env=environment
    )
    assert done.returncode == 0, done.stderr
