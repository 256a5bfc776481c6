"""Points that several tests use, as the dicts of `reference_bvp`, and their way to the solver."""

from math import pi, sqrt

import numpy as np

from ctcbs_ros.solver.parameters import Parameters

GRAVITY = 9.80665

# Five steady states, docs/thesis.md ("Steady state").
FIVE = {"omega": 3.0, "l": 6.0, "m": 3.5, "d_n": 0.05, "f": 0.1}
# Stretch matters, and MoorDyn settles at 0.1574 and 3.041, docs/thesis.md ("Stretch").
STRETCHED = {"omega": 1.6, "l": 3.0, "m": 50.0, "d_n": 10.0, "f": 1.0, "gamma": 600.0}
# Tension is greatest inside the cable, 28 % above both ends.
TAUT_INSIDE = {
    "omega": 2.3056, "l": 4.5406, "m": 5.96703, "d_n": 20.392, "f": 0.67527, "gamma": 600.0,
}  # fmt: skip
# Flutter, thesis Fig. 4.1.
FLUTTER = {"omega": 3.4, "l": 3.0, "m": 3.5, "d_n": 1.33, "f": 0.1, "gamma": 600.0}


def figure_3_1(d_n, omega=1.0):
    """Thesis Fig. 3.1: f 1, l 3, m 50."""
    return {"omega": omega, "l": 3.0, "m": 50.0, "d_n": d_n, "f": 1.0}


def figure_4_1(d_n, omega):
    """Thesis Fig. 4.1: m 3.5, l 3, f 0.1."""
    return {"omega": omega, "l": 3.0, "m": 3.5, "d_n": d_n, "f": 0.1}


def design(radius, length=1000.0, area=0.045, elastic=True, speed=50.0, air=1.18):
    """Thesis Chapter 5 and Table 5.1 made non-dimensional here, from the definitions alone."""
    diameter, density = 0.00048, 1100.0
    mu = density * pi * diameter**2 / 4.0
    d_n = 0.5 * air * diameter * 0.6 * radius / mu
    d = 0.5 * air * area * 1.6 / mu
    point = {
        "omega": speed / sqrt(radius * GRAVITY),
        "l": length / radius,
        "m": 1.0 / (mu * radius),
        "d_n": d_n,
        "f": d / d_n,
    }
    if elastic:
        point["gamma"] = 2e9 / (density * radius * GRAVITY)
    return point


def parameters(point, **others):
    """The solver's parameters of a point."""
    optional = {"w": "end_weight", "rho": "density", "gamma": "elasticity"}
    return Parameters(
        omega=point["omega"], length=point["l"], end_mass=point["m"], cable_drag=point["d_n"],
        drag_ratio=point["f"],
        **{optional[key]: value for key, value in point.items() if key in optional}, **others,
    )  # fmt: skip


def random_points(n, seed, elastic):
    """Points of thesis Table 2.1; a third of them over its whole range of drag."""
    rng = np.random.default_rng(seed)
    for i in range(n):
        most_drag = 2000.0 if i % 3 == 0 else 20.0
        point = {
            "omega": rng.uniform(0.05, 3.0),
            "l": rng.uniform(1.5, 6.0),
            "m": np.exp(rng.uniform(np.log(3.5), np.log(100.0))),
            "d_n": np.exp(rng.uniform(np.log(0.03), np.log(most_drag))),
            "f": np.exp(rng.uniform(np.log(0.1), np.log(4.0))),
        }
        yield {**point, "gamma": 600.0} if elastic else point
