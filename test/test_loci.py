"""Cusps and critical drags against brute force, and the thesis's figures for them."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from ctcbs_ros.solver.loci import critical_drag, cusp
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


def test_drag_for_unique_solutions_is_the_thesis_s_6_2():
    # Thesis, Fig. 3.1 and its text: no jumps for omega < 3 with d_n above 6.2.
    critical = critical_drag(FIG_31)
    assert critical.unique == pytest.approx(6.2, abs=0.1)
    assert critical.unique == pytest.approx(cusp(FIG_31).cable_drag, rel=1e-9)
    assert most_states(FIG_31, critical.unique * 1.01, np.linspace(0.05, 3.0, 200)) == 1
    assert most_states(FIG_31, critical.unique * 0.98, np.linspace(0.90, 0.93, 60)) == 3
    assert critical.required == max(critical.unique, critical.stable)


def test_state_at_the_first_minimum_loses_stability_at_the_stable_drag():
    critical = critical_drag(FIG_41)

    def growth_at_minimum(drag):
        def radius(omega):
            return states_at(FIG_41, drag, omega)[0].end_mass_radius

        best = minimize_scalar(
            radius, bounds=(1.7, 3.0), method="bounded", options={"xatol": 1e-7}
        )
        return stability(states_at(FIG_41, drag, best.x)[0]).growth_rate

    assert growth_at_minimum(critical.stable * 1.01) < 0.0
    assert growth_at_minimum(critical.stable * 0.99) > 0.0


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
    assert set(json.loads(done.stdout)) == {"unique", "stable", "required"}


def test_missing_argument_is_refused_in_one_line():
    done = ctcbs("cusp", "--length", "3")
    assert done.returncode == 2
    assert done.stderr == "ctcbs: error: missing: --end-mass --drag-ratio\n"
