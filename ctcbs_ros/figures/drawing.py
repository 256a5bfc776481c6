"""What the drawings share: a figure without a display, axes' names, looks of stability and events.

Every symbol of the thesis is named in words beside it; lengths are over the tow radius a.
"""

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from ctcbs_ros.figures.curves import FIRST_MINIMUM, FOLD, HOPF
from ctcbs_ros.figures.rows import Row
from ctcbs_ros.solver.stability import DIVERGENCE, FLUTTER, STABLE

LABELS = {
    "omega": r"angular velocity $\omega = \Omega\,\sqrt{a/g}$ [-]",
    "end_mass_radius": r"end-mass radius / tow radius, $x_d$ [-]",
    "length": r"cable length / tow radius, $l$ [-]",
    "cable_drag": r"cable drag $d_n$ [-]",
    "tow_radius_m": r"tow radius $a$ [m]",
}
STYLES = {STABLE: "-", FLUTTER: "--", DIVERGENCE: ":"}
STYLE_NAMES = {STABLE: "stable", FLUTTER: "unstable: flutter", DIVERGENCE: "unstable: divergence"}
MARKERS = {FOLD: "o", HOPF: "D", FIRST_MINIMUM: "v"}
COLORS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")
# Numbers of the thesis's text: to compare with, so they stay behind the curves.
GIVEN = "0.55"


def blank(title: str, panels: int = 1, width: float = 10.0, height: float = 5.8):
    """A titled figure and its axes (a list where there are several panels, one above another)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(panels, sharex=True, squeeze=False)[:, 0]
    figure.suptitle(typeset(title), fontsize=11)
    for each in axes:
        each.grid(alpha=0.25)
    return figure, axes[0] if panels == 1 else list(axes)


def logarithmic(axes) -> None:
    """A logarithmic y axis with plain numbers at 1, 2 and 5."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def typeset(text: str) -> str:
    return text.replace("d_n", "$d_n$").replace("A_C", "$A_C$")


def of_kind(rows: list[Row], kind: str, **values) -> list[Row]:
    """Rows of one kind, and with these values."""
    return [
        row for row in rows
        if row["kind"] == kind and all(row[name] == value for name, value in values.items())
    ]  # fmt: skip


def grouped(rows: list[Row], *names: str) -> dict[tuple, list[Row]]:
    """Rows by the values of some columns, in the order in which they appear."""
    groups: dict[tuple, list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def draw_branch(axes, rows: list[Row], x: str, y: str, color: str) -> None:
    """A branch, each stretch in the style of its stability; stretches meet in the events."""
    stretches, start = [], 0
    # A stretch takes the looks of its points; a fold or a Hopf point belongs to both sides.
    looks = [row["stability"] for row in rows]
    for i in range(1, len(rows)):
        if looks[i] and looks[start] and looks[i] != looks[start]:
            # No event between: the change is somewhere in the last step.
            stretches.append((start, i))
            start = i
        elif not looks[i] and i > start:
            stretches.append((start, i))
            start = i
    stretches.append((start, len(rows) - 1))
    for first, last in stretches:
        look = next((look for look in looks[first : last + 1] if look), STABLE)
        part = rows[first : last + 1]
        axes.plot([r[x] for r in part], [r[y] for r in part], STYLES[look], color=color, lw=1.6)


def draw_events(axes, rows: list[Row], x: str, y: str, color: str) -> None:
    """Markers of the events among the rows."""
    for row in rows:
        if row["event"]:
            axes.plot(
                row[x], row[y], MARKERS[row["event"]], color=color, markerfacecolor="white",
                markersize=5.5, zorder=4,
            )  # fmt: skip


def keys(rows: list[Row], colors: dict[str, str]) -> list[Line2D]:
    """Legend entries for the curves' colours and for the styles and markers that occur."""
    entries = [Line2D([], [], color=color, label=typeset(name)) for name, color in colors.items()]
    looks = {row["stability"] for row in rows if row["kind"] == "branch"}
    events = {row["event"] for row in rows if row["kind"] == "branch"}
    entries += [
        Line2D([], [], color="black", linestyle=style, label=STYLE_NAMES[look])
        for look, style in STYLES.items() if look in looks
    ]  # fmt: skip
    entries += [
        Line2D(
            [], [], color="black", marker=marker, linestyle="", markerfacecolor="white",
            markersize=5.5, label=event,
        )
        for event, marker in MARKERS.items() if event in events
    ]  # fmt: skip
    return entries
