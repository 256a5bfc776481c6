"""The bifurcation diagram of `ctcbs branch`."""

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from ctcbs_ros.files import atomic_file

LABELS = {
    "omega": "angular velocity omega",
    "length": "cable length l",
    "end_mass": "end mass m",
    "cable_drag": "cable drag d_n",
    "drag_ratio": "drag ratio f",
    "radius_m": "tow radius [m]",
    "speed_m_s": "tow speed [m/s]",
    "cable_length_m": "cable length [m]",
}


def plot_diagram(path: str, name: str, result: dict) -> None:
    """Draw end-mass radius against the varied value: solid stable, dashed unstable, with events.

    Parameters
    ----------
    path : str
        Its suffix decides the format.
    name : str
        The varied value's name in the result.
    result : dict
        Of `ctcbs branch`.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5.5), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)
    labels = set()

    def once(label):
        if label in labels:
            return None
        labels.add(label)
        return label

    changes = [(e[name], e["end_mass_radius"]) for e in result["stability_changes"]]
    for branch in result["branches"]:
        line, stable = _smooth(*_with_changes(name, branch["points"], changes))
        start = 0
        for end in range(1, len(stable) + 1):
            if end < len(stable) and stable[end] == stable[start]:
                continue
            axes.plot(
                *line[start : end + 1].T, "-" if stable[start] else "--",
                color="tab:blue" if stable[start] else "tab:red",
                label=once("stable" if stable[start] else "unstable"),
            )
            start = end
    divergences = [e for e in result["stability_changes"] if e["kind"] == "divergence"]
    result = {**result, "divergences": divergences}
    for key, marker, label in (
        ("folds", "o", "fold"), ("hopf", "D", "Hopf point"), ("divergences", "s", "divergence"),
    ):
        for event in result[key]:
            axes.plot(
                event[name], event["end_mass_radius"], marker, color="black", fillstyle="none",
                label=once(label),
            )
    if result["first_minimum"]:
        event = result["first_minimum"]
        axes.plot(
            event[name], event["end_mass_radius"], "v", color="tab:green",
            label=once("first minimum"),
        )
    axes.set_xlabel(LABELS[name])
    axes.set_ylabel("end-mass radius / tow radius")
    point = next((p for branch in result["branches"] for p in branch["points"]), {})
    if "end_mass_radius_m" in point and name != "radius_m":
        tow_radius = point["end_mass_radius_m"] / point["end_mass_radius"]
        metres = axes.secondary_yaxis(
            "right", functions=(lambda share: share * tow_radius, lambda m: m / tow_radius)
        )
        metres.set_ylabel("end-mass radius [m]")
    axes.grid(alpha=0.3)
    if labels:
        axes.legend()
    with atomic_file(path, "wb") as file:
        figure.savefig(file, format=Path(path).suffix.lstrip(".") or "png", dpi=120)
    plt.close(figure)


def _with_changes(name, points, changes):
    """The branch with its changes of stability put in their places: (n, 2), stable after each."""
    line, stable = [], []
    for i, point in enumerate(points):
        here = np.array([point[name], point["end_mass_radius"]])
        line.append(here)
        stable.append(point["stable"])
        if i + 1 == len(points) or points[i + 1]["stable"] == point["stable"]:
            continue
        there = np.array([points[i + 1][name], points[i + 1]["end_mass_radius"]])
        size = np.abs(there - here) + 1e-9 * np.abs(here)
        between = [
            c for c in changes
            if np.all(np.abs(c - 0.5 * (here + there)) <= 0.75 * size + 0.05 * size.max())
        ]
        if between:
            line.append(np.array(min(between, key=lambda c: np.linalg.norm(c - here))))
            stable.append(points[i + 1]["stable"])
    return np.array(line), stable


def _smooth(line, stable):
    """A spline through the points of a branch, and whether each of its parts is stable."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(np.log(line), axis=0), axis=1))])
    kept = np.concatenate([[True], np.diff(way) > 1e-9])
    way, line, stable = way[kept], line[kept], np.array(stable)[kept]
    if len(way) < 4:
        return line, stable
    index = np.linspace(0.0, len(way) - 1.0, 8 * (len(way) - 1) + 1)
    spline = np.exp(CubicSpline(way, np.log(line))(np.interp(index, np.arange(len(way)), way)))
    return spline, stable[index.astype(int)]
