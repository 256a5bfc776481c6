"""The margin in wind of coarse motions and of those in time, against the decay after a gust."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.periodic.fourier import times
from ctcbs_ros.periodic.tow_path import GROUND_SPEED
from ctcbs_ros.pieces import drained
from ctcbs_ros.prediction.wind_follower import _PIECE
from ctcbs_ros.prediction.wind_growth import growth_search
from ctcbs_ros.prediction.wind_in_time import motion_in_time_search
from ctcbs_ros.prediction.wind_motion import Flight, linear_motion_search
from ctcbs_ros.prediction.wind_reasons import COARSE
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.twin.decay import decay
from ctcbs_ros.twin.simulated_cable import elastic

DRONE = load_configuration("small_drone")
TURN = 2.0 * np.pi


def scaled(radius, speed, stiffer=1.0):
    cable = replace(DRONE.cable, youngs_modulus=stiffer * DRONE.cable.youngs_modulus)
    return flight_point(replace(DRONE, cable=cable), radius, speed, 1.225).parameters


def decay_after_a_gust(parameters, wind):
    """Growth rate per radian: a cable settled in a tenth more wind, until that is gone."""
    line = line_of(elastic(parameters))
    # Of the stretch alone, a tenth of critical: without it such waves go on for ever.
    wave = (line.stiffness / line.mass_per_length) ** 0.5
    line = replace(line, damping=0.1 * line.length / (np.pi * wave))
    when = np.linspace(0.0, TURN, 181)
    circle = np.stack([np.cos(when), np.sin(when), 0.0 * when], axis=1)
    circle[-1] = circle[0]
    tow = spline(when, circle, periodic=True)
    begun = equilibrium(steady_states(parameters).states[0], 32)
    before, after = (drive(line, tow, constant((speed, 0.0, 0.0))) for speed in (1.1 * wind, wind))
    turns = 4
    later = np.linspace(0.0, TURN, 51)[1:]
    runs = []
    for driven in (before, after):
        state, seen = begun, []
        for _ in range(7):
            state = replace(simulate(line, driven, state, [TURN]).end, time=0.0)
        for _ in range(turns):
            motion = simulate(line, after, state, later, 1e-5)
            state = replace(motion.end, time=0.0)
            seen.append(motion.positions[:, 0])
        runs.append(np.array(seen))
    apart = np.linalg.norm(runs[1] - runs[0], axis=2)
    sizes = np.log(np.sqrt(np.mean(apart**2, axis=1)))
    return np.polyfit(np.arange(turns), sizes, 1)[0] / TURN


def flight_of(radius, speed, wind, stiffer=1.0):
    """The steady state in still air, and the flight in the wind."""
    state = steady_states(scaled(radius, speed, stiffer)).states[0]
    p = state.parameters
    cable = p.length * radius, p.end_mass * radius, p.cable_drag / radius
    return state, Flight(radius, speed / radius, wind, GROUND_SPEED, cable)


def in_time(radius, speed, wind, stiffer=1.0):
    """The functions that still air needs, and the motion in time."""
    state, flight = flight_of(radius, speed, wind, stiffer)
    of_such = partial(scaled, stiffer=stiffer)
    return stability(state).functions, drained(motion_in_time_search(flight, of_such, state, None))


@pytest.mark.parametrize(
    ("radius", "speed", "wind", "stiffer"),
    [
        (40.0, 24.0, 5.83, 1.0), (60.0, 18.0, 1.8, 1.0), (68.4, 18.0, 6.9, 1.0),
        (83.0, 20.8, 4.4, 25.0),
    ],
)  # fmt: skip
def test_the_margin_of_a_motion_in_time_is_the_decay_after_a_gust(radius, speed, wind, stiffer):
    functions, solved = in_time(radius, speed, wind, stiffer)
    found = drained(growth_search(solved, functions))
    assert found.frequency > 0.5
    after_a_gust = decay_after_a_gust(scaled(radius, speed, stiffer), wind / speed)
    assert found.at(solved.flight) == pytest.approx(after_a_gust, rel=0.05)


def test_the_margin_of_a_motion_in_time_changes_with_the_flight():
    functions, solved = in_time(68.4, 18.0, 6.9)
    _, there = in_time(69.8, 18.0, 7.1)
    found, expected = (drained(growth_search(one, functions)) for one in (solved, there))
    change = expected.growth_rate - found.growth_rate
    assert abs(change) > 0.02
    assert found.at(there.flight) - found.growth_rate == pytest.approx(change, rel=0.3)


@pytest.mark.parametrize(
    ("radius", "speed", "wind"), [(60.0, 20.0, 3.0), (60.0, 16.0, 4.0), (102.0, 20.6, 8.9)]
)
def test_a_coarse_motion_of_a_stiff_cable_has_the_margin_that_the_decay_after_a_gust_shows(
    radius, speed, wind
):
    state, flight = flight_of(radius, speed, wind)
    coarse = drained(linear_motion_search(flight, scaled, state, None))
    assert coarse.coarse
    work = []
    found = drained(counted(growth_search(coarse, stability(state).functions), work))
    after_a_gust = decay_after_a_gust(scaled(radius, speed), wind / speed)
    assert found.at(flight) == pytest.approx(after_a_gust, rel=0.05)
    assert sum(work) < 10.0 * _PIECE  # samples


def counted(search, work):
    """A search whose pieces of work are kept."""
    while True:
        try:
            work.append(next(search))
        except StopIteration as ended:
            return ended.value
        yield work[-1]


def test_where_the_highest_orders_matter_to_the_exponent_the_margin_is_the_decay_or_none():
    functions, solved = in_time(60.0, 18.0, 1.8)
    motion = solved.motion
    high = 3e-3 * np.cos(25.0 * times(len(motion.values)))
    rough = replace(solved, motion=replace(motion, values=motion.values + high[:, None, None]))
    found = drained(growth_search(rough, functions))
    assert found.growth_rate == solved.decay.growth_rate
    assert np.isnan(found.frequency)
    assert found.nearest_loss is None
    assert drained(growth_search(replace(rough, decay=None), functions)) == COARSE


def test_a_common_decay_is_the_slope_of_all_flights_with_what_they_scatter_by():
    rate, turns = -0.3, np.arange(5)
    exact = [size * np.exp(rate * TURN * turns) for size in (0.09, 0.03)]
    found = decay(exact)
    assert found.growth_rate == pytest.approx(rate, rel=1e-9)
    assert found.known
    # neither what is large nor what is lost in the steps' error counts
    more = [np.concatenate([[0.5, 0.4], exact[0], [1e-6, 1e-6]]), exact[1]]
    assert decay(more).growth_rate == pytest.approx(rate, rel=1e-9)
    rng = np.random.default_rng(1)
    drawn = [
        decay([one * np.exp(rng.normal(0.0, 0.2, 5)) for one in exact[:2]]) for _ in range(300)
    ]
    off = np.array([(d.growth_rate - rate) / d.sigma for d in drawn])
    assert 0.9 < np.sqrt(np.mean(off**2)) < 1.5  # few points: Student's, 3 to 5 left over


def test_a_decay_that_few_turns_or_scattered_ones_tell_is_not_known():
    assert not decay([]).known
    assert not decay([np.array([1e-2])]).known
    two = decay([np.array([1e-2, 1e-3])])
    assert two.growth_rate == pytest.approx(np.log(0.1) / TURN)
    assert not two.known  # nothing to judge it by
    assert not decay([np.array([1e-2, 1e-3, 5e-3, 1e-4]), np.array([1e-2, 8e-3])]).known
    assert not decay([1e-3 * 1.1 ** np.arange(9)]).known  # grows
