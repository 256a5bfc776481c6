"""The orbit estimator's bars: errors, stated errors, entry and departure, what is no orbit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from orbit_figures import readme, sentence, tables

from ctcbs_ros.cli.main import main
from ctcbs_ros.kernels.circle_angles import continuous_angles, mean_rate
from ctcbs_ros.orbit import (
    study,
    study_bars,
    study_cases,
    study_comparison,
    study_convergence,
)
from ctcbs_ros.orbit.alternatives import METHODS
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.noise import circle_covariance, fit_by_scatter
from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.tracks import (
    TURN,
    correlated_noise,
    estimate,
    fly,
    random_circle,
    spiral,
    straight,
)
from ctcbs_ros.orbit.window import SampleWindow

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("name", study_cases.NOISES)
def test_errors_are_within_the_bars_and_what_is_stated_of_them_holds(name):
    noise = study_cases.NOISES[name]
    found = {name: study.accuracy(noise, 20 if noise.cost > 1 else 40)}
    assert study_bars.missed(study_bars.bars(found, None, {}, {})) == []


def test_without_its_noise_model_a_correlated_error_would_be_understated():
    noise = study.Noise(0.5, 0.3, correlated=2.0)
    told = study.accuracy(noise, 60).covered["circle"]

    class Untold(study.Noise):
        settings = OrbitSettings(correlated_share=0.0)

    untold = study.accuracy(Untold(0.5, 0.3, correlated=2.0), 60).covered["circle"]
    assert told > 0.85
    assert untold < 0.5


def test_an_orbit_is_found_within_half_a_turn_and_given_up_within_a_quarter():
    bars = study_bars.bars({}, study.entry_and_departure(20), {}, {})
    assert len(bars) == 3
    assert study_bars.missed(bars) == []


@pytest.mark.parametrize("noise", ["white 5 m, 1 m/s, 20 % lost, not stated"])
def test_noise_that_nobody_states_does_not_lose_the_orbit(noise):
    assert study.entry_and_departure(16, study_cases.NOISES[noise]).lost < 0.03


@pytest.mark.parametrize("shape", [s for s in study.SHAPES if "radii" not in s])
def test_other_tracks_are_no_orbit_but_where_they_are_half_a_circle(shape):
    share = study.taken_for_orbits(shape, 10 if "20" in shape else 3)
    assert study_bars.missed(study_bars.bars({}, None, {shape: share}, {})) == []


def test_stated_deviations_of_radius_and_rate_are_those_of_two_thousand_arcs():
    # The flights of the study without their entry, the fit without the rules of what is no orbit:
    # so many that a bad draw does not look like a bad covariance.
    rng = np.random.default_rng(6)
    settings = OrbitSettings(correlated_share=0.0)
    off = []
    for _ in range(2000):
        radius, speed, sense = random_circle(rng)
        rate = sense * speed / radius
        time = np.arange(0.0, 0.73 * TURN / abs(rate), 0.2)
        angle = rng.uniform(0.0, TURN) + rate * time
        position, velocity = np.zeros((2, len(time), 3))
        position[:, 0], position[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
        velocity[:, 0], velocity[:, 1] = -rate * position[:, 1], rate * position[:, 0]
        position += 1.5 * rng.standard_normal(position.shape)
        velocity += 0.3 * rng.standard_normal(velocity.shape)
        window = SampleWindow(settings)
        for i in range(len(time)):
            window.add(time[i], position[i], velocity[i], 1.5, 0.3, np.nan)
        samples = window.kept
        fit, *sigmas, _ = fit_by_scatter(samples, None, False)
        seen, operators = np.empty(len(time)), np.zeros((2, len(time)))
        continuous_angles(fit.points, *fit.center, time, 0.0, seen)
        found, excess = mean_rate(
            time, seen, sigmas[0] / fit.radius, False, operators[0], np.empty(2)
        )
        covariance = circle_covariance(
            fit, samples, *sigmas, operators, abs(found), excess, settings
        )
        stated = np.sqrt(np.diag(covariance)[[2, 3]])
        off.append(np.array([fit.radius - radius, found - rate]) / stated)
    assert np.std(off, axis=0) == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(off) < 1.96, axis=0) == pytest.approx(0.955, abs=0.015)


def test_a_small_spiral_taken_for_a_circle_is_off_by_what_is_stated():
    # Over half a turn of 40 to 60 m noise hides what the radius changes.
    off, turned = [], 0
    for run in range(40):
        rng = np.random.default_rng([31, run])
        radius, growth = rng.uniform(40.0, 60.0), rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.4)
        speed = rng.uniform(15.0, 25.0)
        track = [straight(60.0), *spiral(radius, growth, 1.2)]
        flight = fly(track, speed, rng, course=rng.uniform(0.0, TURN))
        angle = np.maximum(flight.piece - 1, 0) / 16.0 + flight.angle / TURN
        now = radius * (1.0 + growth * angle)
        for a, orbit in zip(now, estimate(OrbitEstimator(), flight, sigma=(1.5, 0.3)),
                            strict=True):  # fmt: skip
            turned += 1
            if orbit is not None:
                errors = orbit.radius - a, orbit.angular_rate - speed / a
                off.append(np.array(errors) / np.sqrt(np.diag(orbit.covariance)[[3, 4]]))
    assert 20 < len(off) < 0.1 * turned
    # Six to ten for the radius and twenty for the rate, if the radius were taken to stand still.
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() < 2.0
    assert np.max(np.abs(off)) < 4.0


def test_simulated_correlated_noise_has_its_deviation_and_correlation_time():
    rng = np.random.default_rng(0)
    noise = correlated_noise(np.arange(0.0, 40_000.0, 1.0), 2.0, 45.0, rng, 3)
    assert noise.std() == pytest.approx(2.0, rel=0.05)
    lagged = np.mean(noise[45:] * noise[:-45]) / noise.var()
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.06)


def test_missed_bars_are_told():
    bad = study.Accuracy(1000, 100, 0.2, 0.0, 5.0, covered={"circle": 0.5})
    turns = study.Turns(10, [0.6] * 3, [0.4] * 3, 0.1, 0.1)
    found = study_bars.bars({"white 1.5 m, 0.3 m/s": bad}, turns, {"straight leg": 0.2}, {})
    missed = study_bars.missed(found)
    assert missed == [bar.line() for bar in found]
    assert len(missed) == 8


def test_of_fewer_flights_the_bounds_of_coverage_are_wider():
    for runs, least in ((1000, 93.0), (200, 88.9)):
        few = study.Accuracy(runs, 0, 0.002, 0.0, 0.2, covered={"circle": 0.9})
        bars = study_bars.bars({"white 1.5 m, 0.3 m/s": few}, None, {}, {})
        (inside,) = [bar for bar in bars if "inside" in bar.what]
        assert inside.least == pytest.approx(least, abs=0.05)
        assert inside.holds == (runs == 200)


def test_a_bar_is_printed_with_whether_it_holds():
    assert study_bars.Bar("radius", "%", 0.3, 0.0, 1.0).line().split() == [
        "radius", "0.30", "%", "bar", "1", "holds",
    ]  # fmt: skip
    missed = study_bars.Bar("inside", "%", 97.6, 93.0, 97.0)
    assert missed.line().endswith("bar 93 to 97     MISSED")
    assert not study_bars.Bar("nothing", "%", float("nan"), 0.0, 1.0).holds


def test_converging_flights_are_judged_by_their_bars():
    found = {"to another radius": study_convergence.fly_convergence("to another radius", 4)}
    assert study_bars.missed(study_bars.bars({}, None, {}, found)) == []
    bad = study_convergence.Convergence(4, 0.5, 0.8, 0.7, 0.5, 0.1, 0.6)
    bars = study_bars.bars({}, None, {}, {"to another radius": bad})
    assert len(study_bars.missed(bars)) == 2


def test_the_command_prints_its_seeds_and_every_figure(capsys, monkeypatch):
    # The others take long, and have tests of their own.
    monkeypatch.setattr(study_cases, "NOISES", dict(list(study_cases.NOISES.items())[:2]))
    monkeypatch.setattr(study, "SHAPES", dict(list(study.SHAPES.items())[:2]))
    monkeypatch.setattr(study_convergence, "CASES", study_convergence.CASES[:1])
    code = main(["orbit-study", "--runs", "20", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert report["seeds"] == study.SEEDS
    assert [row["noise"] for row in report["accuracy"]] == list(study_cases.NOISES)
    assert [row["track"] for row in report["taken_for_orbits"]] == list(study.SHAPES)
    assert [row["change"] for row in report["convergence"]] == list(study_convergence.CASES)
    lines = {bar["what"]: bar for bar in report["bars"]}
    assert lines["white 1.5 m, 0.3 m/s: radius"]["most"] == 1.0
    assert lines["departure to NOT_ORBITING, at most"]["most"] == 0.25
    assert {row["case"] for row in report["comparison"]} == set(study_comparison.CASES)
    assert code == (1 if report["missed_bars"] else 0)


def words(name):
    """A document as words with one space between."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def test_the_tables_of_the_orbit_page_have_every_case_of_the_study_and_the_readme_their_figures():
    page = (ROOT / "docs" / "orbit.md").read_text(encoding="utf-8")
    for name, noise in study_cases.NOISES.items():
        assert f"| {name} | {1000 // noise.cost} |" in page
    for name in (*study.SHAPES, *METHODS, "this estimator"):
        assert f"\n| {name} | " in page
    for name, said in (
        ("white 1.5 m, 0.3 m/s", "radius to {} and centre to {} at 1.5 m noise"),
        ("white 5 m, 1 m/s, 20 % lost", "{} and {} at 5 m with"),
        ("Gauss-Markov 2 m, 45 s on 0.5 m, 0.3 m/s", "{} and {} where 2 m are correlated"),
    ):
        radius, center = re.search(
            rf"\n\| {re.escape(name)} \| 1000 \| ([\d.]+ %).*?([\d.]+ m)(?: \(1\))? \|", page
        ).groups()
        assert said.format(radius, center) in words("README.md")


@pytest.mark.slow
def test_all_bars_hold_in_a_thousand_runs_and_the_documents_give_their_figures(capsys):
    code = main(["orbit-study", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert report["missed_bars"] == []
    assert code == 0
    page = (ROOT / "docs" / "orbit.md").read_text(encoding="utf-8")
    for lines in tables(report).values():
        assert "\n".join(lines) in page
    assert sentence(report) in words("docs/orbit.md")
    assert readme(report) in words("README.md")
