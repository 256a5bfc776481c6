"""The end mass in the local frame: signs and senses, mirror images, covariance."""

from dataclasses import replace
from math import cos, erfc, inf, pi, sin, sqrt

import numpy as np
import pytest
from folding_flight import AIR, RADIUS, UNIT_SPEED, folding_configuration
from points import GRAVITY

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction import pose
from ctcbs_ros.prediction import pose_study as study
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.steady_state import correct_state, steady_states

DRONE = load_configuration("small_drone")
NO_COVARIANCE = np.zeros((6, 6))


def orbit_of(sense=1, phase=0.3, radius=80.0, speed=20.0, covariance=NO_COVARIANCE):
    return Orbit(
        time=100.0, start_time=60.0, center=np.array([120.0, -45.0, 260.0]), radius=radius,
        angular_rate=speed / radius, sense=sense, phase=phase, climb_rate=0.0, rms_residual=0.5,
        arc=6.5, samples=200, covariance=covariance,
    )  # fmt: skip


def solved(orbit, configuration=DRONE, index=0):
    point = flight_point(configuration, orbit.radius, orbit.speed, 1.225)
    return point, steady_states(point.parameters).states[index]


def tow_point(orbit):
    return orbit.center + orbit.radius * np.array([cos(orbit.phase), sin(orbit.phase), 0.0])


def wrapped(angle):
    return (angle + pi) % (2.0 * pi) - pi


@pytest.mark.parametrize("sense", [1, -1])
def test_the_end_mass_trails_the_tow_point_in_the_sense_of_rotation(sense):
    orbit = orbit_of(sense)
    point, state = solved(orbit)
    east, north, up = pose.end_mass_position(orbit, point, state) - orbit.center
    behind = wrapped(orbit.phase - np.arctan2(north, east)) * sense
    assert 0.0 < behind < pi
    assert behind == pytest.approx(state.phase_lag)
    assert np.hypot(east, north) == pytest.approx(state.end_mass_radius * 80.0)
    assert up == pytest.approx(-state.depth * 80.0)
    assert -150.0 < up < -90.0  # 150 m of line, hanging down


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("phase", np.linspace(-pi, pi, 9))
def test_yaw_is_the_direction_in_which_the_position_moves(sense, phase):
    orbit = orbit_of(sense, phase)
    point, state = solved(orbit)
    dt = 1e-4
    before, after = (
        pose.end_mass_position(
            replace(orbit, phase=phase + sense * orbit.angular_rate * t), point, state
        )
        for t in (-dt, dt)
    )
    east, north, up = (after - before) / (2.0 * dt)
    yaw = pose.motion_yaw(orbit, state)
    assert -pi < yaw <= pi
    assert wrapped(yaw - np.arctan2(north, east)) == pytest.approx(0.0, abs=1e-6)
    assert np.hypot(east, north) == pytest.approx(
        state.end_mass_radius * orbit.radius * orbit.angular_rate, rel=1e-6
    )
    assert up == pytest.approx(0.0)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("drift", [(5.0, 0.0), (-3.0, 4.0), (0.5, -0.2)])
@pytest.mark.parametrize("phase", np.linspace(-pi, pi, 5))
def test_yaw_on_a_drifting_circle_is_that_of_the_motion_over_the_ground(sense, drift, phase):
    drift, dt = np.array(drift), 1e-4
    orbit = replace(orbit_of(sense, phase, radius=50.0, speed=15.0), drift=drift)
    point, state = solved(orbit)
    before, after = (
        pose.end_mass_position(
            replace(
                orbit, phase=phase + sense * orbit.angular_rate * t,
                center=orbit.center + np.append(drift * t, 0.0),
            ), point, state,
        )
        for t in (-dt, dt)
    )  # fmt: skip
    east, north, _ = after - before
    assert wrapped(pose.motion_yaw(orbit, state) - np.arctan2(north, east)) == pytest.approx(
        0.0, abs=1e-6
    )


@pytest.mark.parametrize("sense", [1, -1])
def test_covariance_of_the_yaw_on_a_drifting_circle_is_that_of_finite_differences(sense):
    random = np.random.default_rng(3)
    deviations = np.array([0.4, 0.3, 0.5, 0.6, 0.001, 0.006, 0.1, 0.05, 0.04])
    mix = random.normal(size=(9, 9)) / 3.0 + np.eye(9)
    covariance = deviations[:, None] * (mix @ mix.T) * deviations
    orbit = replace(orbit_of(sense, 0.9, covariance=covariance), drift=np.array([5.0, -2.0]))
    point, state = solved(orbit)
    known = pose.pose_covariance(orbit, point, state)[5, 5]

    def yaw(steps):
        drawn = replace(
            orbit, radius=orbit.radius + steps[3], angular_rate=orbit.angular_rate + steps[4],
            phase=orbit.phase + steps[5], drift=orbit.drift + steps[7:],
        )  # fmt: skip
        there = flight_point(DRONE, drawn.radius, drawn.speed, 1.225)
        return pose.motion_yaw(drawn, correct_state(there.parameters, state.end_mass_radius))

    steps = np.diag(0.02 * deviations)
    slopes = [wrapped(yaw(s) - yaw(-s)) / (2.0 * s.sum()) for s in steps]
    assert known == pytest.approx(slopes @ covariance @ slopes, rel=1e-3)


def test_a_yaw_that_nobody_knows_leaves_the_place_known():
    # An end mass that stands over the ground for a moment: the drift undoes its own motion.
    orbit = orbit_of(covariance=np.diag([0.1, 0.1, 0.2, 0.1, 1e-6, 1e-4, 0.1, 0.01, 0.01]))
    point, state = solved(orbit)
    own = orbit.speed * state.end_mass_radius
    yaw = pose.motion_yaw(orbit, state)
    drifting = replace(orbit, drift=-(own - 1e-6) * np.array([cos(yaw), sin(yaw)]))
    still, found = (pose.pose_covariance(o, point, state) for o in (orbit, drifting))
    assert found[:3, :3] == pytest.approx(still[:3, :3])
    assert found[5, 5] == pytest.approx(pi**2)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("phase", [-2.0, 0.0, 1.1, 3.0])
def test_the_cable_leads_from_the_end_mass_to_the_tow_point(sense, phase):
    orbit = orbit_of(sense, phase)
    point, state = solved(orbit)
    cable = pose.cable_points(orbit, point, state)
    assert cable.shape == (pose.CABLE_POINTS, 3)
    assert cable[0] == pytest.approx(pose.end_mass_position(orbit, point, state), abs=1e-9)
    assert cable[-1] == pytest.approx(tow_point(orbit), abs=1e-5)
    lengths = np.linalg.norm(np.diff(cable, axis=0), axis=1)
    # 150 m of line stretched a little, measured along chords.
    assert lengths.sum() == pytest.approx(150.0, rel=5e-3)
    assert lengths.max() < 1.02 * lengths.min()


def test_each_point_of_the_cable_leans_back_against_the_motion():
    for sense in (1, -1):
        orbit = orbit_of(sense)
        point, state = solved(orbit)
        offset = pose.cable_points(orbit, point, state) - orbit.center
        azimuth = np.unwrap(np.arctan2(offset[:, 1], offset[:, 0]))
        # From the end mass up to the tow point the azimuth advances in the sense of rotation.
        assert sense * (azimuth[-1] - azimuth[0]) == pytest.approx(state.phase_lag, abs=1e-6)


def test_mirrored_flights_have_mirrored_end_masses():
    # Mirror about the east axis through the centre: north changes sign, and with it the sense.
    random = np.random.default_rng(4)
    root = random.normal(size=(6, 6)) * np.array([0.5, 0.5, 0.5, 0.5, 1e-3, 1e-2])[:, None]
    mirror_orbit = np.diag([1.0, -1.0, 1.0, 1.0, 1.0, -1.0])
    mirror_pose = np.diag([1.0, -1.0, 1.0, 1.0, 1.0, -1.0])
    covariance = root @ root.T
    one = orbit_of(1, 0.7, covariance=covariance)
    other = orbit_of(-1, -0.7, covariance=mirror_orbit @ covariance @ mirror_orbit)
    point, state = solved(one)
    flip = np.array([1.0, -1.0, 1.0])

    def relative(orbit, positions):
        return positions - orbit.center

    for of in (pose.end_mass_position, pose.cable_points):
        there = relative(one, of(one, point, state)) * flip
        assert np.allclose(relative(other, of(other, point, state)), there, rtol=0, atol=1e-12)
    assert pose.motion_yaw(other, state) == pytest.approx(-pose.motion_yaw(one, state))
    mirrored = mirror_pose @ pose.pose_covariance(one, point, state) @ mirror_pose
    assert pose.pose_covariance(other, point, state) == pytest.approx(mirrored, abs=1e-12)


@pytest.mark.parametrize("sense", [1, -1])
def test_covariance_is_that_of_solving_each_orbit_that_may_have_been_flown(sense):
    random = np.random.default_rng(8)
    deviations = np.array([0.4, 0.3, 0.5, 0.6, 0.001, 0.006])
    mix = random.normal(size=(6, 6)) / 3.0 + np.eye(6)
    covariance = deviations[:, None] * (mix @ mix.T) * deviations
    orbit = orbit_of(sense, 0.9, covariance=covariance)
    point, state = solved(orbit)
    first_order = pose.pose_covariance(orbit, point, state)
    n = 3000
    samples = random.multivariate_normal(np.zeros(6), covariance, n)
    poses = np.empty((n, 4))
    yaw = pose.motion_yaw(orbit, state)
    for row, (east, north, up, radius, rate, phase) in zip(poses, samples, strict=True):
        drawn = replace(
            orbit, center=orbit.center + np.array([east, north, up]),
            radius=orbit.radius + radius, angular_rate=orbit.angular_rate + rate,
            phase=orbit.phase + phase,
        )  # fmt: skip
        there = flight_point(DRONE, drawn.radius, drawn.speed, 1.225)
        moved = correct_state(there.parameters, state.end_mass_radius)
        row[:3] = pose.end_mass_position(drawn, there, moved)
        row[3] = yaw + wrapped(pose.motion_yaw(drawn, moved) - yaw)
    sampled = np.cov(poses.T)
    known = first_order[np.ix_([0, 1, 2, 5], [0, 1, 2, 5])]
    scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    # Three standard errors of a sampled variance are 3 sqrt(2/n) = 8 %.
    assert np.abs(known - sampled).max() <= 0.08 * scale.max()
    assert np.all(np.abs(known - sampled) <= 0.08 * scale)


def test_unknown_attitude_has_a_large_variance_and_the_matrix_is_symmetric():
    orbit = orbit_of(covariance=np.diag([0.1, 0.1, 0.2, 0.1, 1e-6, 1e-4]))
    point, state = solved(orbit)
    covariance = pose.pose_covariance(orbit, point, state)
    assert np.array_equal(covariance, covariance.T)
    assert covariance[3, 3] == covariance[4, 4] == pose.UNKNOWN_VARIANCE
    assert np.linalg.eigvalsh(covariance).min() > 0.0


@pytest.mark.parametrize("value", [np.inf, np.nan, 1e300])
def test_an_orbit_of_unknown_covariance_gives_unknown_and_not_zero(value):
    orbit = orbit_of(covariance=np.diag(np.full(6, value)))
    point, state = solved(orbit)
    covariance = pose.pose_covariance(orbit, point, state)
    assert np.array_equal(covariance, np.diag(np.full(6, pose.UNKNOWN_VARIANCE)))


@pytest.mark.parametrize("name", study.CASES)
def test_drawn_orbits_spread_the_end_mass_as_stated_also_near_a_fold(name):
    case = study.CASES[name]
    for sense in (case.sense, -case.sense):
        found = study.spread(replace(case, sense=sense), 250)
        assert study.missed_pose_bars({name: found}, {}) == []
        # Draws beyond the fold, by a first-order distance to it.
        assert found.jumped == pytest.approx(found.stated_jumped, abs=0.13)


def test_towards_the_fold_the_stated_deviation_grows_and_the_distance_falls():
    near = [study.predicted(study.CASES[name])[1] for name in study.CASES if "fold" in name]
    distances = [end_mass.fold_distance for end_mass in near]
    horizontal = [np.trace(end_mass.covariance[:2, :2]) for end_mass in near]
    assert distances == sorted(distances, reverse=True)
    assert horizontal == sorted(horizontal)
    assert distances[0] > 20.0
    assert distances[-1] < 1.0
    assert horizontal[-1] > 20.0**2 * horizontal[0]


def test_without_the_chance_of_a_jump_a_pose_near_a_fold_would_be_understated(monkeypatch):
    case = study.CASES["fold 0.3 % away"]
    whole = pose.pose_covariance

    def first_order(orbit, point, state, *_):
        return whole(orbit, point, state)

    monkeypatch.setattr(pose, "pose_covariance", first_order)
    assert study.missed_pose_bars({"near": study.spread(case, 100)}, {})


@pytest.mark.parametrize(
    ("rate", "radius", "correlation"),
    [(0.02, -0.01, 0.0), (0.02, -0.01, 0.8), (-0.03, 0.02, -0.5), (0.02, None, 0.3)],
)
def test_the_fold_is_as_far_as_the_chance_of_being_beyond_it_says(rate, radius, correlation):
    relative = np.array([0.008, 0.012])  # of radius and rate
    covariance = np.zeros((6, 6))
    orbit = orbit_of()
    sigmas = relative * (orbit.radius, orbit.angular_rate)
    covariance[3:5, 3:5] = np.outer(sigmas, sigmas) * [[1.0, correlation], [correlation, 1.0]]
    orbit = orbit_of(covariance=covariance)
    jumps = [value and Jump(1.0, value, 1.0) for value in (rate, radius)]
    k = pose.fold_distance(orbit, *jumps)
    draws = np.random.default_rng(3).multivariate_normal(np.zeros(6), covariance, 200_000)
    d_radius, d_rate = draws[:, 3] / orbit.radius, draws[:, 4] / orbit.angular_rate
    # Of a change of the radius, the part at constant speed, and the change of the rate beside it.
    along = d_radius / radius if radius else 0.0
    beyond = np.mean(along + (d_rate + d_radius) / rate > 1.0)
    assert beyond == pytest.approx(0.5 * erfc(k / sqrt(2.0)), abs=0.003)


def test_without_a_fold_or_an_error_of_the_orbit_none_is_near():
    assert pose.fold_distance(orbit_of(covariance=np.eye(6)), None, None) == inf
    assert pose.fold_distance(orbit_of(), Jump(1.0, 0.1, 1.0), None) == inf
    at_it = pose.fold_distance(orbit_of(covariance=np.eye(6)), Jump(1.0, 0.0, 1.0), None)
    assert at_it == 0.0


@pytest.mark.parametrize(("place", "sense"), [("north", 1), ("south", -1)])
def test_the_true_end_mass_of_a_noisy_flight_is_where_it_is_stated_to_be(place, sense):
    found = study.flown(place, sense, 8)
    assert study.missed_pose_bars({}, {"flights": found}) == []
    assert found.error < 0.6


@pytest.mark.slow
def test_the_covariance_holds_in_400_flights_and_1000_draws_of_each_case(capsys):
    assert main(["pose-study"]) == 0
    assert "All bars hold." in capsys.readouterr().out


def test_covariance_grows_towards_a_fold():
    # The large branch of thesis Fig. 3.1, d_n 4.8, ends at omega 1.0982.
    configuration = folding_configuration()
    deviations = []
    for omega in (1.0, 1.06, 1.09, 1.097, 1.0981):
        orbit = orbit_of(
            radius=RADIUS, speed=omega * UNIT_SPEED,
            covariance=np.diag([0.0, 0.0, 0.0, 0.01, 1e-8, 0.0]),
        )  # fmt: skip
        assert orbit.speed / sqrt(GRAVITY * RADIUS) == pytest.approx(omega)
        point = flight_point(configuration, orbit.radius, orbit.speed, AIR)
        state = steady_states(point.parameters).states[2]
        covariance = pose.pose_covariance(orbit, point, state)
        deviations.append(sqrt(covariance[0, 0] + covariance[1, 1]))
    assert np.all(np.diff(deviations) > 0.0)
    assert deviations[-1] > 10.0 * deviations[0]
