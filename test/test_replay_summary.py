"""Replays through the core: what the summary and the records of a flight hold."""

import json
import os
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from replays import DRONE, ctcbs

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import end_mass_fields, prediction_record
from ctcbs_ros.replay import core
from ctcbs_ros.replay.motion_kind import IN_WIND
from ctcbs_ros.replay.summary import _between
from ctcbs_ros.table import table_for
from ctcbs_ros.telemetry.source import open_log


def test_summary_has_the_keys_that_other_tools_rely_on(drone_log, drone_table):
    done = ctcbs("replay", drone_log, "--config", DRONE, "--table", drone_table, "--json")
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
    done = ctcbs(
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


def test_records_are_json_without_infinities(core_replay):
    for record in core_replay[0]:
        json.dumps(record, allow_nan=False)


def test_figures_that_are_infinite_or_not_known_are_none(drone_log, drone_table):
    configuration = load_configuration(DRONE)
    predictor = Predictor(configuration, table_for(configuration, drone_table))
    valid = next(p for p in map(predictor.update, open_log(drone_log)) if p.valid)
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


def test_python_warnings_do_not_come_up_in_a_replay(drone_log, drone_table, tmp_path):
    environment = os.environ | {"PYTHONWARNINGS": "error::RuntimeWarning"}
    done = ctcbs(
        "replay", drone_log, "--config", DRONE, "--table", drone_table, env=environment
    )
    assert done.returncode == 0, done.stderr


def test_a_loop_between_the_points_remembered_of_it_is_that_of_its_harmonics():
    def loop(points):
        turn = 2.0 * np.pi * np.arange(points) / points
        east = 30.0 + 20.0 * np.cos(turn) + 3.0 * np.sin(2.0 * turn)
        return np.column_stack((east, -7.0 + 19.0 * np.sin(turn) + np.cos(3.0 * turn)))

    assert _between(loop(12)) == pytest.approx(loop(24), abs=1e-9)


def test_the_place_of_an_end_mass_has_its_error_in_still_air_and_where_nobody_knows_the_wind(
    core_replay,
):
    records, summary = core_replay
    (orbit,) = summary["orbits"]
    assert orbit["end_mass_motion"] != IN_WIND
    errors = [
        (record["end_mass_east_std_m"], record["end_mass_north_std_m"])
        for record in records
        if record["valid"] and record["pose_holds"]
    ]
    # Of one sigma along the worse of all directions.
    least = min(max(pair) for pair in errors)
    greatest = max(np.hypot(*pair) for pair in errors)
    assert least <= orbit["end_mass_horizontal_std_m"] * 1.000001
    assert orbit["end_mass_horizontal_std_m"] <= greatest
