"""The motion in wind flown in time until it repeats: beside and beyond the periodic solution."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from points import figure_4_1, parameters

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.equilibrium import equilibrium, trailing
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.periodic.floquet import floquet
from ctcbs_ros.periodic.solve import periodic_motion
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED, TowPath
from ctcbs_ros.pieces import drained
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import prediction_record
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.simulated_flight import simulate_flight
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.twin.simulated import TwinState
from ctcbs_ros.twin.simulated_cable import line_in_si
from ctcbs_ros.twin.turns import Flying, refined_turns_search

DRONE = load_configuration("small_drone")
AIR = 1.225
# Tow radius, airspeed and wind beyond which Newton's method is at its end.
RADIUS, SPEED, WIND = 40.0, 24.0, (5.0, -3.0)


def drone(radius, speed):
    return flight_point(DRONE, radius, speed, AIR).parameters


@cache
def flown(parameters, kind, wind):
    """The steady state in still air, and what the turns come to."""
    state = steady_states(parameters).states[0]
    begun = equilibrium(state, 12)
    search = refined_turns_search(parameters, TowPath(kind, wind), begun, True, Flying())
    return state, drained(search)[1]


@pytest.mark.parametrize(
    ("point", "kind", "wind"),
    [
        (drone(60.0, 18.0), GROUND_SPEED, 0.1),
        (drone(80.0, 20.0), AIRSPEED, 0.15),
        (replace(parameters(figure_4_1(3.0, 2.0)), elasticity=600.0), GROUND_SPEED, 0.1),
    ],
)
def test_the_turns_come_to_the_periodic_solution_within_what_both_state(point, kind, wind):
    state, found = flown(point, kind, wind)
    exact = periodic_motion(state, TowPath(kind, wind), 1e-4).motion
    times = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    off = np.linalg.norm(found.motion.end_mass(times) - exact.end_mass(times), axis=1)
    assert off.max() < 0.003
    assert off.max() < 2.0 * (found.motion.residual + exact.residual) + 1e-4
    arc = np.linspace(0.0, point.length, 9)
    for time in (0.0, 2.0):
        assert found.motion.cable(time, arc) == pytest.approx(exact.cable(time, arc), abs=0.005)
    assert found.motion.least_tension == pytest.approx(exact.least_tension, rel=0.05)
    modes = floquet(exact, stability(state).functions)
    assert found.growth_rate == pytest.approx(modes.growth_rate, rel=0.4)


def test_turns_that_do_not_repeat_are_no_motion_and_are_told():
    point = replace(parameters(figure_4_1(1.33, 2.4)), elasticity=600.0)
    _, found = flown(point, GROUND_SPEED, 0.6)
    assert found.motion is None
    assert "do not repeat" in found.reason
    assert found.greatest_distance > found.least_distance + 0.5


def test_beyond_convergence_the_command_gives_the_motion_in_time_and_says_so(capsys):
    p = drone(RADIUS, SPEED)
    given = {
        "omega": p.omega, "length": p.length, "end-mass": p.end_mass, "cable-drag": p.cable_drag,
        "drag-ratio": p.drag_ratio, "elasticity": p.elasticity, "wind": 0.25,
    }  # fmt: skip
    arguments = [text for name, value in given.items() for text in (f"--{name}", f"{value!r}")]
    assert main(["periodic", *arguments, "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert "cable flown in time" in err
    assert result["source"] == "time-domain"
    assert result["stable"] is True
    _, found = flown(p, GROUND_SPEED, 0.25)
    there = result["mean"]["downwind"], result["mean"]["crosswind"], -result["mean"]["depth"]
    assert found.motion.mean == pytest.approx(there, abs=0.003)
    assert result["residual"] < 0.003


def told(path, air):
    """Samples of a flight, and its end mass: of a finer, undamped cable along the true path."""
    length = DRONE.cable.length
    line = replace(line_in_si(flight_point(DRONE, length, 30.0, AIR)), damping=0.0)
    begun = trailing(line, 40, path.position[0], path.velocity[0], (*air, 0.0))
    begun = CableState(float(path.time[0]), begun.positions, begun.velocities)
    driven = drive(line, spline(path.time, path.position), constant((*air, 0.0)))
    truth = simulate(line, driven, begun, path.time).positions[:, 0]
    samples = [
        Sample(
            float(t), round(1e9 * t), 0, local_position=tuple(map(float, x)),
            velocity=tuple(map(float, v)), airspeed=path.airspeed, wind=(*air, 0.0),
            wind_accuracy=0.1,
        )
        for t, x, v in zip(path.time, path.position, path.velocity, strict=True)
    ]  # fmt: skip
    return samples, truth


@cache
def flight(sense):
    """A flight in a wind in which no periodic solution is found, its samples and end mass."""
    path = simulate_flight(RADIUS, SPEED, 5, sense=sense, wind=WIND)
    return path, *told(path, WIND)


@pytest.mark.parametrize("sense", [1, -1])
def test_where_no_periodic_motion_is_found_the_pose_is_that_of_the_cable_in_time(sense):
    path, samples, truth = flight(sense)
    predictor = Predictor(DRONE, with_twin=True)
    predictions = [predictor.update(s) for s in samples]
    last = np.flatnonzero(np.isfinite(path.radius))[-30:]
    off = []
    for i in last:
        end_mass = predictions[i].end_mass
        assert end_mass.holds
        codes = [w.code for w in predictions[i].warnings]
        assert WarningCode.WIND_UNMODELLED not in codes
        record = prediction_record(predictions[i])
        assert record["in_wind_source"] == "time-domain"
        assert record["margin_of"] == "wind"
        assert record["stable"] is record["settled"] is True
        away = end_mass.position - truth[i]
        known = end_mass.covariance[:3, :3]
        assert away @ np.linalg.solve(known, away) < 7.8  # 95 % of three normal errors
        off.append(np.linalg.norm(away))
    assert np.max(off) < 0.02 * RADIUS
    # what it moves by is many times that
    assert np.linalg.norm(np.ptp(truth[last], axis=0)) > 0.5 * RADIUS
    # the cable beside the flight begins straight behind it, and comes to the same
    twin = [np.linalg.norm(predictions[i].simulated.position - truth[i]) for i in last]
    assert np.max(twin) < 0.06 * RADIUS


def test_a_twin_begun_on_such_an_orbit_is_valid_when_the_decay_in_that_wind_says_so():
    path, samples, _ = flight(1)
    on_orbit = np.flatnonzero(np.isfinite(path.radius))
    predictor = Predictor(DRONE, with_twin=True)
    predictions = [predictor.update(samples[i]) for i in on_orbit]
    times = np.array([p.time for p in predictions])
    valid = np.array([p.simulated is not None and p.simulated.valid for p in predictions])
    known = [
        (p.time, p.end_mass.settling_time) for p in predictions
        if p.end_mass is not None and np.isfinite(p.end_mass.settling_time)
    ]
    begun = next(
        p.time for p in predictions
        if p.simulated is not None and p.simulated.state is not TwinState.WAITING
    )
    assert valid.any()
    first = times[valid.argmax()]
    # not before it is known, which takes the work of many samples where exponents are looked for
    settling = known[-1][1]
    assert first == pytest.approx(max(begun + settling, known[0][0]), abs=0.1 * settling)


def test_without_a_twin_nothing_is_flown_in_time():
    _, samples, _ = flight(1)
    predictor = Predictor(DRONE)
    predictions = [predictor.update(s) for s in samples]
    assert not any(p.end_mass is not None and p.end_mass.in_wind for p in predictions)


def test_a_coarse_motion_that_cannot_be_refined_gives_way_to_the_one_in_time():
    # the flight of a drone in a wind of 0.4 of its speed, cut to what settles
    radius, air = 68.4, (-4.4, -5.3)
    path = simulate_flight(radius, 18.0, 4, sense=-1, wind=air, rate=3.0)
    samples, truth = told(path, air)
    predictor = Predictor(DRONE, with_twin=True)
    predictions = [predictor.update(s) for s in samples]
    last = np.flatnonzero(np.isfinite(path.radius))[-60:]
    assert {predictions[i].end_mass.in_wind.source.value for i in last} == {"time-domain"}
    off, apart = (
        np.array([np.linalg.norm(where(predictions[i]) - truth[i]) for i in last])
        for where in (lambda p: p.end_mass.position, lambda p: p.simulated.position)
    )
    assert max(off.max(), apart.max()) < 0.02 * radius
