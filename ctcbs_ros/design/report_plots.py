"""The plots of a design's report, each as the bytes of a PNG."""

import io
from math import isfinite

import numpy as np

from ctcbs_ros.design.design import Design
from ctcbs_ros.design.requirements import tension_limit
from ctcbs_ros.design.way_in import ENTRY

LINES = ("-", "--", ":", "-.")
BAD = "tab:red"


def envelope_plot(design: Design) -> bytes:
    """End-mass radius, margin and tension over the envelope; points that are not good crossed."""
    evaluation = design.evaluation
    rows = evaluation.rows
    radii = np.array([row[0].flight.radius for row in rows])
    speeds = np.array([point.flight.speed for point in rows[0]])
    bad = np.array([[bool(evaluation.violations(point)) for point in row] for row in rows])
    allowed = tension_limit(evaluation.configuration, evaluation.requirements)

    def field(name: str) -> np.ndarray:
        return np.array([[getattr(point, name) for point in row] for row in rows])

    tension = field("tension")
    panels = [
        ("End-mass radius [m]", field("end_mass_radius"), "viridis_r"),
        ("Margin: decay rate of the\nleast damped mode [1/s]", field("margin"), "viridis"),
        ("Tension [% of that allowed]", 100.0 * tension / allowed, "viridis_r")
        if isfinite(allowed)
        else ("Tension [N] (not judged)", tension, "viridis_r"),
    ]
    figure = _figure(12.0, 4.2)
    for axes, (title, values, colours) in zip(
        figure.subplots(1, 3, sharey=True), panels, strict=True
    ):
        mesh = axes.pcolormesh(radii, speeds, values.T, cmap=colours, shading="nearest")
        bar = figure.colorbar(mesh, ax=axes, location="bottom", shrink=0.9)
        bar.ax.tick_params(labelsize=8)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("tow radius [m]")
        if bad.any():
            i, j = np.nonzero(bad)
            axes.plot(
                radii[i], speeds[j], "x", color=BAD, markersize=5, linestyle="none",
                label="not good",
            )  # fmt: skip
    first = figure.axes[0]
    first.set_ylabel("tow speed [m/s]")
    if bad.any():
        figure.legend(*first.get_legend_handles_labels(), loc="outside upper right")
    return _png(figure)


def way_in_plot(design: Design) -> bytes:
    """End-mass radius, margin and tension on the ways in that count, with their jumps."""
    evaluation = design.evaluation
    ways = evaluation.judged_ways_in
    entry = evaluation.requirements.way_in == ENTRY
    radii = sorted({way.radius for way in ways})
    speeds = sorted({way.speed for way in ways})
    colours = _colours(len(radii))
    figure = _figure(12.0, 4.6)
    panels = figure.subplots(1, 3)
    for way in ways:
        colour = colours[radii.index(way.radius)]
        line = LINES[speeds.index(way.speed) % len(LINES)]
        places = np.array(
            [point.flight.radius if entry else point.flight.cable_length for point in way.points]
        )
        for axes, name in zip(panels, ("end_mass_radius", "margin", "tension"), strict=True):
            values = [getattr(point, name) for point in way.points]
            axes.plot(places, values, line, color=colour, linewidth=1.2)
        for jump in way.jumps:
            at = jump.radius if entry else jump.cable_length
            panels[0].plot([at, at], [jump.before, jump.after], "-", color=BAD, linewidth=1.0)
            panels[0].plot(at, jump.before, "o", color=BAD, markersize=4)
    titles = "End-mass radius [m]", "Margin [1/s]", "Tension [N]"
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
        axes.set_xlabel("tow radius [m]" if entry else "cable paid out [m]")
        if entry:
            axes.set_xscale("log")
            axes.invert_xaxis()
    if entry:
        panels[0].set_yscale("log")
    if any(way.jumps for way in ways):
        panels[0].plot([], [], "o-", color=BAD, markersize=4, linewidth=1.0, label="jump")
        panels[0].legend(fontsize=8)
    panels[1].axhline(0.0, color=BAD, linewidth=0.8)
    allowed = tension_limit(evaluation.configuration, evaluation.requirements)
    if isfinite(allowed):
        panels[2].axhline(allowed, color=BAD, linewidth=0.8, label="allowed")
        panels[2].legend(fontsize=8)
    if entry:
        radii = []
    for radius, colour in zip(radii, colours, strict=False):
        panels[1].plot([], [], "-", color=colour, label=f"tow radius {radius:.4g} m")
    for speed, line in zip(speeds, LINES, strict=False):
        panels[1].plot([], [], line, color="black", label=f"{speed:.4g} m/s")
    handles, labels = panels[1].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(len(labels), 8), fontsize=8
    )
    return _png(figure)


def _colours(count: int) -> list:
    from matplotlib import colormaps

    return [colormaps["viridis"](share) for share in np.linspace(0.0, 0.9, max(count, 1))]


def _figure(width: float, height: float):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    # Room about the labels, which a browser may cut at the very edge.
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)
    return figure


def _png(figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=110)
    return content.getvalue()
