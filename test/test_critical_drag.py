"""Critical drags against brute force, and the thesis's figures for them."""

import json
import subprocess
import sys
from dataclasses import replace
from math import inf, log

import numpy as np
import pytest
from processes import LIMIT
from scans import FIG_31, FIG_41, most_states, states_at
from scipy.optimize import brentq, minimize_scalar

from ctcbs_ros.cli.main import main
from ctcbs_ros.solver.critical_drag import (
    CriticalDrag,
    critical_drag,
    least_drag_stable_everywhere,
    least_stable_drag,
)
from ctcbs_ros.solver.cusp import cusp
from ctcbs_ros.solver.first_minimum import FirstMinimum
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.stability_loss import SAMPLED, first_zero_from_above


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


def test_a_rate_that_never_grows_needs_no_drag_and_one_that_grows_at_the_largest_has_none_enough():
    for rate, drag in ((-0.1, None), (0.1, inf)):
        found = first_zero_from_above(lambda *_, rate=rate: (rate, None), SAMPLED, 12)
        assert found == drag
        assert CriticalDrag(4.0, found, None).required == (drag or 4.0)


def test_where_the_minimum_ends_is_told_from_where_it_becomes_stable():
    assert not critical_drag(FIG_31).minimum_ends
    found = critical_drag(replace(FIG_31, length=1.5, elasticity=3000.0))
    assert found.minimum_ends
    at = FirstMinimum(replace(FIG_31, length=1.5, elasticity=3000.0)).at
    assert stability(at(log(found.stable) - 1e-3)).growth_rate > 0.01
    assert [at(log(found.stable) + above) for above in (0.01, 0.1)] == [None, None]


def test_command_says_whether_no_drag_is_needed_or_none_suffices(capsys, monkeypatch):
    def found(*values):
        monkeypatch.setattr(
            "ctcbs_ros.solver.critical_drag.critical_drag", lambda *_, **__: CriticalDrag(*values)
        )

    arguments = "critical-drag --length 5.7573 --end-mass 6.6487 --drag-ratio 3.947".split()
    # As `test_a_later_minimum_that_loses_stability_does_not_count` finds it.
    found(0.9, None, 1.8)
    assert main([*arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["stable"] is None
    assert result["reasons"] == {"stable": "none needed: holds at every d_n from 0.01 to 2000"}
    found(None, inf, 3.0)
    assert main([*arguments, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    suffices = "none suffices: fails even at d_n 2000"
    assert [result[key] for key in ("unique", "stable", "required")] == [None] * 3
    assert result["reasons"]["stable"] == result["reasons"]["required"] == suffices
    assert result["reasons"]["unique"].startswith("none needed")
    assert main(arguments) == 0
    header, *lines = capsys.readouterr().out.splitlines()
    assert header == "From which cable drag on, for omega up to 3:"
    assert [line.split("  ")[0] for line in lines] == [
        "there is one steady state",
        "the state at the first minimum of the end-mass radius is stable",
        "both",
        "every state of the branch from omega 0 on is stable",
    ]
    assert lines[1].endswith(f"is stable  {suffices}")
    assert lines[3].endswith("d_n 3")


def test_first_minimum_of_a_short_cable_is_judged_wherever_it_is():
    parameters = replace(FIG_31, length=2.0)
    drag = least_stable_drag(parameters)
    omegas = np.linspace(11.0, 18.0, 15)
    above, below = (minimum_by_scan(parameters, drag * k, omegas) for k in (1.001, 0.999))
    assert below.parameters.omega > 10.0
    assert stability(above).growth_rate < 0.0 < stability(below).growth_rate


@pytest.mark.slow
def test_drag_for_stability_everywhere_is_converged_at_a_large_omega():
    parameters = Parameters(1.0, 2.4907, 14.168, 1.0, 0.21138, elasticity=1629.7)

    def growth(drag):
        return stability(states_at(parameters, drag, 10.0)[0], functions=(60,)).growth_rate

    zero = brentq(growth, 34.0, 36.0, rtol=1e-6)
    assert least_drag_stable_everywhere(parameters, 10.0) == pytest.approx(zero, rel=1e-3)


def ctcbs(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", *arguments],
        capture_output=True, text=True, timeout=LIMIT,
    )


def test_commands_print_the_same_as_json():
    arguments = ["--length", "3", "--end-mass", "50", "--drag-ratio", "1", "--json"]
    done = ctcbs("cusp", *arguments)
    assert done.returncode == 0, done.stderr
    drag = json.loads(done.stdout)["cable_drag"]
    assert drag == pytest.approx(cusp(FIG_31).cable_drag, rel=1e-9)
    done = ctcbs("critical-drag", *arguments)
    assert set(json.loads(done.stdout)) == {
        "unique", "stable", "required", "stable_everywhere", "reasons"
    }


def test_missing_argument_is_refused_in_one_line():
    done = ctcbs("cusp", "--length", "3")
    assert done.returncode == 2
    assert done.stderr == "ctcbs: error: missing: --end-mass --drag-ratio\n"
