"""The orbit estimator while an autopilot converges onto its circle, or leaves it."""

import numpy as np
import pytest

from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.guided_tracks import Autopilot, Loiter, Straight, guided
from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.study_convergence import flown_circles


def flown(legs, seed, wind=(0.0, 0.0), airspeed=23.0, start=(-400.0, 0.0)):
    """Time, true position and the estimator's orbits at 5 Hz; 1.5 m and 0.3 m/s."""
    rng = np.random.default_rng(seed)
    time, position, velocity = guided(Autopilot(airspeed, wind=wind), legs, start, 0.0)
    time, position, velocity = time[::10], position[::10], velocity[::10]
    estimator = OrbitEstimator(OrbitSettings(correlated_share=0.0))
    orbits = [
        estimator.add(
            t, np.array([*p, 100.0]) + rng.normal(0.0, 1.5, 3),
            np.array([*v, 0.0]) + rng.normal(0.0, 0.3, 3), 1.5, 0.3,
        ).orbit
        for t, p, v in zip(time, position, velocity, strict=True)
    ]  # fmt: skip
    return time, position, orbits


@pytest.mark.parametrize("wind", [(0.0, 0.0), (4.0, -3.0)])
def test_a_steered_flight_ends_on_its_circle_and_is_straight_where_it_should_be(wind):
    legs = [Straight(20.0, 1.0), Loiter(100.0, (60.0, 300.0), 100.0, -1)]
    time, position, velocity = guided(Autopilot(23.0, wind=wind), legs, (-400.0, 0.0), 0.3)
    late = time > 70.0
    distance = np.hypot(*(position[late] - legs[1].center).T)
    assert distance.min() == pytest.approx(distance.max(), rel=0.06 if any(wind) else 1e-4)
    assert distance.mean() == pytest.approx(100.0, rel=0.01)
    east, north = (position[late] - legs[1].center).T
    assert np.all(velocity[late, 1] * east - velocity[late, 0] * north < 0.0)
    course = np.arctan2(velocity[(time > 15.0) & (time < 20.0), 1],
                        velocity[(time > 15.0) & (time < 20.0), 0])  # fmt: skip
    assert course == pytest.approx(1.0, abs=0.02)
    assert np.hypot(*(velocity - wind).T) == pytest.approx(23.0)
    moved = np.diff(position, axis=0) / np.diff(time)[:, None]
    assert moved == pytest.approx(0.5 * (velocity[1:] + velocity[:-1]), abs=0.02)


@pytest.mark.parametrize("radius", [70.0, 120.0])
def test_a_circle_converged_onto_is_not_taken_for_one_that_drifts(radius):
    # In still air; with a tighter and a wider circle flown before.
    legs = [Loiter(70.0, (0.0, 0.0), 95.0, 1), Loiter(150.0, (40.0, 0.0), radius, 1)]
    seen = 0
    for seed in range(3):
        for orbit in flown(legs, seed)[2]:
            if orbit is not None:
                assert not np.any(orbit.drift)
                seen += 1
    assert seen > 800


def worst_known(known_share):
    """Largest share to which a radius is given, and the reasons for none: half turns of 40 m."""
    reasons, worst = set(), 0.0
    for seed in range(16):
        rng = np.random.default_rng(seed)
        estimator = OrbitEstimator(OrbitSettings(known_share=known_share))
        for t in np.arange(0.0, 12.0, 0.2):
            angle = 0.4 * t
            at = 40.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
            velocity = 16.0 * np.array([-np.sin(angle), np.cos(angle), 0.0])
            # Not stated.
            noisy = at + rng.normal(0.0, 5.0, 3), velocity + rng.normal(0.0, 1.0, 3)
            fix = estimator.add(t, *noisy)
            reasons.add(fix.reason)
            if fix.orbit is not None:
                worst = max(worst, np.sqrt(fix.orbit.covariance[3, 3]) / fix.orbit.radius)
    return worst, reasons


def test_a_circle_hardly_known_is_no_orbit_and_the_reason_says_how_well_it_is_known():
    worst, reasons = worst_known(0.08)
    assert 0.0 < worst < 0.08
    assert any(r.endswith("m, not to 8 %") and "m is known to +-" in r for r in reasons)
    worst, reasons = worst_known(np.inf)
    assert worst > 0.1
    assert not any("is known to" in r for r in reasons)


def test_a_window_across_two_circles_is_of_neither():
    # A simulator's small errors: the two halves of such a window are within a metre of one circle.
    inside = 0
    for seed, (first, radius, sense) in enumerate(((195.0, 234.0, 1), (263.0, 315.0, -1))):
        rng = np.random.default_rng([60, seed])
        legs = [Loiter(130.0, (0.0, 0.0), first, sense), Loiter(260.0, (0.0, 0.0), radius, sense)]
        start, course = (first, 0.0), sense * np.pi / 2.0
        time, position, velocity = (
            x[::10] for x in guided(Autopilot(28.0, 14.0, 0.7), legs, start, course)
        )
        estimator = OrbitEstimator()
        turn = 2.0 * np.pi * radius / 28.0
        for t, p, v in zip(time, position, velocity, strict=True):
            seen = np.append(p, 100.0) + rng.normal(0.0, 0.07, 3)
            orbit = estimator.add(t, seen, np.append(v, 0.0), 0.3, 0.04).orbit
            if orbit is not None and 0.25 < (t - 130.0) / turn < 1.5:
                error = orbit.radius - radius
                assert abs(error) < 2.5 * np.sqrt(orbit.covariance[3, 3]) + 0.01 * radius
                inside += 1
    assert inside > 150


def test_a_circle_flown_on_the_way_is_one_for_half_a_turn_and_a_quarter_after():
    angle = np.linspace(0.0, 4.0 * np.pi, 400)
    on = np.column_stack([30.0 + 80.0 * np.cos(angle), -80.0 * np.sin(angle)])
    tangent = np.column_stack([-np.sin(angle), -np.cos(angle)])
    away = on[-1] + np.outer(np.arange(1.0, 60.0), 2.5 * tangent[-1])
    straight = np.tile(tangent[-1], (59, 1))
    flown = flown_circles(np.vstack([on, away]), np.vstack([tangent, straight]))
    assert not any(flown[:100])
    for circles in flown[110:400]:
        for circle in circles:
            assert circle == pytest.approx([30.0, 0.0, 80.0], abs=0.05)
    assert all(flown[110:400])
    # Twice as wide for the next half turn: the quarter in which both are flown, then the new one.
    wide = np.linspace(0.0, 2.0 * np.pi, 400)
    wider = np.column_stack([-50.0 + 160.0 * np.cos(wide), -160.0 * np.sin(wide)])
    along = np.column_stack([-np.sin(wide), -np.cos(wide)])
    both = flown_circles(np.vstack([on, wider]), np.vstack([tangent, along]))
    assert [round(c[2]) for c in both[440][:1]] == [80]
    assert both[550] == []
    assert {round(c[2]) for c in both[700]} == {160}


def test_the_circle_given_while_another_radius_is_converged_onto_is_as_far_off_as_is_stated():
    # True is the circle settled upon, from a quarter turn after the change on.
    inside, samples = [], 0
    for seed, (radius, first) in enumerate(((70.0, 95.0), (120.0, 95.0), (80.0, 60.0))):
        legs = [Loiter(70.0, (0.0, 0.0), first, 1), Loiter(150.0, (0.0, 0.0), radius, 1)]
        time, position, orbits = flown(legs, 40 + seed)
        settled = np.mean(np.hypot(*position[time > 120.0].T))
        turn = 2.0 * np.pi * radius / 23.0
        for t, orbit in zip(time, orbits, strict=True):
            since = (t - 70.0) / turn
            if 0.25 < since < 1.8:
                samples += 1
            if 0.25 < since < 1.8 and orbit is not None:
                error = np.array([*orbit.center[:2], orbit.radius - settled])
                covariance = orbit.covariance[np.ix_([0, 1, 3], [0, 1, 3])]
                inside.append(error @ np.linalg.solve(covariance, error) < 7.81)
    assert len(inside) > 0.3 * samples
    assert np.mean(inside) > 0.93
