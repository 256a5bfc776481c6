"""Cusps, and the folds of largest cable drag: where uniqueness is lost when drag falls.

A configuration has one state as omega -> 0, and the number of states changes at folds alone; so
there is more than one at some omega up to a limit exactly where there is a fold. Drags are looked
at from above: on each one all branches are traced, isolated ones included; the fold curves through
it are followed upwards to where they turn, in a cusp or at the birth of an isolated branch, or
leave the range of omega; and cusps are sought near the steepest places of each branch, which finds
those of fold curves that lie between two of the drags as well.
"""

from collections.abc import Iterator
from math import log, sqrt

import numpy as np

from ctcbs_ros.solver.fold_curve import FoldCurve, add_cusps, curve_through, folds_on, near
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.surface import DRAG_RANGE, LocusPoint, Surface, branches_from_above, point

OMEGA_MAX = 3.0
_CUTS = 5  # in omega, at the least


def cusp(parameters: Parameters, omega_max: float = OMEGA_MAX) -> LocusPoint | None:
    """The cusp of largest cable drag, on whatever branch.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float
        Cusps at a larger omega do not count.

    Returns
    -------
    LocusPoint or None
        None where there is no cusp for any drag in `DRAG_RANGE`.
    """
    for delta, found, best in _from_above(parameters, omega_max):
        best = max((*best, *(c for f in found for c in f.cusps)), key=_drag, default=None)
        if best is not None and log(best.cable_drag) >= delta:
            return best
    return None


def least_unique_drag(parameters: Parameters, omega_max: float = OMEGA_MAX) -> float | None:
    """Least cable drag above which every omega up to a limit has one steady state.

    Parameters
    ----------
    parameters : Parameters
        Its omega and cable drag do not matter.
    omega_max : float

    Returns
    -------
    float or None
        None where nothing folds at any drag in `DRAG_RANGE`.

    Notes
    -----
    The largest drag of any fold curve: a cusp, the drag at which an isolated branch is born, or
    that at which a fold comes in at `omega_max`.
    """
    for delta, found, cusps in _from_above(parameters, omega_max):
        events = [*cusps, *(e for f in found for e in (*f.cusps, *f.branch_points))]
        drags = [e.cable_drag for e in events if log(e.cable_drag) >= delta]
        drags += [float(f.cable_drag.max()) for f in found]
        if drags:
            return max(drags)
    return None


def has_folds(parameters: Parameters, omega_max: float = OMEGA_MAX) -> bool:
    """Whether a configuration folds at any omega up to a limit, at any drag in `DRAG_RANGE`.

    Stretch can make folds vanish (or move beyond the limit); this looks instead of assuming.
    """
    return least_unique_drag(parameters, omega_max) is not None


def _from_above(
    parameters: Parameters, omega_max: float
) -> Iterator[tuple[float, list[FoldCurve], list[LocusPoint]]]:
    """For drags from above: ln d_n, the fold curves above it that reach it, and all cusps seen."""
    surface = Surface(parameters)
    low = np.array([log(min(slowest_fold(parameters), 0.5 * omega_max)), log(DRAG_RANGE[0])])
    high = np.array([log(omega_max), log(DRAG_RANGE[1])])
    cusps: list[np.ndarray] = []
    for delta, branches in branches_from_above(surface, low, high, _CUTS):
        found, lines = [], []
        above = np.array([low[0], delta - 1e-9])
        for points in branches:
            add_cusps(surface, delta, points, low, high, cusps)
            for z in folds_on(surface, delta, points, low, high):
                if any(near(line, z) for line in lines):
                    continue
                curve, line = curve_through(surface, z, above, high)
                if curve is not None:
                    found.append(curve)
                    lines.append(line)
        yield delta, found, [point(z) for z in cusps]


def slowest_fold(parameters: Parameters) -> float:
    """An omega below which nothing folds: a quarter of the pendulum's, of the stretched cable.

    Within Table 2.1 folds lie above 0.7 times the pendulum's 1/sqrt(l).
    """
    stretch = (parameters.end_weight + parameters.length) / parameters.elasticity
    return 0.25 / sqrt(parameters.length * (1.0 + stretch))


def _drag(place: LocusPoint) -> float:
    return place.cable_drag
