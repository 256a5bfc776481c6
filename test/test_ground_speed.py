"""The unevenness of the ground speed, on simulated turns of which the orbit is known."""

import numpy as np
import pytest

from ctcbs_ros.orbit.ground_speed import GroundSpeedVariation
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.tracks import TURN, arc, fly


def true_orbit(time, radius, speed):
    return Orbit(
        time, 0.0, np.zeros(3), radius, speed / radius, 1, 0.0, 0.0, 0.0, TURN, 100, np.eye(6)
    )


def variations(radius, airspeed, seed, **conditions):
    """Variation after each sample, times the mean ground speed: the amplitude [m/s]."""
    turns = 2.0
    flight = fly([arc(radius, turns)], airspeed, np.random.default_rng(seed), **conditions)
    speed = turns * TURN * radius / flight.time[-1]
    kept = GroundSpeedVariation()
    found = []
    for time, velocity in zip(flight.time, flight.velocity, strict=True):
        kept.add(time, velocity)
        found.append(kept.variation(true_orbit(time, radius, speed)) * speed)
    return flight, np.array(found), speed


@pytest.mark.parametrize("rate", [5.0, 50.0])
@pytest.mark.parametrize(("radius", "airspeed", "wind"), [(68, 16, 7), (100, 25, 8), (60, 20, 2)])
def test_wind_is_the_amplitude_within_a_tenth_once_a_turn_is_flown(radius, airspeed, wind, rate):
    flight, found, _ = variations(radius, airspeed, 1, wind=(0.6 * wind, -0.8 * wind), rate=rate)
    assert found[flight.angle > TURN] == pytest.approx(wind, rel=0.1)


def test_wind_is_known_at_one_sample_a_second():
    flight, found, _ = variations(68, 16, 1, wind=(4.2, -5.6), rate=1.0)
    assert found[flight.angle > TURN] == pytest.approx(7.0, rel=0.1)


@pytest.mark.parametrize("speed_change", [0.0, 0.2, -0.2])
def test_in_still_air_neither_noise_nor_a_change_of_airspeed_passes_for_wind(speed_change):
    _, found, speed = variations(100, 20, 2, speed_change=speed_change)
    assert np.nanmax(found) < 0.05 * speed


def test_on_less_than_three_quarters_of_a_turn_nothing_is_known():
    flight, found, _ = variations(100, 20, 3, wind=(5.0, 0.0))
    # The time of three quarters of a mean turn is told by the mean angular rate.
    part = flight.time / flight.time[-1] * 2.0
    assert np.isnan(found[part < 0.74]).all()
    assert np.isfinite(found[part > 0.8]).all()


def test_nothing_is_known_without_velocities_or_after_a_reset():
    kept = GroundSpeedVariation()
    for i in range(400):
        kept.add(0.2 * i, None)
    assert np.isnan(kept.variation(true_orbit(80.0, 100, 20)))
    flight = fly([arc(100, 1.5)], 20, np.random.default_rng(4))
    for time, velocity in zip(flight.time, flight.velocity, strict=True):
        kept.add(time, velocity)
    end = true_orbit(flight.time[-1], 100, 20)
    assert np.isfinite(kept.variation(end))
    kept.reset()
    assert np.isnan(kept.variation(end))


def test_velocities_that_stand_still_or_repeat_tell_nothing_and_raise_nothing():
    kept = GroundSpeedVariation()
    for i in range(400):
        kept.add(0.2 * i, (20.0, 0.0, 0.0))
    assert np.isnan(kept.variation(true_orbit(80.0, 100, 20)))


def test_what_was_flown_before_an_orbit_began_does_not_count():
    kept = GroundSpeedVariation()
    for i in range(5000):  # long straight flight at a high rate, slower than the circle
        kept.add(0.02 * i - 100.0, (12.0, 0.0, 0.0))
    flight = fly([arc(100, 1.5)], 20, np.random.default_rng(4))
    for time, velocity in zip(flight.time, flight.velocity, strict=True):
        kept.add(time, velocity)
    kept.begin(0.0)
    orbit = true_orbit(flight.time[-1], 100, 20)
    assert kept.variation(orbit) * 20 < 1.0
