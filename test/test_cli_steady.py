"""`ctcbs steady` as a process: its JSON, its two kinds of input, and what it refuses."""

import json
import subprocess
import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import pytest
from points import STRETCHED, design, figure_3_1
from processes import LIMIT
from reference_bvp import boundary_value_problem, brute_force

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

ROOT = Path(__file__).resolve().parents[1]
DESIGN = str(ROOT / "config" / "design_example.yaml")
KEYS = (
    "end_mass_radius", "depth", "phase_lag", "tension_end_mass", "tension_tow_point",
    "greatest_tension", "growth_rate", "frequency", "stable", "residual",
)  # fmt: skip
UNITS = {
    "end_mass_radius": "_m", "depth": "_m", "phase_lag": "_rad", "tension_end_mass": "_n",
    "tension_tow_point": "_n", "greatest_tension": "_n", "growth_rate": "_per_s",
    "frequency": "_per_s",
}  # fmt: skip


def _run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", "steady", *arguments],
        cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=False,
    )  # fmt: skip


def _flags(point):
    names = {"omega": "omega", "l": "length", "m": "end-mass", "d_n": "cable-drag",
             "f": "drag-ratio", "gamma": "elasticity"}  # fmt: skip
    return [f"--{names[key]}={value!r}" for key, value in point.items()]


def _solved(*arguments):
    done = _run(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


@pytest.mark.parametrize(("d_n", "number"), [(10.0, 1), (4.8, 3), (2.7, 3)])
def test_steady_prints_every_state_of_figure_3_1_as_solve_bvp_has_it(d_n, number):
    point = figure_3_1(d_n)
    result, messages = _solved(*_flags(point))
    assert messages == ""
    assert len(result["solutions"]) == number
    radii = [solution["end_mass_radius"] for solution in result["solutions"]]
    assert radii == sorted(radii)
    for solution, start in zip(result["solutions"], brute_force(point), strict=True):
        assert set(KEYS) <= set(solution)
        reference, _ = boundary_value_problem(point, start)
        assert solution["end_mass_radius"] == pytest.approx(reference.x_d, rel=1e-7)
        assert solution["depth"] == pytest.approx(reference.depth, rel=1e-7)
        assert solution["phase_lag"] == pytest.approx(reference.lag, abs=1e-7)
        assert solution["tension_tow_point"] == pytest.approx(
            reference.tension_tow_point, rel=1e-7
        )
        assert 0.0 <= solution["phase_lag"] < 2.0 * pi
        assert solution["frequency"] >= 0.0
        assert solution["stable"] == (solution["growth_rate"] < 0.0)
        assert solution["residual"] < 1e-9
        assert "si" not in solution


def test_parameters_are_echoed_with_null_for_an_infinite_elasticity():
    result, _ = _solved(*_flags(figure_3_1(10.0)))
    p = result["parameters"]
    assert (p["omega"], p["length"], p["end_mass"]) == (1.0, 3.0, 50.0)
    assert (p["cable_drag"], p["drag_ratio"], p["end_weight"]) == (10.0, 1.0, 50.0)
    assert p["density"] == 1.0
    assert p["elasticity"] is None
    assert p["vibration_elasticity"] == 600.0


def test_elasticity_is_that_of_the_steady_state_and_of_the_vibration():
    result, _ = _solved(*_flags(STRETCHED))
    (solution,) = result["solutions"]
    # docs/thesis.md ("Stretch", "Stability")
    assert solution["end_mass_radius"] == pytest.approx(0.15739, abs=5e-6)
    assert -solution["growth_rate"] == pytest.approx(0.0247, abs=6e-5)
    stiff = {**STRETCHED, "gamma": float("inf")}
    result, _ = _solved(*_flags(stiff), "--vibration-elasticity=600")
    assert -result["solutions"][0]["growth_rate"] == pytest.approx(0.0067, abs=5e-5)


def test_a_strain_that_no_cable_bears_is_told():
    soft, messages = _solved(*_flags({**figure_3_1(10.0), "gamma": 0.2}))
    (solution,) = soft["solutions"]
    # The weight of 50 alone stretches a cable of EA 0.2 by 250 of its lengths.
    assert 250.0 < solution["greatest_strain"] < 270.0
    assert f"state 1 of 1 is stretched by {solution['greatest_strain']:.3g} times its" in messages


def test_the_greatest_strain_is_that_of_solve_bvps_tension_and_none_without_stretch():
    point = {**figure_3_1(10.0), "gamma": 1e4}
    result, messages = _solved(*_flags(point))
    reference, _ = boundary_value_problem(point, brute_force(point)[0])
    # The tension rises all the way up here.
    assert result["solutions"][0]["greatest_strain"] == pytest.approx(
        reference.tension_tow_point / 1e4, rel=1e-7
    )
    assert messages == ""
    result, messages = _solved(*_flags({**point, "gamma": float("inf")}))
    assert result["solutions"][0]["greatest_strain"] == 0.0
    assert messages == ""


def test_a_search_that_is_given_up_is_told_and_ends_with_1(monkeypatch, capsys):
    monkeypatch.setattr("ctcbs_ros.kernels.search.MOST_WORK", 1)
    assert main(["steady", *_flags(figure_3_1(10.0))]) == 1
    out, err = capsys.readouterr()
    assert "radius/a" in out
    assert "the search was given up" in err


def test_the_state_between_two_folds_is_unstable_without_stretch():
    result, _ = _solved(*_flags(figure_3_1(4.8, 1.09)))
    assert [s["stable"] for s in result["solutions"]] == [True, False, True]
    assert result["solutions"][1]["nearest_loss"] == "divergence"
    assert result["solutions"][1]["growth_rate"] > 0.0


def test_configuration_gives_the_design_example_in_both_units():
    result, messages = _solved("--config", DESIGN, "--radius", "250", "--speed", "50")
    assert messages == ""
    (solution,) = result["solutions"]
    point = design(250.0)
    reference, _ = boundary_value_problem(point, brute_force(point)[0])
    assert solution["end_mass_radius"] == pytest.approx(reference.x_d, rel=1e-7)
    si = solution["si"]
    assert set(si) == {name + unit for name, unit in UNITS.items()}
    assert si["end_mass_radius_m"] == pytest.approx(250.0 * reference.x_d, rel=1e-7)
    assert si["depth_m"] == pytest.approx(250.0 * reference.depth, rel=1e-7)
    assert si["phase_lag_rad"] == solution["phase_lag"]
    # mu a g, from Table 5.1
    unit = 1100.0 * pi / 4.0 * 0.00048**2 * 250.0 * 9.80665
    assert si["tension_end_mass_n"] == pytest.approx(unit * reference.tension_end_mass, rel=1e-7)
    assert si["tension_tow_point_n"] == pytest.approx(unit * reference.tension_tow_point, rel=1e-7)
    # per radian times V/a = 0.2 rad/s
    assert si["growth_rate_per_s"] == pytest.approx(0.2 * solution["growth_rate"], rel=1e-12)
    assert si["frequency_per_s"] == pytest.approx(0.2 * solution["frequency"], rel=1e-12)


def test_configuration_with_less_cable_paid_out():
    result, _ = _solved(
        "--config", DESIGN, "--radius=100", "--speed=50", "--cable-length=500"
    )  # fmt: skip
    assert result["parameters"]["length"] == 5.0
    point = design(100.0, length=500.0)
    assert result["solutions"][0]["end_mass_radius"] == pytest.approx(
        brute_force(point)[0], rel=1e-7
    )


def test_a_shipped_configuration_goes_by_its_name():
    result, _ = _solved("--config", "small_drone", "--radius", "80", "--speed", "20")
    assert len(result["solutions"]) >= 1


def test_band_bounds_the_frequencies_that_count():
    flags = _flags(figure_3_1(10.0))
    wide, _ = _solved(*flags)
    narrow, _ = _solved(*flags, "--band", "0.6")
    assert narrow["solutions"][0]["frequency"] <= 0.6
    assert narrow["solutions"][0]["growth_rate"] <= wide["solutions"][0]["growth_rate"]


def test_the_table_for_people_has_a_line_for_every_state():
    done = _run(*_flags(figure_3_1(4.8)))
    assert done.returncode == 0
    header, *rows = done.stdout.splitlines()
    assert "radius/a" in header
    *rows, explained = rows
    assert len(rows) == 3
    assert [row.split()[-1] for row in rows] == ["yes", "NO", "yes"]
    # As everywhere else: a margin below zero is unstable.
    column = header.split().index("margin/rad")
    assert [float(row.split()[column]) > 0.0 for row in rows] == [True, False, True]
    assert explained.startswith("margin: decay rate")


GOOD = _flags(figure_3_1(10.0))
FLIGHT = ["--config", DESIGN, "--radius=250", "--speed=50"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "--omega"),
        (GOOD[1:], "--omega"),
        ([*GOOD[1:], "--omega=0"], "omega"),
        ([*GOOD[1:], "--omega=1e-300"], "omega"),
        ([*GOOD[1:], "--omega=-1"], "omega"),
        ([*GOOD[1:], "--omega=nan"], "omega"),
        ([*GOOD, "--length=inf"], "length"),
        ([*GOOD, "--length=1e-300"], "length"),
        ([*GOOD, "--drag-ratio=-0.1"], "drag_ratio"),
        ([*GOOD, "--elasticity=0"], "elasticity"),
        ([*GOOD, "--band=0"], "--band"),
        ([*GOOD, "--radius=100"], "--radius"),
        ([*FLIGHT, "--omega=1"], "--omega"),
        (FLIGHT[:2], "--radius"),
        (FLIGHT[:3], "--speed"),
        ([*FLIGHT[:3], "--speed=0"], "speed"),
        ([*FLIGHT, "--radius=-5"], "radius"),
        ([*FLIGHT, "--cable-length=nan"], "cable length"),
        (["--config=small_drone", *FLIGHT[2:], "--altitude=300"], "--altitude"),
        (["--config", "no/such/file.yaml", *FLIGHT[2:]], "no/such/file.yaml"),
    ],
)
def test_bad_input_ends_with_2_and_one_line_that_names_it(arguments, named):
    done = _run(*arguments, "--json")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert named in done.stderr


def test_a_word_for_a_number_ends_with_2_without_a_traceback():
    done = _run(*GOOD, "--length", "long", "--json")
    assert done.returncode == 2
    assert done.stdout == ""
    assert "--length" in done.stderr
    assert "Traceback" not in done.stderr


# The scaling behind --config.


def test_two_flights_of_equal_groups_are_one_flight_in_two_units():
    # everything Froude-scaled: lengths by k, times by sqrt(k), masses by k^3
    k = 3.0
    one = load_configuration(DESIGN)
    cable = replace(
        one.cable, length=k * one.cable.length, diameter=k * one.cable.diameter,
        youngs_modulus=k * one.cable.youngs_modulus,
    )  # fmt: skip
    end_mass = replace(
        one.end_mass, mass=k**3 * one.end_mass.mass, frontal_area=k**2 * one.end_mass.frontal_area
    )
    other = replace(one, cable=cable, end_mass=end_mass)
    small = flight_point(one, 200.0, 50.0, 1.18)
    large = flight_point(other, k * 200.0, k**0.5 * 50.0, 1.18)
    assert large.parameters.theta() == pytest.approx(small.parameters.theta(), rel=1e-12)
    assert large.parameters.length == pytest.approx(small.parameters.length, rel=1e-12)
    assert large.parameters.elasticity == pytest.approx(small.parameters.elasticity, rel=1e-12)
    states = [steady_states(flight.parameters).states[0] for flight in (small, large)]
    a, b = (
        flight.state_si(state, stability(state))
        for flight, state in zip((small, large), states, strict=True)
    )
    for name, power in (
        ("end_mass_radius_m", 1.0), ("depth_m", 1.0), ("phase_lag_rad", 0.0),
        ("tension_end_mass_n", 3.0), ("tension_tow_point_n", 3.0),
        ("greatest_tension_n", 3.0), ("growth_rate_per_s", -0.5), ("frequency_per_s", -0.5),
    ):  # fmt: skip
        assert b[name] == pytest.approx(k**power * a[name], rel=1e-7)


def test_buoyancy_is_counted_where_the_displaced_volume_is_given():
    one = load_configuration(DESIGN)
    assert flight_point(one, 250.0, 50.0, 1.18).parameters.density == 1.0
    light = replace(one, end_mass=replace(one.end_mass, displaced_volume=0.1))
    p = flight_point(light, 250.0, 50.0, 1.18).parameters
    # rho = 1 - rho_air A_0/mu = 1 - rho_air/rho_a; W = (M - rho_air V) g
    assert p.density == pytest.approx(1.0 - 1.18 / 1100.0, rel=1e-14)
    assert p.end_weight / p.end_mass == pytest.approx(1.0 - 0.118, rel=1e-14)


def test_axial_damping_is_a_time_constant_times_the_angular_rate():
    one = load_configuration(DESIGN)
    damped = replace(one, cable=replace(one.cable, axial_damping=0.3))
    assert flight_point(damped, 250.0, 50.0, 1.18).parameters.damping == pytest.approx(0.06)
