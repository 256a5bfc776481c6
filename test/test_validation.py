"""`ctcbs validate`: what it compares, and that it would see a difference."""

import json
from dataclasses import replace

import numpy as np
import pytest

from ctcbs_ros.cli.main import main
from ctcbs_ros.validation import cases, compare, runs

pytest.importorskip("moordyn", reason="MoorDyn is not installed (pip install moordyn)")


@pytest.fixture
def short(monkeypatch):
    """One case of each kind, not flown for long."""
    monkeypatch.setattr(cases, "STEADY", (replace(cases.STEADY[1], duration=400.0),))
    monkeypatch.setattr(cases, "WINDS", (replace(cases.WINDS[0], duration=400.0),))
    monkeypatch.setattr(cases, "ENTRIES", (replace(cases.ENTRIES[1], duration=120.0),))
    monkeypatch.setattr(cases, "WINCHES", (replace(cases.WINCHES[1], duration=240.0),))
    monkeypatch.setattr(cases, "DECAY", replace(cases.DECAY, duration=700.0))
    monkeypatch.setattr(cases, "ROUGH", replace(cases.ENTRIES[0], duration=120.0))


def test_the_table_and_the_pictures_are_written(short, tmp_path, capsys):
    assert main(["validate", "--out", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["met"]
    assert {row["case"] for row in found["comparisons"]} == {
        "design example, 5 %", "design example", "gamma 600",
        "design example, reeled in by 15 %",
    }  # fmt: skip
    written = {file.name for file in (tmp_path / "out").iterdir()}
    assert written == {
        "comparisons.md", "comparisons.json", "steady.png", "entries.png", "wind.png"
    }  # fmt: skip
    assert json.loads((tmp_path / "out" / "comparisons.json").read_text()) == found


def test_a_difference_is_seen_and_ends_with_1(short, monkeypatch, capsys):
    # two per cent of the drag
    for name in ("STEADY", "WINDS"):
        monkeypatch.setattr(cases, name, ())
    original = runs.entry

    def other(parameters, *rest):
        return original(replace(parameters, cable_drag=1.02 * parameters.cable_drag), *rest)

    monkeypatch.setattr(runs, "entry", other)
    assert main(["validate"]) == 1
    assert "NO" in capsys.readouterr().out


def test_a_winch_that_runs_at_another_rate_is_seen(short, monkeypatch, tmp_path):
    (case,) = cases.WINCHES
    assert all(row.met for row in compare.of_winch(runs.fly_entry(case, tmp_path)))
    original = runs.entry

    def other(*given):
        return original(*given[:4], replace(given[4], breaks=1.01 * given[4].breaks))

    monkeypatch.setattr(runs, "entry", other)
    assert not all(row.met for row in compare.of_winch(runs.fly_entry(case, tmp_path)))


def test_comparisons_are_in_per_cent_of_what_they_say():
    place = np.array([[1.0, 0.0, -3.0], [0.0, 1.0, -3.0]])
    run = runs.WindRun(
        cases.WINDS[0], place, np.add(place, [0.002, 0.0, 0.0]), place,
        np.add(place, [0.0, 0.0, 0.004]), "",
    )
    downwind, across, orbit, periodic = compare.of_wind(run)
    assert downwind.difference == pytest.approx(0.2)
    assert not downwind.met
    assert across.met
    assert orbit.difference == pytest.approx(0.2)
    assert periodic.difference == pytest.approx(0.4)
    assert periodic.met
    lost = compare.of_wind(replace(run, periodic=None, reason="none"))[-1]
    assert not lost.met
    assert lost.note == "none"
    settled = runs.SteadyRun(
        cases.STEADY[0], {20: np.array([1.04, 2.0, 3.0]), 40: np.array([1.01, 2.0, 3.0])},
        {40: np.array([1.0, 2.0, 3.0])}, {}, np.array([1.0, 2.0, 3.0]),
    )  # fmt: skip
    rows = compare.of_steady(settled)
    assert rows[0].difference == pytest.approx(100.0 * 0.01 / 1.01)
    assert rows[3].difference == pytest.approx(0.0, abs=1e-9)  # of second order: 1.04, 1.01 -> 1


def test_without_moordyn_it_is_said(monkeypatch, capsys):
    monkeypatch.setattr("ctcbs_ros.cli.validate.find_spec", lambda name: None)
    assert main(["validate"]) == 2
    assert "pip install moordyn" in capsys.readouterr().err
