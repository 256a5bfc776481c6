"""Folds, jumps and the branch flown, against root finding and quasi-static sweeps by reference."""

from math import exp, log

import numpy as np
import pytest
from points import FIVE, STRETCHED, design, figure_3_1, parameters, random_points
from reference_bvp import brute_force, residual
from scipy.optimize import root

from ctcbs_ros.kernels.continuation import LEFT_RANGE, correct_fold
from ctcbs_ros.solver.branches import branch_end, branch_ends, trace
from ctcbs_ros.solver.family import ANGULAR_RATE, family_between
from ctcbs_ros.solver.flown import branch_from_straight_flight, landing, match
from ctcbs_ros.solver.stability import eigenvalues, stability
from ctcbs_ros.solver.steady_state import describe, steady_states

LOW, HIGH = 0.02, 3.0


def _whole_branch(point, omega=0.5, index=0, direction=1):
    """The branch of a state at omega, over omega LOW to HIGH, and its folds as (omega, x_d)."""
    state = steady_states(parameters({**point, "omega": omega})).states[index]
    path = trace(
        state.parameters, state.end_mass_radius, ANGULAR_RATE, direction,
        (log(LOW / omega), log(HIGH / omega)),
    )  # fmt: skip
    folds = [(omega * exp(fold.tau), fold.end_mass_radius) for fold in path.folds]
    return path, folds, state


def _reference_fold(point, omega, x_d):
    """Fold near a guess: x^2 + y^2 = 1 and no change of it with x_d."""

    def conditions(unknown):
        there = {**point, "omega": unknown[0]}
        e = 2e-5
        low, mid, high = residual(there, unknown[1] + np.array([-e, 0.0, e]), 1e-12)
        return [mid, (high - low) / (2.0 * e)]

    found = root(conditions, [omega, x_d], tol=1e-10)
    assert found.success
    return found.x


@pytest.mark.parametrize("gamma", [np.inf, 2000.0])
def test_folds_of_d_n_4_8_are_where_root_finding_puts_them(gamma):
    point = {**figure_3_1(4.8), "gamma": gamma}
    path, folds, _ = _whole_branch(point)
    assert path.status == LEFT_RANGE
    assert len(folds) == 2
    for fold in folds:
        assert fold == pytest.approx(_reference_fold(point, *np.round(fold, 2)), rel=1e-6)


def test_every_point_of_a_trace_is_a_steady_state():
    path, _, state = _whole_branch(figure_3_1(4.8))
    for tau, x_d in list(zip(path.tau, path.end_mass_radius, strict=True))[::4]:
        there = ANGULAR_RATE.at(state.parameters, tau)
        assert abs(residual(figure_3_1(4.8, there.omega), x_d)[0]) < 1e-5


@pytest.mark.parametrize(("d_n", "gamma"), [(1.0, 600.0), (2.7, 1000.0), (4.8, 2000.0)])
def test_at_a_fold_of_the_elastic_cable_an_eigenvalue_is_zero(d_n, gamma):
    # two computations that share no equation: steady states merge, and a vibration stands still
    _, folds, _ = _whole_branch({**figure_3_1(d_n), "gamma": gamma})
    assert len(folds) == 2
    for omega, x_d in folds:
        point = {**figure_3_1(d_n, omega), "gamma": gamma}
        state = describe(parameters(point), log(x_d))
        assert np.abs(eigenvalues(state, 24)).min() < 1e-5


def test_beyond_a_fold_the_elastic_cable_diverges():
    point = {**figure_3_1(2.7), "gamma": 1000.0}
    states = steady_states(parameters(point)).states
    assert len(states) == 3
    middle = stability(states[1])
    assert states[1].slope < 0.0
    assert middle.growth_rate > 0.0
    assert middle.nearest_loss == "divergence"


def test_newton_finds_a_fold_again_from_nearby():
    path, folds, state = _whole_branch(figure_3_1(4.8))
    p = state.parameters
    for fold, (omega, x_d) in zip(path.folds, folds, strict=True):
        tau, u, good = correct_fold(
            p.theta(), ANGULAR_RATE.exponents(), p.length, 0.0,
            fold.tau + 0.01, log(fold.end_mass_radius) - 0.02, 1e-11,
        )  # fmt: skip
        assert good
        assert (p.omega * exp(tau), exp(u)) == pytest.approx((omega, x_d), rel=1e-5)


def test_a_jump_lands_on_the_state_that_is_left():
    path, folds, state = _whole_branch(figure_3_1(4.8))
    for fold, (omega, _), direction in zip(path.folds, folds, (1, -1), strict=True):
        there = landing(state.parameters, fold, ANGULAR_RATE, direction)
        expected = brute_force(figure_3_1(4.8, omega * exp(direction * 1e-4)))
        assert len(expected) == 1
        assert there.end_mass_radius == pytest.approx(expected[0], rel=1e-7)


def test_branch_end_is_the_first_fold_each_way():
    _, folds, _ = _whole_branch(figure_3_1(4.8))
    inner, middle, outer = steady_states(parameters(figure_3_1(4.8))).states
    (rising, _), (falling, _) = folds
    assert exp(branch_end(outer, ANGULAR_RATE, 1, 1.0).tau) == pytest.approx(rising, rel=1e-6)
    assert branch_end(outer, ANGULAR_RATE, -1, 3.0) is None
    assert exp(branch_end(inner, ANGULAR_RATE, -1, 1.0).tau) == pytest.approx(falling, rel=1e-6)
    assert branch_end(inner, ANGULAR_RATE, 1, 1.0) is None
    assert exp(branch_end(middle, ANGULAR_RATE, 1, 1.0).tau) == pytest.approx(rising, rel=1e-6)


def test_branch_ends_lists_both_families():
    outer = steady_states(parameters(figure_3_1(4.8))).states[2]
    ends = branch_ends(outer)
    assert {end.family.name for end in ends} == {"angular_rate", "radius"}
    for end in ends:
        # on the fold of any family h and dh/dx_d vanish
        at = end.family.at(outer.parameters, end.fold.tau)
        point = {"omega": at.omega, "l": at.length, "m": at.end_mass, "d_n": at.cable_drag,
                 "f": at.drag_ratio}  # fmt: skip
        e = 1e-4
        x = end.fold.end_mass_radius * (1.0 + np.array([-e, 0.0, e]))
        low, mid, high = residual(point, x, 1e-11)
        assert abs(mid) < 1e-7
        assert abs(high - low) / (2.0 * e) < 1e-4


def test_an_isolated_branch_is_traced_and_never_meets_the_main_one():
    # thesis Fig. 3.1, d_n 2.7
    path, folds, _ = _whole_branch(figure_3_1(2.7), omega=1.0, direction=-1)
    assert path.status == LEFT_RANGE
    assert len(folds) == 1
    assert folds[0] == pytest.approx(
        _reference_fold(figure_3_1(2.7), *np.round(folds[0], 2)), rel=1e-6
    )
    assert path.end_mass_radius.max() < 2.6
    main, folds, _ = _whole_branch(figure_3_1(2.7))
    assert folds == []
    assert main.end_mass_radius[-1] > 3.2


def test_the_isolated_branch_joins_the_main_one_near_d_n_4_195():
    # docs/thesis.md ("Steady state")
    assert _whole_branch(figure_3_1(4.18))[1] == []
    assert len(_whole_branch(figure_3_1(4.21))[1]) == 2


def test_a_trace_follows_a_family_back_to_where_it_came_from():
    p, q = parameters(figure_3_1(6.5)), parameters({**figure_3_1(9.0, 1.3), "l": 4.0, "m": 30.0})
    family, distance = family_between(p, q)
    start = steady_states(p).states[0]
    path = trace(p, start.end_mass_radius, family, 1, (-1e-3, distance), target=distance)
    (arrived,) = path.crossings
    assert arrived == pytest.approx(steady_states(q).states[0].end_mass_radius, rel=1e-9)


# The branch flown.


def _tightened(point, k):
    """The point at k times its radius at the same speed."""
    there = {"omega": point["omega"] / np.sqrt(k), "l": point["l"] / k, "m": point["m"] / k,
             "d_n": point["d_n"] * k, "f": point["f"] / k}  # fmt: skip
    return {**there, "gamma": point["gamma"] / k} if "gamma" in point else there


def _swept(point, steps=300):
    """Tighten the circle step by step, from straight flight; the state reached and the jumps."""
    ks = np.geomspace(100.0, 1.0, steps)
    first = brute_force(_tightened(point, ks[0]), n=200)
    assert len(first) == 1
    x, jumps = first[0], 0
    for k in ks[1:]:
        there = _tightened(point, k)
        near = x * np.exp(np.linspace(-0.25, 0.25, 51))
        h = residual(there, near, 1e-8)
        rising = np.flatnonzero((h[:-1] < 0.0) & (h[1:] >= 0.0))
        if rising.size:
            share = h[rising] / (h[rising] - h[rising + 1])
            states = near[rising] + share * (near[rising + 1] - near[rising])
        else:
            jumps += 1
            states = brute_force(there, n=300)[::2]  # every other one has a rising slope
        x = states[np.argmin(np.abs(np.log(states / x)))]
    return x, jumps


@pytest.mark.parametrize(
    ("point", "jumps"),
    [
        (figure_3_1(4.8), 0),
        (figure_3_1(4.8, 1.5), 1),
        (figure_3_1(2.7), 0),
        ({"omega": 1.2, "l": 4.0, "m": 30.0, "d_n": 1.0, "f": 0.5, "gamma": 300.0}, 1),
        (STRETCHED, 0),
        (design(250.0), 0),
        (FIVE, 0),
    ],
)
def test_the_branch_flown_is_the_one_a_slowly_tightened_circle_reaches(point, jumps):
    flown = branch_from_straight_flight(parameters(point))
    expected, expected_jumps = _swept(point)
    assert flown.jumps == expected_jumps == jumps
    assert flown.end_mass_radius == pytest.approx(expected, rel=1e-3)
    everything = brute_force(point)
    assert np.abs(np.log(everything / flown.end_mass_radius)).min() < 1e-7


def test_the_flown_state_is_exactly_one_of_the_full_solve():
    compared = 0
    for elastic in (False, True):
        for point in random_points(60, 12, elastic):
            p = parameters(point)
            flown = branch_from_straight_flight(p)
            states = steady_states(p).states
            if np.isnan(flown.end_mass_radius):
                continue  # a jump on the way lands nowhere stable
            compared += 1
            chosen = match(states, flown.end_mass_radius)
            assert chosen is not None, point
            assert states[chosen].end_mass_radius == pytest.approx(flown.end_mass_radius, rel=1e-8)
    assert compared > 90


@pytest.mark.parametrize("d_n", [1.0, 2.7, 4.8, 10.0])
def test_states_connected_to_straight_flight_begin_with_the_one_flown(d_n):
    flown = branch_from_straight_flight(parameters(figure_3_1(d_n)))
    everything = brute_force(figure_3_1(d_n))
    assert flown.jumps == 0
    assert flown.end_mass_radius == flown.connected[0] == pytest.approx(everything[-1], rel=1e-7)
    for radius in flown.connected:
        assert np.abs(np.log(everything / radius)).min() < 1e-7


def test_all_three_states_of_d_n_4_8_are_connected_to_straight_flight_outer_first():
    flown = branch_from_straight_flight(parameters(figure_3_1(4.8)))
    assert flown.connected == pytest.approx(brute_force(figure_3_1(4.8))[::-1], rel=1e-7)
