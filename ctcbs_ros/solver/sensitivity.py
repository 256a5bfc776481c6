"""How a steady state moves when the flight changes: implicit derivatives along families."""

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
        row[:] = family.exponents() * theta
        row[X_D] = 0.0
    out = np.empty((1, 2 + len(families), 6))
    status, _, _ = integrate(
        theta, directions, np.array([p.length]), _TOLERANCE, MAX_STEPS, out,
        np.empty(MAX_STEPS + 1),
    )
    if status != OK:
        return np.full((len(families), 3), np.inf)
    end, by_radius, along = out[0, 0], out[0, 1, :3], out[0, 2:, :3].copy()
    tension = np.linalg.norm(end[3:])
    by_length = end[3:] * (1.0 / tension + theta[G])
    for row, family in zip(along, families, strict=True):
        row += by_length * p.length * family.length
    x, y = end[:2]
    h_radius = x * by_radius[0] + y * by_radius[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        d_radius = -(x * along[:, 0] + y * along[:, 1]) / h_radius
        moved = along + d_radius[:, None] * by_radius
    d_lag = (x * moved[:, 1] - y * moved[:, 0]) / (x * x + y * y)
    return np.column_stack([d_radius, moved[:, 2], d_lag])
