"""Whether samples go on where those before led: noise does, steps do not."""

import numpy as np
import pytest

from ctcbs_ros.orbit.tracks import correlated_noise
from ctcbs_ros.simulated_flight import simulate_flight
from ctcbs_ros.telemetry.continuity import Continuity, Track
from ctcbs_ros.telemetry.sample import Sample


def verdicts(flight, position, velocity, kept=None):
    """What a track is made of each sample."""
    continuity = Continuity()
    return [
        continuity.check(Sample(time=t, stamp_ns=0, velocity=tuple(v)), p)
        for t, p, v in zip(
            flight.time[kept].ravel().tolist(),
            position[kept].reshape(-1, 3),
            velocity[kept].reshape(-1, 3).tolist(),
            strict=True,
        )
    ]


@pytest.mark.parametrize(
    ("white", "speed", "correlated", "loss"),
    [(1.5, 0.3, 0.0, 0.0), (5.0, 1.0, 0.0, 0.2), (0.5, 0.3, 2.0, 0.0), (0.3, 0.05, 0.0, 0.5)],
)
@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_noise_hardly_ever_strays_and_never_breaks_the_track(
    white, speed, correlated, loss, rate
):
    """Noises and loss are those that the orbit is estimated in."""
    random = np.random.default_rng(4)
    found = []
    for radius, airspeed in ((40.0, 18.0), (150.0, 35.0)):
        flight = simulate_flight(radius, airspeed, 3, rate=rate, wind=(4.0, 3.0))
        shape = flight.position.shape
        position = flight.position + random.normal(0.0, white, shape)
        position += correlated_noise(flight.time, correlated, 45.0, random, 3)
        velocity = flight.velocity + random.normal(0.0, speed, shape)
        found += verdicts(flight, position, velocity, random.random(shape[0]) >= loss)
    assert Track.BREAKS not in found
    assert found.count(Track.STRAYS) <= 0.002 * len(found)


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_step_breaks_the_track_at_its_fifth_sample_and_a_shorter_one_strays(axis, rate):
    random = np.random.default_rng(4)
    flight = simulate_flight(150.0, 20.0, 1, rate=rate)
    position = flight.position + random.normal(0.0, 0.5, flight.position.shape)
    # For 3 s a track leads on.
    for length in (1, 4, 10) if rate > 1.0 else (1, 10):
        stepped = position.copy()
        stepped[40 : 40 + length, axis] += 15.0
        found = verdicts(flight, stepped, flight.velocity, np.arange(len(position)))
        wrong = {i: v for i, v in enumerate(found) if v is not Track.GOES_ON}
        expected = {40 + i: Track.STRAYS for i in range(min(length, 4))}
        if length > 4:
            expected |= {44: Track.BREAKS, 54: Track.BREAKS}
            expected |= {50 + i: Track.STRAYS for i in range(4)}
        assert wrong == expected


def test_source_without_velocities_goes_on_anywhere():
    continuity = Continuity()
    for i in range(50):
        sample = Sample(time=i / 5, stamp_ns=0)
        assert continuity.check(sample, np.array([1e3 * (i % 7), 0.0, 0.0])) is Track.GOES_ON


def test_after_a_gap_the_track_goes_on_where_it_is():
    flight = simulate_flight(150.0, 20.0, 1, rate=5.0)
    after = np.r_[0:60, 80:120]  # 4 s
    stepped = flight.position.copy()
    stepped[80:] += 100.0
    assert set(verdicts(flight, stepped, flight.velocity, after)) == {Track.GOES_ON}
