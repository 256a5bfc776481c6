"""Orbits of a flight put together, from true orbits on simulated tracks."""

import tracemalloc

import numpy as np
import pytest

from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.segments import OrbitSegments
from ctcbs_ros.orbit.tracks import TURN, arc, between, fly, straight

SPEED = 20.0


def flown(track, found_after=0.5, keep=lambda time: True):
    """Segments of a track on which each circle is found after a part of a turn, without error."""
    flight = fly(track, SPEED, np.random.default_rng(0), position_noise=0.0, velocity_noise=0.0)
    segments = OrbitSegments()
    for i, time in enumerate(flight.time):
        if not keep(time):
            continue
        piece = flight.piece[i]
        orbit = None
        if flight.centers[piece] is not None and flight.angle[i] > found_after * TURN:
            curvature = track[piece][1]
            offset = flight.true_position[i, :2] - flight.centers[piece]
            covered = min(flight.angle[i], 1.1 * TURN)
            rate = SPEED * abs(curvature)
            orbit = Orbit(
                time=time,
                start_time=time - covered / rate,
                center=np.array([*flight.centers[piece], flight.true_position[i, 2]]),
                radius=1.0 / abs(curvature),
                angular_rate=rate,
                sense=int(np.sign(curvature)),
                phase=float(np.arctan2(offset[1], offset[0])),
                climb_rate=0.0,
                rms_residual=0.0,
                arc=covered,
                samples=50,
                covariance=np.eye(6),
            )
        segments.add(time, orbit, flight.true_position[i])
    return flight, segments.finish()


@pytest.mark.parametrize("sense", [1, -1])
def test_an_orbit_is_one_segment_with_the_turns_flown_before_it_was_found(sense):
    flight, found = flown([straight(400), arc(80, 3, sense), straight(400)])
    (segment,) = found
    assert segment.sense == sense
    # The straight lies within a quarter of the radius of the circle for 0.12 turn.
    assert segment.turns == pytest.approx(3.0, abs=0.15)
    assert segment.radius == pytest.approx(80.0)
    assert segment.speed == pytest.approx(SPEED)
    assert segment.center == pytest.approx(flight.centers[1])
    assert segment.up == pytest.approx(100.0)
    assert segment.angular_rate == pytest.approx(SPEED / 80)
    entry = flight.time[flight.piece == 1][0]
    assert entry - 4.0 < segment.start_time <= entry + 0.3
    assert segment.end_time == pytest.approx(flight.time[flight.piece == 1][-1])


def test_two_circles_with_a_straight_between_are_two_segments():
    _, found = flown([arc(80, 2), straight(500), arc(120, 1.5), straight(300)])
    assert [round(s.radius) for s in found] == [80, 120]
    assert found[0].end_time < found[1].start_time


def test_a_change_of_radius_that_lasts_begins_another_segment():
    _, found = flown([arc(60, 2), arc(80, 2)])
    assert [round(s.radius) for s in found] == [60, 80]


def test_a_change_of_sense_begins_another_segment():
    _, found = flown([arc(60, 2, 1), arc(60, 2, -1)])
    assert [s.sense for s in found] == [1, -1]


def test_a_gap_of_five_seconds_does_not_split_an_orbit_and_its_turns_are_counted():
    _, found = flown([arc(80, 4)], keep=lambda time: not 40.0 < time < 45.0)
    (segment,) = found
    assert segment.turns == pytest.approx(4.0, abs=0.05)


def test_a_turn_of_less_than_nine_tenths_is_no_orbit():
    _, found = flown([straight(300), arc(80, 0.7), straight(300)])
    assert found == []


def test_memory_does_not_grow_with_the_turns_flown():
    turns, rate = 800, SPEED / 80
    center = np.array([0.0, 0.0, 100.0])
    tracemalloc.start()
    segments = OrbitSegments()
    for i in range(int(turns * TURN / rate)):
        time, phase = float(i), (rate * i + np.pi) % TURN - np.pi
        place = np.array([80 * np.cos(phase), 80 * np.sin(phase), 100.0])
        covariance = np.eye(6)
        orbit = Orbit(
            time, time - 20, center, 80.0, rate, 1, phase, 0.0, 0.0, TURN, 50, covariance
        )
        segments.add(time, orbit, place)
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    (segment,) = segments.finish()
    assert segment.turns == pytest.approx(turns + 1.0, abs=0.1)
    # Kept in full, 20,000 orbits with their covariances take more than 10 MB.
    assert used < 4e6


def test_segments_do_not_overlap_and_a_transition_is_none():
    # The windows of a transition hold parts of both circles, and fit one in between.
    flight = fly(
        [straight(300.0), arc(60.0, 3.0), between(60.0, 80.0, 0.25), arc(80.0, 3.0)],
        SPEED, np.random.default_rng(1),
    )
    estimator, segments = OrbitEstimator(), OrbitSegments()
    for time, position, velocity in zip(
        flight.time, flight.position, flight.velocity, strict=True
    ):
        fix = estimator.add(time, position, velocity, 1.5, 0.3)
        segments.add(time, fix.orbit, position)
    first, second = segments.finish()
    assert [first.radius, second.radius] == pytest.approx([60.0, 80.0], rel=0.01)
    assert second.start_time >= first.end_time
    assert first.turns + second.turns == pytest.approx(6.25, abs=0.4)
