"""The bifurcation diagram of `ctcbs branch`."""

from pathlib import Path

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
    labels = set()

    def once(label):
        if label in labels:
            return None
        labels.add(label)
        return label

    for branch in result["branches"]:
        points = branch["points"]
        start = 0
        for end in range(1, len(points) + 1):
            if end < len(points) and points[end]["stable"] == points[start]["stable"]:
                continue
            # Joined to the next stretch, so that the curve has no holes.
            part = points[start : end + 1]
            stable = points[start]["stable"]
            axes.plot(
                [p[name] for p in part],
                [p["end_mass_radius"] for p in part],
                "-" if stable else "--",
                color="tab:blue" if stable else "tab:red",
                label=once("stable" if stable else "unstable"),
            )
            start = end
    for key, marker, label in (("folds", "o", "fold"), ("hopf", "D", "Hopf point")):
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
    axes.grid(alpha=0.3)
    if labels:
        axes.legend()
    with atomic_file(path, "wb") as file:
        figure.savefig(file, format=Path(path).suffix.lstrip(".") or "png", dpi=120)
    plt.close(figure)
