"""The end mass in the wind as the predictor follows it, against motions solved for each orbit."""

import gc
from dataclasses import replace
from functools import cache
from types import GeneratorType

import numpy as np
import pytest
from folding_flight import folding_configuration

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.equilibrium import steady_cable
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.periodic.circle import Circle, end_mass_position, end_mass_velocity, motion_on
from ctcbs_ros.periodic.floquet import floquet
from ctcbs_ros.periodic.fourier import at_times
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED
from ctcbs_ros.pieces import drained
from ctcbs_ros.prediction import wind_follower
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.prediction import Margin, MarginOf
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.warnings import stability_warnings
from ctcbs_ros.prediction.wind_follower import WindFollower
from ctcbs_ros.prediction.wind_motion import Flight, linear_motion_search
from ctcbs_ros.prediction.wind_reasons import NO_TIME, STILL_SOLVED
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.telemetry.sample import Sample

AIR = 1.2
# Configuration, tow radius, speed and wind towards east and north.
FLIGHTS = {
    "small drone": ("small_drone", 80.0, 20.0, (3.0, 4.0)),
    "design example": ("design_example", 250.0, 50.0, (-4.0, 2.0)),
}
SIGMAS = np.array([0.3, 0.4, 0.5, 0.4, 1e-3, 4e-3])  # centre, radius [m], rate [rad/s], phase
CENTER = np.array([10.0, -20.0, 300.0])


def orbit_of(radius, rate, sense=1, phase=0.7, center=CENTER):
    """An orbit with independent errors."""
    covariance = np.zeros((9, 9))
    covariance[:6, :6] = np.diag(SIGMAS**2)
    return Orbit(
        time=0.0, start_time=-30.0, center=np.asarray(center, float), radius=radius,
        angular_rate=rate, sense=sense, phase=phase, climb_rate=0.0, rms_residual=1.0, arc=6.3,
        samples=100, covariance=covariance, drift=np.zeros(2),
    )  # fmt: skip


def scaled(name):
    """The configuration's parameters at a tow radius and a speed."""
    configuration = load_configuration(FLIGHTS[name][0])
    return lambda radius, speed: flight_point(configuration, radius, speed, AIR).parameters


def updated(follower, name, orbit, wind, kind=GROUND_SPEED, sigma=0.5):
    """What the follower makes of an orbit, once it has solved what it wants to."""
    state = steady_states(scaled(name)(orbit.radius, orbit.speed)).states[0]
    return settled(follower, orbit, scaled(name), state, wind, sigma, kind)


def settled(follower, orbit, scaled, state, wind, sigma, kind):
    """The same of a state."""
    idle = 0
    for _ in range(500):
        covariance = sigma**2 * np.eye(2)
        motion = follower.update(orbit, scaled, state, np.asarray(wind), covariance, kind)
        idle = 0 if follower.judging else idle + 1
        if idle == 2:  # after a coarse motion a finer one is sought
            return motion
    raise AssertionError("the search does not end")


@cache
def follower_of(name, kind):
    """A follower that has solved a flight, and that flight."""
    _, radius, speed, wind = FLIGHTS[name]
    follower = WindFollower()
    assert updated(follower, name, orbit_of(radius, speed / radius), wind, kind) is not None
    return follower


def solved(name, orbit, wind, kind):
    """The circle and its motion, solved for this very orbit."""
    circle = Circle(orbit.radius, orbit.angular_rate, orbit.sense, *wind, kind)
    state = steady_states(scaled(name)(orbit.radius, orbit.speed)).states[0]
    found = motion_on(circle, state, accuracy=1e-4)
    return circle, found.motion


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("kind", [GROUND_SPEED, AIRSPEED])
@pytest.mark.parametrize("name", FLIGHTS)
def test_between_its_solutions_the_motion_is_within_a_five_hundredth_of_the_tow_radius(
    name, kind, sense
):
    _, radius, speed, wind = FLIGHTS[name]
    follower = follower_of(name, kind)
    for longer, faster, later, stronger in ((1.0, 1.0, 0.0, 1.0), (1.015, 0.99, -2.0, 1.04)):
        orbit = orbit_of(radius * longer, speed / radius * faster, sense, 0.7 + later)
        now = stronger * np.array(wind) + [0.0, 0.1]
        motion = updated(follower, name, orbit, now, kind)
        circle, exact = solved(name, orbit, now, kind)
        there = CENTER + end_mass_position(circle, exact, orbit.phase)
        assert motion.position == pytest.approx(there, abs=0.002 * radius)
        assert motion.path[0] == pytest.approx(motion.position, abs=1e-6)
        assert motion.cable[0] == pytest.approx(motion.position, abs=1e-6)
        tow = orbit.radius * np.array([np.cos(orbit.phase), np.sin(orbit.phase), 0.0])
        assert motion.cable[-1] == pytest.approx(CENTER + tow, abs=1e-6)
        moves = end_mass_velocity(circle, exact, orbit.phase)
        off = motion.yaw - np.arctan2(moves[1], moves[0])
        speed_there = np.hypot(*moves[:2])
        assert abs((off + np.pi) % (2 * np.pi) - np.pi) * speed_there < 0.01 * orbit.speed
        assert motion.mean == pytest.approx(
            CENTER + radius * longer * circle.in_field(exact.mean), abs=0.002 * radius
        )


@pytest.mark.slow
def test_drawn_orbits_and_winds_spread_the_end_mass_as_stated():
    name, random, sense = "small drone", np.random.default_rng(4), -1
    _, radius, speed, wind = FLIGHTS[name]
    orbit = orbit_of(radius, speed / radius, sense)
    motion = updated(WindFollower(), name, orbit, wind, sigma=0.3)
    _, base = solved(name, orbit, wind, GROUND_SPEED)
    places = []
    for _ in range(60):
        off = SIGMAS * random.normal(size=6)
        air = wind + 0.3 * random.normal(size=2)
        drawn = orbit_of(
            radius + off[3], speed / radius + off[4], sense, 0.7 + off[5], CENTER + off[:3]
        )
        circle = Circle(drawn.radius, drawn.angular_rate, sense, *air, GROUND_SPEED)
        state = steady_states(scaled(name)(drawn.radius, drawn.speed)).states[0]
        found = motion_on(circle, state, before=base)
        places.append(drawn.center + end_mass_position(circle, found.motion, drawn.phase))
    # 60 draws tell a deviation to 9 %.
    drawn = np.sqrt(np.diag(np.cov(np.array(places).T)))
    assert np.sqrt(np.diag(motion.covariance)[:3]) == pytest.approx(drawn, rel=0.3)
    # A wind of 0.3 m/s counts for more than all errors of the orbit.
    calm = updated(WindFollower(), name, orbit, wind, sigma=1e-3)
    assert calm.covariance[:3, :3].trace() < 0.5 * motion.covariance[:3, :3].trace()


@pytest.mark.parametrize("sense", [1, -1])
def test_yaw_on_a_drifting_circle_is_that_of_the_motion_over_the_ground(sense):
    name, drift, dt = "small drone", np.array([2.0, -1.0]), 0.01
    _, radius, speed, wind = FLIGHTS[name]
    wind = np.array(wind)
    orbit = replace(orbit_of(radius, speed / radius, sense), drift=drift)
    follower = WindFollower()
    motion = updated(follower, name, orbit, wind - drift)
    before, after = (
        updated(follower, name, replace(
            orbit, phase=orbit.phase + sense * orbit.angular_rate * t,
            center=orbit.center + np.append(drift * t, 0.0),
        ), wind - drift).position
        for t in (-dt, dt)
    )  # fmt: skip
    east, north, _ = after - before
    assert np.exp(1j * motion.yaw) == pytest.approx(
        np.exp(1j * np.arctan2(north, east)), abs=2e-3
    )
    # The drift alone not known, by 0.2 m/s: it is in the air past the circle as well.
    variances = np.diag([0.0] * 7 + [0.04, 0.04])
    found = updated(follower, name, replace(orbit, covariance=variances), wind - drift, sigma=0.2)
    exact = updated(
        follower, name, replace(orbit, covariance=np.zeros((9, 9))), wind - drift, sigma=0.0
    )
    slopes = []
    for step in 0.05 * np.eye(2):
        low, high = (
            updated(follower, name, replace(orbit, drift=drift + s), wind - drift - s).yaw
            for s in (-step, step)
        )
        slopes.append((np.exp(1j * (high - low))).imag / 0.1)
    of_drift = found.covariance[3, 3] - exact.covariance[3, 3]
    assert of_drift == pytest.approx(0.04 * np.dot(slopes, slopes), rel=0.02)


def test_without_wind_it_is_the_steady_state():
    name = "small drone"
    _, radius, speed, _ = FLIGHTS[name]
    orbit = orbit_of(radius, speed / radius)
    motion = updated(WindFollower(), name, orbit, (0.0, 0.0))
    state = steady_states(scaled(name)(radius, speed)).states[0]
    angle = orbit.phase - state.phase_lag
    place = radius * np.array(
        [*(state.end_mass_radius * np.array([np.cos(angle), np.sin(angle)])), -state.depth]
    )
    assert motion.position == pytest.approx(CENTER + place, abs=5e-4 * radius)
    assert motion.mean[:2] == pytest.approx(CENTER[:2], abs=5e-4 * radius)
    assert np.isfinite(motion.covariance).all()


def test_it_is_solved_anew_only_where_the_flight_has_moved(monkeypatch):
    name, count = "small drone", []
    _, radius, speed, wind = FLIGHTS[name]

    def counted(*arguments):
        count.append(arguments)
        return original(*arguments)

    original = wind_follower.linear_motion_search
    monkeypatch.setattr(wind_follower, "linear_motion_search", counted)
    follower = WindFollower()
    for factor in (1.0, 1.01, 0.99, 1.03):
        updated(follower, name, orbit_of(radius * factor, speed / radius), wind)
    assert len(count) == 2
    updated(follower, name, orbit_of(radius * 1.03, speed / radius), wind, AIRSPEED)
    assert len(count) == 3
    # A wind without a motion is not tried with each sample.
    for _ in range(3):
        assert updated(follower, name, orbit_of(radius, speed / radius), (22.0, 0.0)) is None
        assert "below 1" in follower.reason
    assert len(count) == 4


def test_after_a_jump_the_motion_is_that_of_the_other_branch():
    configuration = folding_configuration(youngs_modulus=4e11)

    def of(radius, speed):
        return flight_point(configuration, radius, speed, AIR).parameters

    states = steady_states(of(100.0, 31.3)).states
    small, large = states[0], states[-1]
    follower, orbit = WindFollower(), orbit_of(100.0, 0.313)
    places = [
        settled(follower, orbit, of, state, (0.2, 0.0), 0.1, GROUND_SPEED)
        for state in (small, large)
    ]
    for motion, state in zip(places, (small, large), strict=True):
        out = np.hypot(*(motion.path[:, :2] - CENTER[:2]).T)
        assert out.mean() == pytest.approx(100.0 * state.end_mass_radius, rel=0.1)


@pytest.mark.parametrize("sense", [1, -1])
def test_in_a_light_wind_from_any_quarter_the_end_mass_is_displaced_as_by_any_other(sense):
    name = "small drone"
    _, radius, speed, _ = FLIGHTS[name]
    orbit, follower, offs = orbit_of(radius, speed / radius, sense), WindFollower(), []
    for quarter in range(4):
        downwind = np.exp(1j * (0.3 + 0.5 * np.pi * quarter))
        motion = updated(follower, name, orbit, 0.5 * np.array([downwind.real, downwind.imag]))
        off = motion.mean - CENTER
        offs.append((off[0] + 1j * off[1]) / downwind)
    # Downwind, and as much to the left on one circle as to the right on the other.
    assert np.real(offs) == pytest.approx(np.full(4, offs[0].real), abs=0.01)
    assert np.imag(offs) == pytest.approx(np.full(4, offs[0].imag), abs=0.01)
    assert offs[0].real > 2.0
    assert sense * offs[0].imag > 0.5


@pytest.mark.parametrize("sense", [1, -1])
def test_the_cable_in_time_comes_to_within_half_a_per_cent_of_the_tow_radius_of_it(sense):
    """The second way: integrated in the field's own frame, in a wind of a tenth of the speed."""
    name, segments, turns = "small drone", 20, 4
    _, radius, speed, _ = FLIGHTS[name]
    orbit = orbit_of(radius, speed / radius, sense, phase=0.0, center=np.zeros(3))
    downwind = np.exp(2.2j)
    air = 0.1 * np.array([downwind.real, downwind.imag, 0.0])
    motion = updated(WindFollower(), name, orbit, speed * air[:2])
    state = steady_states(scaled(name)(radius, speed)).states[0]
    end = 2.0 * np.pi * turns
    angle = np.linspace(0.0, end, 256 * turns + 1)
    tow = np.stack([np.cos(angle), sense * np.sin(angle), np.zeros_like(angle)], axis=-1)
    driven = drive(line_of(state.parameters), spline(angle, tow), constant(air))
    begin = steady_cable(state, segments)
    mirror = np.array([1.0, sense, 1.0])
    begun = replace(
        begin, positions=begin.positions * mirror, velocities=begin.velocities * mirror
    )
    times = end - 2.0 * np.pi + 2.0 * np.pi * np.arange(1, 73) / 72
    found = simulate(line_of(state.parameters), driven, begun, times).positions[:, 0]
    # The tow point is where the turn of the motion begins.
    expected = np.roll(motion.path, -1, axis=0) / radius
    assert found == pytest.approx(expected, abs=0.005)


def test_where_the_motion_bends_its_error_is_stated_from_what_the_last_step_showed():
    # a tight circle, on which the linear motion is off by 20 times what is usual
    radius, speed = 100.0, 55.0
    configuration = load_configuration("design_example")

    def point(radius, speed):
        return flight_point(configuration, radius, speed, AIR).parameters

    state = steady_states(point(radius, speed)).states[0]
    orbit = orbit_of(radius, speed / radius)

    def linear(wind, before=None):
        flight = Flight.of(orbit, wind, GROUND_SPEED, state.parameters)
        return drained(linear_motion_search(flight, point, state, before))

    first = linear(2.2)
    second = linear(3.4, first.motion)
    third = linear(4.6, second.motion)
    unaware = off_at(second, third)
    assert unaware > 3.0 * second.error(third.flight)
    assert off_at(second, third) < second.after(first).error(third.flight) < 6.0 * unaware


def off_at(before, after):
    """Greatest error of the end mass in the later flight, over the tow radius."""
    times = np.linspace(0.0, 2.0 * np.pi, 50)
    waves = before.at(after.flight)[:, 0, :, 0], after.waves[:, 0, :, 0]
    places = [at_times(wave, times) for wave in waves]
    return np.linalg.norm(places[0] - places[1], axis=-1).max()


def still_air(name, orbit):
    return stability(steady_states(scaled(name)(orbit.radius, orbit.speed)).states[0])


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_margin_in_wind_is_that_of_the_motion_solved_for_the_very_flight(name):
    _, radius, speed, wind = FLIGHTS[name]
    follower = follower_of(name, GROUND_SPEED)
    for longer, faster, stronger in ((1.0, 1.0, 1.0), (1.01, 0.995, 1.03)):
        orbit = orbit_of(radius * longer, speed / radius * faster)
        now = stronger * np.array(wind)
        margin = updated(follower, name, orbit, now).margin
        _, exact = solved(name, orbit, now, GROUND_SPEED)
        found = floquet(exact, still_air(name, orbit).functions)
        assert margin.of is MarginOf.WIND
        assert margin.per_radian == pytest.approx(-found.growth_rate, rel=0.02)
        assert margin.per_second == pytest.approx(margin.per_radian * orbit.angular_rate)
        assert margin.settling_time == pytest.approx(np.log(20.0) / margin.per_second)


@pytest.mark.parametrize("name", FLIGHTS)
def test_in_hardly_any_wind_the_margin_is_that_of_still_air(name):
    _, radius, speed, _ = FLIGHTS[name]
    orbit = orbit_of(radius, speed / radius)
    still = still_air(name, orbit)
    margin = updated(WindFollower(), name, orbit, (1e-3, 0.0)).margin
    assert margin.per_radian == pytest.approx(still.margin, rel=0.01)
    assert margin.frequency == pytest.approx(still.frequency * orbit.angular_rate, rel=0.01)
    assert margin.nearest_loss == still.nearest_loss


def test_the_margin_is_known_with_the_coarse_motion_already_and_remains():
    name, orbit = "small drone", orbit_of(60.0, 0.3)
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    told = []
    for _ in range(100):
        motion = follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
        if motion is not None:
            told.append(motion.margin)
    assert told[0].of is MarginOf.NOT_YET
    assert told[0].stable is None
    assert np.isnan(told[0].settling_time)
    first = next(i for i, margin in enumerate(told) if margin.known)
    assert first < 12
    assert all(margin.stable for margin in told[first:])
    assert told[first].per_radian == pytest.approx(told[-1].per_radian, rel=0.03)


def test_a_margin_that_cannot_be_told_is_said_to_be_unknown_once_and_for_all(monkeypatch):
    name = "small drone"

    def untellable(*_):
        for _ in range(6):
            yield 0.6
        return "it is too windy"

    monkeypatch.setattr(wind_follower, "growth_search", untellable)
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    told = []
    for i in range(150):  # over two turns: each begins a finer search
        orbit = replace(orbit_of(60.0, 0.3 * (1.0 + 3e-4 * i)), time=0.3 * i)
        motion = follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
        if motion is not None:
            told.append(motion.margin.of)
    changes = [i for i in range(1, len(told)) if told[i] is not told[i - 1]]
    assert [told[0], told[-1]] == [MarginOf.NOT_YET, MarginOf.NOT_KNOWN]
    assert len(changes) == 1
    assert changes[0] < 10
    assert not follower.judging
    (warning,) = stability_warnings(motion.margin, load_configuration("small_drone").limits)
    assert warning.code is WarningCode.MARGIN_UNKNOWN
    assert warning.text.endswith("how soon it settles: it is too windy")


def test_a_flight_that_leaves_no_time_to_find_out_is_said_to_have_a_margin_not_known(monkeypatch):
    name = "small drone"
    monkeypatch.setattr(wind_follower, "growth_search", lambda *_: (0.3 for _ in range(10**9)))
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    told = {}
    for i in range(60):
        orbit = replace(orbit_of(60.0, 0.3), time=0.3 * i)
        motion = follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
        if motion is not None:
            told[orbit.time] = motion.margin.of
    half_a_turn = min(told) + np.pi / 0.3
    for time, of in told.items():
        assert of is (MarginOf.NOT_YET if time <= half_a_turn else MarginOf.NOT_KNOWN)
    (warning,) = stability_warnings(motion.margin, load_configuration("small_drone").limits)
    assert warning.text.endswith(NO_TIME)


def test_of_a_flight_that_moves_on_and_on_the_margin_is_known_meanwhile():
    # Half a turn in wind shows a speed that goes on growing, here by 1.5 % a sample at 4 Hz.
    name, wind = "small drone", np.array([3.0, 0.0])
    follower, told = WindFollower(), []
    for i in range(20):
        orbit = replace(orbit_of(60.0, 14.0 / 60.0 * 1.015**i), time=0.25 * i)
        state = steady_states(scaled(name)(60.0, orbit.speed)).states[0]
        motion = follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
        told.append(motion.margin if motion is not None else Margin(MarginOf.NOT_YET))
    known = np.flatnonzero([margin.known for margin in told])
    assert known.size >= 8
    last = known[-1]
    _, exact = solved(name, orbit_of(60.0, 14.0 / 60.0 * 1.015**last), wind, GROUND_SPEED)
    assert told[last].per_radian == pytest.approx(-floquet(exact).growth_rate, rel=0.03)


def test_a_motion_that_the_flight_has_left_behind_is_sought_no_more(monkeypatch):
    name, begun = "small drone", []

    def endless(flight, *_):
        begun.append(flight.radius)
        while True:
            yield 0.6

    monkeypatch.setattr(wind_follower, "linear_motion_search", endless)
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    for radius in (60.0, 60.5, 62.0, 64.0, 66.0, 67.0):
        orbit = orbit_of(radius, 0.3)
        assert follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED) is None
        assert follower.reason == STILL_SOLVED
    assert begun == [60.0, 66.0]


def test_of_samples_that_come_seldom_each_is_given_more_work(monkeypatch):
    name, worked = "small drone", []

    def endless(*_):
        while True:
            worked.append(True)
            yield 0.23

    monkeypatch.setattr(wind_follower, "linear_motion_search", endless)
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    counts = []
    for time in (0.0, 0.1, 0.12, 0.32, 5.0):
        orbit, before = replace(orbit_of(60.0, 0.3), time=time), len(worked)
        follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
        counts.append(len(worked) - before)
    # 20 ms a sample at 10 Hz and above, in proportion below, 60 ms at most
    assert counts == [3, 3, 3, 6, 8]


def test_a_coarse_motion_that_cannot_be_known_better_is_not_tried_again(monkeypatch):
    name, count = "small drone", []

    def fails(*_):
        count.append(True)
        yield 0.1
        return "no better"

    monkeypatch.setattr(wind_follower, "finer_motion_search", fails)
    state = steady_states(scaled(name)(60.0, 18.0)).states[0]
    follower, wind = WindFollower(), np.array([3.0, 0.0])
    for factor in (1.0, 1.03):
        for turn in range(4):
            for _ in range(20):
                orbit = replace(orbit_of(60.0 * factor, 0.3), time=30.0 * (turn + 10.0 * factor))
                follower.update(orbit, scaled(name), state, wind, np.eye(2), GROUND_SPEED)
    assert len(count) == 2  # one for each motion solved


def predicted(turned, sense):
    """Place and margin, turn by turn and mirrored back, of a flight turned by an angle [rad]."""
    radius, speed, air = 60.0, 16.0, 3.2 * np.exp(1.1j)
    predictor, found = Predictor(load_configuration("small_drone")), []

    def there(z):
        return (z if sense == 1 else np.conj(z)) * np.exp(1j * turned)

    for i in range(110):
        out = np.exp(0.25j * i * speed / radius)
        place, moves, wind = (there(z) for z in (radius * out, 1j * speed * out, air))
        prediction = predictor.update(Sample(
            0.25 * i, 250_000_000 * i, local_position=(place.real, place.imag, 300.0),
            velocity=(moves.real, moves.imag, 0.0), horizontal_accuracy=1.0, speed_accuracy=0.3,
            wind=(wind.real, wind.imag, 0.0), wind_accuracy=0.3,
        ))  # fmt: skip
        end_mass = prediction.end_mass
        if end_mass is not None and end_mass.in_wind is not None:
            back = (end_mass.position[0] + 1j * end_mass.position[1]) * np.exp(-1j * turned)
            back = back if sense == 1 else np.conj(back)
            found.append([back.real, back.imag, end_mass.position[2], end_mass.margin.per_second])
    return np.array(found)


def test_a_flight_turned_and_mirrored_is_predicted_the_same_turned_and_mirrored():
    as_flown = predicted(0.0, 1)
    assert np.isfinite(as_flown[-1]).all()
    for turned, sense in ((2.3, 1), (-1.0, -1)):
        found = predicted(turned, sense)
        assert found[:, :3] == pytest.approx(as_flown[:, :3], abs=1e-6)
        assert found[:, 3] == pytest.approx(as_flown[:, 3], abs=1e-9, nan_ok=True)


def test_a_search_that_is_done_is_not_kept_until_the_next_collection_of_garbage():
    _, radius, speed, wind = FLIGHTS["small drone"]
    gc.collect()
    gc.disable()
    try:
        motion = updated(WindFollower(), "small drone", orbit_of(radius, speed / radius), wind)
        kept = {one.gi_code.co_name for one in gc.get_objects() if isinstance(one, GeneratorType)}
    finally:
        gc.enable()
    assert motion.margin.known
    assert kept.isdisjoint({"growth_search", "_found_anyhow", "_found_finer"})
