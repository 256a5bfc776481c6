"""`ctcbs periodic`: its JSON, its defaults, and what it refuses."""

import json

import pytest
from points import STRETCHED, parameters

from ctcbs_ros.cli.main import main
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

POINT = "--omega 1.6 --length 3 --end-mass 50 --cable-drag 10 --drag-ratio 1".split()


def run(capsys, *arguments):
    """Exit code, output and messages."""
    code = main(["periodic", *POINT, *arguments])
    done = capsys.readouterr()
    return code, done.out, done.err


def solved(capsys, *arguments):
    """The JSON of a run that has a result."""
    code, out, err = run(capsys, *arguments, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def test_without_wind_it_prints_the_steady_state_with_its_growth_rate(capsys):
    (state,) = steady_states(parameters(STRETCHED)).states
    result = solved(capsys, "--wind", "0")
    assert set(result) >= {"mean", "harmonics", "growth_rate", "stable", "residual"}
    assert result["mean"]["downwind"] == pytest.approx(0.0, abs=1e-9)
    assert result["mean"]["crosswind"] == pytest.approx(0.0, abs=1e-9)
    assert result["mean"]["depth"] == pytest.approx(state.depth, abs=1e-6)
    (first, *others) = result["harmonics"]
    assert first["order"] == 1
    assert others == []
    assert first["x"] == pytest.approx(state.end_mass_radius, abs=1e-6)
    assert first["y"] == pytest.approx(state.end_mass_radius, abs=1e-6)
    assert first["z"] == pytest.approx(0.0, abs=1e-9)
    assert result["growth_rate"] == pytest.approx(stability(state).growth_rate, rel=1e-4)
    assert result["frequency"] == pytest.approx(stability(state).frequency, rel=1e-4)
    assert result["stable"] is True
    assert result["residual"] < 1e-5


def test_it_lies_upwind_at_the_default_elasticity_and_downwind_where_it_is_stiff(capsys):
    # both as the cable in time has them: test_periodic
    soft, stiff = (solved(capsys, "--wind", ".05", *g) for g in ([], ["--elasticity", "6e4"]))
    assert soft["parameters"]["elasticity"] == 600.0
    assert soft["mean"]["downwind"] == pytest.approx(-0.0387, abs=1e-4)
    assert stiff["mean"]["downwind"] == pytest.approx(0.1405, abs=1e-4)
    orders = [row["order"] for row in soft["harmonics"]]
    assert orders == list(range(1, len(orders) + 1))
    assert len(orders) >= 3


def test_the_table_says_upwind_in_words_and_which_side(capsys):
    mean = solved(capsys, "--wind", ".05")["mean"]
    assert mean["downwind"] < 0.0 < mean["crosswind"]  # physics: upwind near the bounce
    _, out, _ = run(capsys, "--wind", ".05")
    assert f"mean: {-mean['downwind']:.5g} UPWIND (x {mean['downwind']:+.5g})" in out
    assert f"{mean['crosswind']:.5g} to the left of the circle's centre" in out
    assert "upwind can be right" in out
    _, out, _ = run(capsys, "--wind", ".05", "--elasticity", "6e4")
    assert "downwind (x +" in out
    assert "UPWIND" not in out
    _, out, _ = run(capsys, "--wind", "0")
    assert "mean: 0 downwind (x +0) and 0 to the left" in out


def test_the_path_at_constant_airspeed_is_another(capsys):
    ground, air = (
        solved(capsys, "--wind", ".05", "--path", path) for path in ("ground-speed", "airspeed")
    )
    assert ground["mean"]["crosswind"] == pytest.approx(0.0624, abs=1e-4)
    assert air["mean"]["crosswind"] == pytest.approx(0.0238, abs=1e-4)


def test_the_table_names_the_offset_and_the_verdict(capsys):
    code, out, err = run(capsys, "--wind", "0.05")
    assert (code, err) == (0, "")
    assert "UPWIND (x -0.03867" in out
    assert "stable" in out
    assert "margin 0.030" in out


def test_of_several_steady_states_the_one_that_straight_flight_leads_to_unless_told(capsys):
    several = "--omega 1 --cable-drag 4 --elasticity 1e5 --wind 0.02 --json".split()
    by_default, chosen = (run(capsys, *several, *which) for which in ([], ["--state", "1"]))
    assert by_default[2] == (
        "ctcbs: note: 3 steady states in still air; state 3 is continued, see --state\n"
    )
    assert chosen[2] == ""
    # so weak a wind changes the first order by less than a fiftieth
    wide, narrow = (json.loads(out) for _, out, _ in (by_default, chosen))
    for result in (wide, narrow):
        radius = result["still_air"]["end_mass_radius"]
        assert result["harmonics"][0]["x"] == pytest.approx(radius, rel=0.02)
    assert wide["still_air"]["end_mass_radius"] > 2.0 * narrow["still_air"]["end_mass_radius"]


@pytest.mark.slow
def test_where_newton_ends_the_result_is_null_with_the_reason(capsys):
    code, out, err = run(capsys, "--wind", "0.6", "--json")
    result = json.loads(out)
    assert code == 0
    assert result["mean"] is result["growth_rate"] is result["stable"] is None
    assert result["harmonics"] == []
    assert "does not converge beyond a wind of 0.2" in result["reason"]
    assert err == f"ctcbs: note: {result['reason']}\n"


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["--wind", "1"], "at least 0 and below 1"), (["--wind", "nan"], "at least 0 and below 1"),
        (["--wind", "-0.1"], "at least 0 and below 1"), ([], "missing: --wind"),
        (["--wind", "0.1", "--path", "ground"], "path: 'ground' is not allowed"),
        (["--wind", "0.1", "--elasticity", "inf"], "--elasticity: inf is not allowed"),
        (["--wind", "0.1", "--elasticity", "nan"], "elasticity: nan is not allowed"),
        (["--wind", "0.1", "--state", "2"], "--state: 2 is not allowed, there is 1 steady"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_ends_with_2(capsys, arguments, what):
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    (line,) = err.splitlines()
    assert line.startswith("ctcbs: error: ")
    assert what in line
