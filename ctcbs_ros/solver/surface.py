"""The surface of steady states over omega and cable drag, at a fixed drag ratio.

The states are a surface h = 0 over (tau, delta, u) = (ln omega, ln d_n, ln x_d): a cut at one drag
has all branches over omega; folds and Hopf points are curves on it, cusps points.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels import fold_curve as kernel
from ctcbs_ros.kernels.search import MAX_STEPS, MAX_STRAIN
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.family import ANGULAR_RATE, Family, at_omega_one
from ctcbs_ros.solver.level_set import curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import TOLERANCE, describe

OMEGA_RANGE = (0.02, 3.0)
DRAG_RANGE = (0.01, 2000.0)
DRAG = Family("cable_drag", cable_drag=1.0, end_mass_drag=1.0)
# Ratio of neighbouring drags at which all branches are traced, and cuts in omega on each.
DRAG_STEP = 1.6
_CUTS = 9
_SCAN = 1e-7
_TRACE = 1e-9
_MOST_POINTS = 4000


@dataclass(frozen=True)
class LocusPoint:
    """A point of the surface of steady states: omega, cable drag d_n, end-mass radius x_d."""

    omega: float
    cable_drag: float
    end_mass_radius: float


class Surface:
    """h over (tau, delta, u) = (ln omega, ln d_n, ln x_d) of one configuration, as kernels see it.

    The kernels take the configuration at omega = d_n = 1, and work space; this keeps both.
    """

    def __init__(self, parameters: Parameters):
        self.unit = replace(at_omega_one(parameters), cable_drag=1.0)
        self.arguments = (
            self.unit.theta(), np.array([ANGULAR_RATE.exponents(), DRAG.exponents()]),
            self.unit.length, np.zeros(2),
        )
        self.work = np.empty((1, 4, 6)), np.empty(MAX_STEPS + 1)

    def with_drag(self, delta: float) -> Parameters:
        """The parameters at omega = 1 and a drag."""
        return DRAG.at(self.unit, delta)

    def at(self, tau: float, delta: float) -> Parameters:
        """The parameters at a point of the plane."""
        return ANGULAR_RATE.at(self.with_drag(delta), tau)

    def gradients(self, z, tolerance=TOLERANCE):
        """(h, h_u), (2,), and their gradients by (tau, delta, u), (2, 3); None if it fails."""
        jacobian = np.empty((2, 3))
        h, h_u, status = kernel.fold_equations(*self.arguments, z, tolerance, *self.work, jacobian)
        return (np.array([h, h_u]), jacobian) if status == OK else None

    def fold(self, z, tolerance=TOLERANCE):
        """The point of the fold curve near z, and the gradients there; None if it fails."""
        z, jacobian = np.array(z, float), np.empty((2, 3))
        _, good = kernel.correct_fold(*self.arguments, z, tolerance, *self.work, jacobian)
        return (z, jacobian) if good else None

    def fold_with(self, z, fixed: int):
        """The fold near z with one coordinate held: 0 ln omega, 1 ln d_n, 2 ln x_d; or None."""
        z, free = np.array(z, float), [j for j in range(3) if j != fixed]
        for _ in range(12):
            found = self.gradients(z)
            if found is None:
                return None
            residual, jacobian = found
            try:
                step = np.linalg.solve(jacobian[:, free], -residual)
            except np.linalg.LinAlgError:
                return None
            size = np.abs(step).max()
            if not size < 0.3:
                return None
            z[free] += step
            if size < 1e-8:
                return z
        return None

    def means_something(self, z) -> bool:
        """Whether the state at z is stretched no more than states are sought for."""
        state = describe(self.at(z[0], z[1]), float(z[2]))
        if state is None:
            return False
        return state.greatest_tension <= MAX_STRAIN * state.parameters.elasticity

    def cusp(self, z):
        """The cusp near z, or None."""
        z = np.array(z, float)
        _, good = kernel.correct_cusp(*self.arguments, z, 1e-12, *self.work)
        return z if good else None

    def trace(self, z, direction, low, high):
        """Status and points (n, 5) of the fold curve one way from z; see the kernel."""
        points = np.empty((_MOST_POINTS, 5))
        status, count = kernel.trace_folds(
            *self.arguments, z, direction, low, high, _TRACE, points
        )
        return status, points[:count].copy()


def point(z) -> LocusPoint:
    """(tau, delta, u) as a value."""
    return LocusPoint(exp(z[0]), exp(z[1]), exp(z[2]))


def checked_box(omega_range, drag_range) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest (ln omega, ln d_n), each (2,); an InputError where a range is empty."""
    for name, (low, high) in (("omega", omega_range), ("cable drag", drag_range)):
        if not 0.0 < low < high < np.inf:
            raise InputError(
                f"{name}: {low:g} to {high:g} is not allowed, 0 < from < to is needed"
            )
    low, high = np.log(np.transpose([omega_range, drag_range]))
    return low, high


def branches_from_above(
    surface: Surface, low, high, cuts: int = _CUTS
) -> Iterator[tuple[float, list[np.ndarray]]]:
    """For drags from above: ln d_n, and all branches over omega there."""
    for delta in falling(low[1], high[1]):
        there = surface.with_drag(delta)
        yield float(delta), curves(there, ANGULAR_RATE, low[0], high[0], cuts, _SCAN)


def falling(low: float, high: float) -> np.ndarray:
    """Logarithms of drags from high to low, neighbours at most `DRAG_STEP` apart."""
    return np.linspace(high, low, max(int(np.ceil((high - low) / log(DRAG_STEP))) + 1, 2))
