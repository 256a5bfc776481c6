"""Drawings of loci in two parameters: Figs. 3.2, 3.3, 3.4 and 4.2."""

from matplotlib.lines import Line2D

from ctcbs_ros.figures.drawing import (
    COLORS,
    GIVEN,
    LABELS,
    blank,
    grouped,
    logarithmic,
    of_kind,
    typeset,
)

# The thesis's own looks: a dash for each end mass, dark and light for the drag ratios 1 and 2.
_DASHES = {20.0: "-", 50.0: "--", 100.0: "-."}
# A wide line under a narrow one: curves of two end masses may coincide.
_WIDTHS = {20.0: 1.5, 50.0: 2.6, 100.0: 1.2}
_SHADES = {1.0: "navy", 2.0: "tab:cyan"}
_GIVEN_KEY = "number in the thesis's text"


def draw_folds(title: str, rows, limits):
    """The folds in (cable drag, omega), meeting in their cusp.

    Parameters
    ----------
    title : str
    rows : list of dict
        As read from the CSV.
    limits : tuple of 4 floats
        Of drag and omega.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = blank(title)
    colors = dict(zip(("F1", "F2"), COLORS, strict=False))
    paths = grouped(of_kind(rows, "fold path"), "curve", "branch")
    for (name, _), path in paths.items():
        axes.plot(
            [row["cable_drag"] for row in path], [row["omega"] for row in path],
            color=colors[name], label=f"fold {name}", lw=1.6,
        )  # fmt: skip
    for row in of_kind(rows, "fold path", event="cusp"):
        axes.plot(row["cable_drag"], row["omega"], "s", color="black", mfc="white", zorder=4)
        axes.annotate(
            f"cusp C: $d_n$ {row['cable_drag']:.4g}, $\\omega$ {row['omega']:.4g}",
            (row["cable_drag"], row["omega"]), (-75, -42), textcoords="offset points",
            ha="center", fontsize=9, arrowprops={"arrowstyle": "-", "lw": 0.7},
        )  # fmt: skip
    for row in of_kind(rows, "thesis"):
        axes.axvline(row["cable_drag"], color=GIVEN, lw=0.8, ls="-.", label=row["note"])
    axes.set(xlim=limits[:2], ylim=limits[2:], xlabel=LABELS["cable_drag"], ylabel=LABELS["omega"])
    _legend(axes, dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True)).values())
    return figure


def draw_least_drags(title: str, rows):
    """Least cable drags against cable length, a panel for each kind of them.

    A dash for each end mass, a shade for each drag ratio.
    """
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    figure, panels = blank(title, panels=len(kinds), height=5.8 if len(kinds) == 1 else 8.5)
    panels = panels if len(kinds) > 1 else [panels]
    for axes, kind in zip(panels, kinds, strict=True):
        for (name, mass, ratio), curve in _curves(of_kind(rows, kind)):
            axes.plot(
                [row["length"] for row in curve], [row["cable_drag"] for row in curve],
                _DASHES[mass], color=_SHADES[ratio], marker=".", markersize=4, lw=1.5, label=name,
            )  # fmt: skip
        axes.set_ylabel(LABELS["cable_drag"])
        if len(kinds) > 1:
            axes.set_title(kind, fontsize=10)
        logarithmic(axes)
    panels[-1].set_xlabel(LABELS["length"])
    _legend(panels[0], panels[0].get_legend_handles_labels()[0])
    return figure


def draw_cusps(title: str, rows):
    """Omega and end-mass radius at the cusp and at the first minimum, against cable length."""
    figure, panels = blank(title, panels=2, height=7.5)
    colors = {"cusp": "tab:orange", "first minimum": "navy"}
    for axes, quantity in zip(panels, ("omega", "end_mass_radius"), strict=True):
        for kind, color in colors.items():
            for (name, mass, _), row in _curves(of_kind(rows, kind)):
                axes.plot(
                    [r["length"] for r in row], [r[quantity] for r in row], _DASHES[mass],
                    color=color, lw=_WIDTHS[mass], alpha=0.5 if mass == 50.0 else 1.0,
                    label=f"{kind}, {name}",
                )  # fmt: skip
        axes.set_ylabel(LABELS[quantity])
        logarithmic(axes)
    for row in of_kind(rows, "thesis"):
        panels[0].plot(row["length"], row["omega"], "+", color=GIVEN, markersize=9, mew=1.4)
    panels[1].set_xlabel(LABELS["length"])
    handles = panels[0].get_legend_handles_labels()[0]
    handles.append(Line2D([], [], color=GIVEN, marker="+", ls="", ms=9, label=_GIVEN_KEY))
    _legend(panels[0], handles)
    return figure


def _curves(rows):
    return grouped(rows, "curve", "end_mass", "drag_ratio").items()


def _legend(axes, handles) -> None:
    legend = axes.legend(
        handles=list(handles), loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8.5
    )
    for text in legend.get_texts():
        text.set_text(typeset(text.get_text()))
