"""A prediction says since when its orbit has been flown, and whether the end mass has settled."""

from math import log

import numpy as np
import pytest
from sample_flights import orbiting, samples_of

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor

DRONE = load_configuration("small_drone")


def valid(flight, predictor=None, start=0.0):
    predictor = predictor or Predictor(DRONE)
    made = [predictor.update(sample) for sample in samples_of(flight, start=start)]
    return [p for p in made if p.valid]


def entry_time(flight):
    """When a flight's track comes onto its circle: its course begins to turn."""
    course = np.unwrap(np.arctan2(*flight.velocity[:, 1::-1].T))
    return float(flight.time[np.argmax(np.abs(course - course[0]) > 1e-3)])


def test_an_end_mass_has_settled_once_its_orbit_was_flown_for_the_settling_time():
    flight = orbiting(60.0, 20.0, turns=3.0)
    entered = entry_time(flight)
    flown = valid(flight)
    for prediction in flown:
        mass = prediction.end_mass
        # The first window begins within the first degrees of the turn.
        assert mass.time_on_orbit == pytest.approx(prediction.time - entered, abs=1.5)
        assert mass.settled is (mass.time_on_orbit >= log(20.0) / mass.state.margin_per_s)
    assert [flown[0].end_mass.settled, flown[-1].end_mass.settled] == [False, True]


def test_another_radius_has_to_settle_anew():
    flown = valid(orbiting(60.0, 20.0, turns=6.0, radius_change=(72.0, 3.0)))
    times = np.array([p.end_mass.time_on_orbit for p in flown])
    radii = np.array([p.orbit.radius for p in flown])
    assert times[np.flatnonzero(radii < 62.0)[-1]] > 40.0
    first = np.argmax(radii > 70.0)
    assert times[first] < 15.0
    settled = [p.end_mass.settled for p in flown]
    assert [settled[first - 1 - 60], settled[first], settled[-1]] == [True, False, True]


def test_a_change_of_the_cable_has_to_settle_anew_and_one_of_a_limit_does_not():
    predictor = Predictor(DRONE)
    samples = samples_of(orbiting(60.0, 20.0, turns=4.0))
    before = [p for p in map(predictor.update, samples[:-150]) if p.valid][-1]
    predictor.change(cable_length=DRONE.cable.length, limits=DRONE.limits)
    same = predictor.update(samples[-150])
    predictor.change(cable_length=140.0)
    changed = predictor.update(samples[-149])
    assert before.end_mass.settled
    assert same.end_mass.time_on_orbit > before.end_mass.time_on_orbit
    assert changed.end_mass.time_on_orbit == 0.0
    assert not changed.end_mass.settled
