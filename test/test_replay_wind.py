"""Replays of a flight in wind: where summary and pictures have the end mass then."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from sample_flights import orbiting, samples_of

from ctcbs_ros import plots
from ctcbs_ros.configuration import SetWind, load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import prediction_record
from ctcbs_ros.replay.moments import Moments
from ctcbs_ros.replay.motion_kind import IN_WIND
from ctcbs_ros.replay.summary import Summary
from ctcbs_ros.replay.tables import (
    PREDICTIONS,
    SAMPLES,
    ReplayTables,
)


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


def test_summary_of_a_windy_flight_has_the_path_of_the_end_mass_in_wind(windy):
    predictions, _, summary = windy
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


def test_pictures_of_a_windy_flight_have_the_path_of_the_end_mass_in_wind(windy):
    predictions, folder, summary = windy
    newest = [p for p in predictions if p.pose_holds][-1]
    loop = np.array(summary["orbits"][0]["end_mass_loop_m"])
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
    for axis in ("east", "north", "up"):
        table[f"end_mass_{axis}_m"][:half] = [""] * half  # a place that does not hold is not told
    still = [float(cell) for cell in table["end_mass_radius_m"][:half]]
    for figure, places in (
        (plots.track_figure(table, samples, summary["orbits"]), False),
        (plots.end_mass_figure(table, samples), True),
    ):
        shown = {line.get_label(): line for line in figure.axes[0].lines}
        wrong = [line for label, line in shown.items() if "not for the wind" in label]
        assert len(wrong) == places
        if places:
            drawn = wrong[0].get_ydata()
            assert drawn[np.isfinite(drawn)] == pytest.approx(still)
        (guessed,) = [line for label, line in shown.items() if "without wind" in label]
        assert np.isfinite(guessed.get_ydata()).sum() == len(table["time_s"]) - half
        assert not [line for line in shown.values() if line.get_color() == plots.MASS]


def spread_over(hours, windy):
    """The valid predictions of the flight again and again, one in 5 s."""
    valid = [prediction for prediction in windy[0] if prediction.valid]
    times = np.arange(0.0, 3600.0 * hours, 5.0)
    return [replace(valid[i % len(valid)], time=time) for i, time in enumerate(times)]


def test_a_flight_longer_than_the_memory_is_remembered_as_a_whole(windy):
    moments, flown = Moments(most=64), spread_over(2.0, windy)
    for prediction in flown:
        moments.add(prediction)
    kept = moments.all
    assert 32 <= len(kept) <= 64
    assert kept["count"].sum() == len(flown)
    assert kept["not_modelled"].sum() == sum(not p.pose_holds for p in flown)
    assert np.all(np.diff(kept["time"]) > 0.0)
    assert kept["time"][0] < 120.0
    assert flown[-1].time - kept["time"][-1] < 240.0
    # of 720 ten seconds, 16 in turn share one, and of those that which knows most
    most = max(kept["worth"])
    assert np.mean(kept["worth"] == most) > 0.9
    assert len(moments.between(kept["time"][3], kept["time"][5])) == 3


def test_what_is_remembered_takes_no_memory_that_it_had_not_at_first(windy):
    moments, flown = Moments(), spread_over(1.0, windy)
    moments.add(flown[0])
    tracemalloc.start()
    for prediction in flown[1:]:
        moments.add(prediction)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(moments.all) == pytest.approx(360, abs=2)
    assert grown < 2000


def test_what_came_after_a_time_stamp_that_was_wrong_is_forgotten(windy):
    moments, flown = Moments(), spread_over(0.1, windy)
    for prediction in flown:
        moments.add(prediction)
    moments.forget_after(100.0)
    assert moments.all["time"][-1] <= 100.0
    moments.add(replace(flown[-1], time=101.0))
    assert moments.all["time"][-1] == 101.0
