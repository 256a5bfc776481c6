"""`ctcbs bench`: its peers solve the same problem, its figures are judged rightly, and a row that
has become slower is told from the noise of the machine."""

import json
import time
from math import inf
from pathlib import Path

import numpy as np
import pytest
from points import FIVE, STRETCHED, design, figure_3_1, parameters

from ctcbs_ros.bench import cost, flight_rows, peer_auto, peer_bvp, peer_ivp, solver_rows, timing
from ctcbs_ros.bench.compare import changes, read_report
from ctcbs_ros.bench.report import document, row_document, text
from ctcbs_ros.bench.row import Outcome, Row
from ctcbs_ros.bench.run import chosen_rows, measure
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.timing import Measured, duel
from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.steady_state import correct_state, steady_states

CHEAP = "steady-3.1"


def outcome(**values):
    """An outcome of a millisecond against a peer ten times slower."""
    usual = dict(median=1e-3, p99=2e-3, samples=9, peer_median=1e-2, ratio=0.1, yardstick=1.0)
    return Outcome(**{**usual, **values})


def row(**values):
    """A row that `outcome()` meets."""
    usual = dict(name="some", what="a figure", target=1e-3, peer="scipy", measure=None)
    return Row(**{**usual, **values})


def report_of(*results):
    """A report as it is written and read."""
    return json.loads(json.dumps(document(list(results), quick=True)))


def written(path, report):
    path.write_text(json.dumps(report))
    return path


# --- the peers ----------------------------------------------------------------------------------


@pytest.mark.parametrize("point", [figure_3_1(10.0, 1.6), STRETCHED], ids=["rigid", "stretched"])
def test_solve_bvp_solves_the_same_steady_state(point):
    p = parameters(point)
    (state,) = steady_states(p).states
    guess = 1.01 * state.end_mass_radius
    found = peer_bvp.steady_state(p, guess, peer_bvp.warm_start(p, guess))
    assert found == pytest.approx(state.end_mass_radius, rel=1e-6)


def test_the_scan_finds_the_five_states_and_a_tight_integration_agrees_to_ten_digits():
    p = parameters(FIVE)
    states = [state.end_mass_radius for state in steady_states(p).states]
    assert len(states) == 5
    assert peer_ivp.all_states(p) == pytest.approx(states, rel=1e-7)
    assert [peer_ivp.tight_state(p, x * 1.0001) for x in states] == pytest.approx(states, rel=1e-9)


def test_the_cusp_of_the_peer_is_where_three_states_merge():
    omega, cable_drag, radius = peer_ivp.cusp(solver_rows.CUSP, 0.92, 6.1, 1.55)
    counts = [
        len(steady_states(parameters(figure_3_1(0.98 * cable_drag, omega * x))).states)
        for x in np.linspace(0.97, 1.03, 25)
    ]
    assert max(counts) == 3
    at_cusp = steady_states(parameters(figure_3_1(1.001 * cable_drag, omega))).states
    assert len(at_cusp) == 1
    assert at_cusp[0].end_mass_radius == pytest.approx(radius, rel=0.1)


def test_auto_finds_both_folds_and_the_radii_that_the_solver_corrects_to(tmp_path):
    start = steady_states(solver_rows.BRANCH_START).states[0]
    try:
        problem = peer_auto.AutoProblem(
            tmp_path, solver_rows.BRANCH_START, start.end_mass_radius, 3.0
        )
    except FileNotFoundError as error:
        pytest.skip(str(error))
    assert problem.run().wall > 0.0
    found = problem.branch()
    assert found.omega.size == pytest.approx(80, abs=8)
    # docs/thesis.md: jumps at omega 1.1 rising and 0.9 falling
    assert [round(fold[0], 4) for fold in found.folds] == [1.0982, 0.9323]
    for omega, radius in zip(found.omega[::6], found.end_mass_radius[::6], strict=True):
        state = correct_state(parameters(figure_3_1(4.8, omega)), radius, 0.01)
        assert state.end_mass_radius == pytest.approx(radius, rel=1e-6)


def test_what_is_not_installed_is_said_and_ours_is_measured_all_the_same(monkeypatch, tmp_path):
    monkeypatch.setattr(peer_auto, "AUTO", tmp_path)
    monkeypatch.setattr(solver_rows, "find_spec", lambda name: None)
    monkeypatch.setattr(flight_rows, "find_spec", lambda name: None)
    with Session(quick=True) as session:
        without = [solver_rows.branch(session), solver_rows.settle(session)]
        node = flight_rows.node_start(session)
    assert [o.missing.split()[0] for o in without] == ["AUTO-07p", "MoorDyn"]
    assert all(o.median > 0.0 and o.ratio is None and o.yardstick > 0.0 for o in without)
    assert "not installed" in node.missing
    shown = text(report_of(*((row(name=o.missing[:4]), o) for o in [*without, node])))
    assert shown.count("not installed") == 3


# --- timing -------------------------------------------------------------------------------------


def test_calls_of_both_sides_alternate_and_each_round_has_its_ratio():
    order = []

    def ours(number):
        order.append(("ours", number))
        return Measured(1.0, 2.0)

    def peer(number):
        order.append(("peer", number))
        return Measured(10.0, 8.0)

    timed = duel(ours, peer, rounds=2, calls=2, warm_up=False)
    assert order == [("ours", 0), ("ours", 1), ("peer", 0), ("ours", 2), ("ours", 3), ("peer", 1)]
    assert (timed.ours.median, timed.peer.median, timed.ratio) == (1.0, 10.0, 0.25)


def test_processor_time_counts_work_and_not_waiting():
    timed = duel(lambda _: time.sleep(0.2), lambda _: sum(range(3_000_000)), rounds=1)
    assert timed.ours.cpu[0] < 0.1 < 0.199 < timed.ours.wall[0]
    assert timed.peer.cpu[0] > timed.ours.cpu[0]


# --- judging ------------------------------------------------------------------------------------


def test_a_row_is_met_only_when_it_is_fast_exact_and_ahead_of_its_peer_as_asked():
    assert row().met(outcome()) == "yes"
    assert row().met(outcome(median=1.01e-3)) == "no"
    assert row().met(outcome(accurate=False)) == "no"
    assert row(needed=0.05).met(outcome()) == "no"
    assert row(needed=0.05).met(outcome(ratio=None)) == "yes"
    assert row(judged="p99").met(outcome()) == "no"
    assert row(judged="p99", target=2e-3).met(outcome()) == "yes"


def test_a_busy_machine_is_told_from_a_slow_program():
    assert row().met(outcome(median=3e-3, cpu_median=0.9e-3)) == "cpu"
    assert row().met(outcome(median=3e-3, cpu_median=1.1e-3)) == "no"
    assert row(judged="p99").met(outcome(p99=9e-3, cpu_median=1.0, cpu_p99=0.9e-3)) == "cpu"
    assert row(needed=0.05).met(outcome(median=3e-3, cpu_median=0.9e-3)) == "no"


def test_the_table_for_people_is_aligned_and_tells_target_and_peer():
    measured = outcome(cpu_median=9e-4)
    shown = text(report_of((row(), measured), (row(name="longer", needed=0.01), measured)))
    head, line, first, second, *_ = shown.splitlines()
    assert head.split()[:5] == ["row", "median", "cpu", "p99", "target"]
    assert set(line) == {"-", " "}
    assert first.split() == "some 1 ms 900 us 2 ms 1 ms yes scipy 10 ms 1/10 -".split()
    assert second.split() == "longer 1 ms 900 us 2 ms 1 ms NO scipy 10 ms 1/10 1/100".split()
    assert first.index("scipy") == second.index("scipy") == head.index("peer")


# --- comparing ----------------------------------------------------------------------------------


def judged(now, then, again=None):
    """Changes from one outcome to another."""
    before = {"some": row_document(row(), then)}
    repeated = iter(again or [])
    return changes(
        report_of((row(), now)), before, lambda name: row_document(row(), next(repeated))
    )


def test_a_machine_half_as_fast_is_no_slow_down_because_the_peer_is_slower_too():
    (change,) = judged(outcome(median=2e-3, peer_median=2e-2), outcome())
    assert (change.factor, change.by, change.slower) == (1.0, "peer", False)


def test_a_slow_down_counts_only_if_it_is_there_again():
    (noise,) = judged(outcome(ratio=0.15), outcome(), again=[outcome(ratio=0.101)])
    assert not noise.slower
    assert noise.measured == 2
    lasting = [outcome(ratio=0.131), outcome(ratio=0.14)]
    (slower,) = judged(outcome(ratio=0.15), outcome(), again=lasting)
    assert slower.slower
    assert slower.factor == pytest.approx(1.31)
    assert slower.measured == 3


def test_without_a_peer_in_one_of_the_runs_the_yardstick_decides():
    again = [outcome(ratio=None, yardstick=1.5)] * 2
    (change,) = judged(outcome(ratio=None, yardstick=1.5), outcome(), again)
    assert (change.factor, change.by, change.slower) == (1.5, "yardstick", True)


def test_nothing_to_judge_by_is_no_slow_down():
    assert judged(outcome(ratio=None, yardstick=None), outcome()) == []


def test_a_slow_down_of_30_percent_is_seen_and_noise_is_not_one(monkeypatch):
    """The whole way from a row to its judgement, on a clock of its own: each call costs its time
    and a fifth more or less, on a machine that is at times half as fast."""
    spent, noise = [0.0], np.random.default_rng(2)
    monkeypatch.setattr(timing, "processor_time", lambda: spent[0])
    speed = [1.0]

    def costs(module, name, seconds, call=None):
        call = call or getattr(module, name)

        def costly(*arguments):
            spent[0] += speed[0] * seconds * np.exp(noise.normal(0.0, 0.2))
            return call(*arguments)

        monkeypatch.setattr(module, name, costly)

    costs(timing, "_yardstick", 1e-3)
    costs(peer_bvp, "steady_state", 1e-2, lambda p, guess, start: guess)
    costs(solver_rows, "correct_state", 1e-4)
    rows = chosen_rows(CHEAP, quick=True)

    def report():
        return json.loads(json.dumps(document(measure(rows, quick=True), quick=True)))

    def again(name):
        return report()["rows"][0]

    before = {CHEAP: report()["rows"][0]}
    assert before[CHEAP]["ratio"] == pytest.approx(0.01, rel=0.1)
    for speed[0] in (1.0, 2.0):
        (change,) = changes(report(), before, again)
        assert not change.slower, change

    costs(solver_rows, "correct_state", 0.3e-4)
    for speed[0] in (1.0, 2.0):
        (change,) = changes(report(), before, again)
        assert change.slower, change
        assert change.by == "peer"


# --- the command --------------------------------------------------------------------------------


def test_bench_writes_the_report_that_it_prints_and_compares_with_it(tmp_path, capsys):
    file = tmp_path / "bench.json"
    assert main(["bench", "--quick", "--only", "table-size", "--json", "--out", str(file)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(file.read_text())
    (size,) = printed["rows"]
    assert size["row"] == "table-size"
    assert size["met"] == "yes"
    assert printed["machine"]["cores"] >= 1
    assert printed["versions"]["numpy"] == np.__version__

    assert main(["bench", "--quick", "--only", "table-size", "--compare", str(file)]) == 0
    assert "1.00  by size\n" in capsys.readouterr().out

    size["median"] /= 1.4
    written(file, printed)
    assert main(["bench", "--quick", "--only", "table-size", "--compare", str(file)]) == 1
    assert "  by size, the least of 3 measurements  SLOWER\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "cannot be read"),
        ("not JSON", "not JSON"),
        ("[1, 2]", "no report"),
        ('{"format": "another"}', "no report"),
        ('{"format": "ctcbs_ros bench", "format_version": 99}', "format version 99"),
        ('{"format": "ctcbs_ros bench", "format_version": 1}', "incomplete"),
        (
            '{"format": "ctcbs_ros bench", "format_version": 1, "rows": [{"row": "cusp"}]}',
            "incomplete",
        ),
    ],
)
def test_a_wrong_file_to_compare_with_ends_with_two_before_anything_is_measured(
    tmp_path, capsys, content, reason
):
    file = tmp_path / "before.json"
    if content is not None:
        file.write_text(content)
    assert main(["bench", "--compare", str(file)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"ctcbs: error: {file}")
    assert reason in error
    assert error.count("\n") == 1


def test_a_ratio_that_is_no_positive_number_makes_a_report_incomplete(tmp_path):
    report = report_of((row(), outcome()))
    report["rows"][0]["ratio"] = -inf
    with pytest.raises(InputError, match="incomplete"):
        read_report(written(tmp_path / "before.json", report))


def test_an_unknown_row_ends_with_two_and_names_the_rows(capsys):
    assert main(["bench", "--only", "steady-3.1,speed"]) == 2
    assert "--only speed: no such row, there are steady-3.1" in capsys.readouterr().err


def test_an_out_file_that_cannot_be_written_ends_with_two(tmp_path, capsys):
    nowhere = tmp_path / "no such folder" / "bench.json"
    assert main(["bench", "--quick", "--only", "table-size", "--out", str(nowhere)]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert not Path(nowhere).exists()


# --- what accuracy costs ------------------------------------------------------------------------


def test_errors_fall_with_functions_and_with_tighter_tolerances():
    p = parameters(figure_3_1(10.0, 1.6))
    margin = cost.margin_cost("", parameters(design(250.0)))
    assert margin.error[margin.size >= 18].max() < 1e-4 < 0.1 < margin.error[0]
    ours = cost.integration_cost("", p)
    peer = cost.bvp_cost("", p)
    for curve, best in ((ours, 1e-10), (peer, 1e-10)):
        assert curve.error[-1] < best < 1e-8 < curve.error[0]


def test_the_picture_has_a_column_for_each_kind_of_size(monkeypatch, tmp_path):
    few = np.array([1e-3, 1e-5])
    short = dict(FUNCTIONS=(4, 8), MOST_FUNCTIONS=12, TOLERANCES=few, PEER_TOLERANCES=few)
    for name, values in short.items():
        monkeypatch.setattr(cost, name, values)
    two = cost.Curve("", np.array([3, 33]), np.array([0.1, 1e-3]), np.array([1.0, 10.0]))
    monkeypatch.setattr(cost, "table_costs", lambda configuration: (two, two))
    drawn, draw = [], cost._drawn
    monkeypatch.setattr(cost, "_drawn", lambda columns: drawn.extend(columns) or draw(columns))
    assert main(["bench", "--plot", str(tmp_path / "cost.png")]) == 0
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")
    assert [len(column.curves) for column in drawn] == [2, 4, 2]


@pytest.mark.slow
def test_a_finer_table_guesses_better(monkeypatch):
    monkeypatch.setattr(cost, "TABLE_NODES", (3, 9))
    median, worst = cost.table_costs(load_configuration("small_drone"))
    # of the order of the cell's square
    assert 4.0 < median.error[0] / median.error[1] < 64.0
    assert np.all(worst.error >= median.error)


def test_a_picture_of_an_unknown_kind_ends_with_two(tmp_path, capsys):
    assert main(["bench", "--plot", str(tmp_path / "cost.txt")]) == 2
    assert "must end in .png, .pdf, .svg" in capsys.readouterr().err
