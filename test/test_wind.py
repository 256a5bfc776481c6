"""Wind from a turn: the circle of velocities, what it rests on, what is stated of its error."""

from dataclasses import replace
from math import cos, hypot, nan, radians, sin, sqrt

import numpy as np
import pytest
from sample_flights import orbiting, samples_of
from scipy.optimize import least_squares

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import SetWind, load_configuration
from ctcbs_ros.kernels.wind import refine_wind, wind_covariance
from ctcbs_ros.orbit import wind_study as study
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.tracks import TURN, arc, fly
from ctcbs_ros.orbit.wind import Wind, WindSource, worst_sigma
from ctcbs_ros.orbit.wind_of_turn import FlightWind, WindEstimator, WindSettings, wind_of_turn
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import prediction_record, wind_fields
from ctcbs_ros.prediction.wind_choice import FRESH, WindChoice, described, user_wind

SURE = WindSettings(airspeed_wander=1e-6)
AIR = np.array([4.2, -5.6])  # 7 m/s towards the south-east


def rows_of(time, velocity, sigma=nan, airspeed=nan, heading=nan):
    rows = np.empty((len(time), 6))
    rows[:, 0], rows[:, 1:3] = time, velocity
    rows[:, 3], rows[:, 4], rows[:, 5] = sigma, airspeed, heading
    return rows


def air_circle(airspeed=20.0, turn=25.0, turns=1.0, sense=1, wind=AIR):
    """A circle flown in moving air: time, ground velocity, direction through the air."""
    time = np.arange(0.0, turns * turn, 0.2)
    angle = 0.7 + sense * TURN * time / turn
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    return time, wind + airspeed * along, angle


def held_ground_speed(speed=20.0, turn=25.0, wind=AIR):
    """A circle at constant ground speed: time, velocity, airspeed, heading."""
    time, velocity, _ = air_circle(speed, turn, wind=np.zeros(2))
    air = velocity - wind
    return time, velocity, np.hypot(*air.T), np.arctan2(air[:, 1], air[:, 0])


# --- the circle of velocities --------------------------------------------------------------------


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("turns", [0.5, 1.0])
def test_without_noise_centre_and_radius_are_wind_and_airspeed(sense, turns):
    time, velocity, _ = air_circle(turns=turns, sense=sense)
    found = wind_of_turn(rows_of(time, velocity), 25.0)
    assert found.velocity == pytest.approx(AIR, abs=0.01)
    assert found.airspeed == pytest.approx(20.0, abs=0.01)
    assert found.relation == "constant airspeed"


@pytest.mark.parametrize("sense", [1, -1])
def test_a_circle_held_over_the_ground_shows_the_same_wind(sense):
    flight = fly([arc(90.0, 1.0, sense)], 20.0, np.random.default_rng(3), wind=AIR)
    found = wind_of_turn(rows_of(flight.time, flight.velocity[:, :2], 0.3), 30.0, SURE)
    error = found.velocity - AIR
    assert error @ np.linalg.solve(found.covariance, error) < 13.8  # chi2, 0.999
    assert worst_sigma(found.covariance) < 0.15


def test_it_is_the_circle_that_scipy_fits():
    flight = fly([arc(90.0, 1.0)], 20.0, np.random.default_rng(5), wind=AIR)
    velocity = flight.velocity[:, :2]
    found = wind_of_turn(rows_of(flight.time, velocity, 0.3), 30.0, SURE)
    middle = flight.time - flight.time.mean()

    def residuals(p):
        radial = np.hypot(*(velocity - p[:2]).T) - p[2] * (1.0 + p[3] * middle / 30.0)
        return np.append(radial / 0.3, p[3] / 0.1)

    scipy = least_squares(residuals, [0.0, 0.0, 15.0, 0.0], loss="huber", f_scale=1.345)
    # scipy's Huber counts the prior of the trend in the same way; the noise's mean is left out.
    assert found.velocity == pytest.approx(scipy.x[:2], abs=0.01)
    assert found.airspeed == pytest.approx(scipy.x[2], abs=0.01)


def test_outliers_hardly_move_it():
    time, velocity, _ = air_circle()
    velocity[::10] += 8.0
    found = wind_of_turn(rows_of(time, velocity, 0.1), 25.0)
    assert found.velocity == pytest.approx(AIR, abs=0.15)


@pytest.mark.parametrize("change", [0.1, -0.1])
def test_an_airspeed_that_rises_or_falls_is_no_wind(change):
    time, velocity, _ = air_circle(wind=np.zeros(2))
    velocity = AIR + (1.0 + change * time / 25.0)[:, None] * velocity
    found = wind_of_turn(rows_of(time, velocity, 0.1), 25.0)
    assert found.velocity == pytest.approx(AIR, abs=0.25)


def test_nothing_is_known_of_too_little():
    time, velocity, _ = air_circle(turns=0.3)
    assert wind_of_turn(rows_of(time, velocity), 25.0) is None
    time, velocity, _ = air_circle()
    assert wind_of_turn(rows_of(time, velocity)[::12], 25.0) is None
    still = np.tile([20.0, 0.0], (len(time), 1))
    assert wind_of_turn(rows_of(time, still), 25.0) is None
    assert wind_of_turn(rows_of(time, 0.0 * still), 25.0) is None
    assert wind_of_turn(np.empty((0, 6)), 25.0) is None


def test_less_of_a_turn_tells_less():
    sigmas = []
    for turns in (0.5, 0.75, 1.0):
        time, velocity, _ = air_circle(turns=turns)
        found = wind_of_turn(rows_of(time, velocity, 0.5), 25.0, SURE)
        sigmas.append(worst_sigma(found.covariance))
    assert sigmas[0] > 1.5 * sigmas[1] > 2.0 * sigmas[2]


# --- what it rests on ----------------------------------------------------------------------------


def test_a_held_ground_speed_looks_like_still_air_and_a_measured_airspeed_tells():
    time, velocity, airspeed, _ = held_ground_speed()
    assert wind_of_turn(rows_of(time, velocity), 25.0) is None
    told = wind_of_turn(rows_of(time, velocity, airspeed=0.9 * airspeed), 25.0)
    assert told.relation == "measured airspeed"
    assert told.velocity == pytest.approx(AIR, abs=0.05)


@pytest.mark.parametrize("nose", ["course", "centre", "held"])
def test_a_heading_that_shows_no_wind_does_not_prove_still_air(nose):
    time, velocity, airspeed, _ = held_ground_speed()
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    heading = {"course": course, "centre": course + 0.5 * np.pi, "held": 0.0 * course}[nose]
    assert wind_of_turn(rows_of(time, velocity, heading=heading), 25.0) is None
    told = wind_of_turn(rows_of(time, velocity, airspeed=airspeed, heading=heading), 25.0)
    assert told.velocity == pytest.approx(AIR, abs=0.05)


def test_still_air_is_shown_by_a_measured_airspeed():
    time, velocity, angle = air_circle(wind=np.zeros(2))
    assert wind_of_turn(rows_of(time, velocity, heading=angle), 25.0) is None
    shown = wind_of_turn(rows_of(time, velocity, airspeed=np.full(len(time), 20.0)), 25.0)
    assert np.hypot(*shown.velocity) < 0.05


def test_a_heading_tells_that_the_airspeed_is_not_constant():
    time, velocity, _, heading = held_ground_speed()
    told = wind_of_turn(rows_of(time, velocity, heading=heading + 0.1), 25.0)
    assert told.relation == "heading"
    assert told.note == "the airspeed is not constant"
    assert told.velocity == pytest.approx(AIR, abs=0.05)


def test_a_heading_that_is_the_course_over_ground_does_not_deny_the_wind():
    time, velocity, _ = air_circle()
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    found = wind_of_turn(rows_of(time, velocity, heading=course), 25.0)
    assert found.velocity == pytest.approx(AIR, abs=0.05)
    assert "follows the course" in found.note


def test_a_heading_that_agrees_confirms_a_constant_airspeed():
    time, velocity, angle = air_circle()
    found = wind_of_turn(rows_of(time, velocity, heading=angle), 25.0)
    assert found.velocity == pytest.approx(AIR, abs=0.05)
    assert (found.relation, found.note) == ("constant airspeed", "the heading agrees")


# --- what is stated of its error -----------------------------------------------------------------


def fitted(velocity, time, sigma):
    n = len(time)
    solution = np.array([0.0, 0.0, 20.0, 0.0])
    inverse, residual, unit = np.empty((4, 4)), np.empty(n), np.empty((n, 2))
    gain = np.empty((n, 4))
    assert refine_wind(
        time - time.mean(), velocity, np.full(n, sigma), np.ones(n), False, 25.0, 0.1, 1e3,
        solution, inverse, residual, unit, gain,
    )
    return solution, inverse, unit, gain


def test_gains_are_how_the_fit_moves_with_each_velocity():
    time, velocity, _ = air_circle()
    rng = np.random.default_rng(1)
    velocity += 0.05 * rng.standard_normal(velocity.shape)
    solution, _, unit, gain = fitted(velocity, time, 0.3)
    for i in (0, 40, 100):
        for axis in range(2):
            moved = velocity.copy()
            moved[i, axis] += 0.05
            by_difference = (fitted(moved, time, 0.3)[0] - solution) / 0.05
            assert by_difference == pytest.approx(gain[i] * unit[i, axis], abs=2e-3)


def test_correlated_errors_are_summed_over_all_pairs():
    time, velocity, _ = air_circle()
    _, inverse, unit, gain = fitted(velocity, time, 0.3)
    covariance = np.empty((4, 4))
    n = len(time)
    wind_covariance(time, unit, gain, np.full(n, 0.09), 0.16, 10.0, 0.5, 3.0, 0.1, inverse,
                    covariance)  # fmt: skip
    apart = np.abs(time[:, None] - time)
    alike = 0.16 * (unit @ unit.T) * np.exp(-apart / 10.0) + 0.5 * np.exp(-apart / 3.0)
    pairs = gain.T @ (alike + 0.09 * np.eye(n)) @ gain
    assert covariance == pytest.approx(
        pairs + np.outer(inverse[:, 3], inverse[:, 3]) / 0.1**2, rel=1e-9
    )


@pytest.mark.parametrize("name", study.CASES)
def test_the_true_wind_is_inside_what_is_stated(name):
    assert study.missed_wind_bars({name: study.wind_accuracy(study.CASES[name], 100)}) == []


@pytest.mark.slow
def test_the_true_wind_is_inside_what_is_stated_in_1000_turns_of_each_kind(capsys):
    assert main(["wind-study"]) == 0
    assert "All bars hold." in capsys.readouterr().out


def test_an_error_that_nobody_knows_of_is_understated_and_the_study_says_so(capsys):
    class Untold(study.Conditions):
        settings = WindSettings(airspeed_wander=0.0)

    found = study.wind_accuracy(Untold(wander=0.05), 60)
    assert found.covered < 0.5
    name = "airspeed varies once a turn, 2 %"
    assert study.missed_wind_bars({name: found})
    assert main(["wind-study", "--runs", "20", "--json"]) in (0, 1)
    assert '"covered"' in capsys.readouterr().out


# --- the window ----------------------------------------------------------------------------------


def orbit_at(time, radius, speed):
    return Orbit(
        time, 0.0, np.zeros(3), radius, speed / radius, 1, 0.0, 0.0, 0.0, TURN, 100, np.eye(6)
    )


@pytest.mark.parametrize("rate", [1.0, 5.0, 50.0])
def test_at_any_rate_the_last_turn_is_kept_and_what_was_flown_before_does_not_count(rate):
    kept = WindEstimator(SURE)
    for i in range(5000):  # long straight flight, slower than the circle
        kept.add(0.02 * i - 100.0, (12.0, 0.0, 0.0))
    flight = fly([arc(100, 1.5)], 20, np.random.default_rng(4), rate=rate, wind=AIR)
    for time, velocity in zip(flight.time, flight.velocity, strict=True):
        kept.add(time, velocity, 0.3)
    kept.begin()
    speed = 1.5 * TURN * 100 / flight.time[-1]
    orbit = orbit_at(flight.time[-1], 100, speed)
    assert kept.estimate(orbit).velocity == pytest.approx(AIR, abs=0.4)
    kept.reset()
    assert kept.estimate(orbit) is None


def test_an_orbit_that_is_begun_anew_and_then_reaches_further_back_has_its_whole_turn():
    kept, fresh = WindEstimator(SURE), WindEstimator(SURE)
    flight = fly([arc(100, 1.0)], 20, np.random.default_rng(4), rate=5.0, wind=AIR)
    for time, velocity in zip(flight.time, flight.velocity, strict=True):
        kept.add(time, velocity, 0.3)
        fresh.add(time, velocity, 0.3)
    whole = orbit_at(flight.time[-1], 100, TURN * 100 / flight.time[-1])
    half = replace(whole, start_time=0.5 * flight.time[-1])
    kept.begin()
    short = kept.estimate(half).velocity
    kept.begin()
    long = kept.estimate(whole).velocity
    assert long == pytest.approx(fresh.estimate(whole).velocity, abs=1e-12)
    assert short != pytest.approx(long, abs=1e-3)


@pytest.mark.parametrize("towards", [0.4, 3.5])
def test_behind_a_wind_that_changes_the_lag_counts_as_an_error(towards):
    kept, random = WindEstimator(), np.random.default_rng(5)
    airspeed, radius = 20.0, 64.0
    rate = airspeed / radius  # a turn in 20 s
    rises = 0.1 * np.array([cos(towards), sin(towards)])  # 4 m/s in 40 s
    inside, widened = {False: [], True: []}, []
    for time in np.arange(0.0, 160.0, 0.2):
        true = AIR + rises * np.clip(time - 80.0, 0.0, 40.0)
        along = np.array([cos(rate * time), sin(rate * time)])
        kept.add(time, true + airspeed * along + 0.3 * random.standard_normal(2), 0.3)
        found = kept.estimate(orbit_at(time, radius, airspeed))
        if found is None or time < 25.0:
            continue
        off = found.velocity - true
        changes = 95.0 < time < 140.0  # and a turn more; half a turn shows that it does
        inside[changes].append(off @ np.linalg.solve(found.covariance, off) < 5.99)
        if time < 80.0:
            widened.append(worst_sigma(found.covariance))
    assert np.mean(inside[True]) > 0.85  # a mean of the turn, 1 m/s behind
    assert np.mean(inside[False]) > 0.9
    assert max(widened) < 1.3 * min(widened)


def test_samples_without_a_velocity_tell_nothing_and_raise_nothing():
    kept = WindEstimator()
    for i in range(400):
        kept.add(0.2 * i, None if i % 2 else (nan, 3.0, 0.0))
    assert kept.estimate(orbit_at(80.0, 100, 20)) is None


# --- whose wind is believed ----------------------------------------------------------------------


def shown(velocity, sigma=0.4, time=0.0):
    return FlightWind(
        time, np.array(velocity, float), sigma**2 * np.eye(2), 20.0, 0.2, "constant airspeed"
    )


def test_the_autopilots_wind_is_used_while_it_is_fresh_then_the_flights_then_the_users():
    choice = WindChoice(user_wind(SetWind(5.0, 270.0, 2.0)))
    by_user = choice.at(0.0)
    assert by_user.source is WindSource.PARAMETER
    assert by_user.velocity == pytest.approx([5.0, 0.0])  # from the west, towards the east
    choice.shown(shown([4.0, -5.0]))
    assert choice.at(0.0).source is WindSource.FLIGHT
    choice.told(0.0, (4.2, -5.6, 0.0), nan)
    assert choice.at(FRESH).source is WindSource.AUTOPILOT
    assert "the flight shows 6.4 m/s from 321 deg" in choice.at(FRESH).note
    assert choice.at(FRESH + 0.1).source is WindSource.FLIGHT
    # Its variance grows with its age: by 1 m/s in 100 s.
    assert choice.at(100.0).sigma == pytest.approx(sqrt(0.4**2 + 1.0))
    assert choice.at(300.0).source is WindSource.PARAMETER
    choice.reset()
    assert choice.at(0.0).source is WindSource.PARAMETER
    assert WindChoice().at(0.0) is None
    assert user_wind(SetWind()) is None


@pytest.mark.parametrize(
    ("by_user", "then"),
    [(None, WindSource.FLIGHT), (user_wind(SetWind(5.0, 270.0, 2.0)), WindSource.PARAMETER)],
)
def test_a_contradicted_autopilot_is_not_believed_again_while_the_flights_wind_is_known(
    by_user, then
):
    choice = WindChoice(by_user)
    choice.shown(shown([4.2, -5.6]))
    # 0.4 m/s, then 1.45, 1.8 and 2.45.
    flight = WindSource.FLIGHT
    for age, source in ((0.0, flight), (195.0, flight), (300.0, then), (585.0, then)):
        choice.told(age, (-6.0, 8.0, 0.0), nan)
        assert choice.at(age).source is source
    # Then nobody knows better.
    choice.told(620.0, (-6.0, 8.0, 0.0), nan)
    assert choice.at(620.0).source is WindSource.AUTOPILOT


def test_the_flights_own_wind_is_forgotten_when_it_is_too_old():
    choice = WindChoice()
    choice.shown(shown([4.2, -5.6]))
    assert choice.at(595.0).sigma == pytest.approx(2.47, abs=0.01)
    assert choice.at(620.0) is None


def test_an_autopilot_that_the_flight_contradicts_is_not_believed():
    choice = WindChoice()
    choice.shown(shown([4.2, -5.6]))
    choice.told(0.0, (-4.0, 5.5, 0.0), nan)
    wind = choice.at(0.0)
    assert wind.source is WindSource.FLIGHT
    assert "the opposite: where it blows to" in wind.note
    choice.told(0.0, (-7.0, -7.0, 0.0), 0.5)
    assert choice.at(0.0).source is WindSource.FLIGHT
    assert "opposite" not in choice.at(0.0).note


def test_an_autopilots_wind_without_an_error_is_known_no_better_than_it_has_changed_lately():
    # It begins at nought and converges: 6 m/s within 20 s.
    choice = WindChoice()
    for t in np.arange(0.0, 21.0):
        choice.told(t, (0.3 * t + 0.1, 0.0, 0.0), nan)
    assert choice.at(20.0).velocity == pytest.approx([6.1, 0.0])
    assert choice.at(20.0).sigma == pytest.approx(hypot(1.5, 6.0))
    # Contradicted it is by what it says now.
    choice.shown(shown([-6.0, 0.0], time=20.0))
    assert choice.at(20.0).source is WindSource.FLIGHT
    # A minute without a change, and it is as well known as before; so is one that states it.
    for t in np.arange(21.0, 82.0):
        choice.told(t, (6.1, 0.0, 0.0), nan)
    choice.shown(shown([6.0, 0.0], time=81.0))
    assert choice.at(81.0).sigma == pytest.approx(1.5)
    choice.told(82.0, (1.0, 0.0, 0.0), 0.5)
    assert choice.at(82.0).sigma == pytest.approx(0.4, abs=0.02)  # the flight's
    # Clocks that go back begin anew.
    choice.told(3.0, (1.0, 0.0, 0.0), nan)
    choice.reset()
    choice.told(3.0, (1.0, 0.0, 0.0), nan)
    assert choice.at(3.0).sigma == pytest.approx(1.5)


def test_no_wind_sent_as_nought_is_not_known_and_a_poor_estimate_is_not_used():
    choice = WindChoice()
    choice.told(0.0, (0.0, 0.0, 0.0), nan)
    choice.told(0.0, (nan, 1.0, 0.0), nan)
    choice.shown(shown([4.0, -5.0], sigma=2.0))
    choice.shown(None)
    assert choice.at(0.0) is None


def test_direction_and_strength_are_told_as_where_it_blows_from():
    wind = Wind(np.array([0.0, -7.0]), np.diag([0.04, 0.25]), WindSource.FLIGHT)
    assert described(wind) == "7.0 m/s from 0 deg"
    assert wind.sigma == pytest.approx(0.5)


# --- in the prediction ---------------------------------------------------------------------------


def wind_texts(prediction):
    return [w.text for w in prediction.warnings if w.code is WarningCode.WIND_UNMODELLED]


@pytest.mark.parametrize("place", ["north", "south"])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_prediction_says_how_much_wind_there_is_and_by_whom(place, sense):
    blows_from = radians(230.0)
    air = (-4.0 * sin(blows_from), -4.0 * cos(blows_from))
    flight = orbiting(turns=1.5, sense=sense, wind=air)
    predictor = Predictor(load_configuration("small_drone"))
    found = [p for p in map(predictor.update, samples_of(flight, place)) if p.valid]
    # Once its motion is solved: not at the end of the flight, where the orbit may be another.
    last = [p for p in found if p.end_mass.in_wind is not None][-1]
    assert last.time > found[-10].time
    assert last.wind.source is WindSource.FLIGHT
    assert last.wind.velocity == pytest.approx(air, abs=0.2)
    assert "constant airspeed" in last.wind.note
    assert not wind_texts(last)  # it is modelled
    off = (last.end_mass.circle_center - last.orbit.center)[:2]
    assert off @ air > 0.7 * 4.0 * np.hypot(*off) > 20.0  # downwind, in either hemisphere
    record = prediction_record(last)
    assert record["wind_source"] == "flight"
    assert record["wind_from_deg"] == pytest.approx(230.0, abs=4.0)
    assert record["wind_speed_m_s"] == pytest.approx(4.0, abs=0.2)
    # Where it is unknown the same names say so.
    assert set(wind_fields(None)) == set(wind_fields(last.wind))
    assert record["wind_modelled"]


def test_the_autopilots_wind_comes_through_the_sample():
    flight = orbiting(turns=1.0, wind=(0.0, 4.0))
    predictor = Predictor(load_configuration("small_drone"))
    samples = [replace(s, wind=(0.2, 4.2, 0.0), wind_accuracy=0.5) for s in samples_of(flight)]
    last = [p for p in map(predictor.update, samples) if p.valid][-1]
    assert last.wind.source is WindSource.AUTOPILOT
    assert last.wind.covariance == pytest.approx(0.25 * np.eye(2))
    assert "the flight shows" in last.wind.note


def test_of_the_real_flight_the_wind_message_is_the_opposite_of_what_the_turn_shows():
    from pathlib import Path

    from ctcbs_ros.telemetry.source import open_log

    log = Path(__file__).parents[2] / "shared/flights/plane_real_wind.tlog"
    if not log.exists():
        pytest.skip(f"{log} is not here")
    # A 2012 firmware: WIND says 6 m/s from about 200 deg. Ground speed falls from 26 m/s on
    # south-westerly courses to 9 m/s on north-easterly ones: the air moves towards the south-west.
    predictor = Predictor(load_configuration("small_drone"))
    source, found = open_log(log), []
    for sample in source:
        p = predictor.update(replace(sample, wind=source.wind, wind_accuracy=nan))
        if p.orbit is not None and p.orbit.arc > 0.9 * TURN and p.wind is not None:
            found.append(p)
    last = found[-1]
    assert last.wind.source is WindSource.FLIGHT
    assert last.wind.speed == pytest.approx(7.0, abs=1.0)
    assert last.wind.from_direction == pytest.approx(35.0, abs=15.0)
    assert "the opposite: where it blows to" in last.wind.note
