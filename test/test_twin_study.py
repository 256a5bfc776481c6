"""The study of the twin's stated errors: its figures on errors drawn from what is stated."""

import json

import numpy as np
import pytest

from ctcbs_ros.cli.main import main
from ctcbs_ros.prediction import twin_study as study
from ctcbs_ros.simulated_flight import simulate_flight


def drawn(share, runs=400, samples=5):
    """Flights whose errors stay, of which a covariance times `share` is stated."""
    rng = np.random.default_rng(4)
    root = np.array([[3.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.5, 1.0]])
    valid = np.arange(samples) >= 2
    stated = np.tile(share * root @ root.T, (samples, 1, 1))
    return [
        study.Course(valid, np.tile(root @ rng.standard_normal(3), (samples, 1)), stated, 12.0)
        for _ in range(runs)
    ]


def test_of_errors_that_are_as_stated_ninety_five_in_a_hundred_are_inside():
    found = study.summed_up(drawn(1.0))
    assert (found.runs, found.valid, found.waited) == (400, 400, 12.0)
    assert found.covered == pytest.approx(0.95, abs=0.03)
    assert found.covered_before == found.covered
    assert found.square == pytest.approx(3.0, abs=0.4)
    assert found.stated == pytest.approx(np.sqrt(9.0 + 5.0 + 1.25))
    assert study.missed_bars({"so": found}) == []


@pytest.mark.parametrize("share", [0.4, 4.0], ids=["too small", "too large"])
def test_errors_that_are_not_as_stated_miss_a_bar(share):
    found = study.summed_up(drawn(share))
    assert found.square == pytest.approx(3.0 / share, rel=0.15)
    missed = study.missed_bars({"so": found})
    assert any("squared distances" in bar for bar in missed)
    assert any("so: the truth inside the 95 %" in bar for bar in missed) == (share < 1.0)


def test_the_truth_hardly_changes_with_more_segments(monkeypatch):
    flight = simulate_flight(60.0, 18.0, 2, wind=(3.0, 1.0))
    coarse = study.true_places(flight, (3.0, 1.0))
    monkeypatch.setattr(study, "SEGMENTS", 60)
    assert study.true_places(flight, (3.0, 1.0)) == pytest.approx(coarse, abs=0.1)


def test_the_command_prints_a_row_of_each_case(monkeypatch, capsys):
    made = drawn(1.0, runs=20)
    monkeypatch.setattr(study, "course", lambda case, run: made[run])
    assert main(["twin-study", "--runs", "20"]) == 0
    printed = capsys.readouterr().out
    assert all(case in printed for case in study.CASES)
    assert "All bars hold." in printed
    assert main(["twin-study", "--runs", "20", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told["cases"]) == list(study.CASES)
    assert told["missed_bars"] == []


@pytest.mark.slow
def test_a_flight_of_each_case_has_the_truth_nearby():
    for case in study.CASES:
        found = study.course(case, 0)
        assert found.valid.any()
        away = np.linalg.norm(found.off[found.valid], axis=1)
        assert away.max() < 20.0
