"""Pictures of a replay: colours, legends, what is not known, each by its drawn parts."""

import csv

import numpy as np
import pytest
from replays import DRONE

from ctcbs_ros import plots
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.replay.tables import (
    BEACON_COLUMNS,
    PREDICTION_COLUMNS,
    PREDICTIONS,
    SAMPLE_COLUMNS,
    SAMPLES,
)


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
    assert len(legend.texts) == 2 + plots.MOST_ORBITS
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
    for axes in figure.axes[:2]:
        assert [t.get_text() for t in axes.texts] == ["no prediction"]


def test_a_margin_that_is_never_known_is_said_to_be_not_known(tmp_path):
    limits = load_configuration(DRONE).limits
    for margin, said in (("", ["not known"]), (0.1, [])):
        rows = [{"time_s": t, "margin_per_s": margin} for t in range(100)]
        predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
        axes = shown(plots.margin_figure(predictions, samples, limits), tmp_path).axes[0]
        assert [text.get_text() for text in axes.texts] == said


def test_margins_are_drawn_over_the_time_of_the_predictions_and_warnings_over_the_log(tmp_path):
    limits = load_configuration(DRONE).limits
    samples = table_of(SAMPLE_COLUMNS, [{"time_s": t} for t in range(1000)])
    rows = [{"time_s": t, "margin_per_s": 0.1} for t in range(940, 960)]
    margin, jump, strip = shown(
        plots.margin_figure(table_of(PREDICTION_COLUMNS, rows), samples, limits), tmp_path
    ).axes
    for axes in (margin, jump):
        assert 930.0 < axes.get_xlim()[0] < 940.0
        assert 959.0 < axes.get_xlim()[1] < 970.0
    assert strip.get_xlim() == (0.0, 999.0)
    assert [text.get_text() for text in strip.get_legend().texts] == ["time of the panels above"]
    none = plots.margin_figure(table_of(PREDICTION_COLUMNS), samples, limits)
    assert shown(none, tmp_path).axes[0].get_xlim() == (0.0, 999.0)


def test_no_line_goes_through_the_words_in_the_place_of_a_margin(tmp_path):
    limits = load_configuration(DRONE).limits
    samples = table_of(SAMPLE_COLUMNS, [{"time_s": t} for t in range(100)])
    unknown = table_of(PREDICTION_COLUMNS, [{"time_s": t} for t in range(100)])
    for predictions in (unknown, table_of(PREDICTION_COLUMNS)):
        margin = shown(plots.margin_figure(predictions, samples, limits), tmp_path).axes[0]
        (text,) = margin.texts
        assert not any(
            text.get_window_extent().overlaps(line.get_window_extent())
            for line in margin.lines if np.isfinite(line.get_ydata()).any()
        )


def test_the_legend_of_the_track_tells_how_well_the_end_masss_place_is_known(tmp_path):
    orbit = {
        "turns": 2.0, "radius_m": 60.0, "end_mass_radius_m": 30.123, "end_mass_motion": "unknown",
        "end_mass_horizontal_std_m": 48.6,
    }  # fmt: skip
    figure = plots._figure(5.0, 5.0)
    axes = figure.subplots()
    plots._draw_orbit(axes, 1, orbit, 0.0, 0.0, "black")
    (label,) = [str(line.get_label()) for line in axes.lines if "orbit 1" in str(line.get_label())]
    assert "end mass 30.12 m" in label
    assert label.endswith(", its place +- 49 m")


def test_legend_of_the_end_mass_lies_below_its_curves(tmp_path):
    rows = [
        {"time_s": t, "end_mass_east_m": 30.0, "end_mass_north_m": 0.0, "end_mass_up_m": -90.0,
         "orbit_center_east_m": 0.0, "orbit_center_north_m": 0.0, "orbit_center_up_m": 0.0,
         "settled": True, "pose_holds": True, "wind_source": "flight"}
        for t in range(100)
    ]  # fmt: skip
    predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
    figure = shown(plots.end_mass_figure(predictions, samples), tmp_path)
    (legend,) = figure.legends
    assert legend.get_window_extent().y1 < figure.axes[-1].get_window_extent().y0


def test_the_band_of_the_beacon_is_in_the_legend_only_where_it_is_drawn(tmp_path):
    for outcome, band in (("settled", True), ("settling", False)):
        rows = [
            {"time_s": t, "outcome": outcome, "measured_minus_predicted_east_m": 1.0,
             "measured_minus_predicted_east_std_m": 2.0}
            for t in range(50)
        ]  # fmt: skip
        figure = plots.beacon_figure(
            table_of(BEACON_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
        )
        shown(figure, tmp_path)
        assert any("95 %" in text.get_text() for text in figure.legends[0].texts) is band


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


def test_the_track_says_settled_only_of_what_has_settled(tmp_path):
    for last, told in ((100, {"where it will settle"}), (50, {"where it will settle", "settled"})):
        rows = [
            {"time_s": t, "settled": t > last, "pose_holds": True, "wind_source": "flight",
             "end_mass_east_m": t, "end_mass_north_m": 0.0, "tow_point_east_m": 0.0,
             "tow_point_north_m": t}
            for t in range(100)
        ]  # fmt: skip
        predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
        axes = shown(plots.track_figure(predictions, samples, []), tmp_path).axes[0]
        labels = [str(line.get_label()).partition("end mass, ")[2] for line in axes.lines]
        assert {label for label in labels if label} == told


def test_no_legend_of_the_margins_lies_on_a_curve(tmp_path):
    rows = [
        {"time_s": t, "margin_per_s": 0.1 * (t % 9), "jump_speed_relative": 0.05 * (t % 7)}
        for t in range(100)
    ]
    predictions, samples = table_of(PREDICTION_COLUMNS, rows), table_of(SAMPLE_COLUMNS, rows)
    limits = load_configuration(DRONE).limits
    figure = shown(plots.margin_figure(predictions, samples, limits), tmp_path)
    for axes in figure.axes[:2]:
        place = axes.get_legend().get_window_extent()
        # It touches its own panel's edge from above, by its frame's padding.
        assert not any(place.padded(-3.0).overlaps(one.get_window_extent()) for one in figure.axes)
