"""The continuation table: what its nodes hold, and that its guesses lead to all states."""

from dataclasses import fields, replace

import numpy as np
import pytest
from folding_flight import AIR, folding_configuration

from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.branches import branch_ends
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import correct_state, steady_states
from ctcbs_ros.table.build import build_table

# Near the cusp (d_n 5.8) three states live in a wedge narrower than a cell.
CONFIGURATIONS = {
    "folding": folding_configuration(),
    "stretched": folding_configuration(youngs_modulus=4.8e10),  # gamma 6118
    "near_the_cusp": folding_configuration(d_n=5.8, radius=(60.0, 130.0), speed=(22.0, 45.0)),
    "isolated": folding_configuration(d_n=2.7),
}


@pytest.fixture(scope="module", params=CONFIGURATIONS)
def case(request):
    configuration = CONFIGURATIONS[request.param]
    return configuration, build_table(configuration, nodes=5, progress=False)


def test_every_node_holds_all_steady_states_of_its_point(case):
    configuration, table = case
    assert table.count.max() == 3
    for i, radius in enumerate(table.radius):
        for j, speed in enumerate(table.speed):
            states = steady_states(flight_point(configuration, radius, speed, AIR).parameters)
            n = table.count[i, j]
            assert n == len(states.states)
            for name in ("end_mass_radius", "depth", "phase_lag", "tension_tow_point"):
                column = getattr(table, name)[i, j]
                expected = [getattr(s, name) for s in states.states]
                assert column[:n] == pytest.approx(expected, rel=1e-9)
                assert np.all(np.isnan(column[n:]))


def test_a_node_holds_the_margin_and_the_folds_of_its_states(case):
    configuration, table = case
    i, j = np.unravel_index(np.argmax(table.count), table.count.shape)
    point = flight_point(configuration, table.radius[i], table.speed[j], AIR)
    for k, state in enumerate(steady_states(point.parameters).states):
        assert table.growth_rate[i, j, k] == pytest.approx(stability(state).growth_rate)
        taus = {ANGULAR_RATE: [np.nan] * 2, RADIUS_AT_SPEED: [np.nan] * 2}
        for end in branch_ends(state):
            taus[end.family][int(end.direction > 0)] = end.fold.tau
        found = (table.fold_angular_rate[i, j, k], table.fold_radius[i, j, k])
        assert found[0] == pytest.approx(taus[ANGULAR_RATE], nan_ok=True)
        assert found[1] == pytest.approx(taus[RADIUS_AT_SPEED], nan_ok=True)


def test_slopes_are_those_of_finite_differences(case):
    configuration, table = case
    i = j = 2
    step = 1e-5
    for k in range(table.count[i, j]):
        at = table.end_mass_radius[i, j, k]
        for column, (by_radius, by_speed) in enumerate(((step, 0.0), (0.0, step))):
            moved = [
                correct_state(
                    flight_point(
                        configuration,
                        table.radius[i] * np.exp(sign * by_radius),
                        table.speed[j] * np.exp(sign * by_speed),
                        AIR,
                    ).parameters,
                    at,
                ).end_mass_radius
                for sign in (1.0, -1.0)
            ]
            slope = np.log(moved[0] / moved[1]) / (2.0 * step)
            assert table.radius_slope[i, j, k, column] == pytest.approx(slope, rel=1e-3, abs=1e-5)


def test_guesses_lead_by_newton_to_the_same_states_as_the_full_solve(case):
    configuration, table = case
    rng = np.random.default_rng(7)
    guessed = 0
    for _ in range(300):
        radius = np.exp(rng.uniform(*np.log(configuration.envelope.radius)))
        speed = np.exp(rng.uniform(*np.log(configuration.envelope.speed)))
        point = flight_point(configuration, radius, speed, AIR)
        full = steady_states(point.parameters).states
        guesses = table.guesses(point)
        if guesses is None:
            continue
        corrected = [correct_state(point.parameters, guess) for guess in guesses]
        if None in corrected or np.any(np.diff([s.end_mass_radius for s in corrected]) < 1e-6):
            continue  # the tracker then solves in full
        guessed += 1
        assert max(s.residual for s in corrected) < 1e-9
        radii = [s.end_mass_radius for s in full]
        assert [s.end_mass_radius for s in corrected] == pytest.approx(radii, rel=1e-7)
    assert guessed > 80


def test_no_guess_outside_the_envelope_or_for_another_configuration(case):
    configuration, table = case
    low, high = configuration.envelope.radius
    middle = np.mean(configuration.envelope.speed)

    def guesses(radius=0.5 * (low + high), speed=middle, density=AIR, **changed):
        return table.guesses(flight_point(configuration, radius, speed, density, **changed))

    assert guesses(radius=0.8 * low) is None
    assert guesses(radius=1.2 * high) is None
    assert guesses(speed=0.8 * configuration.envelope.speed[0]) is None
    assert guesses(speed=1.2 * configuration.envelope.speed[1]) is None
    assert guesses(density=0.8 * AIR) is None
    assert guesses(cable_length=1.2 * configuration.cable.length) is None
    assert guesses(end_mass=0.8 * configuration.end_mass.mass) is None


def test_branches_may_end_where_there_are_folds_and_only_there(case):
    configuration, table = case
    point = flight_point(configuration, table.radius[2], table.speed[2], AIR)
    assert table.may_end(point)
    none = np.full_like(table.fold_radius, np.nan)
    one_state = np.ones_like(table.count)
    bare = replace(table, count=one_state, fold_radius=none, fold_angular_rate=none)
    assert not bare.may_end(point)
    assert bare.may_end(flight_point(configuration, 2.0 * table.radius[-1], 30.0, AIR))


def test_summary_counts_states_and_names_the_envelope(case):
    configuration, table = case
    summary = table.summary()
    assert summary["states"] == [table.count.min(), table.count.max()]
    assert summary["nodes"] == [5, 5]
    assert summary["radius_m"] == pytest.approx(configuration.envelope.radius)
    assert summary["branches_end_in_folds"]
    margins = [
        -table.growth_rate[i, j, k] * table.speed[j] / table.radius[i]
        for i, j, k in zip(*np.nonzero(np.isfinite(table.growth_rate)), strict=True)
    ]
    assert summary["margin_per_s"] == pytest.approx([min(margins), max(margins)])
    assert len(fields(table)) == 17
