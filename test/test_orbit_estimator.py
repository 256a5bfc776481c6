"""The orbit estimator on simulated flights with known truth, and on recorded ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.segments import OrbitSegments
from ctcbs_ros.orbit.tracks import TURN, arc, fly, racetrack, straight
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.source import open_log

FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"
NOISE = {"position_noise": 1.5, "velocity_noise": 0.3}


def estimate(flight, velocity=True, sigmas=(1.5, 0.3)):
    """The estimator's answer to each sample."""
    estimator = OrbitEstimator()
    return [
        estimator.add(t, p, v if velocity else None, *sigmas)
        for t, p, v in zip(flight.time, flight.position, flight.velocity, strict=True)
    ]


def entry(radius, turns, speed, seed, sense=1, **options):
    track = [straight(6.0 * speed), arc(radius, turns, sense)]
    return fly(track, speed, np.random.default_rng(seed), **{**NOISE, **options})


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(("radius", "speed"), [(40.0, 15.0), (80.0, 22.0), (300.0, 60.0)])
def test_after_three_quarters_of_a_turn_radius_and_centre_are_right(radius, speed, sense):
    radii, centers = [], []
    for seed in range(25):
        flight = entry(radius, 0.75, speed, seed, sense)
        orbit = estimate(flight)[-1].orbit
        assert orbit is not None
        assert orbit.sense == sense
        radii.append(orbit.radius)
        centers.append(orbit.center[:2] - flight.centers[1])
    assert np.std(radii) < 0.01 * radius
    assert abs(np.mean(radii) / radius - 1.0) < 0.005
    assert np.std(centers, axis=0).max() < 1.0


def test_first_orbit_comes_within_half_a_turn_or_little_more():
    flight = entry(60.0, 1.0, 20.0, 0)
    fixes = estimate(flight)
    first = next(i for i, fix in enumerate(fixes) if fix.orbit is not None)
    assert flight.piece[first] == 1
    assert flight.angle[first] < 0.55 * TURN


@pytest.mark.parametrize("before", [0.3, 1.0])
def test_a_turn_flown_long_before_does_not_delay_the_first_orbit(before):
    a, speed = 70.0, 16.0
    track = [straight(200.0), arc(a, before), straight(2.5 * TURN * a), arc(a, 1.2)]
    flight = fly(track, speed, np.random.default_rng(1), **NOISE)
    found = [fix.orbit is not None and piece == 3
             for fix, piece in zip(estimate(flight), flight.piece, strict=True)]  # fmt: skip
    assert flight.angle[np.argmax(found)] < 0.53 * TURN


def test_circle_that_is_left_is_no_orbit_within_a_quarter_of_a_turn():
    track = [straight(120.0), arc(60.0, 2.0), straight(400.0)]
    flight = fly(track, 20.0, np.random.default_rng(1), **NOISE)
    fixes = estimate(flight)
    after = [f.orbit for f, piece in zip(fixes, flight.piece, strict=True) if piece == 2]
    quarter = int(0.25 * TURN * 60.0 / 20.0 * 5.0)
    assert all(orbit is None for orbit in after[quarter:])


@pytest.mark.parametrize("rate", [1.0, 5.0, 50.0])
def test_rate_of_samples_does_not_matter(rate):
    flight = entry(200.0, 1.5, 18.0, 2, rate=rate)
    orbit = estimate(flight)[-1].orbit
    assert orbit.radius == pytest.approx(200.0, rel=0.01)
    assert orbit.angular_rate == pytest.approx(18.0 / 200.0, rel=0.01)


def test_positions_alone_are_enough_for_a_whole_turn():
    orbit = estimate(entry(80.0, 1.3, 20.0, 3), velocity=False)[-1].orbit
    assert orbit.radius == pytest.approx(80.0, rel=0.02)


@pytest.mark.parametrize("seed", [1, 3])
def test_without_velocities_it_does_not_matter_to_where_it_is_flown(seed):
    """A flight mirrored, or turned by any angle, has the same orbits, mirrored or turned."""
    flight = entry(120.0, 1.2, 20.0, seed, rate=1.0)
    expected = [fix.orbit for fix in estimate(flight, velocity=False)]
    assert expected[-1] is not None
    position = flight.position
    for there in np.diag([-1.0, 1.0]), np.diag([-1.0, -1.0]), np.array([[0.6, -0.8], [0.8, 0.6]]):
        flown = replace(
            flight, position=np.column_stack([position[:, :2] @ there.T, position[:, 2]])
        )
        for orbit, fix in zip(expected, estimate(flown, velocity=False), strict=True):
            assert (orbit is None) == (fix.orbit is None)
            if orbit is not None:
                assert fix.orbit.radius == pytest.approx(orbit.radius, abs=1e-3)
                center = there @ orbit.center[:2]
                assert fix.orbit.center[:2] == pytest.approx(center, abs=1e-3)


@pytest.mark.parametrize("velocity", [True, False])
def test_samples_too_far_apart_never_make_an_orbit_of_another_sense_or_speed(velocity):
    """An angle of 290 deg from one sample to the next looks like one of -70 deg."""
    radius, speed = 40.0, 26.0
    found = 0
    for apart in np.arange(0.04, 1.8, 0.04):
        time = apart * TURN * radius / speed * np.arange(14.0)
        angle = -time * speed / radius
        fixes, estimator = [], OrbitEstimator()
        for t, a in zip(time, angle, strict=True):
            out = np.array([np.cos(a), np.sin(a), 0.0])
            along = np.array([np.sin(a), -np.cos(a), 0.0])
            fixes.append(
                estimator.add(t, radius * out, speed * along if velocity else None, 1.0, 0.3)
            )
        orbits = [fix.orbit for fix in fixes if fix.orbit is not None]
        found += bool(orbits)
        assert all(o.sense == -1 and o.speed == pytest.approx(speed, rel=0.05) for o in orbits)
        assert all(fix.reason for fix in fixes if fix.orbit is None)
    assert found >= 5


def test_a_glitch_to_the_centre_of_the_circle_does_not_end_the_orbit():
    for seed in range(6):
        flight = entry(100.0, 0.75, 20.0, seed)
        on = np.flatnonzero(flight.piece == 1)
        flight.position[on[[20, 40, -20]], :2] = flight.centers[1] + [0.5, 0.2]
        orbit = estimate(flight)[-1].orbit
        assert orbit is not None
        assert orbit.radius == pytest.approx(100.0, rel=0.03)


@pytest.mark.parametrize("course", [0.0, 90.0, 180.0, -100.0])
def test_an_aircraft_that_stood_has_not_turned_when_it_takes_off(course):
    estimator = OrbitEstimator()
    towards = np.array([np.cos(np.radians(course)), np.sin(np.radians(course)), 0.0])
    for i in range(60):
        speed = 0.0 if i < 30 else 15.0
        distance = 0.2 * speed * max(i - 30, 0)
        fix = estimator.add(0.2 * i, distance * towards, speed * towards, 1.5, 0.3)
    assert fix.reason == "the course does not turn"


def test_circle_held_over_the_ground_in_wind_is_an_orbit_of_its_own_period():
    # plane_real_wind.tlog: 7 m/s of wind at about 16 m/s.
    flight = entry(70.0, 2.5, 16.0, 4, wind=(4.0, -5.7))
    orbit = estimate(flight)[-1].orbit
    on_circle = flight.time[flight.piece == 1]
    turns = flight.angle[-1] / TURN
    period = (on_circle[-1] - on_circle[0]) / turns
    assert orbit.radius == pytest.approx(70.0, rel=0.01)
    # The last half turn is not a whole period, and in wind its halves last differently.
    assert orbit.angular_rate == pytest.approx(TURN / period, rel=0.12)


@pytest.mark.parametrize("sense", [1, -1])
def test_circle_that_drifts_is_an_orbit_with_its_drift_and_its_radius_in_the_air(sense):
    wind = np.array([4.0, -5.7])
    flight = entry(70.0, 1.4, 16.0, 9, sense)
    flight.position[:, :2] += np.outer(flight.time, wind)
    flight.velocity[:, :2] += wind
    orbit = estimate(flight)[-1].orbit
    center = flight.centers[1] + wind * flight.time[-1]
    assert orbit.sense == sense
    assert orbit.radius == pytest.approx(70.0, rel=0.01)
    assert orbit.angular_rate == pytest.approx(16.0 / 70.0, rel=0.01)
    assert orbit.drift == pytest.approx(wind, abs=0.15)
    assert orbit.center[:2] == pytest.approx(center, abs=1.5)
    error = orbit.drift - wind
    assert error @ np.linalg.solve(orbit.covariance[7:, 7:], error) < 13.8


def in_part_taken_along(seed, sense=1, turns=2.4, speed=2.0):
    """A circle that 6 m/s of wind pass and some more take along; its drift."""
    drift = speed * np.array([0.6, -0.8])
    flight = entry(100.0, turns, 25.0, seed, sense, wind=(3.6, -4.8))
    flight.position[:, :2] += np.outer(flight.time, drift)
    flight.velocity[:, :2] += drift
    return flight, drift


@pytest.mark.parametrize("sense", [1, -1])
def test_circle_that_drifts_more_slowly_than_the_wind_is_found_with_its_drift(sense):
    flight, drift = in_part_taken_along(3, sense)
    fixes = estimate(flight)
    samples = zip(fixes, flight.time, flight.angle, strict=True)
    settled = [(fix.orbit, t) for fix, t, angle in samples if angle > 1.7 * TURN]
    assert len(settled) > 80
    for orbit, t in settled:
        assert orbit.drift == pytest.approx(drift, abs=0.25)
        assert orbit.radius == pytest.approx(100.0, rel=0.02)
        assert orbit.center[:2] == pytest.approx(flight.centers[1] + drift * t, abs=3.0)


def test_until_its_drift_is_believed_a_circle_is_known_as_if_it_might_drift():
    errors = []
    for seed in range(12):
        flight, drift = in_part_taken_along(seed, turns=1.2, speed=0.5)
        for fix, t in zip(estimate(flight), flight.time, strict=True):
            orbit = fix.orbit
            if orbit is None or np.any(orbit.drift) or not np.isfinite(orbit.covariance).all():
                continue
            error = np.array([*(orbit.center[:2] - flight.centers[1] - drift * t), *-drift])
            covariance = orbit.covariance[np.ix_([0, 1, 7, 8], [0, 1, 7, 8])]
            errors.append(error @ np.linalg.solve(covariance, error))
    assert len(errors) > 40
    assert np.mean(np.array(errors) < 9.49) > 0.9


def test_circle_that_stands_still_has_no_drift_and_how_well_that_is_known_once_it_can_be():
    fixes = estimate(entry(80.0, 1.3, 20.0, 10))
    orbits = [fix.orbit for fix in fixes if fix.orbit is not None]
    early, late = orbits[0], orbits[-1]
    assert not np.any(late.drift)
    assert np.isinf(np.diag(early.covariance)[7:]).all()
    assert (np.sqrt(np.diag(late.covariance)[7:]) < 0.2).all()


def test_climb_and_height_are_inside_what_is_stated_of_them():
    inside = []
    for seed in range(40):
        flight = entry(80.0, 0.75, 20.0, seed, climb=2.0)
        orbit = estimate(flight)[-1].orbit
        error = np.array([orbit.center[2] - flight.true_position[-1, 2], orbit.climb_rate - 2.0])
        block = orbit.covariance[np.ix_([2, 6], [2, 6])]
        inside.append(error @ np.linalg.solve(block, error) < 5.99)
    assert np.mean(inside) > 0.85


def test_gap_of_five_seconds_on_the_circle_does_not_lose_it():
    flight = entry(60.0, 3.0, 20.0, 5)
    middle = flight.time[len(flight.time) // 2]
    keep = (flight.time < middle) | (flight.time > middle + 5.0)
    estimator = OrbitEstimator()
    fixes = [
        (t, estimator.add(t, p, v, 1.5, 0.3))
        for t, p, v in zip(
            flight.time[keep], flight.position[keep], flight.velocity[keep], strict=True
        )
    ]
    after = [fix.orbit for t, fix in fixes if t > middle + 5.0]
    assert np.mean([orbit is not None for orbit in after]) > 0.95


def test_one_glitch_of_a_hundred_metres_does_not_move_the_circle():
    flight = entry(60.0, 2.0, 20.0, 6)
    flight.position[-10, :2] += 100.0
    orbit = estimate(flight)[-1].orbit
    assert orbit.radius == pytest.approx(60.0, rel=0.01)


@pytest.mark.parametrize(
    "track",
    [[straight(3000.0)], racetrack(60.0, 400.0, 2)],
    ids=["straight", "racetrack"],
)
def test_what_is_no_circle_is_no_orbit(track):
    flight = fly(track, 20.0, np.random.default_rng(7), **NOISE)
    valid = np.mean([fix.orbit is not None for fix in estimate(flight)])
    assert valid < 0.06


@pytest.mark.parametrize("noise", [1.5, 4.0])
def test_hovering_or_parked_in_noise_is_no_orbit(noise):
    rng = np.random.default_rng(8)
    estimator = OrbitEstimator()
    for i in range(600):
        position = rng.normal(0.0, noise, 3)
        fix = estimator.add(0.2 * i, position, rng.normal(0.0, 0.3, 3), noise, 0.3)
        assert fix.orbit is None


def fixes_of(name):
    """Sample, position and answer, one after another."""
    file = FLIGHTS / name
    if not file.exists():
        pytest.skip(f"{file} is not there")
    screen, frame, estimator = Screen(), LocalFrame(), OrbitEstimator()
    for sample in open_log(file):
        if screen.check(sample) is None:
            local = frame.localize(sample)
            velocity = None if sample.velocity is None else np.array(sample.velocity)
            fix = estimator.add(
                sample.time, local.position, velocity,
                sample.horizontal_accuracy, sample.speed_accuracy,
            )
            yield sample, local.position, fix


def recorded(name):
    segments = OrbitSegments()
    for sample, position, fix in fixes_of(name):
        segments.add(sample.time, fix.orbit, position)
    return segments.finish()


def test_recorded_loiter_is_one_clockwise_orbit():
    (orbit,) = recorded("plane_sitl_loiter.tlog")
    assert orbit.turns >= 1.8
    assert orbit.radius == pytest.approx(102.5, abs=0.5)
    assert orbit.speed == pytest.approx(23.2, abs=0.3)
    assert orbit.sense == -1


def test_recorded_climbing_loiter_is_found_in_a_dataflash_log():
    # shared/flights/README.md: 2.2 turns clockwise, R 83 m, 23 m/s.
    (orbit,) = recorded("plane_sitl_guided_loiter.BIN")
    assert orbit.turns == pytest.approx(2.2, abs=0.15)
    assert orbit.radius == pytest.approx(83.0, abs=1.0)
    assert orbit.speed == pytest.approx(23.0, abs=0.5)
    assert orbit.sense == -1


def test_the_first_orbit_of_a_recorded_entry_is_of_the_arc_flown_then():
    # It narrows from 87 m to 82.5 m in another turn, and the stated error has that once it shows.
    places, orbits = [], []
    for sample, position, fix in fixes_of("plane_sitl_guided_loiter.BIN"):
        places.append((sample.time, *position[:2]))
        if fix.orbit is not None:
            orbits.append(fix.orbit)
    first = orbits[0]
    times, *east_north = np.transpose(places)
    flown = (times <= first.time) & (times >= first.time - first.arc / first.angular_rate)
    off = np.hypot(*(np.array(east_north)[:, flown].T - first.center[:2]).T) - first.radius
    assert flown.sum() > 40
    assert np.sqrt(np.mean(off**2)) < 0.3
    later = [o for o in orbits if 6.0 < o.time - first.time < 20.0]
    assert len(later) > 40
    for orbit in later:
        assert abs(orbit.radius - 82.5) < 2.0 * np.sqrt(orbit.covariance[3, 3])


def test_recorded_circle_in_real_wind_is_found():
    # shared/flights/README.md: 1.4 turns clockwise, R about 68 m.
    orbits = recorded("plane_real_wind.tlog")
    assert any(
        o.sense == -1 and abs(o.radius - 68.0) < 4.0 and abs(o.turns - 1.4) < 0.35 for o in orbits
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_small_circle_once_seen_to_drift_is_not_lost_again_to_noise(seed):
    wind = 5.0 * np.array([np.cos(seed), np.sin(seed)])
    flight = entry(41.0, 2.5, 22.0, seed)
    flight.position[:, :2] += np.outer(flight.time, wind)
    flight.velocity[:, :2] += wind
    orbits = [fix.orbit for fix in estimate(flight)]
    late = [o for o, angle in zip(orbits, flight.angle, strict=True) if angle > 1.3 * TURN]
    assert len(late) > 60
    assert all(o is not None and o.radius == pytest.approx(41.0, rel=0.03) for o in late)


def test_a_copters_turns_known_hardly_at_all_are_no_orbits():
    # One of 12.9 +- 10.8 m, and others, passed for orbits of a towing aircraft.
    orbits = [fix.orbit for _, _, fix in fixes_of("copter_reboot.tlog") if fix.orbit is not None]
    assert len(orbits) > 40
    assert all(np.sqrt(orbit.covariance[3, 3]) < 0.15 * orbit.radius for orbit in orbits)


@pytest.mark.parametrize("sense", [1, -1])
def test_a_speed_that_grows_is_followed_and_the_rate_says_how_far_behind(sense):
    # 10 % a turn from the second turn on; the mean of the last turn is 5 % behind.
    seen = 0
    for seed in range(5):
        random, estimator = np.random.default_rng([seed, 9]), OrbitEstimator()
        angle = 0.0
        for i in range(300):
            speed = 20.0 * (1.0 + 0.1 * max(angle / TURN - 1.0, 0.0))
            out = np.array([np.cos(sense * angle), np.sin(sense * angle)])
            place = np.append(60.0 * out, 100.0) + random.normal(0.0, 1.5, 3)
            velocity = np.append(sense * speed * np.array([-out[1], out[0]]), 0.0)
            velocity += random.normal(0.0, 0.3, 3)
            orbit = estimator.add(0.2 * i, place, velocity, 1.5, 0.3).orbit
            if angle > 1.6 * TURN:
                assert orbit is not None
                rate = orbit.angular_rate
                assert 0.03 < 1.0 - rate * 60.0 / speed < 0.07
                seen += abs(rate - speed / 60.0) < 1.96 * np.sqrt(orbit.covariance[4, 4])
            angle += 0.2 * speed / 60.0
            if angle > 2.2 * TURN:
                break
    assert seen > 0.95 * 5 * 45
