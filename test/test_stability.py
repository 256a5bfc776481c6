"""Stability against a lumped-mass line, sines, shooting, a time simulation, known limits."""

from dataclasses import replace

import numpy as np
import pytest
from points import (
    FLUTTER,
    STRETCHED,
    design,
    figure_3_1,
    figure_4_1,
    parameters,
    random_points,
)
from reference_bvp import boundary_value_problem, brute_force
from reference_lumped_mass import LumpedMass, extrapolate, radius_depth_lag
from reference_shooting import divergence_rate, tow_point_matrix
from reference_vibration import (
    complex_step,
    drag_2_6,
    drag_unit_tangent,
    eigenvalues_in_sines,
    largest_in_band,
    spring,
)
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from ctcbs_ros.kernels.galerkin import local_matrices
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import eigenvalues, stability
from ctcbs_ros.solver.steady_state import steady_states


def _state(point, index=0, **others):
    return steady_states(parameters(point, **others)).states[index]


def _shape(point):
    return boundary_value_problem(point, brute_force(point)[0])[1]


# The linearised forces, against complex steps of the nonlinear ones.


@pytest.mark.parametrize("elastic", [True, False])
@pytest.mark.parametrize("s", [0.0, 0.7, 2.1, 3.0])
def test_local_matrices_are_derivatives_of_the_nonlinear_forces(elastic, s):
    point = STRETCHED if elastic else figure_3_1(4.8)
    steady = _state(point)
    position, force = (a[0] for a in steady.cable([s]))
    gamma, d_n, omega, damping = 600.0, point["d_n"], point["omega"], 0.3
    b_rate, b_position, b_slope, stiffness, rub = np.empty((5, 3, 3))
    local_matrices(
        steady.parameters.theta(steady.end_mass_radius), gamma, elastic, damping,
        np.concatenate([position, force]), b_rate, b_position, b_slope, stiffness, rub,
    )  # fmt: skip

    p = np.linalg.norm(force)
    t, none = force / p, np.zeros(3)
    slope = t * (1.0 + p / gamma) if elastic else t
    drag = drag_unit_tangent if elastic else drag_2_6

    def line(u_s):
        if not elastic:
            return spring(gamma, np.array(p), t, u_s)
        along = slope + u_s
        size = np.sqrt(np.sum(along * along))
        return gamma * (size - 1.0) * along / size

    def line_damping(u_ts):
        # tension gamma c d(strain)/dt along the line
        return gamma * damping * np.sum(t * u_ts) * t

    assert d_n > 0.0
    for found, nonlinear, scale in (
        (b_rate, lambda u: drag(position, slope, none, none, u), 1.0),
        (b_position, lambda u: drag(position, slope, u, none, none), 1.0),
        (b_slope, lambda u: drag(position, slope, none, u, none), 1.0),
        (stiffness, line, omega**2),
        (rub, line_damping, omega**2),
    ):
        expected = complex_step(nonlinear, ()) / scale
        assert found == pytest.approx(expected, abs=1e-10 * (1.0 + np.abs(expected).max()))


# An independent lumped-mass line.

LUMPED = {
    "stretched": STRETCHED,
    "flutter": FLUTTER,
    "design": design(250.0),
    "design, small end mass": design(250.0, area=0.00196),
    "a 100 m": design(100.0, length=500.0),
    "buoyant": {**STRETCHED, "w": 45.0, "rho": 0.9},
}


@pytest.mark.parametrize("name", LUMPED)
def test_margin_and_frequency_are_those_of_a_lumped_mass_line(name):
    point = LUMPED[name]
    state = _state(point)
    found = stability(state)
    shape = _shape(point)
    rates, places = [], []
    for segments in (40, 80):
        line = LumpedMass(point, segments)
        rest = line.equilibrium(shape)
        rates.append(line.least_damped(rest, found.band)[0])
        places.append(radius_depth_lag(rest))
    # second order in the segments
    expected = extrapolate(*rates)
    assert found.growth_rate == pytest.approx(expected.real, rel=0.01)
    assert found.frequency == pytest.approx(expected.imag, rel=0.001)
    assert found.converged
    assert found.stable == (expected.real < 0.0)
    radius, depth, lag = extrapolate(*np.array(places))
    assert state.end_mass_radius == pytest.approx(radius, rel=2e-4)
    assert state.depth == pytest.approx(depth, rel=2e-5)
    assert state.phase_lag == pytest.approx(lag, rel=2e-4)


def test_the_lumped_mass_line_converges_to_second_order():
    shape = _shape(STRETCHED)
    exact = stability(_state(STRETCHED), functions=(24, 36)).growth_rate
    errors = []
    for segments in (16, 32, 64):
        line = LumpedMass(STRETCHED, segments)
        errors.append(line.least_damped(line.equilibrium(shape), 5.0)[0].real - exact)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.35)


@pytest.mark.parametrize("name", ["stretched", "design"])
def test_every_mode_in_the_band_is_one_of_the_lumped_mass_line(name):
    point = LUMPED[name]
    state = _state(point)
    shape = _shape(point)
    line = LumpedMass(point, 100)
    expected = np.linalg.eigvals(line.matrix(line.equilibrium(shape)))
    found = eigenvalues(state, 36)
    # slow and little damped: resolved by both
    counted = found[(np.abs(found.imag) < 0.8 * state.parameters.band) & (found.real > -3.0)]
    assert len(counted) >= 6
    for value in counted:
        assert np.abs(expected - value).min() < 0.01 * abs(value)


@pytest.mark.parametrize("damping", [0.02, 0.2])
def test_line_damping_acts_as_dashpots_beside_the_springs(damping):
    shape = _shape(STRETCHED)
    found = stability(_state(STRETCHED, damping=damping))
    line = LumpedMass(STRETCHED, 80, damping)
    expected, _ = line.least_damped(line.equilibrium(shape), found.band)
    assert found.growth_rate == pytest.approx(expected.real, rel=0.01)
    assert found.frequency == pytest.approx(expected.imag, rel=0.001)
    # and it does something: 0.0247 without
    assert abs(found.growth_rate + 0.02475) > 0.002


@pytest.mark.parametrize("point", [STRETCHED, FLUTTER], ids=["decaying", "growing"])
def test_a_small_disturbance_in_time_has_the_growth_rate_and_frequency(point):
    found = stability(_state(point))
    line = LumpedMass(point, 20)
    rest = line.equilibrium(_shape(point))
    _, vector = line.least_damped(rest, found.band)
    start = 1e-5 * (vector / np.abs(vector[: rest.size]).max()).real
    times = np.arange(0.0, 25.0, 0.1)
    states = line.simulate(rest + start[: rest.size], start[rest.size :], times)
    # Prony: x(t) = 2 e^(a h) cos(b h) x(t - h) - e^(2 a h) x(t - 2 h) for one mode a + b i
    every = 5
    signal = states[:, :3] - rest[:3]
    then, now, before = signal[2 * every :], signal[every:-every], signal[: -2 * every]
    (one, two), *_ = np.linalg.lstsq(
        np.column_stack([now.ravel(), before.ravel()]), then.ravel(), rcond=None
    )
    step = 0.1 * every
    growth = 0.5 * np.log(-two) / step
    frequency = np.arccos(one / (2.0 * np.sqrt(-two))) / step
    # 20 segments are off by 0.3 % (decaying) and 7 % (growing), see the convergence above
    assert growth == pytest.approx(found.growth_rate, rel=0.08)
    assert frequency == pytest.approx(found.frequency, rel=0.002)


# The thesis's own model and functions.


def test_the_thesis_sines_converge_to_the_margin():
    # docs/thesis.md: a 100 m, L 500 m, first design, inextensible base: 5 sines 0.067, 10: 0.0865,
    # 20: 0.0872, 24 Legendre functions 0.0874
    point = design(100.0, length=500.0, area=0.00196, elastic=False)
    gamma = 2e9 / (1100.0 * 100.0 * 9.80665)
    state = _state(point, vibration_elasticity=gamma)
    found = stability(state)
    assert found.margin == pytest.approx(0.0874, abs=5e-5)
    for sines, margin in ((5, 0.067), (10, 0.0865), (20, 0.0872)):
        values = eigenvalues_in_sines(point, state.end_mass_radius, sines, gamma)
        assert -largest_in_band(values, found.band).real == pytest.approx(margin, abs=6e-5)
    legendre = largest_in_band(eigenvalues(state, 24), found.band)
    assert -legendre.real == pytest.approx(0.0874, abs=5e-5)


@pytest.mark.parametrize(
    "point", [{**STRETCHED, "gamma": np.inf}, design(250.0, elastic=False), figure_4_1(1.33, 3.4)]
)
def test_inextensible_base_has_the_growth_rate_of_forty_sines(point):
    state = _state(point)
    found = stability(state)
    values = eigenvalues_in_sines(point, state.end_mass_radius, 40, 600.0)
    expected = largest_in_band(values, found.band)
    assert found.growth_rate == pytest.approx(expected.real, rel=0.01)
    assert found.frequency == pytest.approx(abs(expected.imag), rel=0.001)


def test_margins_at_the_stretched_point_are_those_of_the_notes():
    # docs/thesis.md ("Stability"): 0.0247 elastic, 0.0067 with the inextensible base
    assert stability(_state(STRETCHED)).margin == pytest.approx(0.0247, abs=6e-5)
    stiff = stability(_state({**STRETCHED, "gamma": np.inf}))
    assert stiff.margin == pytest.approx(0.0067, abs=5e-5)


def test_legendre_functions_converge_at_the_flutter_point_as_the_notes_say():
    # docs/thesis.md: 10: +0.0109, 16: +0.0154, 24: +0.0157
    state = _state(FLUTTER)
    for functions, growth in ((10, 0.0109), (16, 0.0154), (24, 0.0157)):
        value = largest_in_band(eigenvalues(state, functions), 5.0)
        assert value.real == pytest.approx(growth, abs=6e-5)
    assert stability(state).nearest_loss == "flutter"


@pytest.mark.parametrize("elastic", [False, True])
def test_margin_does_not_move_with_half_again_as_many_functions(elastic):
    for point in random_points(12, 3, elastic):
        for state in steady_states(parameters(point)).states:
            found = stability(state)
            assert found.converged
            if found.beyond_fold and not elastic:
                continue  # not a mode with a gamma of 600; by shooting, below
            more = eigenvalues(state, round(1.5 * found.functions))
            growth = largest_in_band(more, 1.001 * found.band).real
            assert growth == pytest.approx(found.growth_rate, rel=0.011, abs=1e-5)


# Divergence.


def test_a_fold_is_where_a_real_eigenvalue_passes_zero():
    for point in (figure_3_1(4.8), figure_3_1(2.7)):
        states = steady_states(parameters(point)).states
        found = [stability(state) for state in states]
        real = [np.max(v.real[np.abs(v.imag) < 1e-9], initial=-np.inf)
                for v in (eigenvalues(state, 12) for state in states)]  # fmt: skip
        # the middle one has a negative slope and grows without oscillation
        assert [state.slope < 0.0 for state in states] == [value > 0.0 for value in real]
        growth = divergence_rate(parameters(point), states[1].end_mass_radius)
        assert found[1].growth_rate == pytest.approx(growth, rel=1e-3)
        assert found[1].nearest_loss == "divergence"
        assert not found[1].stable


# States between two folds of the inextensible cable which the vibration with the thesis's gamma of
# 600 takes for stable: thesis Fig. 3.1, and two random points of Table 2.1.
UNSEEN = (
    figure_3_1(4.8, 1.09),
    {"omega": 2.9733, "l": 3.9122, "m": 5.2358, "d_n": 0.45608, "f": 0.21488},
    {"omega": 1.45466, "l": 2.05137, "m": 89.176, "d_n": 1.169, "f": 2.16059},
)


@pytest.mark.parametrize("point", UNSEEN)
def test_beyond_a_fold_the_growth_rate_is_that_of_the_cable_that_does_not_stretch(point):
    p = parameters(point)
    middle = steady_states(p).states[1]
    found = stability(middle)
    values = eigenvalues(middle, 27)
    assert not np.any((values.imag == 0.0) & (values.real > 0.0))
    assert not found.stable
    assert found.verdict == "divergence"
    assert found.growth_rate == pytest.approx(divergence_rate(p, middle.end_mass_radius), rel=2e-3)
    # A cable that stretches hardly at all, at rest and as it vibrates, does the same.
    stiff = stability(steady_states(parameters({**point, "gamma": 1e7})).states[1])
    assert stiff.growth_rate == pytest.approx(found.growth_rate, rel=0.01)


def test_the_thesis_vibration_takes_the_middle_state_of_figure_3_1_for_stable():
    # docs/thesis.md; the growth rate of the one real mode in question.
    state = _state(UNSEEN[0], 1)
    values = eigenvalues(state, 18)
    assert max(values.real[values.imag == 0.0]) == pytest.approx(-0.0508, abs=5e-5)


@pytest.mark.slow
def test_how_often_the_thesis_vibration_hides_the_divergence():
    # docs/theory.md. As stiff as at rest, just the states beyond a fold have a growing real mode.
    beyond, hidden, others = 0, 0, 0
    for point in folding_points(400, 11):
        point.pop("gamma", None)
        for state in steady_states(parameters(point)).states:
            rigid = eigenvalues(_as_stiff(state), 18)
            assert np.count_nonzero(rigid.real[rigid.imag == 0.0] > 0.0) == (state.slope < 0.0)
            values = eigenvalues(state, 18)
            grows = np.any(values.real[values.imag == 0.0] > 0.0)
            beyond += state.slope < 0.0
            hidden += state.slope < 0.0 and not grows
            others += state.slope > 0.0
            assert state.slope < 0.0 or not grows
    assert (beyond, hidden, others) == (191, 15, 591)


def _as_stiff(state):
    """The same state, of a cable that does not stretch as it vibrates either."""
    return replace(state, parameters=replace(state.parameters, vibration_elasticity=1e8))


def folding_points(n, seed):
    """Points of thesis Table 2.1 of which every other one has several states."""
    rng = np.random.default_rng(seed)
    for i in range(n):
        yield {
            "omega": rng.uniform(0.3, 3.0), "l": rng.uniform(1.5, 6.0),
            "m": np.exp(rng.uniform(np.log(3.5), np.log(100.0))),
            "d_n": np.exp(rng.uniform(np.log(0.03), np.log(6.0))),
            "f": np.exp(rng.uniform(np.log(0.1), np.log(4.0))),
            **({"gamma": 600.0} if i % 3 == 0 else {}),
        }  # fmt: skip


def test_slopes_alternate_over_table_2_1_and_a_falling_one_means_divergence():
    several, falling = 0, 0
    for i, point in enumerate((*folding_points(60, 2), *random_points(20, 3, False))):
        p = parameters(point)
        states = steady_states(p).states
        assert [s.slope > 0.0 for s in states] == [k % 2 == 0 for k in range(len(states))]
        several += len(states) > 1
        # The slow orbit has one state, on the rising side, and it is a stable pendulum.
        (slow,) = steady_states(replace(p, omega=0.05)).states
        assert slow.slope > 0.0
        for state in states[1::2]:
            falling += 1
            found = stability(state)
            assert found.beyond_fold
            assert found.verdict == "divergence"
            assert found.growth_rate > 0.0
        if i % 4 == 0:
            assert stability(slow).stable
            for state in states:
                # By shooting: an odd number of real modes grows where the determinant is negative.
                still = np.linalg.det(tow_point_matrix(p, state.end_mass_radius))
                slope = 2.0 * state.end_mass_radius**2 * still
                assert slope == pytest.approx(state.slope, rel=1e-6)
    assert several > 20
    assert falling > 20


# Limits. Eigenvalues are those of the rotating frame: a plane swing of frequency f in space is
# seen as the two circular motions f - 1 and f + 1.


def _frequencies(state, functions=16):
    values = eigenvalues(state, functions)
    return np.sort(np.abs(values.imag)), values


def test_a_heavy_mass_on_a_slow_orbit_is_a_pendulum():
    omega, length, mass = 0.05, 2.0, 1e4
    state = steady_states(Parameters(omega, length, mass, 0.0, 0.0)).states[0]
    swing = 1.0 / (omega * np.sqrt(length))
    slow = _frequencies(state)[0]
    for expected in (swing - 1.0, swing + 1.0):
        assert np.abs(slow - expected).min() < 2e-3 * expected


# Little tension and much drag: 8 and 12 functions agree on a mode that neither resolves. Growth
# rates by shooting the linearised cable with complex lambda (Evans function), in 4 digits.
@pytest.mark.parametrize(
    ("point", "growth_rate"),
    [
        ((1.94083, 5.30402, 8.0499, 211.425, 1.34783, 3262.72), -0.04682),
        ((1.2255, 5.6074, 5.045, 542.94, 0.6102, 600.0), -0.06759),
        ((2.738425, 5.683708, 7.575698, 49.42303, 0.234875, np.inf), -0.11697),
        # of 60 functions and of 90
        ((3.4513, 1.4653, 1.5295, 47.961, 0.014803, 16809.0), -0.43158),
    ],
)
def test_chance_agreement_of_unresolved_modes_is_not_taken_for_convergence(point, growth_rate):
    omega, length, end_mass, cable_drag, drag_ratio, elasticity = point
    p = Parameters(omega, length, end_mass, cable_drag, drag_ratio, elasticity=elasticity)
    (state,) = steady_states(p).states
    found = stability(state)
    assert found.converged
    assert found.growth_rate == pytest.approx(growth_rate, rel=0.01)
    # All modes, with twice as many functions as it took at most.
    values = eigenvalues(state, 90)
    worst = values[np.abs(values.imag) <= p.band].real.max()
    assert found.growth_rate == pytest.approx(worst, rel=0.01)


def test_a_hanging_line_has_the_frequencies_of_bessel_functions():
    # (T u')' = omega^2 u'' with T = m + s, mass m at s = 0, fixed at s = l; lambda in space
    omega, length, mass = 0.02, 3.0, 2.0
    state = steady_states(
        Parameters(omega, length, mass, 0.0, 0.0, vibration_elasticity=1e6)
    ).states[0]

    def condition(beta):
        # u = A J0(q) + B Y0(q), q = 2 beta sqrt(m + s); T u' = -beta^2 m u at s = 0
        q0, q1 = 2.0 * beta * np.sqrt(mass), 2.0 * beta * np.sqrt(mass + length)
        at_mass = [f0(q0) * beta - f1(q0) / np.sqrt(mass) for f0, f1 in ((j0, j1), (y0, y1))]
        return at_mass[0] * y0(q1) - at_mass[1] * j0(q1)

    betas, step = [], 0.02
    low = 0.05
    while len(betas) < 4:
        if condition(low) * condition(low + step) < 0.0:
            betas.append(brentq(condition, low, low + step))
        low += step
    values = _frequencies(state, 20)[0]
    for beta in betas:
        for shift in (-1.0, 1.0):
            expected = beta / omega + shift
            assert np.abs(values - expected).min() < 1e-3 * expected


def test_a_stiffly_held_string_has_the_frequencies_of_c_4():
    # heavy mass: constant tension, cos beta = m beta/l sin beta, lambda = beta sqrt(m)/(l omega)
    omega, length, mass = 0.05, 2.0, 400.0
    state = steady_states(
        Parameters(omega, length, mass, 0.0, 0.0, vibration_elasticity=1e6)
    ).states[0]
    values = _frequencies(state, 20)[0]
    for j in range(3):
        beta = brentq(
            lambda b: np.cos(b) - mass * b / length * np.sin(b), j * np.pi, (j + 0.5) * np.pi
        )
        for shift in (-1.0, 1.0):
            expected = beta * np.sqrt(mass + 0.5 * length) / (length * omega) + shift
            assert np.abs(values - expected).min() < 4e-3 * expected


@pytest.mark.parametrize("elastic", [False, True])
def test_the_end_mass_bounces_on_the_stiffness_of_the_line(elastic):
    # beta tan beta = l/m, |Im| = beta sqrt(gamma)/(l omega), and the next axial mode
    omega, length, mass, gamma = 0.05, 3.0, 50.0, 6e5
    kind = {"elasticity": gamma} if elastic else {"vibration_elasticity": gamma}
    state = steady_states(Parameters(omega, length, mass, 0.0, 0.0, **kind)).states[0]
    values = _frequencies(state, 24)[0]
    for low, high in ((1e-6, 1.5), (np.pi + 1e-6, 1.5 * np.pi - 1e-6)):
        beta = brentq(lambda b: b * np.tan(b) - length / mass, low, high)
        expected = beta * np.sqrt(gamma) / (length * omega)
        assert np.abs(values - expected).min() < 1e-3 * expected


def test_without_drag_nothing_is_damped():
    state = steady_states(Parameters(0.3, 3.0, 20.0, 0.0, 0.0)).states[0]
    assert np.abs(eigenvalues(state, 12).real).max() < 1e-8


def test_drag_of_the_end_mass_alone_damps_the_pendulum_as_a_point_does():
    # heavy mass, no line drag, slow orbit at radius 1: m u'' + d J_d u' + m/(omega^2 l) u = 0 in
    # the turning plane; the mean decay of its two whirls is d (1 + 2)/(4 m), to 1/swing
    omega, length, mass, drag = 0.02, 1.0, 1e5, 4e3
    p = Parameters(omega, length, mass, 1e-6, drag / 1e-6, vibration_elasticity=1e9)
    state = steady_states(p).states[0]
    found = stability(state, band=60.0)
    assert found.frequency == pytest.approx(1.0 / (omega * np.sqrt(length)), abs=1.1)
    assert found.margin == pytest.approx(drag * 3.0 / (4.0 * mass), rel=0.04)


# The band.


def test_band_is_five_or_ends_below_the_internal_axial_modes():
    assert Parameters(1.0, 3.0, 50.0, 10.0, 1.0, elasticity=600.0).band == 5.0
    p = Parameters(3.0, 6.0, 50.0, 10.0, 1.0, elasticity=600.0)
    assert p.band == pytest.approx(0.8 * np.pi * np.sqrt(600.0) / 18.0)


def test_a_slow_orbit_is_judged_by_its_pendulum_though_it_is_faster_than_the_band():
    # swing 1/(omega sqrt(l)) = 10 per radian, above the band of 5
    omega, length = 0.1, 1.0
    state = steady_states(Parameters(omega, length, 1000.0, 10.0, 1.0)).states[0]
    found = stability(state)
    assert found.stable
    assert found.frequency == pytest.approx(1.0 / (omega * np.sqrt(length)) - 1.0, rel=0.02)
    assert found.band == pytest.approx(found.frequency)


def test_a_band_that_is_given_counts_only_the_modes_in_it():
    state = _state(FLUTTER)
    wide, narrow = stability(state), stability(state, band=0.5)
    assert wide.frequency > 0.5
    assert wide.growth_rate > 0.0
    assert narrow.frequency <= 0.5
    assert narrow.growth_rate < wide.growth_rate
