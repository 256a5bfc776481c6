"""Cusps and the least drag for unique solutions, against scans of all states."""

from dataclasses import replace

import numpy as np
import pytest
from scans import FIG_31, most_states, states_at

from ctcbs_ros.solver.cusp import cusp, has_folds, least_unique_drag
from ctcbs_ros.solver.parameters import Parameters


@pytest.mark.parametrize("elasticity", [float("inf"), 600.0])
def test_folds_exist_just_below_the_cusp_and_not_just_above(elasticity):
    parameters = replace(FIG_31, elasticity=elasticity)
    found = cusp(parameters)
    near = found.omega * np.linspace(0.998, 1.002, 101)
    assert most_states(parameters, found.cable_drag * 1.001, near) == 1
    assert most_states(parameters, found.cable_drag * 0.995, near) == 3
    inside = [len(states_at(parameters, found.cable_drag * 0.995, omega)) for omega in near]
    radii = [
        s.end_mass_radius
        for omega in near[np.array(inside) == 3]
        for s in states_at(parameters, found.cable_drag * 0.995, omega)
    ]
    assert min(radii) < found.end_mass_radius < max(radii)


@pytest.mark.parametrize(
    ("length", "end_mass", "drag_ratio", "drag"),
    [(3, 50, 1, 6.157654), (3, 20, 1, 2.5556), (3, 100, 1, 12.162), (2, 50, 1, 18.698),
     (4, 50, 2, 2.0102), (3, 3.5, 0.1, 1.32888)],
)
def test_cusp_is_where_a_scan_of_all_states_found_it(length, end_mass, drag_ratio, drag):
    # From scans of the number of states over (omega, cable drag), refined by bisection.
    found = cusp(Parameters(1.0, length, end_mass, 1.0, drag_ratio))
    assert found.cable_drag == pytest.approx(drag, rel=5e-5)


def test_cusp_of_largest_drag_is_the_tip_of_a_narrow_tongue():
    # A light mass on a long cable: three states at drags of 2 to 172, far above the other folds.
    parameters = Parameters(1.0, 6.0, 3.5, 1.0, 0.1)
    found = cusp(parameters)
    near = found.omega * np.linspace(0.99, 1.02, 301)
    assert most_states(parameters, found.cable_drag * 1.005, near) == 1
    assert most_states(parameters, found.cable_drag * 0.97, near) == 3
    assert found.cable_drag > 150.0
    assert least_unique_drag(parameters) == pytest.approx(found.cable_drag, rel=1e-9)


def test_unique_counts_folds_that_enter_at_the_limit_of_omega():
    # No cusp up to omega 3: the fold comes from beyond.
    parameters = Parameters(1.0, 1.5, 100.0, 1.0, 0.1)
    assert cusp(parameters) is None
    drag = least_unique_drag(parameters)
    assert most_states(parameters, drag * 1.0001, np.linspace(2.99, 3.0, 21)) == 1
    assert len(states_at(parameters, drag * 0.9999, 3.0)) == 3


def test_folds_that_vanish_with_stretch_are_nowhere_in_a_scan_of_all_states():
    # With an elasticity of 60 the cable is stretched to more than twice its length.
    elastic = Parameters(1.0, 1.5, 100.0, 1.0, 4.0, elasticity=60.0)
    assert not has_folds(elastic)
    assert has_folds(replace(elastic, elasticity=float("inf")))
    omegas = np.linspace(0.1, 3.0, 80)
    for drag in np.geomspace(0.01, 100.0, 12):
        # Two states: a third is stretched beyond a strain of 3, where none is sought.
        assert most_states(elastic, drag, omegas) == 1


def test_unique_drag_falls_with_length_and_drag_ratio_and_rises_with_end_mass():
    # Thesis, Fig. 3.3 and its text.
    reference = cusp(FIG_31).cable_drag
    assert cusp(replace(FIG_31, length=4.0)).cable_drag < reference
    assert cusp(replace(FIG_31, drag_ratio=2.0)).cable_drag < reference
    assert cusp(replace(FIG_31, end_mass=100.0, end_weight=100.0)).cable_drag > reference
