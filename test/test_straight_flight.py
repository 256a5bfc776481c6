"""When a cable length has been flown straight, at any length, spacing and noise."""

import numpy as np
import pytest

from ctcbs_ros.prediction.straight_flight import StraightFlight

LENGTH = 150.0


def first(track, length=LENGTH):
    """Index of the position after which the flight is straight; None if it never is."""
    straight = StraightFlight()
    return next((i for i, p in enumerate(track) if straight.add(p, length)), None)


def line(step, n, noise=0.0):
    random = np.random.default_rng(1)
    track = np.zeros((n, 3))
    track[:, 0] = step * np.arange(n)
    return track @ np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]) + random.normal(
        0.0, noise, (n, 3)
    )


def circle(radius, turns, step=4.0):
    angle = np.arange(0.0, 2.0 * np.pi * turns, step / radius)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle])


@pytest.mark.parametrize("step", [0.5, 4.0, 30.0])
def test_a_cable_length_of_straight_flight_is_noticed(step):
    flown = step * first(line(step, 2000))
    assert LENGTH <= flown <= LENGTH + 9 * max(step, 1.0)


def test_noise_does_not_hide_it():
    assert 4.0 * first(line(4.0, 300, noise=1.5)) < 2.0 * LENGTH


@pytest.mark.parametrize("radius", [10.0, 20.0, 60.0, 150.0, 300.0])
def test_a_circle_is_not_straight(radius):
    assert first(circle(radius, 5.0)) is None


def test_a_circle_much_wider_than_the_cable_is_long_counts_as_straight():
    assert first(circle(5.0 * LENGTH, 1.0)) is not None


def test_standing_still_is_not_straight_flight():
    assert first(np.random.default_rng(0).normal(0.0, 2.0, (2000, 3))) is None


def test_after_a_reset_it_takes_another_cable_length():
    straight = StraightFlight()
    track = line(4.0, 200)
    assert not any(straight.add(p, LENGTH) for p in track[:30])
    straight.reset()
    again = next(i for i, p in enumerate(track[30:]) if straight.add(p, LENGTH))
    assert 4.0 * again >= LENGTH
