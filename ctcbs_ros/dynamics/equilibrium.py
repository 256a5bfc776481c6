"""The steady state of the discretised cable: at rest in the frame that turns with the tow point.

Newton's method on the nodes' forces plus the centrifugal ones, started from the solver's shape.
Unlike a run in time it also finds the states that are not stable.
"""

import numpy as np

from ctcbs_ros.dynamics.cable import CableState
from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.kernels.block_tridiagonal import factorise, solve
from ctcbs_ros.kernels.cable_forces import derivatives, forces, masses
from ctcbs_ros.solver.steady_state import SteadyState

_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
_OUTWARD = np.diag([1.0, 1.0, 0.0])
_MOST_ITERATIONS = 50


def steady_cable(state: SteadyState, segments: int) -> CableState:
    """Segments along the solver's cable, the tow point at (1, 0, 0), turning at the rate 1.

    Each is as long as the tension in its middle stretches it: a chord of a stiff cable's arc would
    be slack. Non-dimensional: radii a, times 1/Omega (`line_of`).
    """
    s = np.linspace(0.0, state.parameters.length, 2 * segments + 1)
    shape, force = state.cable(s)
    c, d = shape[-1, :2] / np.hypot(*shape[-1, :2])
    back = np.array([[c, d, 0.0], [-d, c, 0.0], [0.0, 0.0, 1.0]])
    along = np.diff(shape[::2] @ back.T, axis=0)
    strain = np.linalg.norm(force[1::2], axis=1) / state.parameters.gamma
    size = state.parameters.length / segments * (1.0 + strain)
    along *= (size / np.linalg.norm(along, axis=1))[:, None]
    nodes = np.empty((segments + 1, 3))
    nodes[-1] = 1.0, 0.0, 0.0
    nodes[:-1] = nodes[-1] - np.cumsum(along[::-1], axis=0)[::-1]
    return CableState(0.0, nodes, nodes @ _TURN.T)


def equilibrium(state: SteadyState, segments: int, drag_at_nodes: bool = False) -> CableState:
    """Steady state of the discretised cable near one of the solver's.

    Parameters
    ----------
    state : SteadyState
    segments : int
    drag_at_nodes : bool
        As in `Line`.

    Returns
    -------
    CableState
        Non-dimensional, at time 0, the tow point at (1, 0, 0); it turns at the rate 1.

    Raises
    ------
    ArithmeticError
        If Newton's method does not converge: near a fold a coarse cable may have none.
    """
    line = line_of(state.parameters, drag_at_nodes)
    nodes = steady_cable(state, segments).positions.copy()
    size, rest = np.inf, np.inf
    for _ in range(_MOST_ITERATIONS):
        residual, step = _newton(line, nodes)
        rest = np.abs(residual).max()
        size = np.abs(step).max()
        if size < 1e-12 * line.length:
            return CableState(0.0, nodes, nodes @ _TURN.T)
        # A long step could turn a segment round.
        limit = 0.3 * line.length / segments
        nodes[:-1] += step * min(1.0, limit / size)
    if size < 1e-9 * line.length:
        return CableState(0.0, nodes, nodes @ _TURN.T)
    raise ArithmeticError(
        f"no equilibrium of {segments} segments near end-mass radius "
        f"{state.end_mass_radius:g}: force {rest:.1e}, step {size:.1e}"
    )


def _newton(line: Line, nodes):
    """Forces in the turning frame, (n, 3), and Newton's step that removes them."""
    n = len(nodes) - 1
    speeds = nodes @ _TURN.T
    arguments = (line.packed(), line.end, np.zeros(3), line.length, 0.0, 0.0)
    force, mass = np.empty((n, 3)), np.empty(n)
    forces(nodes, speeds, *arguments, force)
    masses(line.packed(), line.end, line.length, n, mass)
    force += mass[:, None] * nodes[:-1] @ _OUTWARD
    by_x, by_v = np.empty((3, n, 3, 3)), np.empty((3, n, 3, 3))
    derivatives(nodes, speeds, *arguments, by_x, by_v)
    blocks = by_x + by_v @ _TURN
    blocks[1] += mass[:, None, None] * _OUTWARD
    step = -force
    factorise(blocks[0], blocks[1], blocks[2])
    solve(blocks[0], blocks[1], blocks[2], step)
    return force, step
