"""Where a discretised cable rests: in the frame that turns with the tow point, or towed straight.

Newton's method on the nodes' forces, in the turning frame with the centrifugal ones, started from
the solver's shape or from one built up from the end mass. Unlike a run in time it also finds the
states that are not stable.
"""

import numpy as np

from ctcbs_ros.dynamics.cable import CableState
from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.kernels.block_tridiagonal import factorise, solve
from ctcbs_ros.kernels.cable_forces import derivatives, forces, masses
from ctcbs_ros.solver.steady_state import SteadyState

_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
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
    try:
        _rest(line, nodes, lambda x: x @ _TURN.T, _TURN)
    except ArithmeticError as error:
        raise ArithmeticError(f"near end-mass radius {state.end_mass_radius:g}: {error}") from None
    return CableState(0.0, nodes, nodes @ _TURN.T)


def trailing(
    line: Line, segments: int, tow_point=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0),
    wind=(0.0, 0.0, 0.0),
) -> CableState:  # fmt: skip
    """The cable towed straight at constant velocity, at rest in the tow point's frame.

    Parameters
    ----------
    line : Line
    segments : int
    tow_point, velocity, wind : (3,) array_like

    Returns
    -------
    CableState
        At time 0.

    Raises
    ------
    ArithmeticError
        If Newton's method does not converge.
    """
    velocity, wind = np.asarray(velocity, float), np.asarray(wind, float)
    u = velocity - wind
    h = line.length / segments
    # From the mass up: what pulls on a segment is all below it, with the drag of the one before.
    pull = line.end_drag * np.linalg.norm(u) * u + [0.0, 0.0, line.end_weight]
    nodes = np.zeros((segments + 1, 3))
    for j in range(segments):
        tension = np.linalg.norm(pull)
        t = pull / tension
        nodes[j + 1] = nodes[j] + h * (1.0 + tension / line.stiffness) * t
        across = u - (u @ t) * t
        pull = pull + h * line.drag * np.linalg.norm(across) * across
        pull[2] += h * line.weight_per_length
    nodes += np.asarray(tow_point, float) - nodes[-1]
    _rest(line, nodes, lambda x: np.tile(velocity, (len(x), 1)), np.zeros((3, 3)), wind)
    return CableState(0.0, nodes, np.tile(velocity, (segments + 1, 1)))


def _rest(line: Line, nodes, speeds, turn, wind=(0.0, 0.0, 0.0)) -> None:
    """Move all nodes but the last, in place, to where no force is left."""
    size, rest = np.inf, np.inf
    for _ in range(_MOST_ITERATIONS):
        residual, step = _newton(line, nodes, speeds(nodes), turn, np.asarray(wind, float))
        rest = np.abs(residual).max()
        size = np.abs(step).max()
        if size < 1e-12 * line.length:
            return
        # A long step could turn a segment round.
        limit = 0.3 * line.length / (len(nodes) - 1)
        nodes[:-1] += step * min(1.0, limit / size)
    if not size < 1e-9 * line.length:
        raise ArithmeticError(
            f"no equilibrium of {len(nodes) - 1} segments: force {rest:.1e}, step {size:.1e}"
        )


def _newton(line: Line, nodes, speeds, turn, wind):
    """Forces in a frame that turns, (n, 3), and Newton's step that removes them."""
    n = len(nodes) - 1
    outward = -turn @ turn
    arguments = (line.packed(), line.end, wind, line.length, 0.0, 0.0)
    force, mass = np.empty((n, 3)), np.empty(n)
    forces(nodes, speeds, *arguments, force)
    masses(line.packed(), line.end, line.length, n, mass)
    force += mass[:, None] * nodes[:-1] @ outward
    by_x, by_v = np.empty((3, n, 3, 3)), np.empty((3, n, 3, 3))
    derivatives(nodes, speeds, *arguments, by_x, by_v)
    blocks = by_x + by_v @ turn
    blocks[1] += mass[:, None, None] * outward
    step = -force
    factorise(blocks[0], blocks[1], blocks[2])
    solve(blocks[0], blocks[1], blocks[2], step)
    return force, step
