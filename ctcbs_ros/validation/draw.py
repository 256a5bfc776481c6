"""The pictures of a validation: steady states against segments, entries, orbits in wind."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ctcbs_ros.files import atomic_file
from ctcbs_ros.validation.runs import EntryRun, SteadyRun, WindRun

MOORDYN, PRODUCT, OTHER = "tab:orange", "tab:blue", "tab:green"


def draw_steady(runs: list[SteadyRun], file: Path) -> None:
    """Error of the settled end-mass radius against the number of segments."""
    figure, axes = _blank(1, len(runs), 4.2 * len(runs), 4.0)
    for ax, run in zip(axes[0], runs, strict=True):
        for found, color, label in (
            (run.segments, OTHER, "drag in the middle of segments"),
            (run.nodes, PRODUCT, "drag at nodes"),
        ):
            counts = sorted(found)
            errors = [100.0 * abs(found[n][0] / run.solver[0] - 1.0) for n in counts]
            ax.loglog(counts, errors, "o-", color=color, label=label, markersize=4)
        counts = sorted(run.moordyn)
        errors = [100.0 * abs(run.moordyn[n][0] / run.solver[0] - 1.0) for n in counts]
        ax.loglog(counts, errors, "x", color=MOORDYN, label="MoorDyn", markersize=11, mew=2)
        ax.set_title(run.case.name, fontsize=10)
        ax.set_xlabel("segments")
        ax.set_xticks([5, 10, 20, 40, 80], labels=["5", "10", "20", "40", "80"])
        ax.minorticks_off()
    axes[0][0].set_ylabel("error of the end-mass radius [%]")
    axes[0][0].legend(fontsize=8)
    _save(figure, file)


def draw_entries(runs: list[EntryRun], file: Path) -> None:
    """Radius and depth through entries from rest, and the differences."""
    figure, axes = _blank(2, len(runs), 4.2 * len(runs), 5.6, sharex="col")
    for (top, below), run in zip(np.transpose(axes), runs, strict=True):
        turns = run.angles / (2.0 * np.pi)
        for k, name, style in ((0, "radius", "-"), (1, "depth", "--")):
            peer, ours = run.moordyn[:, k], run.product[:, k]
            top.plot(turns, peer, style, color=MOORDYN, lw=3, label=f"{name}, MoorDyn")
            top.plot(turns, ours, style, color="k", lw=0.9, label=f"{name}, here")
            off = np.abs(ours - peer)
            below.semilogy(turns, np.maximum(off, 1e-9), style, color="k", lw=0.8, label=name)
        top.set_title(run.case.name, fontsize=10)
        below.set_xlabel("orbits")
    axes[0][0].set_ylabel("end mass / tow radius [-]")
    axes[1][0].set_ylabel("difference / tow radius [-]")
    axes[0][0].legend(fontsize=8)
    axes[1][0].legend(fontsize=8)
    _save(figure, file)


def draw_winds(runs: list[WindRun], file: Path) -> None:
    """The end mass's orbits in wind from above, the tow circle's centre at 0, 0."""
    figure, axes = _blank(1, len(runs), 3.7 * len(runs), 4.0)
    for ax, run in zip(axes[0], runs, strict=True):
        ax.plot(*run.moordyn[:, :2].T, color=MOORDYN, lw=4, label="MoorDyn")
        ax.plot(*run.in_time[:, :2].T, color="k", lw=1.2, label="in time")
        if run.periodic is not None:
            some = run.periodic[:: max(1, len(run.periodic) // 24)]
            ax.plot(*some[:, :2].T, "o", color=PRODUCT, markersize=3, label="periodic motion")
        ax.set_title(run.case.name, fontsize=10)
        ax.set_xlabel("downwind of the centre / tow radius [-]")
        ax.set_aspect("equal", adjustable="datalim")
        ax.xaxis.set_major_locator(MaxNLocator(4))
    axes[0][0].set_ylabel("crosswind of the centre / tow radius [-]")
    axes[0][-1].legend(fontsize=8, loc="center")
    _save(figure, file)


def _blank(rows, columns, width, height, sharex=False):
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=sharex)
    for ax in axes.flat:
        ax.grid(alpha=0.25)
    return figure, axes


def _save(figure, file):
    with atomic_file(file, "wb") as handle:
        figure.savefig(handle, format="png", dpi=110)
