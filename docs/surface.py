"""The picture of docs/theory.md: one tow radius for every angular velocity and end-mass radius.

    python docs/surface.py          # writes docs/surface.png

Every point of the plane is one cable, integrated from the end mass up; the colour is how far from
the axis its upper end goes round. All lengths are over one reference length a. The line "tow
radius = a" is the curve d_n 4.8 of the thesis's Fig. 3.1; it has folds, the surface has none.
"""

import sys
from math import log
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.family import ANGULAR_RATE
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import cable_states, steady_states

LENGTH, END_MASS, CABLE_DRAG, DRAG_RATIO = 3.0, 50.0, 4.8, 1.0
LEVELS = (0.6, 0.8, 1.0, 1.3, 1.6)


def cable(omega: float) -> Parameters:
    """The cable of the picture at an angular velocity."""
    return Parameters(omega, LENGTH, END_MASS, CABLE_DRAG, DRAG_RATIO)


def tow_radii(omegas, end_mass_radii) -> np.ndarray:
    """Radius of the tow point's circle at each pair, (end_mass_radii, omegas)."""
    top = np.array([LENGTH])
    return np.array(
        [
            [np.hypot(*cable_states(cable(omega), radius, top, 1e-8)[0, :2]) for omega in omegas]
            for radius in end_mass_radii
        ]
    )


def draw(path) -> None:
    """Draw the surface with its contours, and the folds of the contour 1."""
    omegas, radii = np.linspace(0.6, 1.6, 161), np.geomspace(0.1, 4.0, 161)
    surface = tow_radii(omegas, radii)
    start = cable(0.6)
    (state,) = steady_states(start).states
    path_of_1 = trace(start, state.end_mass_radius, ANGULAR_RATE, 1, (-1.0, log(1.6 / 0.6)))

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    colors = axes.contourf(omegas, radii, surface, np.linspace(0.0, 2.4, 25))
    figure.colorbar(colors, label="tow radius / a [-]", ticks=np.arange(0.0, 2.5, 0.4))
    lines = axes.contour(
        omegas, radii, surface, LEVELS, colors="white",
        linewidths=[2.5 if level == 1.0 else 0.8 for level in LEVELS],
    )
    axes.clabel(lines, fmt="%g", fontsize=9)
    for fold in path_of_1.folds:
        omega = 0.6 * np.exp(fold.tau)
        axes.plot(omega, fold.end_mass_radius, "o", color="white", markeredgecolor="black")
        axes.annotate(
            f"fold {omega:.3f}", (omega, fold.end_mass_radius), color="white",
            xytext=(10, -4), textcoords="offset points",
            bbox={"facecolor": "0.15", "edgecolor": "none", "pad": 1.5},
        )
    axes.axvline(1.0, color="white", linestyle=":", linewidth=1.0)
    axes.set(
        yscale="log", ylim=(0.1, 4.0), yticks=(0.1, 0.2, 0.5, 1.0, 2.0, 4.0),
        yticklabels=("0.1", "0.2", "0.5", "1", "2", "4"),
        xlabel="angular velocity, omega [-]", ylabel="end-mass radius / a [-]",
        title="l 3, m 50, d_n 4.8, f 1: three states at omega 1, one surface",
    )
    axes.minorticks_off()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix(".png"))
