"""Drawings of bifurcation diagrams: Figs. 3.1, 4.1, 5.2, 5.3 and D.1."""

from matplotlib.lines import Line2D

from ctcbs_ros.figures.drawing import (
    COLORS,
    GIVEN,
    LABELS,
    blank,
    draw_branch,
    draw_events,
    grouped,
    keys,
    logarithmic,
    of_kind,
)

_GIVEN_KEY = "number in the thesis's text"


def draw_curves(
    title: str, rows, x: str = "omega", y: str = "end_mass_radius", limits=None, log_radius=False,
    inset=None,
):
    """Each curve in a colour of its own, with its events, jumps and the thesis's numbers.

    Parameters
    ----------
    title : str
    rows : list of dict
        As read from the CSV.
    x, y : str
        Columns of the axes.
    limits : tuple of 4 floats, optional
        Of x and y.
    log_radius : bool
        Whether y is logarithmic.
    inset : tuple of 2 tuples of 4 floats, optional
        Place of an enlarged part within the axes, as fractions (left, bottom, width, height), and
        the part's limits of x and y.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = blank(title)
    branches = grouped(of_kind(rows, "branch"), "curve", "branch")
    names = list(dict.fromkeys(name for name, _ in branches))
    colors = dict(zip(names, COLORS, strict=False))
    entries = keys(rows, colors)
    parts = [axes]
    if inset is not None:
        place, window = inset
        parts.append(axes.inset_axes(place, xlim=window[:2], ylim=window[2:]))
        parts[1].tick_params(labelsize=7)
        parts[1].grid(alpha=0.25)
        axes.indicate_inset_zoom(parts[1], edgecolor="0.4")
    for part in parts:
        for (name, _), branch in branches.items():
            draw_branch(part, branch, x, y, colors[name])
            draw_events(part, branch, x, y, colors[name])
    entries += _draw_jumps(axes, of_kind(rows, "jump"), x, y, colors)
    entries += _draw_fold_path(axes, of_kind(rows, "fold path"), x, y)
    entries += _draw_given(axes, parts[-1], of_kind(rows, "thesis"), x, y)
    entries += _draw_ranges(parts[-1], of_kind(rows, "thesis range"), x, colors)
    if log_radius:
        logarithmic(axes)
    if limits is not None:
        axes.set(xlim=limits[:2], ylim=limits[2:])
    axes.set(xlabel=LABELS[x], ylabel=LABELS[y])
    axes.legend(handles=entries, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8.5)
    return figure


def _draw_jumps(axes, rows, x, y, colors) -> list[Line2D]:
    for (name,), ends in grouped(rows, "curve").items():
        for a, b in zip(ends[::2], ends[1::2], strict=True):
            axes.annotate(
                "", (b[x], b[y]), (a[x], a[y]),
                arrowprops={"arrowstyle": "->", "color": colors[name], "lw": 0.8, "alpha": 0.7},
            )  # fmt: skip
    return [Line2D([], [], color="black", marker="$\\uparrow$", ls="", label="jump")] * bool(rows)


def _draw_fold_path(axes, rows, x, y) -> list[Line2D]:
    look = {"color": "black", "lw": 0.9, "dashes": (6, 3)}
    for path in grouped(rows, "curve", "branch").values():
        axes.plot([row[x] for row in path], [row[y] for row in path], **look)
    return [Line2D([], [], **look, label="path of the folds as $d_n$ varies")] * bool(rows)


def _draw_given(axes, enlarged, rows, x, y) -> list[Line2D]:
    """Crosses for the points that the thesis names; a line where it names no y."""
    for row in rows:
        if row[y] == row[y]:
            axes.plot(row[x], row[y], "+", color=GIVEN, markersize=9, mew=1.4, zorder=3)
        else:
            enlarged.axvline(row[x], color=GIVEN, lw=0.8, ls="-.", zorder=1)
    kinds = {row[y] == row[y] for row in rows}
    entries = [Line2D([], [], color=GIVEN, marker="+", ls="", markersize=9, label=_GIVEN_KEY)]
    lines = [
        Line2D([], [], color=GIVEN, lw=0.8, ls="-.", label=f"{row['note']}, thesis's text")
        for row in rows if row[y] != row[y]
    ]  # fmt: skip
    return (entries if True in kinds else []) + lines


def _draw_ranges(axes, rows, x, colors) -> list[Line2D]:
    """Bars at the bottom for ranges of x, of which each end is a row."""
    names = list(dict.fromkeys(row["curve"] for row in rows))
    for low, high in zip(rows[::2], rows[1::2], strict=True):
        level = 0.03 + 0.035 * names.index(low["curve"])
        axes.plot(
            [low[x], high[x]], [level, level], color=colors[low["curve"]], lw=5, alpha=0.35,
            solid_capstyle="butt", transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    label = "unstable by the thesis's text"
    return [Line2D([], [], color=GIVEN, lw=5, alpha=0.5, label=label)] * bool(rows)
