"""What the summary of a replay says in words: warnings, skips, times, wind."""

import re
from math import log

import pytest

from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.replay.motion_kind import IN_WIND, STILL_AIR, UNKNOWN, UNMODELLED
from ctcbs_ros.replay.text import WARNINGS, summary_text
from ctcbs_ros.telemetry.skip_code import SKIPS, SkipCode


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
        (0, "wind is not known; the"), (7, "there is wind, or may be; the"),
        (3, "there is wind, or may be (3), or it is not known (4); the"),
    ],
)  # fmt: skip
def test_text_of_the_summary_tells_wind_that_is_seen_from_wind_that_is_not_known(
    core_replay, seen, said
):
    windy = core_replay[1] | {"wall_s": 1.0, "warnings": {"WIND_UNMODELLED": 7}, "wind_seen": seen}
    assert f"WIND_UNMODELLED     {said} prediction is for still air" in summary_text(windy)


def test_text_of_the_summary_says_which_orbits_were_too_short_to_settle_on(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    assert orbit["start_s"] + orbit["settling_time_s"] <= orbit["settled_at_s"]
    assert orbit["settled_at_s"] <= orbit["start_s"] + orbit["settling_time_s"] + 10.5
    orbits = [orbit | {"settled_at_s": t} for t in (40.0, None)]
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": orbits})
    assert "Left or changed before the end mass counted as settled: orbit 2. It need" in text
    assert "Left or changed" not in summary_text(
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


def test_text_of_the_summary_gives_no_direction_of_a_wind_weaker_than_its_error(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    calm = orbit | {"wind_source": "flight", "wind_speed_m_s": 0.02, "wind_std_m_s": 0.31}
    calm |= {"wind_from_deg": None, "end_mass_motion": STILL_AIR}
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [calm]})
    assert "Wind at the end of orbit 1: 0.0 +- 0.3 m/s, by the flight, not told from none" in text


def test_text_of_the_summary_says_what_is_not_known_and_what_never_comes(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    for changed, told in (
        ({"margin_per_s": None, "settling_time_s": None}, ["not known", "not known"]),
        ({"margin_per_s": -0.02, "settling_time_s": None}, ["-0.0200", "never"]),
        (
            {"margin_per_s": None, "settling_time_s": None, "end_mass_radius_m": None,
             "end_mass_depth_m": None},
            ["none"] * 4,
        ),
    ):  # fmt: skip
        text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [orbit | changed]})
        row = next(line for line in text.splitlines() if line.startswith("    1  "))
        assert " ".join(row.split()).endswith(" ".join(told))


def test_text_of_the_summary_tells_where_the_end_mass_is_in_wind(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    windy = orbit | {
        "wind_source": "flight", "wind_speed_m_s": 7.0, "wind_std_m_s": 0.5,
        "wind_from_deg": 359.7,
        "end_mass_motion": IN_WIND,
        "wind_unmodelled_share": 0.25, "end_mass_least_depth_m": 80.2,
        "end_mass_greatest_depth_m": 145.4, "end_mass_lowest_above_home_m": 61.0,
        "end_mass_downwind_m": 55.2, "end_mass_crosswind_m": -27.4,
        "end_mass_horizontal_std_m": 9.1, "end_mass_excursion_m": 47.0,
    }  # fmt: skip
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [windy]})
    place = "about a place 55 m downwind and 27 m to the right (as one looks downwind) of"
    assert f"{place} the circle's centre" in text
    assert "up to 47 m from there, 80 to 145 m below the circle, lowest 61 m above" in text
    assert "; +- 9 m (1 sigma, along the worse horizontal axis)" in text
    assert "7.0 +- 0.5 m/s from 0 deg" in text
    row = next(line for line in text.splitlines() if line.startswith("    1  "))
    assert "in wind, see below" in row
    assert "In 25 % of the predictions on orbit 1 the motion in its wind was not known" in text


def in_wind(core_replay, **changed):
    """Text of a flight with one orbit, in wind."""
    (orbit,) = core_replay[1]["orbits"]
    windy = {
        "end_mass_motion": IN_WIND, "margin_of": "wind", "end_mass_least_depth_m": 80.2,
        "end_mass_greatest_depth_m": 145.4, "end_mass_downwind_m": None,
        "end_mass_crosswind_m": None, "end_mass_east_m": 0.2, "end_mass_north_m": -0.4,
        "end_mass_horizontal_std_m": 9.1, "end_mass_excursion_m": 47.0,
        "wind_source": "flight", "wind_speed_m_s": 1.0, "wind_std_m_s": 2.0,
    }  # fmt: skip
    return summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [orbit | windy | changed]})


def test_text_of_the_summary_tells_no_way_off_the_centre_of_less_than_a_metre(core_replay):
    assert "orbit 1 about the circle's centre, up to 47 m from there" in in_wind(core_replay)
    assert "about a place 3 m west of the circle's centre, up" in in_wind(
        core_replay, end_mass_east_m=-3.0
    )
    looked = "about a place 5 m upwind (as one looks downwind) of the circle's centre"
    assert looked in in_wind(
        core_replay, end_mass_downwind_m=-5.0, end_mass_crosswind_m=0.4
    )


def test_text_of_the_summary_tells_one_depth_where_the_least_and_greatest_are_alike(core_replay):
    assert ", 80 to 145 m below the circle" in in_wind(core_replay)
    level = in_wind(core_replay, end_mass_greatest_depth_m=80.4)
    assert "from there, 80 m below the circle" in level


def test_text_of_the_summary_tells_a_margin_not_known_yet_from_one_not_known(core_replay):
    yet = "the motion in the wind is on orbit 1 was not known yet when it was left."
    not_known = "How stable the motion in the wind is on orbit 1 is not known."
    for margin_of, told, untold in (
        ("not known yet", yet, not_known), ("not known", not_known, yet),
    ):  # fmt: skip
        text = in_wind(core_replay, margin_of=margin_of)
        assert told in text
        assert untold not in text
    assert "How stable the motion" not in in_wind(core_replay)


@pytest.mark.parametrize(
    ("motion", "told"),
    [(UNKNOWN, "most of it by the wind that nobody knows"), (STILL_AIR, "orbit's and the wind's")],
)
def test_text_of_the_summary_says_how_well_an_end_mass_in_still_air_is_known(
    core_replay, motion, told
):
    (orbit,) = core_replay[1]["orbits"]
    still = orbit | {"end_mass_motion": motion, "end_mass_horizontal_std_m": 48.6}
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "orbits": [still]})
    (line,) = [line for line in text.splitlines() if line.startswith("End mass of orbit 1, ")]
    assert "+- 49 m (1 sigma, along the worse horizontal axis)" in line
    assert told in line


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


def test_text_of_the_summary_counts_one_and_many(core_replay):
    link = core_replay[1]["link"] | {"lost": 1, "bad_bytes": 2, "bad_runs": 1}
    link["time_steps"] = {"reboot": 1, "wrap": 2}
    text = summary_text(core_replay[1] | {"wall_s": 1.0, "link": link})
    assert "; 1 message lost, 2 damaged bytes in 1 place, " in text
    assert "2 wraps of the vehicle's clock, 1 reboot\n" in text


def test_text_of_the_summary_names_who_else_sent_positions(core_replay):
    others = {"other_positions": 12, "other_systems": {"1": 2, "42": 10}}
    summary = core_replay[1] | {"wall_s": 1.0, "link": core_replay[1]["link"] | others}
    assert summary["vehicle"]["system"] == 1
    told = "12 positions of other vehicles (system 1, 42"
    hint = "; if it is the payload's beacon, set beacon.system_id: 42)\n"
    assert told + hint in summary_text(summary)
    of_itself = summary["link"] | {"other_positions": 2, "other_systems": {"1": 2}}
    assert "2 positions of other vehicles (system 1)\n" in summary_text(
        summary | {"link": of_itself}
    )


def test_text_of_the_summary_tells_where_and_when_the_look_ahead_has_it_settled(core_replay):
    (orbit,) = core_replay[1]["orbits"]
    at = orbit["ahead_settles_at_s"]
    assert orbit["start_s"] < at < orbit["end_s"]
    # It is not looked up in the prediction: the cable in time comes there by itself, to 5 % of a.
    for name in ("radius", "depth"):
        predicted = orbit[f"end_mass_{name}_m"]
        assert orbit[f"ahead_{name}_m"] == pytest.approx(predicted, abs=0.05 * 60.0)
    assert abs(complex(orbit["ahead_east_m"], orbit["ahead_north_m"])) < 0.05 * 60.0
    summary = core_replay[1] | {"wall_s": 1.0}
    told = f"settles from {at:.0f} s on, {orbit['ahead_radius_m']:.0f} m around "
    assert f"{told}the circle's centre, " in summary_text(summary)
    assert orbit["start_s"] < orbit["ahead_told_at_s"] < at
    aside = orbit | {"ahead_east_m": -7.0, "ahead_north_m": 2.0}
    place = "a place 7 m west and 2 m north of the circle's centre, "
    assert told + place in summary_text(summary | {"orbits": [aside]})
    left = orbit | {"end_s": at - 1.0}
    assert "(had the circle been flown on)" in summary_text(summary | {"orbits": [left]})
    below = orbit | {
        "end_mass_motion": IN_WIND, "end_mass_lowest_above_home_m": -7.0,
        **dict.fromkeys(
            ("end_mass_downwind_m", "end_mass_crosswind_m", "end_mass_excursion_m",
             "end_mass_least_depth_m", "end_mass_greatest_depth_m", "end_mass_horizontal_std_m"),
            1.0,
        ),
    }  # fmt: skip
    assert "lowest 7 m BELOW home" in summary_text(summary | {"orbits": [below]})


def test_text_of_the_summary_tells_predictions_that_belong_to_no_orbit(core_replay):
    summary = core_replay[1] | {"wall_s": 1.0}
    assert summary["predictions_outside_orbits"] == 0
    assert "elsewhere in the flight" not in summary_text(summary)
    outside = {"predictions_outside_orbits": 6, "outside_orbits_s": [71.2, 80.9]}
    told = "Some 6 predictions are of arcs elsewhere in the flight, from 71 s to 81 s, too short"
    assert told in summary_text(summary | outside)
