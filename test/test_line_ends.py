"""Ends of all branches on a line, each traced once, against a trace from every state."""

import numpy as np
import pytest
from points import figure_3_1, parameters

from ctcbs_ros.solver.branches import branch_end, reach
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.line_ends import line_ends
from ctcbs_ros.solver.steady_state import steady_states

LINES = {
    "three states between two folds": (figure_3_1(4.8, 0.7), ANGULAR_RATE, 1.4),
    "an isolated branch": (figure_3_1(2.7, 0.7), ANGULAR_RATE, 1.4),
    "near the cusp": (figure_3_1(5.8, 0.9), ANGULAR_RATE, 0.6),
    "stretched": ({**figure_3_1(2.7, 0.7), "gamma": 1000.0}, ANGULAR_RATE, 1.4),
    "no folds": (figure_3_1(10.0, 0.5), ANGULAR_RATE, 1.5),
    "in radius": (figure_3_1(3.0, 1.6), RADIUS_AT_SPEED, 1.5),
    "five states": (
        {"omega": 2.5, "l": 6.0, "m": 3.5, "d_n": 0.05, "f": 0.1}, ANGULAR_RATE, 0.3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LINES)
def test_every_state_of_a_line_ends_where_a_trace_from_it_does(name):
    point, family, width = LINES[name]
    taus = np.linspace(0.0, width, 9)
    p = parameters(point)
    states = [steady_states(family.at(p, tau)).states for tau in taus]
    found = line_ends(states, family, taus)
    for there, ends in zip(states, found, strict=True):
        assert ends.shape == (len(there), 2)
        for state, row in zip(there, ends, strict=True):
            how_far = reach(state.parameters, family)
            for end, direction, distance in zip(row, (-1, 1), how_far, strict=True):
                fold = branch_end(state, family, direction, distance)
                expected = np.nan if fold is None else fold.tau
                assert end == pytest.approx(expected, abs=1e-8, nan_ok=True)


def test_a_branch_is_traced_once_for_all_its_states(monkeypatch):
    from ctcbs_ros.solver import line_ends as module

    count = []
    original = module.traced
    monkeypatch.setattr(module, "traced", lambda *a: count.append(a) or original(*a))
    monkeypatch.setattr(module, "branch_end", None)
    taus = np.linspace(0.0, 1.4, 9)
    p = parameters(figure_3_1(2.7, 0.7))
    states = [steady_states(ANGULAR_RATE.at(p, tau)).states for tau in taus]
    assert max(map(len, states)) == 3
    line_ends(states, ANGULAR_RATE, taus)
    # the main branch and the isolated one, both ways
    assert len(count) == 4


def test_a_line_may_have_points_without_states():
    p = parameters(figure_3_1(4.8))
    states = [(), steady_states(p).states, ()]
    found = line_ends(states, ANGULAR_RATE, np.array([-0.1, 0.0, 0.1]))
    assert [ends.shape for ends in found] == [(0, 2), (3, 2), (0, 2)]
    assert np.isfinite(found[1]).any()
