"""Replays of recorded flights: what was flown is found, and each sample is accounted for."""

import json
import re
from functools import cache

import pytest
from replays import recorded, replayed

from ctcbs_ros.replay.text import summary_text
from ctcbs_ros.telemetry.skip_code import SkipCode


@pytest.fixture(scope="module")
def replay_of(drone_table):
    """Function that gives records and summary of a recorded flight, replayed once."""
    return cache(lambda name: replayed(recorded(name), drone_table))


def test_loiter_of_the_simulator_is_found_as_it_was_flown(replay_of):
    records, summary = replay_of("plane_sitl_loiter.tlog")
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
        "plane_sitl_corrupt.tlog", "copter_reboot.tlog",
    ],
)  # fmt: skip
def test_recorded_flight_replays_and_each_skip_is_counted_and_explained(replay_of, name):
    records, summary = replay_of(name)
    used = sum(record["skip"] is None for record in records)
    assert summary["samples"] == len(records) == used + sum(summary["skipped"].values()) > 0
    assert set(summary["skipped"]) <= {code.value for code in SkipCode}
    text = summary_text(summary | {"wall_s": 1.0})
    for code, count in summary["skipped"].items():
        assert re.search(rf"\b{count}  {code} +\w+ \w+", text), text
    for record in records:
        json.dumps(record, allow_nan=False)


def test_wind_of_the_autopilot_that_the_flight_contradicts_is_told_in_the_summary(replay_of):
    # Its WIND says some 7 m/s, and of the direction where it blows to.
    records, summary = replay_of("plane_real_wind.tlog")
    rejected = summary["autopilot_wind_rejected"]
    notes = [r["wind_note"] for r in records if "the autopilot says" in (r.get("wind_note") or "")]
    assert rejected["samples"] == len(notes) > 50
    assert notes[-1].endswith(f"the autopilot says {rejected['newest']}")
    speed, _, _, direction, *_ = rejected["newest"].split()
    assert 5.0 < float(speed) < 9.0
    assert abs(float(direction) - 211.0) < 30.0
    text = summary_text(summary | {"wall_s": 1.0})
    assert f"rejected at {len(notes)} samples, as the flight shows another; at last" in text


def test_summary_of_the_real_flight_has_the_end_mass_downwind_of_its_circle(replay_of):
    (orbit,) = replay_of("plane_real_wind.tlog")[1]["orbits"]
    # The circle is wide and slow, 1.3 turns in gusts: 45 m is what 7 m/s do to a steady one.
    assert 30.0 < orbit["end_mass_downwind_m"] < 75.0
    assert 5.0 < orbit["end_mass_horizontal_std_m"] < 40.0


def test_on_the_real_flight_the_twin_is_where_the_motion_in_the_wind_is(replay_of):
    # The wind told on the way there was the opposite one: what was flown in it is not kept.
    records, _ = replay_of("plane_real_wind.tlog")
    in_wind = [r for r in records if r.get("in_wind_source") and r["wind_source"] == "flight"]
    assert len(in_wind) > 30
    for record in in_wind:
        assert record["simulated_begun_as"] == "periodic motion"
        assert record["simulated_from_predicted_m"] < 0.3 * record["orbit_radius_m"]
