"""Compiled errors of samples, their heights and the start of a turn, against numpy's formulas."""

import numpy as np
import pytest
from scipy.linalg import cholesky

from ctcbs_ros.kernels.circle_angles import newest_phase
from ctcbs_ros.kernels.circle_errors import (
    clipped_rms,
    height_and_climb,
    larger_rms,
    shown_variances,
    white_scatter,
)
from ctcbs_ros.kernels.track import joined_circle, turn_start
from ctcbs_ros.orbit.circle_fit import fit_circle
from ctcbs_ros.orbit.estimator import OrbitEstimator

RADIUS, SPEED = 90.0, 25.0


def fitted(position_sigma, velocity_sigma, seed=3, samples=150):
    """Age, velocities and fit of a noisy turn, for which 1.5 m and 0.3 m/s are assumed."""
    random = np.random.default_rng(seed)
    age = np.linspace(-20.0, 0.0, samples)
    angle = SPEED / RADIUS * age
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-np.sin(angle), np.cos(angle)])
    points = RADIUS * out + random.normal(0.0, position_sigma, out.shape)
    velocities = SPEED * along + random.normal(0.0, velocity_sigma, out.shape)
    sigmas = np.full(samples, 1.5), np.full(samples, 0.3)
    return age, fit_circle(points, velocities, *sigmas), sigmas


@pytest.mark.parametrize("noise", [(1.5, 0.3), (6.0, 5.0), (6.0, 0.3)])
def test_errors_are_seen_larger_than_stated_only_where_they_are(noise):
    _, fit, sigmas = fitted(*noise, samples=400)
    position, velocity = white_scatter(
        fit.radial, fit.along, fit.velocities, fit.radius, *sigmas, 1.5
    )
    assert position == pytest.approx(noise[0] / 1.5, rel=0.15)
    # Along the radius also shows what the position's error turns it by.
    turned = SPEED / RADIUS * position * 1.5
    assert velocity == pytest.approx(np.hypot(noise[1], turned) / np.hypot(0.3, turned), abs=0.1)


def test_without_velocities_nothing_is_seen_of_their_errors():
    _, fit, sigmas = fitted(6.0, 0.3)
    nothing = np.full_like(fit.velocities, np.nan)
    seen = white_scatter(fit.radial, fit.along * np.nan, nothing, fit.radius, *sigmas, 1.5)
    assert seen == pytest.approx((4.0, 1.0), rel=0.2)


def test_root_mean_squares_are_those_of_numpy():
    random = np.random.default_rng(5)
    one, two, three = random.uniform(0.1, 3.0, (3, 50))
    larger = np.maximum(one, np.hypot(two, three))
    assert larger_rms(one, two, three) == pytest.approx(np.sqrt(np.mean(larger**2)))
    clipped = np.minimum(one, 1.0)
    assert clipped_rms(-one, 1.0) == pytest.approx(np.sqrt(np.mean(clipped**2)))


@pytest.mark.parametrize("noise", [(1.5, 0.3), (1.8, 0.3), (1.2, 0.25), (1.5, 0.4)])
def test_errors_that_nobody_states_are_what_the_residuals_show(noise):
    # Of 30 turns, since one tells its errors to some 10 % only.
    found = []
    for seed in range(30):
        age, fit, sigmas = fitted(*noise, seed=seed)
        variances = sigmas[0] ** 2, (fit.late * sigmas[1]) ** 2
        shown_variances(
            fit.radial, fit.along, fit.weight, fit.velocities, fit.radius, fit.late, age,
            sigmas[0], np.zeros(150), 45.0, False, 0.01, *variances,
        )
        found.append([variances[0].mean(), variances[1].mean()])
    position, velocity = np.mean(found, axis=0)
    assert position == pytest.approx(noise[0] ** 2, rel=0.15)
    # What the position's error turns the radius by is most of what shows along the radius.
    turned = (SPEED / RADIUS * noise[0]) ** 2
    assert velocity + turned == pytest.approx(noise[1] ** 2 + turned, rel=0.15)


def test_stated_errors_are_kept_and_the_excess_over_them_is_told():
    age, fit, sigmas = fitted(1.5, 0.3)
    variances = sigmas[0] ** 2, sigmas[1] ** 2
    for correlated, explained in ((0.0, 1.0), (2.0, 1.0 + (2.0 / 1.5) ** 2 * 20.0 / (6 * 45.0))):
        seen, expected = shown_variances(
            fit.radial, fit.along, fit.weight, fit.velocities, fit.radius, fit.late, age,
            sigmas[0], np.full(150, correlated), 45.0, True, 0.01, *variances,
        )
        assert (variances[0] == sigmas[0] ** 2).all()
        assert (variances[1] == sigmas[1] ** 2).all()
        assert seen == pytest.approx(1.0, abs=0.3)
        assert expected == pytest.approx(explained)


def test_height_and_climb_have_the_covariance_of_dense_matrices():
    age = np.sort(np.random.default_rng(2).uniform(-20.0, 0.0, 40))
    age[-1] = 0.0
    up, sigma = 300.0 + 0.7 * age, np.full(40, 1.5)
    covariance = np.empty((2, 2))
    found = height_and_climb(age, up, sigma, np.full(40, 2.0), 8.0, covariance)
    assert found == pytest.approx((300.0, 0.7))
    errors = np.diag(sigma**2) + 4.0 * np.exp(-np.abs(age[:, None] - age) / 8.0)
    gain = np.linalg.pinv(np.column_stack([np.ones(40), age]))
    assert covariance == pytest.approx(gain @ errors @ gain.T, rel=1e-9)
    # And by drawing such errors.
    noise = cholesky(errors, lower=True) @ np.random.default_rng(1).normal(size=(40, 4000))
    drawn = np.array([
        height_and_climb(age, up + one, sigma, np.zeros(40), 8.0, np.empty((2, 2)))
        for one in noise.T
    ])
    assert np.cov(drawn.T) == pytest.approx(covariance, rel=0.1)


def test_the_phase_is_that_of_a_weighted_line_through_the_newest_part():
    random = np.random.default_rng(9)
    time = np.sort(random.uniform(0.0, 20.0, 60))
    angle, sigma = 0.3 * time + random.normal(0.0, 0.02, 60), random.uniform(0.5, 2.0, 60)
    newest = time > time[-1] - 4.0
    slope_and_phase = np.polyfit(time[newest] - time[-1], angle[newest], 1, w=1.0 / sigma[newest])
    operator = np.zeros(60)
    phase = newest_phase(time, angle, sigma, np.zeros(2), 4.0, operator)
    assert phase == pytest.approx(slope_and_phase[1], rel=1e-9)
    assert operator @ angle == pytest.approx(phase)
    assert not operator[~newest].any()
    # A variation once a turn that is known does not bend the line.
    even = np.linspace(-1.0, 0.6, 60)
    bent = even.copy()
    for _ in range(60):
        bent = even + 0.3 * np.cos(bent) - 0.2 * np.sin(bent)
    operator[:] = 0.0
    harmonic = np.array([0.3, -0.2])
    level = newest_phase(
        np.linspace(-9.0, 0.0, 60), bent, np.ones(60), harmonic, 4.0, operator
    )
    assert level == pytest.approx(bent[-1], abs=5e-4)
    assert abs(operator @ bent - bent[-1]) > 2e-3
    # Never fewer than three samples.
    operator[:] = 0.0
    newest_phase(time, angle, sigma, np.zeros(2), 1e-9, operator)
    assert np.flatnonzero(operator).tolist() == [57, 58, 59]


def test_a_turn_begins_where_straight_flight_ends_and_reaches_no_further_than_the_window():
    turning = np.linspace(0.0, 12.0, 121)
    course = np.concatenate([np.zeros(30), turning])
    time = np.arange(len(course), dtype=float)
    assert turn_start(time, course, 100.0)[0] == 0
    kept, start = turn_start(time, course, 100.0)
    assert 30 <= start <= 34  # 3 % and 0.02 rad of the turn may be lost
    kept, start = turn_start(time, course, 6.5)
    assert course[kept] == pytest.approx(5.4, abs=0.01)
    assert start >= kept
    assert turn_start(time, -course, 6.5) == (kept, start)
    assert turn_start(time[:1], course[:1], 6.5) == (0, 0)


@pytest.mark.parametrize(("leg", "reaches_across"), [(30, True), (90, False)])
@pytest.mark.parametrize("wander", [0.0, 0.5])
def test_a_turn_does_not_reach_across_a_leg_as_long_as_itself(leg, reaches_across, wander):
    # A turn of 180 deg, a leg, a turn of 270 deg at the same 0.1 rad a sample.
    before, after = np.arange(0.0, 3.14, 0.1), np.arange(0.0, 4.7, 0.1)
    flown = np.full(leg, before[-1]) + wander * np.sin(np.arange(leg) / 8.0)
    course = np.concatenate([before, flown, flown[-1] + after])
    _, start = turn_start(np.arange(len(course), dtype=float), course, 6.9)
    joined = len(before) + leg
    assert start < len(before) if reaches_across else joined - 5 <= start <= joined + 5


@pytest.mark.parametrize("share", [0.5, 0.88])
def test_a_circle_over_the_ground_in_wind_is_one_turn_though_it_is_flown_unevenly(share):
    # Speed over the ground where the course is at an angle to the wind, airspeed 1.
    course = np.linspace(0.0, 6.5, 2000)
    speed = np.sqrt(1.0 - (share * np.sin(course)) ** 2) + share * np.cos(course)
    time = np.concatenate([[0.0], np.cumsum(np.diff(course) / speed[1:])])
    for end in range(400, 2001, 100):
        _, start = turn_start(time[:end], course[:end], 6.9)
        assert course[start] <= 0.03 * course[end - 1] + 0.03


@pytest.mark.parametrize("drift", [(0.0, 0.0), (3.0, -4.0)])
def test_a_circle_is_joined_after_the_last_three_samples_in_a_row_off_it(drift):
    ahead = np.linspace(-20.0, 0.0, 100)
    angle, moved = 0.3 * ahead, np.outer(ahead, drift)
    out = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    points = out + moved
    circle, sigma = np.array([0.0, 0.0, RADIUS]), np.full(100, 1.5)
    points[:20] += 0.5 * out[:20]
    points[[40, 41]] -= 0.5 * out[[40, 41]]  # a glitch
    arguments = ahead, sigma, np.zeros(100), circle, np.array(drift)
    assert joined_circle(points, *arguments) == 20
    points[42] += 0.5 * out[42]
    assert joined_circle(points, *arguments) == 43
    assert joined_circle(points[43:], *(a[43:] for a in arguments[:3]), *arguments[3:]) == 0


@pytest.mark.parametrize("noise", [0.02, 1.5])
@pytest.mark.parametrize("climb", [4.0, -3.0, 0.0])
def test_height_is_that_of_now_also_after_a_climb_has_begun_or_ended(climb, noise):
    # A turn of 25 s at 5 Hz, the climb before a bend or after it. In noise a bend shows after 4 s.
    random, off = np.random.default_rng(6), []
    time = np.arange(0.0, 25.0, 0.2)
    angle = 2.0 * np.pi * time / 25.0
    for bend in (8.0, 12.0, 16.0, 20.0, *((23.0,) if noise < 1.0 else ())):
        for up in (climb * np.minimum(time, bend), climb * np.maximum(time - bend, 0.0)):
            estimator = OrbitEstimator()
            seen = up + random.normal(0.0, noise, time.size)
            for t, a, z in zip(time, angle, seen, strict=True):
                position = np.array([80.0 * np.cos(a), 80.0 * np.sin(a), z])
                velocity = 20.0 * np.array([-np.sin(a), np.cos(a), 0.0])
                orbit = estimator.add(t, position, velocity).orbit
            off.append((orbit.center[2] - up[-1], np.sqrt(orbit.covariance[2, 2])))
    error, stated = np.array(off).T
    assert np.abs(error).max() < 0.7 + 2.0 * noise
    assert (np.abs(error) < 3.0 * stated).all()
