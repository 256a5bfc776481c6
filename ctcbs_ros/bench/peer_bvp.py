"""Peer: the steady state as a boundary-value problem by scipy.integrate.solve_bvp.

Position and tension vector over arc length, the end-mass radius an unknown parameter; started from
the guess's end-mass radius and the shape that belongs to it, as a warm start would be.
"""

import numpy as np
from scipy.integrate import solve_bvp

from ctcbs_ros.bench.peer_ivp import end_force, shapes, slope
from ctcbs_ros.solver.parameters import Parameters

TOLERANCE = 1e-6
# About the quickest here, from 5 to 200.
NODES = 60
_MOST_NODES = 20_000


def warm_start(p: Parameters, end_mass_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths (n,) and the shape (6, n) of a guess, not part of what is timed."""
    arc_lengths = np.linspace(0.0, p.length, NODES)
    return arc_lengths, shapes(p, end_mass_radius, arc_lengths, 1e-8)[:, 0]


def steady_state(
    p: Parameters, end_mass_radius: float, start, tolerance: float = TOLERANCE
) -> float:
    """The end-mass radius near a guess.

    Raises
    ------
    ArithmeticError
        If solve_bvp does not converge.
    """
    def rhs(_, y, _unknown):
        return np.concatenate(slope(p, y[:3], y[3:]))

    def ends(bottom, top, unknown):
        x = unknown[0]
        force = bottom[3:] - end_force(p, x)
        return np.array([bottom[0] - x, bottom[1], bottom[2], *force, top[0]**2 + top[1]**2 - 1])

    arc_lengths, shape = start
    found = solve_bvp(
        rhs, ends, arc_lengths, shape, p=[end_mass_radius], tol=tolerance, max_nodes=_MOST_NODES
    )
    if not found.success:
        raise ArithmeticError(f"solve_bvp: {found.message}")
    return float(found.p[0])
