"""The least damped mode without all eigenvalues, against all of them by numpy."""

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
from points import FIVE, FLUTTER, STRETCHED, design, figure_3_1, figure_4_1, parameters
from scipy.integrate import simpson
from scipy.stats import ortho_group
from threadpoolctl import threadpool_limits

from ctcbs_ros.kernels.galerkin import assemble
from ctcbs_ros.solver import stability as solver_stability
from ctcbs_ros.solver.rightmost import corrected, rightmost
from ctcbs_ros.solver.stability import FUNCTIONS, stability, vibration_matrix
from ctcbs_ros.solver.steady_state import cable_states, steady_states


@pytest.fixture(autouse=True)
def _one_thread():
    # two threads only hinder each other in matrices this small
    with threadpool_limits(1, "blas"):
        yield


def _worst(a, band):
    """The rightmost eigenvalue in the band, which is widened to the slowest mode if empty."""
    values = np.linalg.eigvals(a)
    band = max(band, np.abs(values.imag).min())
    values = values[np.abs(values.imag) <= band]
    return values[np.argmax(values.real)]


def _agrees_with_all_eigenvalues(state):
    found, rounding = stability(state), 1e-9
    band = state.parameters.band
    worst = _worst(vibration_matrix(state, found.functions), band)
    if state.slope < 0.0 and not state.parameters.elastic:
        # between two folds the state diverges as stiff as it is at rest, if nothing grows faster
        p = replace(state.parameters, vibration_elasticity=1e8)
        values = np.linalg.eigvals(vibration_matrix(replace(state, parameters=p), found.functions))
        worst = max(worst, *values[values.imag == 0.0], key=lambda value: value.real)
        # Entries of 1e8 are themselves rounded to 1e-8.
        rounding = 3e-8
    assert found.growth_rate == pytest.approx(worst.real, rel=1e-7, abs=rounding), state
    assert found.frequency == pytest.approx(abs(worst.imag), rel=1e-7, abs=1e-7), state
    # and more functions were taken only where fewer did not agree to 1 %, or resolve the cable
    needed = 2.7 * _slow_wave_phase(state)
    first = next((i for i, n in enumerate(FUNCTIONS) if i and n >= needed), len(FUNCTIONS) - 1)
    tried = FUNCTIONS[first - 1 : FUNCTIONS.index(found.functions) + 1]
    matrices = [_over_nodes_of(state, tried[0], tried[1])]
    matrices += [vibration_matrix(state, n) for n in tried[1:]]
    worst = [_worst(matrix, band) for matrix in matrices]
    # or where the mode has much in the highest of them
    tails = [_tail(*mode) for mode in zip(matrices, worst, strict=True)]
    agrees = [
        _agree(*two, 0.01 if tail < 0.013 else 1e-4)
        for two, tail in zip(pairwise(worst), tails[1:], strict=True)
    ]
    if len(agrees) > 1 and agrees[0]:
        # by chance: the mode itself has moved further, and another stands where it was
        values = np.linalg.eigvals(matrices[0])
        agrees[0] = _agree(values[np.argmin(np.abs(values - worst[1]))], worst[1], 0.01)
    assert not any(agrees[:-1]), state
    assert found.converged == agrees[-1], state


def _tail(a, value):
    """Share of the left eigenvector's displacements in the highest third of the functions."""
    values, vectors = np.linalg.eig(a.T)
    half = vectors[len(a) // 2 :, np.argmin(np.abs(values - value))].reshape(3, -1)
    return np.linalg.norm(half[:, -(half.shape[1] // 3) :]) / np.linalg.norm(half)


def _slow_wave_phase(state):
    """Phase of a transverse wave with |lambda| 0.3 along the cable, from its shape.

    docs/theory.md, "Convergence".
    """
    p = state.parameters
    s = np.linspace(0.0, p.length, 401)
    r, force = state.cable(s)
    tension = np.linalg.norm(force, axis=1)
    t = force / tension[:, None]
    v = np.cross([0.0, 0.0, 1.0], r)
    v_n = np.linalg.norm(v - np.sum(v * t, axis=1)[:, None] * t, axis=1)
    stiffness = tension / (1.0 + tension / p.elasticity)
    number = p.omega * np.sqrt((0.3**2 + 0.3 * p.cable_drag * v_n) / stiffness)
    return simpson(number, x=s)


def _agree(before, now, relative):
    frequencies = abs(now.imag), abs(before.imag)
    return (
        _growth_rates_agree(before, now, relative)
        and abs(frequencies[0] - frequencies[1]) <= max(0.01 * abs(now), 1e-5)
    )  # fmt: skip


def _growth_rates_agree(before, now, relative=0.01):
    return abs(now.real - before.real) <= max(relative * abs(now.real), 1e-5)


def _over_nodes_of(state, functions, more):
    """The matrix of some functions, integrated over the nodes that more of them need."""
    p = state.parameters
    x, w = np.polynomial.legendre.leggauss(2 * more + 8)
    nodes, weights = 0.5 * (x + 1.0) * p.length, 0.5 * w * p.length
    return assemble(
        p.theta(state.end_mass_radius), p.length, p.gamma, p.elastic, p.damping, functions,
        nodes, weights, cable_states(p, state.end_mass_radius, nodes, 1e-8),
    )  # fmt: skip


def _random_states(count, seed):
    """States over thesis Table 2.1, slow orbits among them, of both models."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        point = {
            "omega": np.exp(rng.uniform(np.log(0.03), np.log(4.0))),
            "l": rng.uniform(0.5, 10.0),
            "m": np.exp(rng.uniform(np.log(1.0), np.log(200.0))),
            "d_n": np.exp(rng.uniform(np.log(0.03), np.log(2000.0 if i % 3 == 0 else 20.0))),
            "f": np.exp(rng.uniform(np.log(0.05), np.log(4.0))),
        }
        if i % 2:
            point["gamma"] = np.exp(rng.uniform(np.log(100.0), np.log(1e5)))
        damping = 0.05 if i % 10 == 1 else 0.0
        yield from steady_states(parameters(point, damping=damping)).states


def _near_events():
    """States beside the folds of Fig. 3.1 and the edges of the flutter windows of Fig. 4.1."""
    for omega in 1.10713 + np.array([-1e-2, -1e-4, -1e-6, 1e-4]):
        yield from steady_states(parameters(figure_3_1(4.8, omega))).states
    for omega in (0.9, 1.0):
        yield from steady_states(parameters({**figure_3_1(2.7, omega), "gamma": 1000.0})).states
    for omega in (1.8, 2.2, 3.4):
        yield from steady_states(parameters(figure_4_1(1.33, omega))).states


POINTS = {
    "stretched": STRETCHED, "flutter": FLUTTER, "five states": FIVE, "design": design(250.0),
    "design, inextensible": design(250.0, elastic=False), "design, tight": design(100.0),
}  # fmt: skip


@pytest.mark.parametrize("name", POINTS)
def test_least_damped_mode_is_that_of_all_eigenvalues(name):
    for state in steady_states(parameters(POINTS[name])).states:
        _agrees_with_all_eigenvalues(state)


def test_least_damped_mode_beside_folds_and_hopf_points_is_that_of_all_eigenvalues():
    near_zero = 0
    for state in _near_events():
        _agrees_with_all_eigenvalues(state)
        near_zero += abs(stability(state).growth_rate) < 0.02
    assert near_zero > 3


def test_least_damped_mode_of_random_points_is_that_of_all_eigenvalues():
    for state in _random_states(30, 1):
        _agrees_with_all_eigenvalues(state)


@pytest.mark.slow
def test_least_damped_mode_of_two_thousand_points_is_that_of_all_eigenvalues():
    for state in _random_states(2000, 2):
        _agrees_with_all_eigenvalues(state)


def test_a_mode_at_the_edge_of_what_the_subspace_holds_is_not_passed_over():
    # Little tension and drag: the rightmost mode, 4.79i, is hardly in the subspace of 8 to 32.
    point = {
        "omega": 1.4208260977751168, "l": 4.760069909825378, "m": 0.48248926822869215,
        "d_n": 0.032249558425530775, "f": 2.5844657071121335,
    }  # fmt: skip
    state = steady_states(parameters(point)).states[0]
    matrix, band = vibration_matrix(state, 12), state.parameters.band
    worst = _worst(matrix, band)
    assert worst == pytest.approx(-0.02593581 + 4.79195j, abs=1e-5)
    for modes in (None, *range(1, 31)):
        found = rightmost(matrix, band, modes)
        assert found is None or found.value == pytest.approx(worst, abs=1e-6)


def test_phase_of_a_slow_wave_is_the_integral_of_its_wave_number():
    for state in islice(_random_states(10, 8), 20):
        found = solver_stability._slow_wave_phase(state)
        assert found == pytest.approx(_slow_wave_phase(state), rel=0.02)


@pytest.mark.slow
def test_chance_agreement_is_rare_where_little_tension_meets_much_drag(monkeypatch):
    # States along which a slow wave turns by 4 to 17 radians, against 50 functions.
    rng, states = np.random.default_rng(4), []
    while len(states) < 200:
        point = {
            "omega": rng.uniform(0.3, 3.0), "l": rng.uniform(1.5, 6.0),
            "m": np.exp(rng.uniform(np.log(3.5), np.log(100.0))),
            "d_n": np.exp(rng.uniform(np.log(3.0), np.log(2000.0))),
            "f": np.exp(rng.uniform(np.log(0.1), np.log(4.0))),
        }  # fmt: skip
        for state in steady_states(parameters(point)).states:
            if state.slope > 0.0 and 4.0 < _slow_wave_phase(state) < 17.0:
                states.append(state)
    exact = [_worst(vibration_matrix(state, 50), state.parameters.band).real for state in states]

    def wrong():
        found = [stability(state) for state in states]
        return sum(
            one.converged and abs(one.growth_rate - growth) > 0.01 * abs(growth)
            for one, growth in zip(found, exact, strict=True)
        )

    assert wrong() == 0
    # Without what resolves slow waves, short modes and pairs about to become real:
    monkeypatch.setattr("ctcbs_ros.solver.stability._FUNCTIONS_A_RADIAN", 1e-9)
    assert wrong() >= 2
    monkeypatch.setattr("ctcbs_ros.solver.stability._TAIL", 1.0)
    monkeypatch.setattr("ctcbs_ros.solver.stability._agree", _growth_rates_agree)
    assert wrong() >= 6


def test_all_eigenvalues_are_rarely_needed():
    # but on slow orbits, whose pendulum is faster than the band
    doubts, count = 0, 0
    for state in _random_states(60, 3):
        if state.parameters.omega > 0.3:
            count += 1
            doubts += rightmost(vibration_matrix(state, 12), state.parameters.band) is None
    assert count > 40
    assert doubts <= 2


# Matrices whose eigenvalues are known.


def _oscillators(eigenvalues, size, seed=0):
    """First-order matrix of `size` mixed oscillators: the pairs given, and fast ones."""
    rng = np.random.default_rng(seed)
    pairs = list(eigenvalues)
    while len(pairs) < size:
        pairs.append((complex(-rng.uniform(0.1, 3.0), rng.uniform(30.0, 300.0)), None))
    stiffness, damping = [], []
    for first, second in pairs:
        second = first.conjugate() if second is None else second
        stiffness.append((first * second).real)
        damping.append(-(first + second).real)
    turn = ortho_group.rvs(size, random_state=seed)
    a = np.zeros((2 * size, 2 * size))
    a[:size, size:] = np.eye(size)
    a[size:, :size] = -turn @ np.diag(stiffness) @ turn.T
    a[size:, size:] = -turn @ np.diag(damping) @ turn.T
    return a


def test_a_mode_beyond_the_band_does_not_count_however_little_it_is_damped():
    a = _oscillators([(-0.3 + 4.0j, None), (-0.2 + 5.01j, None), (-0.5 + 1.0j, None)], 36)
    assert rightmost(a, 5.0).value == pytest.approx(-0.3 + 4.0j, abs=1e-9)
    assert rightmost(a, 5.02).value == pytest.approx(-0.2 + 5.01j, abs=1e-9)
    assert rightmost(a, 2.0).value == pytest.approx(-0.5 + 1.0j, abs=1e-9)


def test_of_two_modes_nearly_as_far_right_the_right_one_is_found():
    for gap in (1e-3, 1e-5, 1e-7):
        a = _oscillators([(-0.3 + 4.0j, None), (-0.3 + gap + 1.0j, None)], 36)
        assert rightmost(a, 5.0).value.real == pytest.approx(-0.3 + gap, abs=1e-9)


def test_a_real_mode_is_found_stable_or_not():
    for growth in (-1.5, -1e-9, 0.4, 2.0):
        a = _oscillators([(-2.0 + 4.0j, None), (growth, -8.0)], 36)
        found = rightmost(a, 5.0).value
        assert found == pytest.approx(growth, abs=1e-9)


def test_a_mode_that_grows_faster_than_the_disk_reaches_is_a_doubt():
    assert rightmost(_oscillators([(-0.3 + 4.0j, None), (9.0, -1.0)], 36), 5.0) is None


def test_more_modes_than_the_subspace_holds_are_a_doubt():
    crowd = [(-0.3 - 0.01 * i, -2.0 - 0.1 * i) for i in range(36)]
    a = _oscillators(crowd, 36)
    found = rightmost(a, 5.0)
    assert found is None or found.value == pytest.approx(-0.3, abs=1e-9)


def test_no_mode_in_the_band_is_a_doubt():
    assert rightmost(_oscillators([(-0.3 + 8.0j, None)], 36), 5.0) is None


def test_an_eigenvalue_is_corrected_from_near_by_and_not_from_afar():
    a = _oscillators([(-0.3 + 4.0j, None), (-1.0 + 2.0j, None)], 24)
    assert corrected(a, -0.31 + 4.1j) == pytest.approx(-0.3 + 4.0j, abs=1e-9)
    assert corrected(a, -5.0 + 9.0j) is None
