"""Bifurcation diagrams against brute force: states counted, growth rates bisected, minimised."""

import csv
import json
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import yaml
from folding_flight import UNIT_SPEED, folding_mapping
from processes import LIMIT
from scipy.optimize import brentq, minimize_scalar

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.diagram import VARIED, diagram, first_minimum
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import eigenvalues, stability
from ctcbs_ros.solver.steady_state import correct_state, steady_states

# Fig. 3.1 and Fig. 4.1 of the thesis.
FIG_31 = Parameters(omega=1.0, length=3.0, end_mass=50.0, cable_drag=4.8, drag_ratio=1.0)
FIG_41 = Parameters(omega=1.0, length=3.0, end_mass=3.5, cable_drag=1.33, drag_ratio=0.1)
OMEGA = VARIED["omega"]


def count(parameters, omega):
    return len(steady_states(replace(parameters, omega=omega)).states)


def where_count_changes(parameters, low, high):
    """omega at which the number of states changes, by bisection."""
    first = count(parameters, low)
    while high - low > 1e-11:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if count(parameters, middle) == first else (low, middle)
    return 0.5 * (low + high)


def test_folds_are_where_the_number_of_states_changes():
    branches = diagram(FIG_31, OMEGA, 1.0, 0.05, 3.0, with_stability=False)
    folds = sorted(event.omega for branch in branches for event in branch.folds)
    assert len(branches) == 1
    assert branches[0].connected_to_zero
    expected = [where_count_changes(FIG_31, 0.85, 1.0), where_count_changes(FIG_31, 1.0, 1.2)]
    np.testing.assert_allclose(folds, expected, rtol=0, atol=2e-9)


def test_isolated_branch_is_found_and_told_from_the_connected_one():
    parameters = replace(FIG_31, cable_drag=2.7)
    branches = diagram(parameters, OMEGA, 1.0, 0.05, 3.0, with_stability=False)
    assert [branch.connected_to_zero for branch in branches] == [True, False]
    (fold,) = branches[1].folds
    expected = where_count_changes(parameters, 0.7, 1.2)
    assert fold.omega == pytest.approx(expected, abs=2e-9)


@pytest.mark.parametrize("elasticity", [float("inf"), 600.0])
def test_every_branch_passes_through_every_state(elasticity):
    parameters = replace(FIG_31, elasticity=elasticity)
    branches = diagram(parameters, OMEGA, 1.0, 0.05, 3.0, with_stability=False)
    for omega in np.random.default_rng(1).uniform(0.06, 2.9, 20):
        crossings = sum(
            (a.omega - omega) * (b.omega - omega) < 0.0
            for branch in branches
            for a, b in zip(branch.points[:-1], branch.points[1:], strict=True)
        )
        assert crossings == count(parameters, omega)


def test_hopf_points_are_the_edges_of_both_flutter_windows():
    (branch,) = diagram(FIG_41, OMEGA, 1.0, 0.05, 4.0)

    def growth(omega):
        (state,) = steady_states(replace(FIG_41, omega=omega)).states
        return stability(state, functions=(40,)).growth_rate

    brackets = ((1.8, 2.0), (2.0, 2.2), (2.7, 3.0))
    edges = [brentq(growth, *bracket, xtol=1e-8) for bracket in brackets]
    np.testing.assert_allclose([e.omega for e in branch.hopf], edges, atol=2e-4)
    assert [e.kind for e in branch.stability_changes] == ["hopf"] * 3
    # Thesis, Fig. 4.1: 1.8 to 2.2 and from 2.8 on.
    np.testing.assert_allclose(edges, [1.8, 2.2, 2.8], atol=0.25)
    assert all(0.6 < e.frequency < 0.8 for e in branch.hopf)


def test_window_of_flutter_narrower_than_a_step_is_found():
    parameters = replace(FIG_41, cable_drag=1.73)
    (branch,) = diagram(parameters, OMEGA, 1.0, 0.05, 2.5)

    def growth(omega):
        (state,) = steady_states(replace(parameters, omega=omega)).states
        return stability(state, functions=(40,)).growth_rate

    worst = minimize_scalar(lambda w: -growth(w), bounds=(1.9, 1.98), method="bounded").x
    edges = [brentq(growth, 1.85, worst), brentq(growth, worst, 2.05)]
    np.testing.assert_allclose([e.omega for e in branch.hopf], edges, atol=2e-4)
    # No point of the branch lies in the window: it shows in the slopes at its ends alone.
    assert not any(edges[0] < point.omega < edges[1] for point in branch.points)


def test_pair_of_folds_closer_than_a_step_is_found():
    # Just below the cusp at d_n 6.157654.
    parameters = replace(FIG_31, cable_drag=6.14)
    (branch,) = diagram(parameters, OMEGA, 1.0, 0.05, 3.0, with_stability=False)
    folds = sorted(event.omega for event in branch.folds)
    inside = 0.5 * (folds[0] + folds[1])
    assert folds[1] - folds[0] < 1e-3
    assert [count(parameters, w) for w in (folds[0] - 1e-6, inside, folds[1] + 1e-6)] == [1, 3, 1]


@pytest.mark.parametrize("drag", [0.4396, 0.4397, 0.4399])
def test_branches_keep_apart_where_they_almost_touch(drag):
    # A light mass on a long cable: two branches touch at d_n 0.439716, omega 2.17604.
    parameters = Parameters(1.0, 6.0, 3.5, drag, 0.1)
    branches = diagram(parameters, OMEGA, 1.0, 0.05, 3.0, with_stability=False)
    for omega in (0.5, 2.05, 2.1, 2.15, 2.17, 2.18, 2.2, 2.4, 2.9):
        crossings = sum(
            (a.omega - omega) * (b.omega - omega) < 0.0
            for branch in branches
            for a, b in pairwise(branch.points)
        )
        assert crossings == count(parameters, omega)


@pytest.mark.parametrize("drag", [4.8, 2.7])  # connected to omega -> 0, and an isolated branch
def test_folds_of_the_inextensible_cable_are_where_its_stability_changes(drag):
    # Its vibration stretches with a gamma of 600 and shows the divergence only from omega 1.035
    # to 0.939 (d_n 4.8).
    branch = diagram(replace(FIG_31, cable_drag=drag), OMEGA, 1.0, 0.05, 3.0)[-1]
    assert [e.kind for e in branch.stability_changes] == ["fold"] * len(branch.folds) + ["hopf"]
    assert not branch.divergences
    between = [p for p in branch.points if p.verdict == "divergence"]
    inner, *outer = sorted(e.end_mass_radius for e in branch.folds)
    assert all(inner < p.end_mass_radius < max(outer, default=np.inf) for p in between)
    assert min(p.growth_rate for p in between) > 0.0
    assert {p.verdict for p in branch.points} == {"stable", "divergence", "flutter"}


@pytest.mark.parametrize("elasticity", [float("inf"), 600.0])
def test_along_a_branch_the_slope_changes_sign_at_its_folds_and_nowhere_else(elasticity):
    parameters = replace(FIG_31, elasticity=elasticity, cable_drag=2.7)
    for branch in diagram(parameters, OMEGA, 1.0, 0.05, 3.0, with_stability=False):
        states = [
            correct_state(replace(parameters, omega=p.omega), p.end_mass_radius)
            for p in branch.points
        ]
        rising = [state.slope > 0.0 for state in states if state is not None]
        assert sum(a != b for a, b in pairwise(rising)) == len(branch.folds)
        assert rising[0] or not branch.connected_to_zero


def test_folds_of_a_cable_that_stretches_are_where_its_stability_changes():
    parameters = replace(FIG_31, elasticity=600.0, cable_drag=2.7)
    (branch,) = diagram(parameters, OMEGA, 1.0, 0.05, 3.0)
    assert [e.kind for e in branch.stability_changes] == ["fold", "fold", "hopf"]
    assert not branch.divergences


def test_first_minimum_of_the_radius_is_the_least_of_its_neighbourhood():
    branches = diagram(FIG_41, OMEGA, 1.0, 0.05, 4.0, with_stability=False)

    def radius(omega):
        (state,) = steady_states(replace(FIG_41, omega=omega)).states
        return state.end_mass_radius

    best = minimize_scalar(radius, bounds=(1.9, 2.7), method="bounded", options={"xatol": 1e-9})
    minimum = first_minimum(branches)
    assert minimum.end_mass_radius == pytest.approx(best.fun, rel=1e-12)
    assert minimum.omega == pytest.approx(best.x, abs=1e-6)


@pytest.mark.parametrize("vary", ["length", "end_mass", "cable_drag", "drag_ratio"])
def test_points_of_any_varied_parameter_are_steady_states(vary):
    value = getattr(FIG_31, vary)
    branches = diagram(FIG_31, VARIED[vary], value, 0.6 * value, 1.6 * value, with_stability=False)
    for branch in branches:
        for point in branch.points[:: max(len(branch.points) // 6, 1)]:
            changed = {vary: point.value}
            if vary == "end_mass":
                changed["end_weight"] = point.value
            states = steady_states(replace(FIG_31, **changed)).states
            radii = np.array([s.end_mass_radius for s in states])
            assert np.abs(radii / point.end_mass_radius - 1.0).min() < 1e-6


def test_empty_range_is_refused():
    with pytest.raises(InputError, match="0 < from < to"):
        diagram(FIG_31, OMEGA, 1.0, 3.0, 2.0)


def ctcbs(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", "branch", *arguments],
        capture_output=True, text=True, timeout=LIMIT,
    )


def test_branch_command_gives_json_csv_and_a_picture(tmp_path):
    done = ctcbs(
        "--vary", "radius", "--from", "100", "--to", "250", "--speed", "50",
        "--config", "design_example", "--json",
        "--csv", str(tmp_path / "b.csv"), "--plot", str(tmp_path / "b.png"),
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    (branch,) = result["branches"]
    assert branch["connected_to_zero"] is True
    assert branch["points"][0]["radius_m"] == pytest.approx(100.0)
    # Thesis, Chapter 5: all stable, x_d near 0.08 at a = 250 m with Table 5.1's end mass.
    assert all(point["stable"] for point in branch["points"])
    assert branch["points"][-1]["end_mass_radius"] == pytest.approx(0.08, abs=0.001)
    assert result["folds"] == result["hopf"] == []
    rows = list(csv.DictReader((tmp_path / "b.csv").open()))
    assert len(rows) == len(branch["points"])
    assert float(rows[-1]["end_mass_radius_m"]) == pytest.approx(0.08 * 250.0, abs=0.25)
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("vary", "low", "high", "others"),
    [
        ("radius", 100.0, 250.0, {"speed": 50.0}),
        ("speed", 30.0, 60.0, {"radius": 250.0}),
        ("cable_length", 300.0, 1000.0, {"radius": 250.0, "speed": 50.0}),
    ],
)
def test_branch_in_si_has_the_steady_states_of_each_point_scaled_by_itself(
    vary, low, high, others
):
    flags = [f"--{name}={value}" for name, value in others.items()]
    done = ctcbs(
        "--config", "design_example", "--vary", vary, "--from", str(low), "--to", str(high),
        *flags, "--json",
    )
    assert done.returncode == 0, done.stderr
    (branch,) = json.loads(done.stdout)["branches"]
    configuration = load_configuration("design_example")
    name = {"radius": "radius_m", "speed": "speed_m_s", "cable_length": "cable_length_m"}[vary]
    assert [branch["points"][i][name] for i in (0, -1)] == pytest.approx([low, high])
    for point in branch["points"][::5]:
        flown = {"cable_length": None, **others, vary: point[name]}
        flight = flight_point(
            configuration, flown["radius"], flown["speed"],
            configuration.air.density_at(0.0), flown["cable_length"],
        )
        (state,) = steady_states(flight.parameters).states
        assert point["omega"] == pytest.approx(flight.parameters.omega, rel=1e-12)
        assert point["end_mass_radius"] == pytest.approx(state.end_mass_radius, rel=1e-8)
        assert point["growth_rate"] == pytest.approx(stability(state).growth_rate, rel=0.02)
        assert point["status"] == "ok"
        si = flight.state_si(state, stability(state))
        assert point["end_mass_radius_m"] == pytest.approx(si["end_mass_radius_m"], rel=1e-8)
        assert point["growth_rate_per_s"] == pytest.approx(si["growth_rate_per_s"], rel=0.02)


@pytest.fixture
def folding_file(tmp_path):
    """Fig. 3.1, d_n 4.8, at a tow radius of 100 m; omega 1 is 31.3 m/s."""
    file = tmp_path / "folding.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": folding_mapping()}}))
    return file


def test_events_in_si_are_those_of_figure_3_1_scaled(folding_file, capsys):
    arguments = ["branch", "--config", str(folding_file), "--radius=100", "--vary=speed"]
    assert main([*arguments, "--from=10", "--to=80", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    (branch,) = diagram(FIG_31, OMEGA, 1.0, 10.0 / UNIT_SPEED, 80.0 / UNIT_SPEED)
    for key, events in (("folds", branch.folds), ("hopf", branch.hopf)):
        for found, event in zip(result[key], events, strict=True):
            assert found["speed_m_s"] == pytest.approx(event.omega * UNIT_SPEED, rel=1e-6)
            assert found["end_mass_radius_m"] == pytest.approx(
                100.0 * event.end_mass_radius, rel=1e-6
            )
            assert found["branch"] == 1
    (hopf,) = result["hopf"]
    assert hopf["frequency_per_s"] == hopf["frequency"] * hopf["speed_m_s"] / 100.0

    assert main([*arguments, "--from=10", "--to=80"]) == 0
    shown = capsys.readouterr().out
    assert "branch  " in shown
    assert "speed[m/s]  end-mass radius[m]" in shown
    lines = [line for line in shown.splitlines() if line.startswith(("fold", "Hopf"))]
    assert len(lines) == 3
    for line, event in zip(
        lines, sorted([*result["folds"], *result["hopf"]], key=lambda e: e["omega"]), strict=True
    ):
        assert f"{event['speed_m_s']:.7g}" in line
        assert f"{event['end_mass_radius_m']:.6g}" in line
    assert all(line.endswith("changes") for line in lines)


def test_main_and_isolated_branches_are_named_and_explained(capsys):
    arguments = "branch --vary omega --from 0.5 --to 1.5 --length 3 --end-mass 50 --drag-ratio 1"
    assert main([*arguments.split(), "--cable-drag", "2.7"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in shown[1:3]] == [["1", "main"], ["2", "isolated"]]
    assert shown[3].startswith("  main: leads to the one state at omega -> 0")
    assert shown[4].startswith("  isolated: does not")


def test_points_stretched_beyond_reason_say_so_and_the_branch_goes_on():
    parameters = Parameters(1.0, 3.0, 100.0, 1.0, 1.0, elasticity=40.0)
    branches = diagram(parameters, OMEGA, 1.0, 0.05, 1.0)
    statuses = {point.status for branch in branches for point in branch.points}
    assert statuses == {"ok", "stretched beyond a strain of 3"}
    for branch in branches:
        for point in branch.points:
            tension = np.hypot(1.0, point.omega**2 * point.end_mass_radius) * 100.0
            if tension > 3.2 * 40.0:
                assert point.status != "ok"


def test_parameters_beyond_table_2_1_are_computed_with_a_note():
    done = ctcbs(
        "--vary", "omega", "--from", "1", "--to", "3.5", "--length", "3", "--end-mass", "50",
        "--cable-drag", "12", "--drag-ratio", "1", "--json",
    )
    assert done.returncode == 0
    result = json.loads(done.stdout)
    assert result["notes"] == [
        "omega 1 to 3.5: beyond the thesis's Table 2.1 (0 to 3), computed all the same"
    ]
    assert f"ctcbs: note: {result['notes'][0]}\n" == done.stderr
    assert result["folds"] == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--vary", "omega", "--from", "1", "--to", "2"], "missing: --length"),
        (["--vary", "speed", "--from", "1", "--to", "2"], "needs --config; without it vary omega"),
        (
            ["--vary", "wind", "--from", "1", "--to", "2"],
            "'wind' cannot vary; omega, length, end-mass, cable-drag or drag-ratio can, and with "
            "--config radius, speed or cable-length",
        ),
        (
            ["--vary", "end_mass", "--from", "1", "--to", "2", "--config", "small_drone"],
            "--vary end-mass: not with --config; vary radius, speed or cable-length",
        ),
        (["--vary", "omega", "--omega", "1", "--from", "1", "--to", "2"], "--omega 1: not with"),
        (["--vary", "omega", "--radius", "80", "--from", "1", "--to", "2"], "--radius: only with"),
        (
            ["--vary", "speed", "--from", "10", "--to", "20", "--config", "small_drone",
             "--radius", "60", "--speed", "15"],
            "--speed 15: not with --vary speed",
        ),
        (
            ["--vary", "omega", "--from", "2", "--to", "1", "--length", "3", "--end-mass", "50",
             "--cable-drag", "5", "--drag-ratio", "1"],
            "0 < from < to",
        ),
    ],
)
def test_branch_command_refuses_bad_input_in_one_line(arguments, said):
    done = ctcbs(*arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("parameters", "high", "events"),
    [
        # The first minimum is at omega 2.132, the fold at 1.09818, both by an integrator of
        # another kind (variable-order Adams); the step of the trace goes beyond them.
        (replace(FIG_41, cable_drag=3.0), 2.12, "minima"),
        (FIG_31, 1.098, "folds"),
        # The fold is at 1.098181083: the trace goes round it in one step.
        (FIG_31, 1.098181, "folds"),
    ],
)
def test_events_just_beyond_the_range_are_not_listed_at_its_end(parameters, high, events):
    def listed(end):
        branches = diagram(parameters, OMEGA, 1.0, 0.05, end, with_stability=False)
        return [e.value for branch in branches for e in getattr(branch, events)]

    assert not any(value > 0.99 * high for value in listed(high))
    assert sum(high < value < 1.01 * high for value in listed(1.02 * high)) == 1


def test_closed_branch_is_listed_once():
    # Three states from end mass 3.83 to 87.2 by a scan of the boundary condition.
    parameters = Parameters(0.730741, 5.914303, 3.5, 0.1106494, 0.5568789, elasticity=394.4854)
    branches = diagram(
        parameters, VARIED["end_mass"], 3.5, 3.5, 100.0, with_stability=False
    )
    for mass in (4.0, 10.0, 40.0, 80.0):
        crossings = sum(
            (a.value - mass) * (b.value - mass) < 0.0
            for branch in branches
            for a, b in pairwise(branch.points)
        )
        states = steady_states(replace(parameters, end_mass=mass, end_weight=mass)).states
        assert crossings == len(states) == 3
    assert sorted(len(branch.folds) for branch in branches) == [0, 2]


@pytest.mark.parametrize(("high", "branches"), [(3.0, 2), (60.0, 1)])
def test_branch_that_folds_beyond_omega_6_is_connected_all_the_same(high, branches):
    # The fold is at omega 8.73: between it and that at 0.938 there are three states.
    parameters = replace(FIG_31, cable_drag=4.1888)
    assert [count(parameters, omega) for omega in (0.9, 6.0, 8.7, 8.8)] == [1, 3, 3, 1]
    found = diagram(parameters, OMEGA, 1.0, 0.05, high, with_stability=False)
    assert [branch.connected_to_zero for branch in found] == [True] * branches
    if high > 8.8:
        assert first_minimum(found) is not None


def test_growth_that_too_few_functions_do_not_see_has_its_hopf_point():
    # With 12 functions this mode decays up to omega 3. The values are zeros of an Evans
    # determinant, with an integrator of another kind.
    parameters = Parameters(1.0, 4.808, 4.1534, 0.38445, 0.26239)
    (branch,) = diagram(parameters, OMEGA, 1.0, 1.0, 3.0)
    np.testing.assert_allclose([e.value for e in branch.hopf], [1.8224, 1.9040, 2.6626], atol=2e-4)
    assert [e.kind for e in branch.stability_changes] == ["hopf"] * 3


def test_hopf_point_beside_a_fold_is_found():
    # Both values by an Evans determinant and another integrator.
    parameters = Parameters(2.25092, 1.5, 13.37735, 1.504494, 0.502005)
    branches = diagram(parameters, VARIED["length"], 1.5, 1.5, 1.8)
    (branch,) = [branch for branch in branches if branch.folds]
    assert [e.value for e in branch.folds] == pytest.approx([1.58061], abs=1e-5)
    assert [e.value for e in branch.hopf] == pytest.approx([1.58069], abs=1e-5)


def test_growing_mode_that_comes_into_the_band_is_no_hopf_point():
    parameters = Parameters(1.0, 1.84347, 4.32625, 0.0998634, 0.143938)
    branch = diagram(parameters, OMEGA, 1.0, 1.5, 2.1)[0]
    (change,) = branch.stability_changes
    assert change.kind == "band"
    assert not branch.hopf

    def fastest(omega):
        (state,) = [
            s for s in steady_states(replace(parameters, omega=omega)).states
            if s.end_mass_radius > 1.0
        ]
        modes = eigenvalues(state, 18)
        return modes[np.argmin(np.abs(modes - 5.0j))]

    edge = brentq(lambda omega: fastest(omega).imag - 5.0, 1.7, 1.9)
    assert change.value == pytest.approx(edge, abs=1e-5)
    assert fastest(edge).real > 0.002


def test_picture_of_an_unknown_kind_is_refused_before_the_work(tmp_path, capsys):
    picture = tmp_path / "branch.xyz"
    arguments = "branch --vary omega --from 0.5 --to 1 --length 3 --end-mass 50 --cable-drag 10"
    assert main([*arguments.split(), "--drag-ratio", "1", "--plot", str(picture)]) == 2
    assert "must end in .png, .pdf, .svg" in capsys.readouterr().err
    assert not picture.exists()
