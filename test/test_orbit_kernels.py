"""Compiled regressions and the circle fit against numpy and scipy."""

import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from ctcbs_ros.kernels.circle import scatter
from ctcbs_ros.kernels.circle_angles import (
    continuous_angles,
    mean_rate,
    newest_offset,
    newest_phase,
    progress,
)
from ctcbs_ros.kernels.circle_covariance import propagate
from ctcbs_ros.kernels.circle_trend import lag, widening
from ctcbs_ros.kernels.course_trend import course_widening
from ctcbs_ros.kernels.rate_trend import rate_lag
from ctcbs_ros.kernels.regression import invert_normal, least_squares, line
from ctcbs_ros.orbit.circle_fit import HUBER, drifting_start, fit_circle


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6])
def test_the_inverse_of_a_normal_matrix_is_that_of_numpy(size):
    random = np.random.default_rng(size)
    half = random.normal(size=(size + 2, size))
    normal, inverse = half.T @ half, np.empty((size, size))
    assert invert_normal(normal, inverse)
    assert inverse == pytest.approx(np.linalg.inv(normal), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "normal", [np.zeros((2, 2)), np.ones((2, 2)), -np.eye(3), np.full((2, 2), np.nan)]
)
def test_a_matrix_that_is_not_positive_definite_is_refused(normal):
    assert not invert_normal(normal, np.empty_like(normal))


def test_least_squares_and_line_are_those_of_numpy():
    random = np.random.default_rng(1)
    x, weight = np.sort(random.uniform(-30.0, 0.0, 50)), random.uniform(0.5, 2.0, 50)
    y = 3.0 - 0.2 * x + random.normal(0.0, 0.1, 50)
    design = np.column_stack([np.ones(50), x])
    root = np.sqrt(weight)
    expected, residual, *_ = np.linalg.lstsq(design * root[:, None], y * root, rcond=None)
    covariance = np.linalg.inv((design.T * weight) @ design)

    solution, inverse = np.empty(2), np.empty((2, 2))
    squares, determined = least_squares(design, y, weight, solution, inverse)
    assert determined
    assert solution == pytest.approx(expected, rel=1e-9)
    assert inverse == pytest.approx(covariance, rel=1e-9)
    assert squares == pytest.approx(residual[0], rel=1e-9)

    at_zero, slope, of_zero, of_slope, left = line(x, y, weight)
    assert [at_zero, slope] == pytest.approx(expected, rel=1e-9)
    assert [of_zero, of_slope] == pytest.approx(np.diag(covariance), rel=1e-9)
    assert left == pytest.approx(residual[0], rel=1e-9)


def test_columns_that_depend_on_each_other_determine_nothing():
    design = np.column_stack([np.ones(9), np.arange(9.0), 1.0 + 2.0 * np.arange(9.0)])
    _, determined = least_squares(
        design, np.arange(9.0), np.ones(9), np.empty(3), np.empty((3, 3))
    )
    assert not determined


def track(count=80, turns=0.8, noise=1.0, seed=0):
    """Positions and velocities about (30, -20) at radius 100, anticlockwise, and their angles."""
    random = np.random.default_rng(seed)
    angle = np.linspace(2.0, 2.0 + 2.0 * np.pi * turns, count)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    points = (30.0, -20.0) + 100.0 * out + random.normal(0.0, noise, (count, 2))
    return points, 20.0 * along + random.normal(0.0, 0.2 * noise, (count, 2)), angle


@pytest.mark.parametrize("with_velocities", [True, False])
def test_the_circle_has_the_least_huber_loss_that_scipy_finds(with_velocities):
    points, velocities, _ = track()
    points[[10, 40]] += 25.0  # glitches, for the robust loss to matter
    velocities[::3] = np.nan
    if not with_velocities:
        velocities[:] = np.nan
    known = np.isfinite(velocities[:, 0])

    def residuals(circle):
        offset = points - circle[:2]
        distance = np.hypot(*offset.T)
        along = np.sum(velocities * offset, axis=1)[known] / distance[known]
        across = (velocities[:, 1] * offset[:, 0] - velocities[:, 0] * offset[:, 1])[known]
        # What the position's noise turns the radius, and how far it moves a point outwards.
        sigma = np.hypot(0.2, across / distance[known] ** 2)
        return np.concatenate([distance - 0.5 / distance - circle[2], along / sigma])

    reference = scipy_least_squares(
        residuals, [0.0, 0.0, 80.0], loss="huber", f_scale=HUBER, x_scale=100.0, xtol=1e-14
    )
    fit = fit_circle(points, velocities, np.full(80, 1.0), np.full(80, 0.2))
    # The fit ends at a step of 3e-4 radii, 0.03 m.
    assert [*fit.center, fit.radius] == pytest.approx(reference.x, abs=0.03)
    expected = np.hypot(*(points - fit.center).T) - fit.radius
    assert fit.radial == pytest.approx(expected, abs=0.03)


def test_a_drifting_circle_without_noise_is_found_exactly_from_nothing():
    age = np.linspace(-20.0, 0.0, 60)
    angle = 0.3 * age
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    drift, center = np.array([5.0, -2.0]), np.array([300.0, -40.0])
    points = center + np.outer(age, drift) + 70.0 * out
    velocities = drift + 70.0 * 0.3 * np.column_stack([-out[:, 1], out[:, 0]])
    exact = [*center, 70.0, *drift]
    assert drifting_start(points, velocities, age) == pytest.approx(exact, abs=1e-6)
    fit = fit_circle(points, velocities, np.full(60, 1e-3), np.full(60, 1e-3), None, age)
    assert [*fit.center, fit.radius, *fit.drift] == pytest.approx(exact, abs=1e-6)


def test_points_on_a_line_have_no_circle():
    points = np.column_stack([np.linspace(0.0, 100.0, 20), np.zeros(20)])
    nothing = np.full((20, 2), np.nan)
    assert fit_circle(points, nothing, np.ones(20), np.ones(20)) is None


def test_angles_go_on_through_full_turns_and_across_a_gap():
    points, _, angle = track(count=200, turns=3.2, noise=0.0)
    time = np.linspace(0.0, 100.0, 200)
    rate = (angle[-1] - angle[0]) / 100.0
    kept = np.r_[0:60, 140:200]  # 1.3 turns missing
    found = np.empty(kept.size)
    continuous_angles(points[kept], 30.0, -20.0, time[kept], rate, found)
    assert found == pytest.approx(angle[kept], abs=1e-9)


def test_the_mean_rate_is_free_of_what_wind_does_once_a_turn():
    angle = np.linspace(0.0, 2.2 * np.pi, 100)
    # Ground speed 1 + 0.3 sin(angle) over the mean: time is the integral of its inverse.
    fine = np.linspace(0.0, 2.0 * np.pi, 20_001)
    slowness = 1.0 / (1.0 + 0.3 * np.sin(fine))
    turn = np.mean(slowness[:-1]) * 2.0 * np.pi
    time = np.interp(angle, np.linspace(0.0, 4.0 * np.pi, 40_001), np.concatenate(
        [[0.0], np.cumsum(np.tile(slowness[:-1], 2))]
    ) * (2.0 * np.pi / 20_000))
    mean = 2.0 * np.pi / turn
    operator = np.empty(100)
    with_harmonic, _ = mean_rate(time, angle, np.full(100, 0.01), True, operator, np.empty(2))
    assert operator @ angle == pytest.approx(with_harmonic, rel=1e-9)
    without, excess = mean_rate(time, angle, np.full(100, 0.01), False, operator, np.empty(2))
    assert with_harmonic == pytest.approx(mean, rel=0.02)
    assert abs(without - mean) > abs(with_harmonic - mean)
    design = np.column_stack([np.ones(100), time])
    solution, residual, *_ = np.linalg.lstsq(design, angle, rcond=None)
    assert without == pytest.approx(solution[1], rel=1e-9)
    assert operator == pytest.approx(np.linalg.pinv(design)[1], rel=1e-9)
    assert excess == pytest.approx(residual[0] / 98 / 0.01**2, rel=1e-6)


def dense_errors(time, sigma, correlated, correlation_time):
    """Covariance of one axis of the positions, (n, n)."""
    lag = np.abs(time[:, None] - time)
    return sigma**2 * np.eye(len(time)) + correlated**2 * np.exp(-lag / correlation_time)


@pytest.mark.parametrize("drifts", [False, True])
def test_errors_are_propagated_as_finite_differences_and_dense_matrices_say(drifts):
    # The fit is run again for each coordinate moved a little; nothing but it is trusted.
    points, velocities, _ = track(count=40, noise=0.3)
    time = np.sort(np.random.default_rng(3).uniform(0.0, 25.0, 40))
    age = time - time[-1]
    if drifts:
        drift = np.array([3.0, -1.0])
        points, velocities = points + np.outer(age, drift), velocities + drift
    sigmas = np.full(40, 1.5), np.full(40, 0.3)
    operators = np.vstack([np.linspace(-0.1, 0.1, 40), np.r_[np.zeros(30), np.full(10, 0.1)]])

    def result(moved, faster, start):
        fit = fit_circle(moved, faster, *sigmas, start, age if drifts else None)
        angle = np.empty(40)
        continuous_angles(fit.points, *fit.center, time, 0.0, angle)
        drift = fit.drift if drifts else []
        return np.array([*fit.center, fit.radius, *drift, *operators @ angle]), fit

    start = None if drifts else np.array([30.0, -20.0, 100.0, 0.0, 0.0])
    for _ in range(5):
        base, fit = result(points, velocities, start)
        start = fit.start
    gain = np.empty((2, 2, 40, len(base)))  # of position and velocity, axis, sample
    for axis in range(2):
        for i in range(40):
            step = np.zeros((40, 2))
            step[i, axis] = 0.05
            gain[0, axis, i] = (result(points + step, velocities, start)[0] - base) / 0.05
            gain[1, axis, i] = (result(points, velocities + step, start)[0] - base) / 0.05
    position, velocity = dense_errors(time, 1.5, 2.0, 8.0), 0.3**2 * np.eye(40)
    expected = sum(g.T @ position @ g for g in gain[0]) + sum(g.T @ velocity @ g for g in gain[1])
    covariance = np.empty((len(base), len(base)))
    propagate(
        fit.points, fit.velocities, age, fit.circle, fit.weight, fit.inverse, operators,
        sigmas[0] ** 2, sigmas[1] ** 2, np.full((1, 40), 2.0), np.array([8.0]), covariance,
    )
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert covariance / scale == pytest.approx(expected / scale, abs=0.03)


def test_a_spiral_is_told_from_a_circle_over_half_a_turn():
    random = np.random.default_rng(4)
    angle = np.linspace(1.0, 1.0 + np.pi, 60)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    for growth in (0.0, 30.0):
        radius = 100.0 + growth * (angle - angle[-1]) / (2.0 * np.pi)
        points = radius[:, None] * out + random.normal(0.0, 1.5, (60, 2))
        slip = growth / (2.0 * np.pi) / radius
        velocities = 20.0 * (along + slip[:, None] * out) + random.normal(0.0, 0.3, (60, 2))
        fit = fit_circle(points, velocities, np.full(60, 1.5), np.full(60, 0.3))
        change, variance, _ = widening(
            points, velocities, np.linspace(-8.0, 0.0, 60), fit.circle, False, angle, fit.radial,
            fit.along, fit.weight, np.zeros(60), 45.0, (0.0, np.inf),
        )
        # Huber's weights, those of a circle, shrink a large change by some 15 %.
        assert abs(change - 0.85 * growth) < 3.0 * np.sqrt(variance)
        assert np.sqrt(variance) < 8.0


def test_scatter_is_the_white_noise_on_a_smooth_course_with_a_jump():
    random = np.random.default_rng(6)
    values = 50.0 * np.sin(np.linspace(0.0, 3.0, 400)) + random.normal(0.0, 2.0, 400)
    values[200:] += 40.0
    assert scatter(values) == pytest.approx(2.0, rel=0.15)
    assert scatter(np.full(30, np.nan)) == 0.0


def test_offset_and_progress_of_a_track():
    random = np.random.default_rng(5)
    angle = np.linspace(0.0, 6.0, 50)
    radial = 0.5 + 2.0 * angle / (2.0 * np.pi) + random.normal(0.0, 0.01, 50)
    near = angle > 6.0 - 0.5
    off, count = newest_offset(radial, angle, 0.5)
    assert (off, count) == (pytest.approx(np.median(radial[near])), near.sum())

    time, quiet = np.arange(50.0), 0.01
    even = progress(radial, angle, time, 1, 6.0, 10.0, quiet)
    assert even[0] == 0.0
    assert not even[2]
    assert even[1] == pytest.approx(angle[-1] - angle[-6])
    assert progress(radial, angle, time, -1, 6.0, 10.0, quiet)[0] == 1.0
    leap = angle + 1.0 * (time > 25.0)
    assert progress(radial, leap, time, 1, 7.0, 10.0, quiet)[2]
    assert not progress(radial, leap, time + 12.0 * (time > 25.0), 1, 7.0, 10.0, quiet)[2]
    # A glitch goes there and back, or back and there; at the end nobody can tell it from a leap.
    for sample, off, broken in ((25, 1.0, False), (25, -1.0, False), (49, 1.0, True)):
        glitch = angle + off * (time == sample)
        assert progress(radial, glitch, time, 1, 7.0, 10.0, quiet)[2] == broken


@pytest.mark.parametrize("drifts", [False, True])
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("turns", [0.5, 0.75, 1.05])
def test_a_circle_lags_behind_a_growing_radius_by_what_is_said(turns, sense, drifts):
    # Archimedes' spiral about the origin at constant speed: its angle solves a quadratic equation.
    radius, speed, growth, count = 100.0, 20.0, 0.3, 200
    age = np.linspace(-2.0 * np.pi * turns * radius / speed, 0.0, count)
    angle = (
        2.0 * np.pi / growth * (np.sqrt(radius**2 + growth * speed * age / np.pi) - radius)
    )
    r = radius + growth * angle / (2.0 * np.pi)
    out = np.column_stack([np.cos(angle), sense * np.sin(angle)])
    tangent = np.column_stack([-np.sin(angle), sense * np.cos(angle)])
    points = r[:, None] * out
    swept = growth / (2.0 * np.pi) * out + r[:, None] * tangent
    velocities = speed * swept / np.hypot(*swept.T)[:, None]
    # Small ones: the fit takes off what noise along the circle moves the points outwards.
    sigma = np.full(count, 0.015)
    fit = fit_circle(
        points, velocities, sigma, np.full(count, 0.003), age=age if drifts else None
    )
    seen, operators = np.empty(count), np.zeros((2, count))
    continuous_angles(fit.points, *fit.center, age, sense * speed / radius, seen)
    harmonic = np.empty(2)
    rate, _ = mean_rate(age, seen, sigma / fit.radius, False, operators[0], harmonic)
    phase = newest_phase(age, seen, sigma, harmonic, 2.0, operators[1])
    moved = np.empty(len(fit.inverse) + 2)
    lag(
        fit.points, fit.velocities, age, fit.circle, fit.weight, fit.inverse, seen, operators,
        rate, moved,
    )
    off = [
        *fit.center, fit.radius - radius, *(fit.drift if drifts else ()),
        rate - sense * speed / radius, (phase + np.pi) % (2.0 * np.pi) - np.pi,
    ]  # fmt: skip
    # Metres, metres a second, milliradians.
    units = np.array([1.0] * len(fit.inverse) + [1e3, 1e3])
    assert off * units == pytest.approx(growth * moved * units, rel=0.02, abs=3e-4)


@pytest.mark.parametrize("drifts", [False, True])
@pytest.mark.parametrize("sense", [1, -1])
def test_the_course_over_the_way_flown_tells_a_spiral_within_what_is_stated(sense, drifts):
    # Archimedes' spiral, at a speed that varies; with a drift of the air where one is fitted.
    random = np.random.default_rng(12)
    time = np.arange(0.0, 16.0 if drifts else 9.0, 0.2)
    angle = 0.38 * time + 0.03 * np.sin(time)
    swept = 0.38 + 0.03 * np.cos(time)
    for growth in (0.0, 12.0):
        radius = 50.0 + growth * (angle - angle[-1]) / (2.0 * np.pi)
        out = np.column_stack([np.cos(angle), sense * np.sin(angle)])
        along = np.column_stack([-np.sin(angle), sense * np.cos(angle)])
        velocity = (growth / (2.0 * np.pi) * swept)[:, None] * out
        velocity += (radius * swept)[:, None] * along
        if drifts:
            velocity += (0.8, -0.5)
        found, stated = [], []
        for _ in range(300):
            change, variance = course_widening(
                velocity + random.normal(0.0, 0.3, velocity.shape), time - time[-1], 50.0,
                np.full(len(time), 0.3), drifts,
            )
            found.append(change)
            stated.append(variance)
        deviation = np.sqrt(np.mean(stated))
        # Over half a turn the positions, good to 1.5 m, tell it to 4 m a turn.
        assert deviation < 3.0
        # What a drift does is that on a circle: of a spiral it misses a tenth.
        assert np.mean(found) == pytest.approx(growth, abs=0.5 * deviation + 0.1 * growth)
        assert 0.6 < np.std(found) / deviation < 1.1


def test_the_course_tells_nothing_without_velocities_or_on_the_spot():
    age = np.linspace(-8.0, 0.0, 40)
    velocities = 20.0 * np.column_stack([np.cos(0.4 * age), np.sin(0.4 * age)])
    sigma = np.full(40, 0.3)
    assert np.isfinite(course_widening(velocities, age, 50.0, sigma, False)[1])
    for nothing in (np.nan, 0.0):
        velocities[7] = nothing
        assert course_widening(velocities, age, 50.0, sigma, False)[1] == np.inf


def turned_ever_faster(growth, swing, turns, sense, random, of_position=1.5, of_velocity=0.3):
    """Track about (3, -2) on 60 m at 20 m/s, faster by a share `growth` in a turn."""
    mean = sense * 20.0 / 60.0
    turn = 2.0 * np.pi / abs(mean)
    time = np.arange(0.0, turns * turn, 0.2)
    since = time - 0.5 * time[-1]
    angle = mean * (since + growth * since**2 / (2.0 * turn))
    rate = mean * (1.0 + growth * since / turn) * (1.0 + swing * np.cos(angle))
    angle += swing * np.sin(angle)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-np.sin(angle), np.cos(angle)])
    points = (3.0, -2.0) + 60.0 * out + random.normal(0.0, of_position, out.shape)
    velocities = 60.0 * rate[:, None] * along + random.normal(0.0, of_velocity, out.shape)
    return time, points, velocities, mean, mean * growth * 0.5 * turns


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(
    ("growth", "swing"), [(0.1, 0.0), (-0.1, 0.0), (0.05, 0.2), (0.0, 0.2)]
)
@pytest.mark.parametrize("turns", [1.0, 1.3])
def test_the_rate_is_above_its_mean_by_what_a_speed_that_grows_makes_of_it(
    growth, swing, turns, sense
):
    random, circle = np.random.default_rng(5), np.array([3.0, -2.0, 60.0])
    found, stated = [], []
    for _ in range(200):
        time, points, velocities, mean, lag_true = turned_ever_faster(
            growth, swing, turns, sense, random
        )
        angle = np.empty(len(time))
        continuous_angles(points, 3.0, -2.0, time, mean, angle)
        sigmas = np.full((2, len(time)), [[1.5], [0.3]])
        lag_found, variance = rate_lag(points, velocities, circle, time, angle, *sigmas, mean)
        found.append(lag_found / mean)
        stated.append(variance / mean**2)
    deviation = np.sqrt(np.mean(stated))
    assert deviation < 0.01
    # Of a change in a wind of a fifth of the speed a quarter passes for wind over one turn.
    assert np.mean(found) == pytest.approx(
        lag_true / mean, abs=0.002 + (0.3 * abs(lag_true / mean) if swing else 0.0)
    )
    assert 0.8 < np.std(found) / deviation < 1.4


def test_without_velocities_the_angles_alone_tell_how_the_rate_changes():
    random, circle = np.random.default_rng(6), np.array([3.0, -2.0, 60.0])
    time, points, velocities, mean, lag_true = turned_ever_faster(
        0.1, 0.0, 1.0, 1, random, 0.05, np.nan
    )
    angle = np.empty(len(time))
    continuous_angles(points, 3.0, -2.0, time, mean, angle)
    sigmas = np.full((2, len(time)), [[0.05], [0.3]])
    found, variance = rate_lag(points, velocities, circle, time, angle, *sigmas, mean)
    assert found == pytest.approx(lag_true, abs=3.0 * np.sqrt(variance))
    assert np.sqrt(variance) < 0.05 * lag_true
    sigmas[:] = np.nan
    assert rate_lag(points, velocities, circle, time, angle, *sigmas, mean)[1] == np.inf
