"""The predictor from samples to predictions, on simulated flights."""

from dataclasses import replace
from math import cos, inf, isfinite, nan, pi, sin, sqrt

import numpy as np
import pymap3d
import pytest
from folding_flight import UNIT_SPEED, folding_configuration
from points import GRAVITY
from reference_bvp import boundary_value_problem
from sample_flights import PLACES, orbiting, samples_of

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.telemetry.skip_code import SkipCode

DRONE = load_configuration("small_drone")
FOLDING = folding_configuration()
FLIGHT = orbiting()


def predict(samples, configuration=DRONE, predictor=None):
    predictor = predictor or Predictor(configuration)
    return [predictor.update(sample) for sample in samples]


def valid(predictions):
    return [p for p in predictions if p.valid]


def last_on_circle(flight, predictions):
    """The last valid prediction before the aircraft leaves its circle, and its index."""
    on = [i for i, p in enumerate(predictions) if p.valid and isfinite(flight.radius[i])]
    return predictions[on[-1]], on[-1]


def codes(prediction):
    return {w.code for w in prediction.warnings}


def drone_point(radius, speed):
    """small_drone.yaml made non-dimensional here, from the definitions alone."""
    mu = 970.0 * pi / 4.0 * 0.0006**2
    d_n = 0.5 * 1.225 * 0.0006 * 1.1 * radius / mu
    return {
        "omega": speed / sqrt(radius * GRAVITY),
        "l": 150.0 / radius,
        "m": 0.4 / (mu * radius),
        "d_n": d_n,
        "f": 0.5 * 1.225 * 0.01 * 1.0 / mu / d_n,
        "gamma": 4e10 / (970.0 * radius * GRAVITY),
    }


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("place", PLACES)
def test_the_end_mass_is_where_solve_bvp_has_it(place, sense):
    flight = orbiting(sense=sense, turns=1.3)
    predictor = Predictor(DRONE)
    predictions = predict(samples_of(flight, place), predictor=predictor)
    assert all(p.skip is None for p in predictions)
    last, i = last_on_circle(flight, predictions)
    orbit = last.orbit
    assert orbit.sense == sense
    assert orbit.radius == pytest.approx(80.0, abs=0.05)
    assert orbit.speed == pytest.approx(20.0, abs=0.02)
    reference, _ = boundary_value_problem(
        drone_point(orbit.radius, orbit.speed), last.end_mass.state.radius / orbit.radius
    )
    azimuth = orbit.phase - sense * reference.lag
    expected = orbit.center + orbit.radius * np.array(
        [reference.x_d * cos(azimuth), reference.x_d * sin(azimuth), -reference.depth]
    )
    assert np.linalg.norm(last.end_mass.position - expected) < 0.01
    # And on the Earth: relative to the true centre of the flight.
    latitude, longitude = PLACES[place]
    tow = flight.position[i]
    azimuth = np.arctan2(tow[1], tow[0]) - sense * reference.lag
    geodetic = last.end_mass.geodetic
    assert geodetic.ellipsoidal
    assert -180.0 <= geodetic.longitude <= 180.0
    found = pymap3d.geodetic2enu(
        geodetic.latitude, geodetic.longitude, geodetic.altitude, latitude, longitude, 147.0
    )
    there = 80.0 * np.array([reference.x_d * cos(azimuth), reference.x_d * sin(azimuth), 0.0])
    there[2] = 300.0 - 80.0 * reference.depth
    assert np.linalg.norm(np.array(found) - there) < 0.2
    assert last.end_mass.height_above_home == pytest.approx(there[2], abs=0.2)


def test_figures_are_plain_numbers_and_agree_with_each_other():
    prediction = valid(predict(samples_of(FLIGHT)))[-1]
    mass, orbit = prediction.end_mass, prediction.orbit
    for name, value in vars(mass.state).items():
        assert type(value) is (bool if name == "stable" else float), name
    for name in ("yaw", "height_above_home", "settling_time"):
        assert type(getattr(mass, name)) is float
    assert mass.state.margin_per_s == pytest.approx(mass.state.margin * orbit.angular_rate)
    assert mass.settling_time == pytest.approx(np.log(20.0) / mass.state.margin_per_s)
    assert mass.state.residual < 1e-9
    assert mass.cable[0] == pytest.approx(mass.position, abs=1e-6)
    across = mass.position - mass.circle_center
    assert np.hypot(across[0], across[1]) == pytest.approx(mass.state.radius)
    assert across[2] == pytest.approx(0.0, abs=1e-9)
    assert prediction.air_density == 1.225
    assert mass.jump_margin == inf


@pytest.mark.parametrize(
    ("heights", "ellipsoidal", "offset"),
    [
        (("amsl", "ellipsoid", "home"), True, 147.0),
        (("amsl", "home"), False, 100.0),
        (("ellipsoid",), True, 147.0),
        (("amsl",), False, 100.0),
    ],
)
def test_heights_of_each_kind_are_kept_apart(heights, ellipsoidal, offset):
    mass = valid(predict(samples_of(FLIGHT, heights=heights)))[-1].end_mass
    height = 300.0 - mass.state.depth
    assert mass.geodetic.ellipsoidal is ellipsoidal
    assert mass.geodetic.altitude == pytest.approx(offset + height, abs=0.05)
    if "home" in heights:
        assert mass.height_above_home == pytest.approx(height, abs=0.05)
    else:
        assert np.isnan(mass.height_above_home)


def test_height_is_above_the_set_ground_where_sea_level_is_known_and_else_above_home():
    limits = replace(DRONE.limits, ground_level_amsl=60.0)
    configuration = replace(DRONE, limits=limits)
    mass = valid(predict(samples_of(FLIGHT), configuration))[-1].end_mass
    assert mass.height_above_home == pytest.approx(340.0 - mass.state.depth, abs=0.05)
    mass = valid(predict(samples_of(FLIGHT, local=True), configuration))[-1].end_mass
    assert mass.height_above_home == pytest.approx(300.0 - mass.state.depth, abs=0.05)
    assert np.isnan(mass.geodetic.latitude)


def test_the_standard_atmosphere_is_taken_at_the_tow_point():
    air = replace(DRONE.air, model="standard_atmosphere", density=nan)
    configuration = replace(DRONE, air=air)
    # ICAO Doc 7488: 1.0581 kg/m^3 at 1500 m.
    flight = orbiting(height=1400.0)
    assert valid(predict(samples_of(flight), configuration))[-1].air_density == pytest.approx(
        1.0581, rel=1e-3
    )
    # A local frame alone knows its height above its origin.
    flight = orbiting(height=1500.0)
    last = valid(predict(samples_of(flight, local=True), configuration))[-1]
    assert last.air_density == pytest.approx(1.0581, rel=1e-3)


def test_measured_density_of_the_newest_sample_is_taken_where_it_is_asked_for():
    measured = replace(DRONE, air=replace(DRONE.air, model="measured", density=nan))
    samples = [replace(s, air_density=1.1) for s in samples_of(orbiting(turns=1.5))]
    assert valid(predict(samples, configuration=measured))[-1].air_density == 1.1
    assert valid(predict(samples))[-1].air_density == DRONE.air.density


def test_time_stamps_far_ahead_cost_a_turn_and_no_more():
    samples = samples_of(orbiting(turns=5.0))
    middle = len(samples) // 3
    for i in (middle, middle + 1):
        samples[i] = replace(samples[i], time=samples[i].time + 5000.0)
    predictions = predict(samples)
    assert valid(predictions[: middle])
    assert not valid(predictions[middle : middle + 6])
    assert valid(predictions[-len(samples) // 5 :])


def test_above_the_standard_atmosphere_there_is_no_prediction_rather_than_a_wrong_one():
    air = replace(DRONE.air, model="standard_atmosphere", density=nan)
    samples = [
        replace(s, altitude_amsl=s.altitude_amsl + 21e3, altitude_ellipsoid=nan)
        for s in samples_of(FLIGHT)
    ]
    predictions = predict(samples, replace(DRONE, air=air))
    assert valid(predictions) == []
    told = [w.text for p in predictions for w in p.warnings if w.code is WarningCode.NO_SOLUTION]
    assert "standard atmosphere" in told[-1]


def test_without_velocities_the_orbit_and_the_end_mass_are_the_same():
    with_them, _ = last_on_circle(FLIGHT, predict(samples_of(FLIGHT)))
    without, _ = last_on_circle(FLIGHT, predict(samples_of(FLIGHT, velocities=False)))
    moved = without.end_mass.position - with_them.end_mass.position
    assert np.linalg.norm(moved) < 0.3


def test_cable_length_and_end_mass_change_in_flight():
    samples = samples_of(FLIGHT)
    half = next(i for i, p in enumerate(predict(samples)) if p.valid) + 20
    predictor = Predictor(DRONE)
    before = predict(samples[:half], predictor=predictor)[-1].end_mass
    predictor.change(cable_length=120.0, end_mass=0.6)
    after = predictor.update(samples[half])
    point = drone_point(after.orbit.radius, after.orbit.speed)
    point |= {"l": 120.0 / after.orbit.radius, "m": point["m"] * 1.5}
    reference, _ = boundary_value_problem(point, after.end_mass.state.radius / after.orbit.radius)
    assert after.end_mass.state.depth == pytest.approx(
        reference.depth * after.orbit.radius, abs=0.01
    )
    assert after.end_mass.state.depth < before.state.depth - 10.0


def test_limits_change_in_flight():
    predictor = Predictor(DRONE)
    samples = samples_of(FLIGHT)
    half = next(i for i, p in enumerate(predict(samples)) if p.valid) + 20
    assert WarningCode.LOW_MARGIN not in codes(predict(samples[:half], predictor=predictor)[-1])
    predictor.change(limits=replace(DRONE.limits, low_margin_per_s=50.0))
    assert WarningCode.LOW_MARGIN in codes(predictor.update(samples[half]))


def test_a_gap_of_five_seconds_is_told_and_flown_through():
    samples = samples_of(orbiting(turns=3.0))
    cut = [s for s in samples if not 50.0 <= s.time < 55.0]
    whole = {p.time: p for p in predict(samples)}
    predictions = predict(cut)
    stale = [p for p in predictions if WarningCode.STALE_TELEMETRY in codes(p)]
    assert [p.time for p in stale] == [55.0]
    assert "5.2 s" in next(w.text for w in stale[0].warnings if "gap" in w.text)
    after = [p for p in predictions if 60.0 < p.time < 80.0]
    assert after
    for prediction in after:
        assert prediction.valid
        moved = prediction.end_mass.position - whole[prediction.time].end_mass.position
        assert np.linalg.norm(moved) < 0.5


def test_silence_is_stale_after_the_limit_and_not_before():
    predictor = Predictor(DRONE)
    assert predictor.stale(1.99) is None
    assert predictor.stale(2.01).code is WarningCode.STALE_TELEMETRY


def test_start_up_positions_predict_nothing():
    samples = samples_of(orbiting(turns=2.0))
    ghost = [
        replace(s, time=s.time - 100.0, latitude=1e-6, longitude=-2e-6, fix_type=fix)
        for s, fix in zip(samples[:60], [0, 1, 3] * 20, strict=True)
    ]
    predictor = Predictor(DRONE)
    for sample in ghost:
        prediction = predictor.update(sample)
        assert prediction.skip is SkipCode.ZERO_POSITION
        assert not prediction.valid
    assert predictor.datum is None
    assert valid(predict(samples, predictor=predictor))
    assert predictor.datum.latitude == pytest.approx(47.4, abs=0.1)


def test_another_flight_starts_afresh():
    predictor = Predictor(DRONE)
    first = predict(samples_of(FLIGHT), predictor=predictor)
    again = predict(samples_of(FLIGHT, number=1), predictor=predictor)
    assert [p.valid for p in again] == [p.valid for p in first]
    assert not any(WarningCode.STALE_TELEMETRY in codes(p) for p in again)
    # Its home is its own: none, if it does not say.
    predict(samples_of(FLIGHT, number=2, local=False, heights=("amsl",)), predictor=predictor)
    last = valid(predict(samples_of(FLIGHT, number=3, heights=("amsl",)), predictor=predictor))[-1]
    assert np.isnan(last.end_mass.height_above_home)


def test_the_state_of_an_orbit_is_the_one_near_a_radius():
    predictor = Predictor(FOLDING)
    radii = [69.5, 181.4, 245.7]  # thesis Fig. 3.1, d_n 4.8, omega 1, found by brute force
    for radius in radii:
        state = predictor.state_at(100.0, UNIT_SPEED, 1.2, radius)
        assert state.radius == pytest.approx(radius, abs=0.1)
    assert predictor.state_at(100.0, nan, 1.2, 50.0) is None
    assert predictor.state_at(100.0, UNIT_SPEED, nan, 50.0) is None


# Thesis Fig. 3.1, d_n 4.8, flown at 31.3 m/s: three states at 100 m, tightening ends the large
# branch at 97.1 m.


def folding_flights(*flights, pause=1.0):
    """Samples of flights after each other."""
    samples, start = [], 0.0
    for flight in flights:
        samples += samples_of(flight, start=start)
        start = samples[-1].time + pause
    return samples


def circle(radius=100.0, turns=2.0, **others):
    return orbiting(radius, UNIT_SPEED, turns, height=600.0, rate=3.0, **others)


def test_entered_from_straight_flight_it_is_on_the_large_branch_and_told_of_the_others():
    last = valid(predict(folding_flights(circle()), FOLDING))[-1]
    assert last.end_mass.branch == "main"
    assert last.end_mass.state.radius == pytest.approx(245.7, abs=1.0)
    assert [s.radius for s in last.end_mass.others] == pytest.approx([69.5, 181.4], abs=2.0)
    assert {WarningCode.MULTIPLE_SOLUTIONS, WarningCode.NEAR_JUMP} <= codes(last)
    assert WarningCode.JUMPED not in codes(last)


def test_tightening_past_the_end_of_the_branch_it_jumps_once():
    flight = circle(radius_change=(94.0, 1.5), turns=4.0)
    predictions = valid(predict(folding_flights(flight), FOLDING))
    jumped = [p for p in predictions if WarningCode.JUMPED in codes(p)]
    assert len(jumped) == 1
    assert jumped[0].orbit.radius < 97.5
    assert predictions[0].end_mass.state.radius > 240.0
    assert predictions[-1].end_mass.state.radius < 70.0
    before = predictions[predictions.index(jumped[0]) - 1]
    landing = before.end_mass.jump_in_radius.landing_radius
    assert landing == pytest.approx(jumped[0].end_mass.state.radius, rel=0.1)


def small_branch(**others):
    """Onto the small branch at 100 m: by widening the circle from 94 m, where it is alone."""
    return orbiting(
        94.0, UNIT_SPEED, 3.5, height=600.0, rate=3.0, radius_change=(100.0, 1.2), **others
    )


def test_widening_from_the_small_branch_it_stays_there():
    last = valid(predict(folding_flights(small_branch()), FOLDING))[-1]
    assert last.orbit.radius == pytest.approx(100.0, abs=0.5)
    assert last.end_mass.branch == "main, beyond 2 folds"
    assert last.end_mass.state.radius == pytest.approx(69.5, abs=1.5)


def test_straight_flight_ends_the_history():
    samples = folding_flights(small_branch(), circle())
    predictions = valid(predict(samples, FOLDING))
    assert not any(WarningCode.JUMPED in codes(p) for p in predictions)
    assert predictions[-1].end_mass.branch == "main"
    assert predictions[-1].end_mass.state.radius == pytest.approx(245.7, abs=1.0)


def on_the_circle(flight):
    """Samples of a flight without its straights."""
    return [
        s for s, r in zip(samples_of(flight), flight.radius, strict=True) if isfinite(r)
    ]


@pytest.mark.parametrize(("pause", "branch"), [(10.0, "main, beyond 2 folds"), (40.0, "main")])
def test_a_short_silence_on_the_circle_keeps_the_history_and_a_long_one_does_not(pause, branch):
    samples = on_the_circle(small_branch())
    until = samples[-1].time - 22.0
    # The same circle again: the last turn repeated later.
    turn = 2.0 * pi * 100.0 / UNIT_SPEED
    shift = turn * np.ceil(pause / turn)
    tail = [replace(s, time=s.time + shift) for s in samples if s.time > until + pause - shift]
    flown = [s for s in samples if s.time <= until]
    later = [s for s in tail if s.time > until + pause]
    last = valid(predict([*flown, *later], FOLDING))[-1]
    assert last.time > until + pause
    assert last.end_mass.branch == branch


def test_turning_the_other_way_begins_a_new_history():
    flown = on_the_circle(small_branch())
    other = on_the_circle(circle(sense=-1))
    start = flown[-1].time + 1.0 - other[0].time
    samples = [*flown, *(replace(s, time=s.time + start) for s in other)]
    last = valid(predict(samples, FOLDING))[-1]
    assert last.orbit.sense == -1
    assert last.end_mass.branch == "main"


@pytest.mark.parametrize("wind", [0.0, 4.0])
def test_wind_is_known_within_three_quarters_of_a_turn(wind):
    flight = orbiting(turns=1.5, wind=(wind, 0.0))
    known = [
        (p.time, p.wind is not None and p.wind.source.value == "flight")
        for p in valid(predict(samples_of(flight, wind=(wind, 0.0))))
        if not any("not known" in w.text for w in p.warnings)
    ]
    on_circle = flight.time[np.isfinite(flight.radius)]
    turn = 2.0 * pi * 80.0 / 20.0
    assert known[0][0] - on_circle[0] < 0.75 * turn
    assert all(there_is for _, there_is in known)


def test_receivers_velocity_sigma_holds_for_the_wind_too_where_the_source_states_none():
    flight = orbiting(turns=1.2, wind=(3.0, -4.0))
    samples = [
        replace(s, speed_accuracy=nan, heading=float(np.degrees(angle)))
        for s, angle in zip(samples_of(flight), flight.heading, strict=True)
    ]
    sigmas = []
    for sigma in (0.4, 2.0):
        receiver = replace(DRONE.receiver, velocity_sigma=sigma)
        found = valid(predict(samples, replace(DRONE, receiver=receiver)))[-1]
        assert found.wind.velocity == pytest.approx([3.0, -4.0], abs=0.3)
        sigmas.append(found.wind.sigma)
    assert sigmas[1] > 1.02 * sigmas[0]
