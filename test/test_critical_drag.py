"""Cusps and critical drags against brute force, and the thesis's figures for them."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from ctcbs_ros.solver.critical_drag import (
    critical_drag,
    first_minimum_state,
    least_drag_stable_everywhere,
    least_stable_drag,
)
from ctcbs_ros.solver.cusp import cusp, has_folds, least_unique_drag
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

FIG_31 = Parameters(omega=1.0, length=3.0, end_mass=50.0, cable_drag=1.0, drag_ratio=1.0)
FIG_41 = Parameters(omega=1.0, length=3.0, end_mass=3.5, cable_drag=1.0, drag_ratio=0.1)


def states_at(parameters, drag, omega):
    return steady_states(replace(parameters, cable_drag=drag, omega=omega)).states


def most_states(parameters, drag, omegas):
    return max(len(states_at(parameters, drag, omega)) for omega in omegas)


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


def test_branch_is_all_stable_just_above_the_drag_for_stability_everywhere():
    drag = least_drag_stable_everywhere(FIG_41)

    def largest(drag):
        omegas = np.concatenate([np.linspace(0.3, 1.8, 8), np.linspace(1.9, 1.98, 17)])
        states = (states_at(FIG_41, drag, omega)[0] for omega in [*omegas, *np.linspace(2, 3, 9)])
        return max(stability(state, functions=(27,)).growth_rate for state in states)

    assert largest(drag * 1.01) < 0.0 < largest(drag * 0.98)
    assert drag > least_stable_drag(FIG_41)


def test_drag_for_unique_solutions_is_the_thesis_s_6_2():
    # Thesis, Fig. 3.1 and its text: no jumps for omega < 3 with d_n above 6.2.
    critical = critical_drag(FIG_31)
    assert critical.unique == pytest.approx(6.2, abs=0.1)
    assert critical.unique == pytest.approx(cusp(FIG_31).cable_drag, rel=1e-9)
    assert most_states(FIG_31, critical.unique * 1.01, np.linspace(0.05, 3.0, 200)) == 1
    assert most_states(FIG_31, critical.unique * 0.98, np.linspace(0.90, 0.93, 60)) == 3
    assert critical.required == max(critical.unique, critical.stable)


def test_state_at_the_first_minimum_loses_stability_at_the_stable_drag():
    drag_for_stable = least_stable_drag(FIG_41)

    def growth_at_minimum(drag):
        def radius(omega):
            return states_at(FIG_41, drag, omega)[0].end_mass_radius

        best = minimize_scalar(
            radius, bounds=(1.7, 3.0), method="bounded", options={"xatol": 1e-7}
        )
        return stability(states_at(FIG_41, drag, best.x)[0]).growth_rate

    assert growth_at_minimum(drag_for_stable * 1.01) < 0.0
    assert growth_at_minimum(drag_for_stable * 0.99) > 0.0


@pytest.mark.parametrize(
    ("length", "end_mass", "drag_ratio", "drag"),
    [(3, 50, 1, 3.0268), (3, 20, 1, 1.7245), (3, 100, 1, 17.947), (4, 50, 2, 0.91545),
     (3, 3.5, 0.1, 1.1348)],
)
def test_stable_drag_is_where_another_integrator_and_an_evans_determinant_found_it(
    length, end_mass, drag_ratio, drag
):
    found = least_stable_drag(Parameters(1.0, length, end_mass, 1.0, drag_ratio))
    assert found == pytest.approx(drag, rel=1e-3)


def minimum_by_scan(parameters, drag, omegas):
    """The state of least radius inside a range of omega in which there is one state, or None."""
    radii = [states_at(parameters, drag, omega)[0].end_mass_radius for omega in omegas]
    inside = [i for i in range(1, len(radii) - 1) if radii[i - 1] > radii[i] < radii[i + 1]]
    if not inside:
        return None
    i = inside[0]
    best = minimize_scalar(
        lambda omega: states_at(parameters, drag, omega)[0].end_mass_radius,
        bounds=(omegas[i - 1], omegas[i + 1]), method="bounded", options={"xatol": 1e-7},
    )
    return states_at(parameters, drag, best.x)[0]


def test_stable_drag_is_the_birth_of_an_unstable_minimum_before_a_stable_one():
    parameters = Parameters(1.0, 5.0703, 16.024, 1.0, 0.61138, elasticity=386.43)
    drag = least_stable_drag(parameters)
    omegas = np.linspace(1.2, 2.5, 66)
    assert minimum_by_scan(parameters, drag * 1.001, omegas) is None
    assert stability(minimum_by_scan(parameters, drag * 0.999, omegas)).growth_rate > 0.01
    # The minimum that was the first above the jump.
    later = np.linspace(4.6, 5.1, 26)
    assert stability(minimum_by_scan(parameters, drag * 1.001, later)).stable


@pytest.mark.parametrize(
    ("parameters", "first", "drags"),
    [
        (Parameters(1.0, 5.3202, 91.151, 1.0, 0.79913, elasticity=394.95), 3.42, (0.12, 0.15)),
        (Parameters(1.0, 5.7573, 6.6487, 1.0, 3.947), 1.277, (0.24, 0.3)),
    ],
)
def test_a_later_minimum_that_loses_stability_does_not_count(parameters, first, drags):
    for drag in drags:
        omegas = first * np.linspace(0.95, 1.05, 21)
        assert stability(minimum_by_scan(parameters, drag, omegas)).stable
    assert least_stable_drag(parameters) is None


def test_first_minimum_of_a_short_cable_is_judged_wherever_it_is():
    parameters = replace(FIG_31, length=2.0)
    drag = least_stable_drag(parameters)
    omegas = np.linspace(11.0, 18.0, 15)
    above, below = (minimum_by_scan(parameters, drag * k, omegas) for k in (1.001, 0.999))
    assert below.parameters.omega > 10.0
    assert stability(above).growth_rate < 0.0 < stability(below).growth_rate


def test_a_minimum_beyond_the_limit_is_not_reported_at_the_limit():
    # The minimum lies at omega 10.1.
    parameters = replace(FIG_31, length=2.0, cable_drag=51.5)
    assert first_minimum_state(parameters) is None
    assert first_minimum_state(parameters, 20.0).parameters.omega == pytest.approx(10.14, abs=0.01)


@pytest.mark.slow
def test_drag_for_stability_everywhere_is_converged_at_a_large_omega():
    parameters = Parameters(1.0, 2.4907, 14.168, 1.0, 0.21138, elasticity=1629.7)

    def growth(drag):
        return stability(states_at(parameters, drag, 10.0)[0], functions=(60,)).growth_rate

    zero = brentq(growth, 34.0, 36.0, rtol=1e-6)
    assert least_drag_stable_everywhere(parameters, 10.0) == pytest.approx(zero, rel=1e-3)


def test_unique_drag_falls_with_length_and_drag_ratio_and_rises_with_end_mass():
    # Thesis, Fig. 3.3 and its text.
    reference = cusp(FIG_31).cable_drag
    assert cusp(replace(FIG_31, length=4.0)).cable_drag < reference
    assert cusp(replace(FIG_31, drag_ratio=2.0)).cable_drag < reference
    assert cusp(replace(FIG_31, end_mass=100.0, end_weight=100.0)).cable_drag > reference


def ctcbs(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", *arguments],
        capture_output=True, text=True, timeout=120,
    )


def test_commands_print_the_same_as_json():
    arguments = ["--length", "3", "--end-mass", "50", "--drag-ratio", "1", "--json"]
    done = ctcbs("cusp", *arguments)
    assert done.returncode == 0, done.stderr
    drag = json.loads(done.stdout)["cable_drag"]
    assert drag == pytest.approx(cusp(FIG_31).cable_drag, rel=1e-9)
    done = ctcbs("critical-drag", *arguments)
    assert set(json.loads(done.stdout)) == {
        "unique", "stable", "required", "stable_everywhere"
    }


def test_missing_argument_is_refused_in_one_line():
    done = ctcbs("cusp", "--length", "3")
    assert done.returncode == 2
    assert done.stderr == "ctcbs: error: missing: --end-mass --drag-ratio\n"
