"""Steady states against solve_bvp and a brute-force scan, which share no code with the solver."""

import numpy as np
import pytest
from points import FIVE, STRETCHED, TAUT_INSIDE, design, figure_3_1, parameters, random_points
from reference_bvp import (
    boundary_value_problem,
    brute_force,
    filled,
    greatest_tension,
    residual,
)

from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import correct_state, describe, steady_states

HEAVY_DRAG = {"omega": 2.0, "l": 5.0, "m": 50.0, "d_n": 2000.0, "f": 0.5}
BUOYANT = {**figure_3_1(4.8), "w": 47.0, "rho": 0.9}

# (point, number of states); the numbers of Fig. 3.1 and of FIVE are docs/thesis.md's.
CASES = {
    "d_n 10": (figure_3_1(10.0), 1),
    "d_n 4.8": (figure_3_1(4.8), 3),
    "d_n 2.7 with the isolated pair": (figure_3_1(2.7), 3),
    "five states": (FIVE, 5),
    "stretched": (STRETCHED, 1),
    "five states stretched": ({**FIVE, "gamma": 600.0}, 3),
    "a 250 m, inextensible": (design(250.0, elastic=False), 1),
    "a 250 m, elastic": (design(250.0), 1),
    "a 250 m, small end mass": (design(250.0, area=0.00196), 1),
    "a 100 m, inextensible": (design(100.0, elastic=False), 1),
    "a 100 m, small end mass": (design(100.0, area=0.00196), 1),
    "d_n 500": ({"omega": 1.5, "l": 4.0, "m": 20.0, "d_n": 500.0, "f": 1.0}, 1),
    "d_n 2000": (HEAVY_DRAG, 1),
    "d_n 2000 elastic": ({**HEAVY_DRAG, "gamma": 600.0}, 1),
    "buoyant": (BUOYANT, 3),
}


@pytest.mark.parametrize("name", CASES)
def test_every_state_is_the_one_of_solve_bvp(name):
    point, number = CASES[name]
    found = steady_states(parameters(point))
    expected = brute_force(point)
    assert len(found.states) == len(expected) == number
    assert found.complete
    assert found.reason == ""
    for state, start in zip(found.states, expected, strict=True):
        reference, shape = boundary_value_problem(point, start)
        assert state.end_mass_radius == pytest.approx(reference.x_d, rel=1e-7)
        assert state.depth == pytest.approx(reference.depth, rel=1e-7)
        assert state.phase_lag == pytest.approx(reference.lag, abs=1e-7)
        assert state.tension_end_mass == pytest.approx(reference.tension_end_mass, rel=1e-7)
        assert state.tension_tow_point == pytest.approx(reference.tension_tow_point, rel=1e-7)
        assert state.converged
        assert state.residual < 1e-9
        s = np.linspace(0.0, point["l"], 23)
        positions, tensions = state.cable(s)
        there = shape(s)
        assert np.abs(positions - there[:3].T).max() < 1e-7
        size = np.linalg.norm(tensions, axis=1)
        assert np.abs(tensions / size[:, None] - there[3:].T).max() < 1e-6
        assert size.min() > 0.0


def test_stretch_at_the_stretched_point_is_that_of_the_notes():
    # docs/thesis.md ("Stretch"): without and with it
    stiff = steady_states(parameters({**STRETCHED, "gamma": np.inf})).states[0]
    soft = steady_states(parameters(STRETCHED)).states[0]
    assert (stiff.end_mass_radius, stiff.depth) == pytest.approx((0.17699, 2.7402), abs=5e-5)
    assert (soft.end_mass_radius, soft.depth) == pytest.approx((0.15739, 3.0414), abs=5e-5)


def _disagreements(points):
    compared, wrong = 0, []
    for point in points:
        closest = []
        expected = brute_force(point, closest=closest)
        if min(closest, default=1.0) < 1e-5:
            continue  # a fold: the scan itself cannot tell two states from none
        compared += 1
        states = steady_states(parameters(point)).states
        if len(states) != len(expected) or not np.allclose(
            [state.end_mass_radius for state in states], expected, rtol=1e-7, atol=0.0
        ):
            wrong.append((point, expected, states))
    return compared, wrong


@pytest.mark.parametrize("elastic", [False, True])
def test_a_brute_force_scan_finds_the_same_states_over_table_2_1(elastic):
    compared, wrong = _disagreements(random_points(18, 7, elastic))
    assert wrong == []
    assert compared >= 16


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [False, True])
def test_a_long_brute_force_scan_finds_the_same_states_over_table_2_1(elastic):
    compared, wrong = _disagreements(random_points(500, 8, elastic))
    assert wrong == []
    assert compared >= 490


def test_states_come_in_rising_radius_and_alternate_in_slope():
    states = steady_states(parameters(FIVE)).states
    radii = [state.end_mass_radius for state in states]
    assert radii == sorted(radii)
    assert [np.sign(state.slope) for state in states] == [1, -1, 1, -1, 1]


def test_two_states_just_before_a_fold_are_told_from_none_just_after():
    # the fold of d_n 4.8 near omega 0.93 is where two radii meet: bisect on the brute-force count
    low, high = 0.90, 0.96
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        number = len(brute_force(figure_3_1(4.8, middle), n=300))
        low, high = (middle, high) if number == 1 else (low, middle)
    assert len(steady_states(parameters(figure_3_1(4.8, low - 3e-6))).states) == 1
    assert len(steady_states(parameters(figure_3_1(4.8, high + 3e-6))).states) == 3


def test_newton_returns_to_a_state_from_a_guess_near_it_and_refuses_a_far_one():
    p = parameters(figure_3_1(4.8))
    for state in steady_states(p).states:
        again = correct_state(p, state.end_mass_radius * 1.01)
        assert again.end_mass_radius == pytest.approx(state.end_mass_radius, rel=1e-9)
    assert correct_state(p, 20.0) is None


@pytest.mark.parametrize("off", [0.0, 1e-4, -2e-3, 0.03])
@pytest.mark.parametrize(
    "point", [figure_3_1(10.0, 1.6), design(250.0), design(100.0), STRETCHED],
    ids=["figure 3.1", "design", "design, tight", "stretched"],
)  # fmt: skip
def test_a_corrected_guess_is_the_root_that_scipy_finds_to_eight_digits(point, off):
    (radius,) = brute_force(point)
    state = correct_state(parameters(point), radius * (1.0 + off))
    assert state.end_mass_radius == pytest.approx(radius, rel=1e-8)
    assert abs(residual(point, state.end_mass_radius, 1e-12)[0]) < 1e-8
    # and described as if it had been found without a guess
    (full,) = steady_states(parameters(point)).states
    for name in ("depth", "phase_lag", "tension_end_mass", "tension_tow_point"):
        assert getattr(state, name) == pytest.approx(getattr(full, name), rel=1e-7)
    # dh/du is that of the last iteration but one
    assert state.slope == pytest.approx(full.slope, rel=1e-4)


def test_residual_is_that_of_an_independent_integration():
    p = parameters(figure_3_1(10.0))
    radius = steady_states(p).states[0].end_mass_radius
    # a radius that is off by 1e-5 is not called converged
    off = describe(p, np.log(radius * (1.0 + 1e-5)))
    assert not off.converged
    assert off.residual == pytest.approx(1e-5 * abs(off.slope), rel=1e-3)


def test_tension_satisfies_the_first_integral_along_the_cable():
    # p + p^2/(2 gamma) of the notes, and its limit (2.18)
    for point in (figure_3_1(4.8), STRETCHED, {**BUOYANT, "gamma": 200.0}, design(250.0)):
        omega, length, _, _, _, _, rho, g = filled(point)
        for state in steady_states(parameters(point)).states:
            r, force = state.cable(np.linspace(0.0, length, 50))
            p = np.linalg.norm(force, axis=1)
            total = p + 0.5 * g * p**2 - rho * r[:, 2]
            total += 0.5 * omega**2 * (r[:, 0] ** 2 + r[:, 1] ** 2)
            assert np.ptp(total) < 1e-7 * p.max()


def test_tension_of_a_fast_light_mass_is_greatest_inside_the_cable():
    # 7.960 at s/l 0.53, where the ends have 6.079 and 6.221
    (state,) = steady_states(parameters(TAUT_INSIDE)).states
    assert state.greatest_tension == pytest.approx(7.960, abs=5e-4)
    assert state.greatest_tension > 1.27 * max(state.tension_end_mass, state.tension_tow_point)


@pytest.mark.parametrize("elastic", [False, True])
def test_greatest_tension_is_that_of_scipy_along_the_cable(elastic):
    inside = 0
    for point in (TAUT_INSIDE, *random_points(25, seed=28, elastic=elastic)):
        for state in steady_states(parameters(point)).states:
            expected = greatest_tension(point, state.end_mass_radius)
            assert state.greatest_tension == pytest.approx(expected, rel=1e-7), point
            ends = state.tension_end_mass, state.tension_tow_point
            assert state.greatest_tension >= max(ends)
            inside += expected > 1.001 * max(ends)
            corrected = correct_state(state.parameters, 1.0001 * state.end_mass_radius)
            assert corrected.greatest_tension == pytest.approx(state.greatest_tension, rel=1e-9)
    assert inside >= 5


def test_drag_takes_the_power_that_the_tow_point_gives():
    # per mu a g Omega a: torque of the tow point about the axis is the power of the drag
    for point in (figure_3_1(4.8), STRETCHED, design(250.0, elastic=False)):
        omega, length, _, _, d_n, d, _, _ = filled(point)
        for state in steady_states(parameters(point)).states:
            nodes, weights = np.polynomial.legendre.leggauss(200)
            r, force = state.cable(np.append(0.5 * length * (nodes + 1.0), length))
            torque = r[-1, 0] * force[-1, 1] - r[-1, 1] * force[-1, 0]
            t = force / np.linalg.norm(force, axis=1)[:, None]
            v = np.column_stack([-r[:, 1], r[:, 0], np.zeros(len(r))])
            v_n = v - np.sum(v * t, axis=1)[:, None] * t
            lost = 0.5 * length * weights @ np.linalg.norm(v_n, axis=1)[:-1] ** 3
            drag = omega**2 * (d_n * lost + d * state.end_mass_radius**3)
            assert torque == pytest.approx(drag, rel=1e-7)


# The cable of these comes within a hundredth of lying along its own velocity, where |v_n| v_n
# bends sharply: a step's error estimate is too small there.
ALONG_THE_WIND = (
    {"omega": 1.600100747237091, "l": 5.522822903939297, "m": 7.237235087112201,
     "d_n": 1.218612876432935, "f": 1.0002464895428476},
    {"omega": 0.9217285711567708, "l": 4.594641264469859, "m": 11.874635930788905,
     "d_n": 0.5635670048801277, "f": 1.192582408617562},
    {"omega": 2.5927367900454312, "l": 5.5342683402675945, "m": 35.588692798696606,
     "d_n": 18.877091693609284, "f": 3.0787490430207267},
    {"omega": 0.9469753467572826, "l": 5.967099950632395, "m": 89.47418496516406,
     "d_n": 13.650881618211352, "f": 0.1570488215676178},
)  # fmt: skip


@pytest.mark.parametrize("point", ALONG_THE_WIND)
def test_a_cable_that_nearly_lies_along_its_velocity_meets_the_residual_too(point):
    found = steady_states(parameters(point))
    assert found.reason == ""
    state = found.states[0]
    assert state.residual < 1e-9
    # the radius itself, from scipy's integrator at its finest
    assert abs(residual(point, state.end_mass_radius, 1e-13)[0]) < 2e-9


# Limits.


@pytest.mark.parametrize("gamma", [np.inf, 600.0])
def test_at_rest_the_cable_hangs_straight_down(gamma):
    p = Parameters(1e-4, 3.0, 50.0, 10.0, 1.0, elasticity=gamma)
    found = steady_states(p)
    assert len(found.states) == 1
    state = found.states[0]
    stretch = 0.0 if gamma == np.inf else (50.0 * 3.0 + 3.0**2 / 2.0) / gamma
    assert state.end_mass_radius == pytest.approx(1.0, abs=1e-6)
    assert state.depth == pytest.approx(3.0 + stretch, abs=1e-6)
    assert state.phase_lag == pytest.approx(0.0, abs=1e-5)
    assert state.tension_end_mass == pytest.approx(50.0, rel=1e-6)
    assert state.tension_tow_point == pytest.approx(53.0, rel=1e-6)


def test_without_drag_the_cable_stays_in_the_plane_of_tow_point_and_axis():
    for state in steady_states(Parameters(0.8, 3.0, 50.0, 0.0, 0.0)).states:
        r, _ = state.cable(np.linspace(0.0, 3.0, 9))
        assert np.abs(r[:, 1]).max() == 0.0
        assert min(state.phase_lag, abs(state.phase_lag - np.pi)) < 1e-12


def test_a_heavy_mass_without_drag_is_a_conical_pendulum():
    # m -> infinity: r = 1 + l sin(a), tan(a) = omega^2 r
    omega, length = 0.4, 3.0
    state = steady_states(Parameters(omega, length, 1e6, 0.0, 0.0)).states[0]
    angle = np.arctan(omega**2 * state.end_mass_radius)
    assert state.end_mass_radius == pytest.approx(1.0 + length * np.sin(angle), rel=1e-5)
    assert state.depth == pytest.approx(length * np.cos(angle), rel=1e-5)


def test_a_very_stiff_elastic_cable_is_an_inextensible_one():
    point = figure_3_1(4.8)
    stiff = steady_states(parameters({**point, "gamma": 1e9})).states
    rigid = steady_states(parameters(point)).states
    assert len(stiff) == len(rigid) == 3
    for one, other in zip(stiff, rigid, strict=True):
        assert one.end_mass_radius == pytest.approx(other.end_mass_radius, rel=1e-6)


# Bad input.


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("omega", 0.0), ("omega", -1.0), ("omega", np.nan), ("omega", np.inf), ("length", 0.0),
        ("end_mass", -3.0), ("cable_drag", -1e-9), ("drag_ratio", np.nan), ("elasticity", 0.0),
        ("elasticity", np.nan), ("damping", -1.0), ("density", np.inf), ("length", "long"),
    ],
)  # fmt: skip
def test_a_parameter_out_of_range_is_refused_by_name(name, value):
    good = dict(omega=1.0, length=3.0, end_mass=50.0, cable_drag=10.0, drag_ratio=1.0)
    with pytest.raises(InputError, match=name):
        Parameters(**{**good, name: value})


def test_arc_lengths_that_fall_are_refused():
    state = steady_states(parameters(figure_3_1(10.0))).states[0]
    with pytest.raises(InputError, match="arc lengths"):
        state.cable([1.0, 0.5])


@pytest.mark.parametrize(
    "point",
    [
        {"omega": 30.0, "l": 50.0, "m": 50.0, "d_n": 1e-3, "f": 1.0},
        {"omega": 1.0, "l": 1e4, "m": 50.0, "d_n": 0.0, "f": 1.0},
    ],
    ids=["a whip", "a long line without drag"],
)  # fmt: skip
def test_where_states_crowd_without_end_the_search_is_given_up_and_says_so(point):
    found = steady_states(parameters(point))
    assert not found.complete
    assert "given up" in found.reason


def test_a_cable_far_longer_than_any_of_table_2_1_is_still_solved():
    point = figure_3_1(4.8)
    found = steady_states(parameters({**point, "l": 1e4}))
    assert found.complete
    (state,) = found.states
    assert state.converged
    # it hangs almost straight down
    assert state.depth == pytest.approx(1e4, rel=1e-3)
    assert state.tension_tow_point == pytest.approx(50.0 + 1e4, rel=1e-2)
