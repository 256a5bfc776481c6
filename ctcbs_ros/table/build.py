"""Computation of the continuation table on every core: row by row, then column by column.

A row, of one tow radius, holds the states and the ends of their branches in angular rate; a
column, of one speed, the ends in radius.
"""

from concurrent.futures import as_completed
from math import nan

import numpy as np
from tqdm import tqdm

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.line_ends import line_ends
from ctcbs_ros.solver.sensitivity import sensitivities
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states
from ctcbs_ros.table.table import Table
from ctcbs_ros.worker_pool import worker_pool

NODES = 33
# One state: the fields of the table in the order of `_describe`, the last ones in pairs.
_SINGLE = (
    "end_mass_radius", "depth", "phase_lag", "tension_end_mass", "tension_tow_point",
    "growth_rate", "frequency", "functions",
)
_PAIRS = ("radius_slope", "fold_angular_rate", "fold_radius")
_WIDTH = len(_SINGLE) + 2 * len(_PAIRS)


def build_table(configuration: Configuration, nodes: int = NODES, progress: bool = True) -> Table:
    """Compute the table of a configuration over its envelope.

    Parameters
    ----------
    configuration : Configuration
    nodes : int
        Grid lines a quantity, equally spaced in its logarithm.
    progress : bool
        Show a progress bar on standard error.

    Returns
    -------
    Table
    """
    radius = np.geomspace(*configuration.envelope.radius, nodes)
    speed = np.geomspace(*configuration.envelope.speed, nodes)
    ground = configuration.limits.ground_level_amsl
    density = configuration.air.density_at(ground if np.isfinite(ground) else 0.0)
    with worker_pool() as pool, tqdm(
        total=radius.size + speed.size, desc="table", unit="line", disable=not progress
    ) as bar:
        rows = _gathered(
            bar, [pool.submit(_row, configuration, float(a), speed, density) for a in radius]
        )
        columns = _gathered(
            bar,
            [
                pool.submit(_column, [row[j][0] for row in rows], np.log(radius / radius[0]))
                for j in range(speed.size)
            ],
        )
    rows = [
        [
            [figures + list(folds) for figures, folds in zip(node[1], column[i], strict=True)]
            for node, column in zip(row, columns, strict=True)
        ]
        for i, row in enumerate(rows)
    ]
    count = np.array([[len(node) for node in row] for row in rows])
    most = max(int(count.max()), 1)
    states = np.full((radius.size, speed.size, most, _WIDTH), nan)
    for i, row in enumerate(rows):
        for j, node in enumerate(row):
            if node:
                states[i, j, : len(node)] = node
    single = {name: states[..., k].copy() for k, name in enumerate(_SINGLE)}
    first = len(_SINGLE)
    pairs = {
        name: states[..., first + 2 * k : first + 2 * k + 2].copy()
        for k, name in enumerate(_PAIRS)
    }
    return Table(
        radius=radius, speed=speed, density=float(density),
        cable_length=configuration.cable.length, end_mass=configuration.end_mass.mass,
        count=count, **single, **pairs,
    )


def _gathered(bar: tqdm, jobs: list) -> list:
    """The results of all jobs in their order."""
    for job in as_completed(jobs):
        # A failure shows at once, and not after all the others.
        job.result()
        bar.update()
    return [job.result() for job in jobs]


def _row(configuration: Configuration, radius: float, speeds: np.ndarray, density: float):
    """All states of one tow radius: a list of (states, their fields but the last two)."""
    states = [
        steady_states(flight_point(configuration, radius, float(speed), density).parameters).states
        for speed in speeds
    ]
    folds = line_ends(states, ANGULAR_RATE, np.log(speeds / speeds[0]))
    return [
        (there, [_describe(state) + list(ends) for state, ends in zip(there, at, strict=True)])
        for there, at in zip(states, folds, strict=True)
    ]


def _column(states: list[tuple[SteadyState, ...]], taus: np.ndarray) -> list[np.ndarray]:
    """Folds in radius of all states of one speed."""
    return line_ends(states, RADIUS_AT_SPEED, taus)


def _describe(state: SteadyState) -> list[float]:
    damping = stability(state)
    moves = sensitivities(state, (RADIUS_AT_SPEED, ANGULAR_RATE))[:, 0] / state.end_mass_radius
    return [
        state.end_mass_radius, state.depth, state.phase_lag,
        state.tension_end_mass, state.tension_tow_point,
        damping.growth_rate, damping.frequency, float(damping.functions),
        *moves,
    ]
