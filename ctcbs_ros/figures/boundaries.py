"""Rows of loci in two parameters: folds over drag, and over length the least drags, cusps, minima.

Where a locus has no point at a length, the row says so in its note and is drawn as a gap.
"""

from dataclasses import replace
from itertools import pairwise
from math import hypot, inf, log

import numpy as np

from ctcbs_ros.figures.rows import Row
from ctcbs_ros.solver import critical_drag
from ctcbs_ros.solver import cusp as solver_cusp
from ctcbs_ros.solver.first_minimum import first_minimum_state
from ctcbs_ros.solver.fold_curve import FoldCurve, fold_curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.surface import LocusPoint, Surface, point

FOLD_COLUMNS = (
    "kind", "curve", "branch", "length", "end_mass", "drag_ratio", "cable_drag", "omega",
    "end_mass_radius", "event", "note",
)
LEAST_DRAG_COLUMNS = (
    "kind", "curve", "length", "end_mass", "drag_ratio", "cable_drag", "note",
)
CUSP_COLUMNS = (
    "kind", "curve", "length", "end_mass", "drag_ratio", "cable_drag", "omega",
    "end_mass_radius", "note",
)
CUSP = "cusp"
_NONE_NEEDED = "holds at every drag from 0.01 to 2000"
_NONE_SUFFICES = "fails even at a drag of 2000"
# Distance of neighbouring points of a fold path, in the logarithms of its quantities.
_STEP = 0.04


def fold_paths(
    parameters: Parameters, omega_range: tuple[float, float], drag_range: tuple[float, float]
) -> list[Row]:
    """The folds as cable drag varies: F1 at the larger end-mass radius, F2 beyond their cusp.

    Returns
    -------
    list of dict
        Of kind "fold path", each cusp among them as an event that ends F1 and begins F2.
    """
    rows = []
    surface = Surface(parameters)
    for number, found in enumerate(fold_curves(parameters, omega_range, drag_range), 1):
        points = _dense(surface, found)
        if points[0].end_mass_radius < points[-1].end_mass_radius:
            points.reverse()
        for cusp_point in found.cusps:
            points.insert(_place(points, cusp_point), cusp_point)
        fold = "F1"
        for here in points:
            fixed = {
                "kind": "fold path", "branch": number, "length": parameters.length,
                "end_mass": parameters.end_mass, "drag_ratio": parameters.drag_ratio,
                "elasticity": parameters.elasticity, "cable_drag": here.cable_drag,
                "omega": here.omega, "end_mass_radius": here.end_mass_radius,
            }  # fmt: skip
            if here in found.cusps:
                # The end of one path; the next begins in the same point.
                rows.append(fixed | {"curve": fold, "event": CUSP})
                fold = "F2"
            rows.append(fixed | {"curve": fold})
    return rows


def least_unique_drag(name: str, length: float, end_mass: float, drag_ratio: float) -> list[Row]:
    """The least cable drag above which every omega up to 3 has one steady state: one row."""
    return [_least(solver_cusp.least_unique_drag, "unique", name, length, end_mass, drag_ratio)]


def least_stable_drag(name: str, length: float, end_mass: float, drag_ratio: float) -> list[Row]:
    """The least cable drag above which the first minimum of the radius is stable: one row."""
    found = _least(
        critical_drag.least_stable_drag, "stable at the first minimum", name, length, end_mass,
        drag_ratio,
    )  # fmt: skip
    return [found]


def least_drag_stable_everywhere(
    name: str, length: float, end_mass: float, drag_ratio: float
) -> list[Row]:
    """The least drag above which the branch from omega 0 is stable up to omega 3: one row."""
    found = _least(
        critical_drag.least_drag_stable_everywhere, "stable from omega 0 up to 3", name, length,
        end_mass, drag_ratio,
    )  # fmt: skip
    return [found]


def cusp_and_minimum(name: str, length: float, end_mass: float, drag_ratio: float) -> list[Row]:
    """The cusp, and the first minimum of the end-mass radius at the cusp's drag: two rows."""
    parameters = Parameters(1.0, length, end_mass, 1.0, drag_ratio)
    fixed = {"curve": name, "length": length, "end_mass": end_mass, "drag_ratio": drag_ratio}
    born = solver_cusp.cusp(parameters)
    if born is None:
        note = "no cusp up to omega 3"
        return [{"kind": kind, "note": note} | fixed for kind in ("cusp", "first minimum")]
    fixed["cable_drag"] = born.cable_drag
    rows = [
        {"kind": "cusp", "omega": born.omega, "end_mass_radius": born.end_mass_radius} | fixed
    ]
    # A little more drag: at the cusp itself the branch is vertical.
    above = replace(parameters, cable_drag=born.cable_drag * 1.0001)
    state = first_minimum_state(above)
    if state is None:
        return [*rows, {"kind": "first minimum", "note": "no minimum up to omega 10"} | fixed]
    return [
        *rows,
        {
            "kind": "first minimum", "omega": state.parameters.omega,
            "end_mass_radius": state.end_mass_radius,
        } | fixed,
    ]  # fmt: skip


def _least(function, kind: str, name: str, length, end_mass, drag_ratio) -> Row:
    row = {
        "kind": kind, "curve": name, "length": length, "end_mass": end_mass,
        "drag_ratio": drag_ratio,
    }  # fmt: skip
    try:
        found = function(Parameters(1.0, length, end_mass, 1.0, drag_ratio))
    except ArithmeticError as error:
        return row | {"note": str(error)}
    if found is None:
        return row | {"note": _NONE_NEEDED}
    return row | ({"note": _NONE_SUFFICES} if found == inf else {"cable_drag": found})


def _dense(surface: Surface, found: FoldCurve) -> list[LocusPoint]:
    """Points of a fold curve, with others between those too far apart for a smooth line."""
    logs = np.log([found.omega, found.cable_drag, found.end_mass_radius]).T
    dense = [logs[0]]
    for a, b in pairwise(logs):
        count = int(np.ceil(np.linalg.norm(b - a) / _STEP))
        between = (surface.fold(a + (b - a) * i / count) for i in range(1, count))
        dense += [fold[0] for fold in between if fold is not None]
        dense.append(b)
    return [point(z) for z in dense]


def _place(points: list[LocusPoint], event: LocusPoint) -> int:
    """Index before which a point belongs: where going over it is the least detour."""

    def apart(a, b):
        return hypot(log(a.omega / b.omega), log(a.end_mass_radius / b.end_mass_radius))

    detours = [apart(a, event) + apart(event, b) - apart(a, b) for a, b in pairwise(points)]
    return detours.index(min(detours)) + 1
