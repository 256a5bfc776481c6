"""The nodes' forces of the cable in time, against differences and a peer that shares no code."""

import numpy as np
import pytest
from points import STRETCHED, figure_4_1, parameters
from reference_lumped_mass import LumpedMass

from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.kernels.block_tridiagonal import factorise, solve
from ctcbs_ros.kernels.cable_forces import derivatives, forces, masses


def tangle(seed, at_nodes=0.0, segments=5):
    """Any state of a cable in wind, paid out, damped, some of it slack."""
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.normal(size=(segments + 1, 3)), axis=0)
    v = rng.normal(size=(segments + 1, 3))
    line = np.array([1.0, 50.0, 0.1, 0.7, 2.0, at_nodes])
    end = np.array([2.0, 2.0, 1.5])
    return x, v, (line, end, rng.normal(size=3), 1.5 * segments, 0.3, 0.2)


@pytest.mark.parametrize("at_nodes", [0.0, 1.0], ids=["segments", "nodes"])
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_the_forces(seed, at_nodes):
    x, v, others = tangle(seed, at_nodes)
    n = len(x) - 1
    found = np.empty((3, n, 3, 3)), np.empty((3, n, 3, 3))
    derivatives(x, v, *others, *found)

    def at(positions, velocities):
        force = np.empty((n, 3))
        forces(positions, velocities, *others, force)
        return force

    for blocks, first in zip(found, (True, False), strict=True):
        for j in range(n + 1):
            for a in range(3):
                step = np.zeros_like(x)
                step[j, a] = 1e-6
                more = at(x + step, v) if first else at(x, v + step)
                less = at(x - step, v) if first else at(x, v - step)
                slope = (more - less) / 2e-6
                for i in range(n):
                    near = abs(j - i) <= 1
                    expected = blocks[j - i + 1, i, :, a] if near else 0.0
                    assert slope[i] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    "point", [STRETCHED, {**figure_4_1(1.33, 2.0), "gamma": 600.0}], ids=["heavy", "light"]
)
def test_forces_turned_with_the_tow_point_are_those_of_the_reference(point):
    # the reference works in the turning frame, in units of omega^2
    n, damping = 7, 0.02
    reference = LumpedMass(point, n, damping)
    line = line_of(parameters(point, damping=damping))
    rng = np.random.default_rng(1)
    down = np.linspace(-1.2 * point["l"], 0.0, n + 1)  # taut: the reference would push too
    x = np.column_stack([np.linspace(0.3, 1.0, n + 1), 0.0 * down, down])
    x[:-1] += 0.02 * rng.normal(size=(n, 3))
    slow = 0.1 * rng.normal(size=(n + 1, 3))
    slow[-1] = 0.0
    turn = np.cross([0.0, 0.0, 1.0], x)
    force, mass = np.empty((n, 3)), np.empty(n)
    forces(x, slow + turn, line.packed(), line.end, np.zeros(3), line.length, 0.0, 0.0, force)
    masses(line.packed(), line.end, line.length, n, mass)
    coriolis = 2.0 * np.cross([0.0, 0.0, 1.0], slow) + np.cross([0.0, 0.0, 1.0], turn)
    found = force / mass[:, None] - coriolis[:-1]
    expected = reference.acceleration(x[:-1].ravel(), slow[:-1].ravel()).reshape(n, 3)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_a_slack_cable_pushes_nothing():
    x = np.zeros((4, 3))
    x[:, 2] = np.linspace(-1.0, 0.0, 4)  # 3 long, 1 apart: slack everywhere
    force = np.empty((3, 3))
    forces(x, 0.0 * x, np.array([1.0, 600.0, 0.1, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]),
           np.zeros(3), 3.0, 0.0, 0.0, force)  # fmt: skip
    assert np.all(force == 0.0)


def test_the_block_tridiagonal_solution_is_numpys():
    rng = np.random.default_rng(2)
    n = 6
    low, mid, up = rng.normal(size=(3, n, 3, 3))
    mid += 6.0 * np.eye(3)
    whole = np.zeros((n, 3, n, 3))
    for i in range(n):
        whole[i, :, i] = mid[i]
        if i > 0:
            whole[i, :, i - 1] = low[i]
        if i < n - 1:
            whole[i, :, i + 1] = up[i]
    right = rng.normal(size=(n, 3))
    expected = np.linalg.solve(whole.reshape(3 * n, 3 * n), right.ravel()).reshape(n, 3)
    factorise(low, mid, up)
    solve(low, mid, up, right)
    assert right == pytest.approx(expected, rel=1e-10)
