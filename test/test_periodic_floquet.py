"""Floquet exponents against the eigenvalues in still air and the cable in time in wind."""

from math import pi

import numpy as np
import pytest
from points import FLUTTER, STRETCHED, design, parameters

from ctcbs_ros.dynamics import signal
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.periodic.floquet import (
    exponents_and_frequencies,
    floquet,
    least_damped_search,
)
from ctcbs_ros.periodic.solve import coarse_search, periodic_motion
from ctcbs_ros.periodic.tension import under_tension
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED, TowPath
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import eigenvalues, stability
from ctcbs_ros.solver.steady_state import steady_states


def moving(point, kind, wind, damping=0.0):
    """The periodic motion of a point in a wind."""
    (state,) = steady_states(parameters(point, damping=damping)).states
    return state, periodic_motion(state, TowPath(kind, wind), 1e-5).motion


@pytest.mark.parametrize(
    ("point", "damping"), [(STRETCHED, 0.0), (STRETCHED, 0.05), (design(250.0), 0.0)]
)
def test_without_wind_the_growth_rate_is_the_steady_states(point, damping):
    state, motion = moving(point, GROUND_SPEED, 0.0, damping)
    expected = stability(state)
    found = floquet(motion, expected.functions)
    assert found.growth_rate == pytest.approx(expected.growth_rate, rel=1e-4)
    assert found.frequency == pytest.approx(expected.frequency, rel=1e-4)
    assert found.band == expected.band
    assert found.converged
    assert found.stable == expected.stable


@pytest.mark.parametrize("point", [STRETCHED, design(250.0)])
def test_the_tension_that_a_coarse_motion_needs_is_the_steady_states(point):
    (state,) = steady_states(parameters(point)).states
    coarse = drained(coarse_search(state, TowPath(GROUND_SPEED, 0.0), 1e-2)).motion
    slope, _, _ = under_tension(coarse, 12, np.array([0.0, 1.0]))
    found = coarse.parameters.gamma * (np.linalg.norm(slope, axis=-1) - 1.0)
    nodes = 0.5 * coarse.parameters.length * (1.0 + np.polynomial.legendre.leggauss(12)[0])
    expected = np.linalg.norm(state.cable(nodes)[1], axis=-1)
    assert found == pytest.approx(np.stack([expected, expected]), rel=5e-3)


def test_where_few_orders_have_a_cable_push_its_short_waves_do_not_grow():
    # A light end mass in a strong wind: the least tension is 0.8, by the few orders' push -1.2.
    point = Parameters(0.78, 3.32, 5.8, 43.91, 0.47, elasticity=595.0)
    (state,) = steady_states(point).states
    path = TowPath(GROUND_SPEED, 0.27)
    coarse = drained(coarse_search(state, path, 6e-2)).motion
    fine = periodic_motion(state, path, 1e-3).motion
    when = np.linspace(0.0, 2.0 * np.pi, 64)
    least = []
    for motion in (coarse, fine):
        slope, _, _ = under_tension(motion, 40, when)
        least.append(point.gamma * (np.linalg.norm(slope, axis=-1).min() - 1.0))
    assert least[0] == pytest.approx(0.0, abs=1e-9)
    assert least[1] == pytest.approx(fine.least_tension, rel=0.05)
    expected = drained(least_damped_search(fine, 18, point.band, 64))
    # -0.239 and -0.243 of lumped masses on 12 and 24 segments
    assert expected.growth_rate == pytest.approx(-0.245, rel=0.01)
    for functions in (12, 18, 27):
        found = drained(least_damped_search(coarse, functions, point.band, 64))
        assert found.growth_rate == pytest.approx(expected.growth_rate, rel=0.02)
        assert found.frequency == pytest.approx(expected.frequency, rel=0.05)


def test_the_tension_that_a_damped_motion_in_wind_needs_is_that_of_its_stretch():
    _, motion = moving(STRETCHED, GROUND_SPEED, 0.1, 0.05)
    when = np.array([0.3, 2.0, 4.0])
    slope, _, _ = under_tension(motion, 9, when)
    nodes = 0.5 * motion.parameters.length * (1.0 + np.polynomial.legendre.leggauss(9)[0])
    h = 1e-4
    for time, row in zip(when, slope, strict=True):
        apart = (motion.cable(time, nodes + h) - motion.cable(time, nodes - h)) / (2.0 * h)
        assert row == pytest.approx(apart, abs=2e-4)
        assert (np.linalg.norm(apart, axis=1) > 1.05).all()


def test_without_wind_frequencies_are_those_of_all_slow_modes():
    state, motion = moving(STRETCHED, GROUND_SPEED, 0.0)
    exponents, frequencies = exponents_and_frequencies(motion, 12, 64)
    for value in eigenvalues(state, 12):
        if abs(value) < 5.0 and value.real > -3.0:
            apart = exponents - value
            apart = apart - 1j * np.round(apart.imag)
            near = np.argmin(np.abs(apart) + np.abs(frequencies - abs(value.imag)))
            assert abs(apart[near]) < 2e-4
            assert frequencies[near] == pytest.approx(abs(value.imag), abs=1e-3)


def strobed(motion, segments, turns, size):
    """Once a turn, how far a line that began disturbed is from one that did not, (turns, k)."""
    p = motion.parameters
    line, path = line_of(p), motion.path
    tow = signal.sampled(lambda t: path.motion(t)[0], 0.0, 2.0 * pi * turns, 2.0 * pi / 256)
    driven = drive(line, tow, signal.constant(np.array([path.air_velocity, 0.0, 0.0])))
    s, h = np.linspace(0.0, p.length, segments + 1), 1e-4
    rate = (motion.cable(h, s) - motion.cable(-h, s)) / (2.0 * h)
    when = 2.0 * pi * np.arange(1, turns + 1)
    runs = []
    for push in (0.0, size):
        velocities = rate + push * np.outer(1.0 - s / p.length, [1.0, 0.5, 0.2])
        state = CableState(0.0, motion.cable(0.0, s), velocities)
        done = simulate(line, driven, state, when, 1e-6)
        nodes = slice(0, segments, segments // 4)
        runs.append(
            np.hstack([done.positions[:, nodes].reshape(turns, -1),
                       done.velocities[:, nodes].reshape(turns, -1)])
        )  # fmt: skip
    return runs[1] - runs[0]


@pytest.mark.parametrize(
    ("point", "kind", "wind", "turns", "size"),
    [
        (STRETCHED, GROUND_SPEED, 0.1, 30, 1e-3), (STRETCHED, AIRSPEED, 0.2, 24, 1e-3),
        pytest.param(FLUTTER, GROUND_SPEED, 0.1, 40, 1e-5, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_small_disturbance_grows_or_decays_in_time_as_the_exponent_says(
    point, kind, wind, turns, size
):
    state, motion = moving(point, kind, wind)
    found = floquet(motion, stability(state).functions)
    off = strobed(motion, 40, turns, size)[turns // 2 :]
    # what is left is one pair of multipliers mu: x(k + 2) = 2 Re(mu) x(k + 1) - |mu|^2 x(k)
    scale = np.linalg.norm(off[:-2], axis=1, keepdims=True)
    before = np.stack([(off[1:-1] / scale).ravel(), (off[:-2] / scale).ravel()], axis=1)
    (_, last), *_ = np.linalg.lstsq(before, (off[2:] / scale).ravel(), rcond=None)
    growth = np.log(-last) / (4.0 * pi)
    assert growth == pytest.approx(found.growth_rate, rel=0.02, abs=2e-4)


def test_the_modes_that_count_are_those_that_lead_from_the_band_without_wind():
    state, motion = moving(STRETCHED, GROUND_SPEED, 0.0)
    values = eigenvalues(state, 12)
    tracked = values[np.abs(values.imag) <= state.parameters.band]
    # what has decayed by e^-12 within a turn cannot be followed
    tracked = tracked[tracked.real > -2.0]
    for wind in np.arange(0.02, 0.2001, 0.02):
        motion = periodic_motion(state, TowPath(GROUND_SPEED, wind), 1e-4).motion
        exponents, _ = exponents_and_frequencies(motion, 12, 64)
        apart = exponents[None, :] - tracked[:, None]
        apart = apart - 1j * np.round(apart.imag)
        tracked = exponents[np.argmin(np.abs(apart), axis=1)]
    assert floquet(motion, 12).growth_rate == pytest.approx(tracked.real.max(), rel=0.01)
