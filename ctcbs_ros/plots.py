"""Plots of a replay, from its tables: track, margins with warnings, end mass against time."""

import csv
from math import nan, pi
from pathlib import Path
from typing import Any

import numpy as np

from ctcbs_ros.configuration import WarningLimits
from ctcbs_ros.replay.motion_kind import UNKNOWN, UNMODELLED
from ctcbs_ros.replay.tables import BEACON, PREDICTIONS, SAMPLES

TRACK, MARGIN, END_MASS = "track.png", "margin.png", "end_mass.png"
MEASURED = "beacon.png"
MOST_ROWS = 20_000  # drawn of a table; a longer one is thinned
LEAST_GAP = 3.0  # usual steps without a row that interrupt a line
LEAST_SPAN = 10.0  # m of an axis of heights, so that decimetres do not look like a change
SETTLING = 0.45  # opacity of what is predicted before the end mass has had time to settle
TICK = 0.004  # part of the flight that a single warning is drawn as, at least

BEACON_COLOR = "tab:green"
TOW, MASS, OTHER, REST, LIMIT = "tab:blue", "tab:orange", "0.6", "0.75", "tab:red"
# What is predicted for still air where nobody knows the wind, and where there is one in which the
# motion is not known.
IF_STILL = {"color": "goldenrod", "linestyle": (0, (1, 1))}
NOT_TO_USE = {"color": "0.45", "linestyle": (0, (4, 2)), "linewidth": 1.0}
# Of the orbits, told apart from those above and from each other.
ORBITS = (
    "black", "tab:red", "tab:purple", "tab:brown", "deeppink", "tab:olive", "darkturquoise",
    "navy",
)  # fmt: skip
MOST_ORBITS = len(ORBITS)  # drawn as circles, the longest
BLAND = ("NOT_ORBITING",)  # a state of the flight rather than a danger
GRAVE = ("NO_SOLUTION", "JUMPED", "UNSTABLE", "STALE_TELEMETRY", "GROUND_PROXIMITY")

Table = dict[str, list[str]]


def write_plots(
    folder: Path, orbits: list[dict[str, Any]], limits: WarningLimits, title: str
) -> str:
    """Draw the plots of a replay beside its tables.

    Parameters
    ----------
    folder : Path
        Where predictions.csv and samples.csv are, and track.png, margin.png and end_mass.png go;
        with a beacon.csv also beacon.png.
    orbits : list of dict
        Of the summary.
    limits : WarningLimits
        Drawn as lines.
    title : str
        Name of the flight.

    Returns
    -------
    str
        Why none is drawn; empty where they are.
    """
    predictions, samples = _read(folder / PREDICTIONS), _read(folder / SAMPLES)
    if not np.isfinite(_column(samples, "time_s")).any():
        return "no sample was believed" if samples["time_s"] else "the log has no sample"
    beacon = _read(folder / BEACON) if (folder / BEACON).exists() else None
    figures = [
        (TRACK, track_figure(predictions, samples, orbits, beacon)),
        (MARGIN, margin_figure(predictions, samples, limits)),
        (END_MASS, end_mass_figure(predictions, samples)),
    ]
    if beacon is not None:
        figures.append((MEASURED, beacon_figure(beacon, samples)))
    for name, figure in figures:
        figure.suptitle(title)
        figure.savefig(folder / name, dpi=120)
    return ""


def track_figure(
    predictions: Table, samples: Table, orbits: list[dict[str, Any]], beacon: Table | None = None
):
    """East and north of tow point and end mass, with the circles of each orbit."""
    longest = sorted(orbits, key=lambda orbit: -orbit["turns"])[:MOST_ORBITS]
    figure = _figure(8.0, 7.4 + 0.2 * (len(longest) + 3) / 2)
    axes = figure.subplots()
    time = _column(samples, "time_s")
    axes.plot(
        *_broken(
            time, _column(samples, "tow_point_east_m"), _column(samples, "tow_point_north_m")
        )[1:],
        color=REST, linewidth=1.0, label="tow aircraft",
    )  # fmt: skip
    time = _column(predictions, "time_s")
    known, guessed, wrong = _wind_modelled(predictions)
    settled = _settled(predictions)
    settling = {"color": MASS, "alpha": SETTLING}
    for name, where, style, label in (
        ("tow_point", known | guessed | wrong, {"color": TOW}, "tow aircraft, with a prediction"),
        ("end_mass", guessed, IF_STILL, "end mass, where it will settle without wind (not known)"),
        ("end_mass", known & ~settled, settling, "end mass, where it will settle"),
        ("end_mass", known & settled, {"color": MASS}, "end mass, settled"),
    ):
        if np.count_nonzero(where) < 2:  # is no line
            continue
        east, north = (
            np.where(where, _column(predictions, f"{name}_{axis}_m"), nan)
            for axis in ("east", "north")
        )
        axes.plot(*_broken(time, east, north)[1:], **({"linewidth": 1.2} | style), label=label)
    if beacon is not None:
        measured = [_column(beacon, f"measured_{axis}_m") for axis in ("east", "north")]
        axes.plot(
            *measured, ".", markersize=1.5, color=BEACON_COLOR, label="end mass, by its beacon"
        )
    colors = iter(ORBITS)
    for number, orbit in enumerate(orbits, 1):
        during = (time >= orbit["start_s"]) & (time <= orbit["end_s"])
        if orbit in longest and during.any():
            east = np.median(_column(predictions, "orbit_center_east_m")[during])
            north = np.median(_column(predictions, "orbit_center_north_m")[during])
            _draw_orbit(axes, number, orbit, east, north, next(colors))
    _label_once(axes)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize="small")
    return figure


def margin_figure(predictions: Table, samples: Table, limits: WarningLimits):
    """Stability margin, changes that lead to a jump, and when each warning stood, against time."""
    codes = _warning_codes(samples)
    figure = _figure(10.0, 5.5 + 0.25 * len(codes))
    time = _column(predictions, "time_s")
    jumps = [
        (relative, label, color)
        for name, label, color in (
            ("jump_speed_relative", "of the speed, at this radius", TOW),
            ("jump_radius_relative", "of the tow radius, at this speed", MASS),
        )
        if np.isfinite(relative := _column(predictions, name)).any()
    ]
    margin, jump, strip = figure.subplots(
        3, height_ratios=(3.0, 2.0 if jumps else 0.3, 0.4 + 0.35 * len(codes))
    )
    jump.sharex(margin)
    margin.tick_params(labelbottom=False)
    decay = _column(predictions, "margin_per_s")
    margin.plot(*_broken(time, decay), color=MASS)
    margin.set_ylabel("decay rate of the\nleast damped mode [1/s]")
    if np.isfinite(decay).any():
        margin.axhline(0.0, color="black", linewidth=0.8)
        margin.axhline(
            limits.low_margin_per_s, color=LIMIT, linestyle="--", linewidth=1.0,
            label="limit of LOW_MARGIN",
        )  # fmt: skip
        _legend_above(margin)
    else:
        _say_instead(margin, "not known" if len(time) else "no prediction")

    if jumps:
        jump.set_ylabel("change that leads\nto a jump [%]")
        for relative, label, color in jumps:
            jump.plot(*_broken(time, 100.0 * relative), color=color, label=label)
        for sign in (-1.0, 1.0):
            jump.axhline(
                sign * 100.0 * limits.near_jump, color=LIMIT, linestyle="--", linewidth=1.0,
                label="limit of NEAR_JUMP" if sign > 0 else None,
            )  # fmt: skip
        _legend_above(jump)
    else:
        nothing = "in still air no change of speed or tow radius in reach makes the end mass jump"
        _say_instead(jump, nothing if len(time) else "no prediction")

    _draw_warnings(strip, samples, codes)
    if len(time) > 1:  # above, of a long flight with a short turn the turn
        _show_span(margin, time)
        strip.axvspan(*margin.get_xlim(), color=MASS, alpha=0.12, label="time of the panels above")
        _legend_above(strip)
    else:
        margin.set_xlim(strip.get_xlim())
    jump.set_xlabel("time from the first believed sample [s]")
    strip.set_xlabel("time from the first believed sample [s], whole log")
    for axes in (margin, jump, strip):
        axes.grid(alpha=0.3)
    return figure


def end_mass_figure(predictions: Table, samples: Table):
    """Distance from the circle's centre, depth and height of the end mass against time.

    In the motion predicted, in wind that in the wind. What is predicted for still air where the
    wind is not known stands apart, and so does the state in still air where the motion in the
    wind is not known.
    """
    figure = _figure(10.0, 7.4)
    radius, depth, height = figure.subplots(3, sharex=True)
    time = _column(predictions, "time_s")
    others = [
        (moment, float(other))
        for moment, cell in zip(time, predictions["other_end_mass_radii_m"], strict=True)
        for other in cell.split(";")
        if other
    ]
    if others:
        radius.plot(
            *np.array(others).T, ".", markersize=2, color=OTHER,
            label="other steady states, in still air",
        )
    settled = _settled(predictions)
    holds, guessed, wrong = _wind_modelled(predictions)
    east, north, up = (
        _column(predictions, f"end_mass_{axis}_m")
        - _column(predictions, f"orbit_center_{axis}_m")
        for axis in ("east", "north", "up")
    )
    distance = np.hypot(east, north)
    for axes, column, label in (
        (
            radius, np.where(wrong, _column(predictions, "end_mass_radius_m"), distance),
            "distance from the\ncircle's centre [m]",
        ),
        (
            depth, np.where(wrong, _column(predictions, "end_mass_depth_m"), -up),
            "depth below the\naircraft's circle [m]",
        ),
        (
            height, _column(predictions, "end_mass_height_above_home_m"),
            "height above home\nor set ground [m]",
        ),
    ):  # fmt: skip
        for shown, style, of in (
            (wrong, NOT_TO_USE, "in still air: not for the wind there is"),
            (guessed, IF_STILL, "predicted without wind, which is not known"),
            (settled & holds, {"color": MASS, "alpha": 1.0}, "predicted, settled"),
            (~settled & holds, {"color": MASS, "alpha": SETTLING}, "predicted, still settling"),
        ):
            if np.count_nonzero(shown) > 1:  # is a line
                axes.plot(*_broken(time, np.where(shown, column, nan)), **style, label=of)
        axes.set_ylabel(label)
    # Below the panels, where it lies on no curve.
    figure.legend(
        *radius.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False,
        fontsize="small",
    )  # fmt: skip
    radius.set_ylim(0.0, 1.1 * radius.get_ylim()[1])
    for axes in (depth, height):
        low, high = axes.get_ylim()
        short = max(0.0, LEAST_SPAN - (high - low))
        axes.set_ylim(low - 0.5 * short, high + 0.5 * short)
    height.set_xlabel("time from the first believed sample [s]")
    known = np.isfinite(_column(predictions, "end_mass_height_above_home_m")).any()
    # Of a long flight with a short turn the turn.
    whole = time if len(time) > 1 else _column(samples, "time_s")
    for axes in (radius, depth, height):
        axes.grid(alpha=0.3)
        if not len(time):
            _say_instead(axes, "no prediction")
        elif axes is height and not known:
            _say_instead(axes, "not known: no height above home or ground")
        if np.isfinite(whole).any():
            _show_span(axes, whole)
    return figure


def _show_span(axes, time: np.ndarray) -> None:
    """Let the panels show some times from first to last, and a little more."""
    first, last = np.nanmin(time), np.nanmax(time)
    axes.set_xlim(first - 0.02 * (last - first), last + 0.02 * (last - first))


def beacon_figure(beacon: Table, samples: Table):
    """Measured minus predicted and minus simulated position against time, in three panels."""
    figure = _figure(10.0, 7.0)
    panels = figure.subplots(3, sharex=True)
    time, outcome = _column(beacon, "time_s"), np.array(beacon["outcome"])
    for axes, axis, label in zip(
        panels, ("east", "north", "up"), ("east [m]", "north [m]", "up [m]"), strict=True
    ):
        axes.axhline(0.0, color="black", linewidth=0.8)
        settled = outcome == "settled"
        off = _column(beacon, f"measured_minus_predicted_{axis}_m")
        for of, marks, color in (
            ("settled", settled, MASS),
            (
                "still settling, unconfirmed, or wind not modelled",
                np.isfinite(off) & ~settled, REST,
            ),
        ):
            if marks.any():
                axes.plot(
                    time[marks], off[marks], ".", markersize=3, color=color,
                    label=f"measured minus predicted, {of}",
                )  # fmt: skip
        std = np.where(settled, _column(beacon, f"measured_minus_predicted_{axis}_std_m"), nan)
        known = np.isfinite(time)
        moments, band = _broken(time[known], 1.96 * std[known])
        if np.isfinite(band).any():
            axes.fill_between(
                moments, -band, band, color=MASS, alpha=0.2, linewidth=0.0,
                label="where 95 % of those settled ought to be",
            )  # fmt: skip
        synchronised = np.array(beacon["simulated"]) == "settled"
        simulated = _column(beacon, f"measured_minus_simulated_{axis}_m")
        simulated = np.where(synchronised, simulated, nan)
        if np.isfinite(simulated).any():
            axes.plot(
                time, simulated, ".", markersize=2, color=TOW, zorder=1.5,
                label="measured minus simulated",
            )  # fmt: skip
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        if not (np.isfinite(off).any() or np.isfinite(simulated).any()):
            _say_instead(axes, "no report was compared")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize="small"
    )
    whole = _column(samples, "time_s")
    if np.isfinite(whole).any():
        panels[-1].set_xlim(np.nanmin(whole), np.nanmax(whole))
    panels[-1].set_xlabel("time from the first believed sample [s]")
    return figure


def _draw_orbit(
    axes, number: int, orbit: dict[str, Any], east: float, north: float, color: str
) -> None:
    """Centre and circles of an orbit; its number stands where other orbits' do not."""
    where = (0.25 - 0.9 * number) * pi
    axes.plot(east, north, "+", color=color)
    axes.annotate(
        f"{number}",
        (east + orbit["radius_m"] * np.cos(where), north + orbit["radius_m"] * np.sin(where)),
        ha="center", va="center", fontsize="small", fontweight="bold", color="white",
        bbox={"boxstyle": "circle,pad=0.2", "facecolor": color, "edgecolor": "white"},
    )  # fmt: skip
    text = f"orbit {number}: {orbit['turns']:.1f} turns of {orbit['radius_m']:.1f} m"
    center = complex(east, north)
    turn = np.exp(1j * np.linspace(0.0, 2.0 * pi, 181))
    dashed = {"color": color, "linewidth": 1.8, "linestyle": (0, (3, 5))}
    loop, radius = orbit.get("end_mass_loop_m"), orbit["end_mass_radius_m"]
    end_mass, style, label = None, dashed, None
    if loop:
        off = complex(orbit["end_mass_east_m"], orbit["end_mass_north_m"])
        spread = orbit["end_mass_horizontal_std_m"]
        text += f", end mass about {abs(off):.0f} +- {spread:.0f} m off, in wind"
        end_mass = center + np.array([complex(*place) for place in [*loop, loop[0]]])
    elif radius is not None and orbit.get("end_mass_motion") == UNMODELLED:
        end_mass, style = center + radius * turn, NOT_TO_USE
        label = "end mass in still air: not for the wind there is"
    elif radius is not None:
        without = " without wind" if orbit.get("end_mass_motion") == UNKNOWN else ""
        text += f", end mass {radius:.2f} m{without}"
        spread = orbit.get("end_mass_horizontal_std_m")
        text += "" if spread is None else f", its place +- {spread:.0f} m"
        end_mass = center + radius * turn
    circle = center + orbit["radius_m"] * turn
    axes.plot(circle.real, circle.imag, **dashed, label=text)
    if end_mass is not None:
        axes.plot(end_mass.real, end_mass.imag, **style, label=label)


def _label_once(axes) -> None:
    """Leave each text in the legend once."""
    known = set()
    for line in axes.lines:
        if line.get_label() in known:
            line.set_label(None)
        known.add(line.get_label())


def _say_instead(axes, text: str) -> None:
    """Text in the place of a curve."""
    axes.set_yticks([])
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")


def _legend_above(axes) -> None:
    """Legend above the panel, where it lies on no curve."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1,
        fontsize="small",
    )  # fmt: skip


def _draw_warnings(axes, samples: Table, codes: list[str]) -> None:
    time = _column(samples, "time_s")
    known = np.isfinite(time)
    time = time[known]
    cells = [cell.split(";") for cell, use in zip(samples["warnings"], known, strict=True) if use]
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
        shortest = TICK * (time[-1] - time[0])
        for row, code in enumerate(codes):
            spans = [
                (start, max(end - start, shortest))
                for start, end in _spans(time, [code in cell for cell in cells])
            ]
            color = REST if code in BLAND else LIMIT if code in GRAVE else MASS
            axes.broken_barh(spans, (row - 0.35, 0.7), color=color)
    axes.set_yticks(range(len(codes)), codes)
    axes.set_ylim(len(codes) - 0.4, -0.6)
    if not codes:
        axes.set_ylabel("no warning")


def _spans(time: np.ndarray, on: list[bool]) -> list[tuple[float, float]]:
    """Start and end of each run of samples; the last one stands for the usual step."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    step = _usual_step(time)
    return [(time[first], time[after - 1] + step) for first, after in edges.reshape(-1, 2)]


def _settled(predictions: Table) -> np.ndarray:
    return np.array([cell == "True" for cell in predictions["settled"]], dtype=bool)


def _wind_modelled(predictions: Table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the predicted place holds, where only if there is no wind, and where it does not."""
    holds = np.array([cell == "True" for cell in predictions["pose_holds"]], dtype=bool)
    known = np.array([cell != "" for cell in predictions["wind_source"]], dtype=bool)
    return holds & known, holds & ~known, ~holds


def _warning_codes(samples: Table) -> list[str]:
    """Codes that occur where there is a time, the gravest first."""
    rows = zip(samples["warnings"], samples["time_s"], strict=True)
    codes = {code for cell, time in rows if time for code in cell.split(";") if code}
    return sorted(codes, key=lambda code: (code in BLAND, code not in GRAVE, code))


def _broken(time: np.ndarray, *columns: np.ndarray) -> list[np.ndarray]:
    """The columns, time first, with a nan wherever a gap in time interrupts the line."""
    gaps = np.flatnonzero(np.diff(time) > LEAST_GAP * _usual_step(time)) + 1
    return [np.insert(column, gaps, nan) for column in (time, *columns)]


def _usual_step(time: np.ndarray) -> float:
    steps = np.diff(time)
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def _column(table: Table, name: str) -> np.ndarray:
    return np.array([float(cell) if cell else nan for cell in table[name]])


def _read(path: Path) -> Table:
    """Columns of a CSV file as text, thinned to what a plot can show."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = sum(1 for _ in file) - 1
        file.seek(0)
        reader = csv.reader(file)
        names = next(reader)
        step = max(1, -(-rows // MOST_ROWS))
        kept = [row for number, row in enumerate(reader) if number % step == 0]
    return {name: [row[index] for row in kept] for index, name in enumerate(names)}


def _figure(width: float, height: float):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)
    FigureCanvasAgg(figure)  # draws without a display
    return figure
