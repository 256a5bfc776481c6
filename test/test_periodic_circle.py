"""A circle as it is flown: winds from anywhere, both senses, drift, and what is refused."""

from dataclasses import replace
from math import atan2, cos, hypot, pi, sin

import numpy as np
import pytest
from points import STRETCHED, parameters

from ctcbs_ros.dynamics import signal
from ctcbs_ros.dynamics.cable import drive, hanging, simulate
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.errors import InputError
from ctcbs_ros.periodic.circle import Circle, end_mass_position, end_mass_velocity, motion_on
from ctcbs_ros.solver.steady_state import steady_states

# A radius and a rate of omega 1.6
RADIUS = 80.0
RATE = 1.6 * (9.80665 / RADIUS) ** 0.5
CIRCLE = Circle(RADIUS, RATE, -1, 2.0, 3.0)
ANGLES = np.linspace(0.0, 2.0 * pi, 9)


@pytest.fixture(scope="module")
def state():
    (found,) = steady_states(parameters(STRETCHED)).states
    return found


def places(circle, motion, angles):
    """The end mass at several angles, (k, 3)."""
    return np.array([end_mass_position(circle, motion, angle) for angle in angles])


@pytest.mark.parametrize("path", ["ground-speed", "airspeed"])
def test_a_clockwise_circle_is_the_mirror_image_of_an_anticlockwise_one(state, path):
    circle = replace(CIRCLE, path=path)
    mirrored = replace(circle, sense=1, wind_north=-circle.wind_north)
    here, there = (
        places(c, motion_on(c, state, accuracy=1e-4).motion, a)
        for c, a in ((circle, ANGLES), (mirrored, -ANGLES))
    )
    assert here == pytest.approx(there * [1.0, -1.0, 1.0], abs=1e-6)


def test_a_turned_wind_turns_everything(state):
    motion = motion_on(CIRCLE, state, accuracy=1e-4).motion
    by = 0.7
    speed, to = hypot(2.0, 3.0), atan2(3.0, 2.0) + by
    turned = replace(CIRCLE, wind_east=speed * cos(to), wind_north=speed * sin(to))
    here, there = places(CIRCLE, motion, ANGLES), places(turned, motion, ANGLES + by)
    flat = (here[:, 0] + 1j * here[:, 1]) * np.exp(1j * by)
    assert there == pytest.approx(np.stack([flat.real, flat.imag, here[:, 2]], 1), abs=1e-9)


@pytest.mark.parametrize(("sense", "path"), [(-1, "ground-speed"), (1, "airspeed")])
def test_a_line_towed_along_that_circle_in_that_wind_ends_there(state, sense, path):
    circle = replace(CIRCLE, sense=sense, path=path)
    motion = motion_on(circle, state, accuracy=1e-4).motion
    # the tow point's angle in time, from the definition of the path alone
    unit = RADIUS * RATE
    wind = np.array([2.0, 3.0, 0.0]) / unit
    turns, steps = 30, 400

    def velocity(angle, airspeed):
        """Angular rate at an angle: constant, or such that the airspeed is."""
        if path == "ground-speed":
            return sense
        along = sense * np.array([-sin(angle), cos(angle)])
        w = wind[:2] @ along
        return sense * (w + (airspeed**2 - wind[:2] @ wind[:2] + w * w) ** 0.5)

    def turn(airspeed):
        angles, h = [0.0], 2.0 * pi / steps
        for _ in range(steps):
            k1 = velocity(angles[-1], airspeed)
            k2 = velocity(angles[-1] + 0.5 * h * k1, airspeed)
            k3 = velocity(angles[-1] + 0.5 * h * k2, airspeed)
            k4 = velocity(angles[-1] + h * k3, airspeed)
            angles.append(angles[-1] + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4))
        return np.array(angles)

    low, high = 0.5, 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if abs(turn(middle)[-1]) < 2.0 * pi else (low, middle)
    one = turn(low)
    angles = np.concatenate([one[:-1] + sense * 2.0 * pi * k for k in range(turns + 1)])
    when = 2.0 * pi / steps * np.arange(angles.size)
    grown = np.minimum(when / (2.0 * pi), 1.0) ** 2 * (3.0 - 2.0 * np.minimum(when / 2 / pi, 1.0))
    track = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1) * grown[:, None]
    line = line_of(state.parameters)
    driven = drive(line, signal.spline(when, track), signal.spline(when, np.outer(grown, wind)))
    at = 40 * np.arange(10)
    last = when[steps * turns + at]
    found = [
        simulate(line, driven, hanging(line, n), last).positions[:, 0] for n in (20, 40)
    ]
    expected = RADIUS * (found[1] + (found[1] - found[0]) / 3.0)
    assert places(circle, motion, angles[steps * turns + at]) == pytest.approx(
        expected, abs=5e-4 * RADIUS
    )


def test_velocity_is_that_of_the_positions(state):
    circle = replace(CIRCLE, path="airspeed")
    motion = motion_on(circle, state, accuracy=1e-3).motion
    h = 1e-4
    for angle in (0.3, 2.9):
        here = end_mass_velocity(circle, motion, angle)
        step = places(circle, motion, [angle - h, angle + h])
        taken = (circle.time_at(angle + h) - circle.time_at(angle - h)) / circle.angular_rate
        assert here == pytest.approx((step[1] - step[0]) / taken, rel=1e-4)


def test_a_circle_that_drifts_with_the_air_is_in_still_air(state):
    circle = replace(CIRCLE, path="drift", sense=1)
    found = places(circle, motion_on(circle, state, accuracy=1e-5).motion, ANGLES)
    behind = ANGLES - state.phase_lag
    expected = RADIUS * np.stack(
        [state.end_mass_radius * np.cos(behind), state.end_mass_radius * np.sin(behind),
         np.full(9, -state.depth)], axis=1,
    )  # fmt: skip
    assert found == pytest.approx(expected, abs=2e-6 * RADIUS)


def test_a_motion_nearby_is_started_from(state):
    before = motion_on(CIRCLE, state, accuracy=1e-4).motion
    circle = replace(CIRCLE, wind_east=2.1)
    followed = motion_on(circle, state, before).motion
    anew = motion_on(circle, state, accuracy=1e-4).motion
    assert followed.values.shape == before.values.shape
    assert places(circle, followed, ANGLES) == pytest.approx(
        places(circle, anew, ANGLES), abs=2e-4 * RADIUS
    )


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        ({"radius": 0.0}, "radius"), ({"angular_rate": float("nan")}, "angular_rate"),
        ({"sense": 0}, "sense"), ({"wind_east": float("nan")}, "wind_east"),
        ({"path": "ground"}, "path"), ({"wind_north": RADIUS * RATE}, "wind"),
    ],
)  # fmt: skip
def test_what_no_aircraft_flies_is_refused(wrong, what):
    with pytest.raises(InputError, match=what):
        replace(CIRCLE, **wrong)
