"""Axes that turn with the aircraft: the motion is that of the ground's, in fewer steps."""

import numpy as np
import pytest

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import drive, hanging
from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import constant, linear, sampled
from ctcbs_ros.kernels import cable_motion
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.twin.simulated_cable import elastic, line_in_si

POINT = flight_point(load_configuration("small_drone"), 40.0, 20.0, 1.2)
RATE = 20.0 / 40.0


def advanced(line, driven, state, times, tolerance, axes):
    x, v = state.positions.copy(), state.velocities.copy()
    seen = np.empty((2, len(times), *x.shape))
    status, _, _, steps, _ = cable_motion.advance(
        driven.compiled, line.packed(), driven.stops, tolerance, line.length, 20.0,
        100.0 * line.end_weight, 100_000, 0.0, times[-1], 1e-3, x, v, times, *seen, np.array(axes),
    )  # fmt: skip
    assert status == cable_motion.OK
    assert seen[0, -1] == pytest.approx(x, abs=1e-9)
    assert seen[1, -1] == pytest.approx(v, abs=1e-9)
    return x, v, steps


@pytest.mark.parametrize("axes", [
    [RATE, 100.0, 0.0, 0.0, 1.0, 0.2, 0.3],
    [-0.3, 50.0, 30.0, -9.0, -2.0, 0.0, 0.0],
], ids=["with it", "the other way"])  # fmt: skip
def test_a_transient_with_wind_winch_and_pick_up_is_that_of_the_ground(axes):
    line = line_in_si(POINT)

    def place(t):
        circle = [100.0 + 40.0 * np.cos(RATE * t) + t, 40.0 * np.sin(RATE * t) + np.sin(t)]
        return np.stack([*circle, 0.3 * t], axis=-1)

    wind = linear([0.0, 3.0, 9.0], np.array([[0.0, 0.0, 0.0], [3.0, 1.0, 0.0], [2.0, -1.0, 0.5]]))
    length = linear([0.0, 9.0], np.array([[line.length], [1.1 * line.length]]))
    end = linear([0.0, 5.0, 9.0], np.array([line.end, line.end, 2.0 * line.end]))
    driven = drive(line, sampled(place, 0.0, 9.0, 0.2), wind, length, end)
    state = hanging(line, 12, place(np.array(0.0)), (1.0, 20.0, 0.3))
    times = np.linspace(0.5, 9.0, 9)
    there = advanced(line, driven, state, times, 1e-6, cable_motion.GROUND)
    here = advanced(line, driven, state, times, 1e-6, axes)
    assert here[0] == pytest.approx(there[0], abs=1e-4)  # of a cable of 150 m
    assert here[1] == pytest.approx(there[1], abs=1e-3)


def test_what_turns_steadily_stands_still_in_them():
    state = steady_states(elastic(POINT.parameters)).states[0]
    line, still = line_of(elastic(POINT.parameters)), equilibrium(state, 12)

    def place(t):
        return np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=-1)

    turn = np.array([2.0 * np.pi])
    driven = drive(line, sampled(place, 0.0, 7.0, 0.02), constant(np.zeros(3)))
    x, v, steps = advanced(line, driven, still, turn, 1e-4, [1.0, *6 * [0.0]])
    assert x == pytest.approx(still.positions, abs=1e-5)
    assert v == pytest.approx(still.velocities, abs=1e-4)
    ground = advanced(line, driven, still, turn, 1e-4, cable_motion.GROUND)
    assert steps < 0.2 * ground[2]
