"""How a steady state moves when the flight changes: implicit derivatives along families."""

from math import hypot

import numpy as np

from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import N_THETA, OK, X_D, G, integrate
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.steady_state import SteadyState

_TOLERANCE = 1e-8


def sensitivities(state: SteadyState, families: tuple[Family, ...]) -> np.ndarray:
    """Derivatives of a steady state along families.

    Parameters
    ----------
    state : SteadyState
    families : tuple of k Family

    Returns
    -------
    (k, 3) ndarray
        d(end_mass_radius, depth, phase_lag)/d tau, non-dimensional; infinite at a fold.

    Notes
    -----
    With h the tow-circle condition of thesis (2.17), d x_d/d tau = -(dh/dtau)/(dh/dx_d), both from
    the variational equations.
    """
    p = state.parameters
    theta = p.theta(state.end_mass_radius)
    directions = np.zeros((1 + len(families), N_THETA))
    directions[0, X_D] = 1.0
    for row, family in zip(directions[1:], families, strict=True):
        np.multiply(family.exponents(), theta, out=row)
        row[X_D] = 0.0
    out = np.empty((1, 2 + len(families), 6))
    status, _, _ = integrate(
        theta, directions, np.array([p.length]), _TOLERANCE, MAX_STEPS, out,
        np.empty(MAX_STEPS + 1),
    )
    if status != OK:
        return np.full((len(families), 3), np.inf)
    end, by_radius, *along = out[0].tolist()
    x, y = end[:2]
    strain = 1.0 / hypot(*end[3:]) + float(theta[G])
    by_length = [force * strain for force in end[3:]]
    h_radius = x * by_radius[0] + y * by_radius[1]
    if h_radius == 0.0:
        return np.full((len(families), 3), np.inf)
    found = np.empty((len(families), 3))
    for row, moved, family in zip(found, along, families, strict=True):
        longer = p.length * family.length
        dx, dy, dz = (m + longer * b for m, b in zip(moved[:3], by_length, strict=True))
        d_radius = -(x * dx + y * dy) / h_radius
        dx, dy, dz = (
            m + d_radius * b for m, b in zip((dx, dy, dz), by_radius[:3], strict=True)
        )
        row[:] = d_radius, dz, (x * dy - y * dx) / (x * x + y * y)
    return found
