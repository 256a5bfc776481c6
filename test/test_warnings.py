"""Each warning is raised when it is due, and only then."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from folding_flight import UNIT_SPEED, folding_configuration, taut_inside
from sample_flights import orbiting, samples_of

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.orbit.wind import Wind, WindSource
from ctcbs_ros.prediction.branch import Tracked
from ctcbs_ros.prediction.codes import Level, WarningCode
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import prediction_record
from ctcbs_ros.prediction.tally import Tally
from ctcbs_ros.prediction.warnings import (
    WIND_NOT_KNOWN,
    end_mass_warnings,
    skip_warnings,
    tracking_warnings,
    wind_warnings,
)
from ctcbs_ros.prediction.wind_reasons import STILL_SOLVED, kind_of_reason
from ctcbs_ros.telemetry.skip_code import SkipCode

DRONE = load_configuration("small_drone")
FLIGHT = orbiting()
ERRORS = {
    WarningCode.STALE_TELEMETRY, WarningCode.NO_SOLUTION, WarningCode.JUMPED,
    WarningCode.UNSTABLE, WarningCode.TENSION_LIMIT, WarningCode.GROUND_PROXIMITY,
}  # fmt: skip


def predict(samples, configuration=DRONE):
    predictor = Predictor(configuration)
    return [predictor.update(sample) for sample in samples]


def codes(*predictions):
    return {w.code for p in predictions for w in p.warnings}


@pytest.fixture(scope="module")
def calm():
    return predict(samples_of(FLIGHT, wind=(0.0, 0.0)))


@pytest.fixture(scope="module")
def orbit(calm):
    return next(p.orbit for p in reversed(calm) if p.valid)


@pytest.fixture(scope="module")
def end_mass(calm):
    return [p for p in calm if p.valid][-1].end_mass


def limited(**limits):
    return replace(DRONE.limits, **limits)


def of_end_mass(end_mass, limits=DRONE.limits, cable=DRONE.cable, **changed):
    """Codes of the warnings about an end mass with some figures changed."""
    state = {k: changed.pop(k) for k in list(changed) if k in vars(end_mass.state)}
    margin = {k: changed.pop(k) for k in list(changed) if k in vars(end_mass.in_wind.margin)}
    in_wind = replace(end_mass.in_wind, margin=replace(end_mass.in_wind.margin, **margin))
    state = replace(end_mass.state, **state)
    changed = replace(end_mass, state=state, in_wind=in_wind, **changed)
    return {w.code for w in end_mass_warnings(changed, cable, limits)}


def test_a_calm_flight_ends_its_orbit_without_a_warning(calm):
    flown = [p for p in calm if p.valid]
    assert codes(flown[-30]) == set()
    assert codes(*calm) == {WarningCode.NOT_ORBITING}


def test_each_warning_has_its_level_and_one_line():
    flights = [
        predict(samples_of(FLIGHT), replace(DRONE, limits=limited(low_margin_per_s=9.0))),
        predict(samples_of(orbiting(height=100.0, wind=(4.0, 0.0)))),
        predict(samples_of(orbiting(100.0, UNIT_SPEED, 3.0, height=600.0, rate=3.0,
                                    radius_change=(94.0, 1.5))), folding_configuration()),
    ]  # fmt: skip
    seen = [w for flight in flights for p in flight for w in p.warnings]
    assert len({w.code for w in seen}) >= 7
    for warning in seen:
        assert warning.level is (Level.ERROR if warning.code in ERRORS else Level.WARN)
        assert warning.text
        assert "\n" not in warning.text


def test_not_orbiting_is_said_exactly_where_there_is_no_orbit(calm):
    for prediction in calm:
        assert (WarningCode.NOT_ORBITING in codes(prediction)) == (prediction.orbit is None)


def test_stale_telemetry_is_said_once_after_a_gap():
    samples = [s for s in samples_of(FLIGHT) if not 30.0 <= s.time < 33.0]
    stale = [p.time for p in predict(samples) if WarningCode.STALE_TELEMETRY in codes(p)]
    assert stale == [33.0]


def test_bad_fix_is_said_of_what_a_sample_says_and_not_of_when_it_came():
    samples = samples_of(FLIGHT)
    samples[100] = replace(samples[100], fix_type=1)
    samples[110] = replace(samples[110], latitude=nan)
    samples[120] = replace(samples[120], latitude=samples[120].latitude + 0.1)
    samples[130] = samples[129]
    predictions = predict(samples)
    bad = [i for i, p in enumerate(predictions) if WarningCode.BAD_FIX in codes(p)]
    assert bad == [100, 110, 120]
    assert predictions[130].skip is SkipCode.DUPLICATE
    assert {skip for skip in SkipCode if not skip_warnings(skip)} == {
        SkipCode.DUPLICATE, SkipCode.OUT_OF_ORDER, SkipCode.AHEAD,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("radius", "speed", "words"),
    [(125.0, 20.0, "tow radius 12"), (80.0, 29.0, "speed 2"), (80.0, 20.0, None)],
)
def test_outside_the_envelope_is_said_of_radius_and_of_speed(radius, speed, words):
    flight = orbiting(radius, speed, turns=1.2)
    predictions = predict(samples_of(flight))
    told = [
        w.text for p in predictions for w in p.warnings
        if w.code is WarningCode.OUTSIDE_ENVELOPE
    ]  # fmt: skip
    assert bool(told) == (words is not None)
    assert all(words in text for text in told)


def test_no_solution_says_why():
    nothing = Tracked(None, "", (), "full solve", 0, "the cable is slack")
    (warning,) = tracking_warnings(nothing, 80.0)
    assert (warning.code, warning.text) == (WarningCode.NO_SOLUTION, "the cable is slack")


def test_other_steady_states_are_told_with_their_radii_in_metres_and_their_stability(end_mass):
    others = (
        replace(end_mass.state, radius=61.26, stable=False),
        replace(end_mass.state, radius=75.0, stable=True),
    )
    many = replace(end_mass, branch="main", others=others)
    (warning,) = end_mass_warnings(many, DRONE.cable, DRONE.limits)
    assert warning.code is WarningCode.MULTIPLE_SOLUTIONS
    assert f"branch 'main', circle of {end_mass.state.radius:.1f} m (stable)" in warning.text
    assert warning.text.endswith("61.3 m (unstable), 75.0 m (stable)")


def test_a_jump_is_told_with_the_radius_in_metres(end_mass):
    flight = orbiting(100.0, UNIT_SPEED, 3.0, height=600.0, rate=3.0, radius_change=(94.0, 1.5))
    predictions = predict(samples_of(flight), folding_configuration())
    (jumped,) = [p for p in predictions if WarningCode.JUMPED in codes(p)]
    (warning,) = [w for w in jumped.warnings if w.code is WarningCode.JUMPED]
    assert warning.text.endswith(f"a circle of {jumped.end_mass.state.radius:.1f} m")


def test_a_gap_that_is_over_is_told_as_one():
    samples = [s for s in samples_of(FLIGHT) if not 30.0 <= s.time < 33.0]
    told = [
        w.text for p in predict(samples) for w in p.warnings
        if w.code is WarningCode.STALE_TELEMETRY
    ]  # fmt: skip
    assert told == ["a gap without positions, of 3.2 s (limit 2 s)"]
    assert Predictor(DRONE).stale(3.2).text == "no position for 3.2 s (limit 2 s)"


def test_no_direction_is_told_of_a_wind_weaker_than_its_error(orbit):
    for east, told in ((2.0, False), (4.0, True)):
        air = Wind(np.array([east, 0.0]), 9.0 * np.eye(2), WindSource.PARAMETER)
        (warning,) = wind_warnings(air, orbit)
        assert ("from 270 deg" in warning.text) is told


def test_near_jump_watches_speed_and_radius_whichever_is_nearer(end_mass):
    limits = limited(near_jump=0.1)

    def of(speed=None, radius=None):
        jumps = {
            "jump_in_speed": speed and Jump(20.0 * (1.0 + speed), speed, 30.0),
            "jump_in_radius": radius and Jump(80.0 * (1.0 + radius), radius, 30.0),
        }
        return end_mass_warnings(replace(end_mass, **jumps), DRONE.cable, limits)

    assert of() == of(speed=0.11, radius=-0.12) == []
    (warning,) = of(speed=-0.09, radius=0.12)
    assert warning.code is WarningCode.NEAR_JUMP
    assert "speed of 18.2 m/s (-9.0%)" in warning.text
    (warning,) = of(speed=-0.09, radius=0.05)
    assert "tow radius of 84.0 m (+5.0%)" in warning.text
    lost = replace(end_mass, jump_in_speed=Jump(21.0, 0.05, nan))
    (warning,) = end_mass_warnings(lost, DRONE.cable, limits)
    assert "no stable state" in warning.text


def test_unstable_takes_the_place_of_low_margin(end_mass):
    assert of_end_mass(end_mass, limited(low_margin_per_s=0.05), per_second=0.051) == set()
    low = of_end_mass(end_mass, limited(low_margin_per_s=0.05), per_second=0.049)
    assert low == {WarningCode.LOW_MARGIN}
    unstable = of_end_mass(end_mass, per_second=-0.01)
    assert unstable == {WarningCode.UNSTABLE}


def test_flutter_is_called_unstable():
    # Thesis Fig. 4.1 (m 3.5, l 3, f 0.1, d_n 1.33): unstable for 1.8 < omega < 2.2, stable below.
    configuration = folding_configuration(d_n=1.33, m=3.5, f=0.1, speed=(26.0, 80.0))
    for omega, unstable in ((1.4, False), (2.0, True)):
        flight = orbiting(100.0, omega * UNIT_SPEED, 1.3, height=900.0)
        flown = [p for p in predict(samples_of(flight), configuration) if p.valid]
        assert (WarningCode.UNSTABLE in codes(flown[-10])) is unstable
        assert flown[-10].end_mass.state.stable is not unstable
        assert (flown[-10].end_mass.settling_time == inf) is unstable


def test_tension_is_judged_against_the_fraction_of_the_breaking_tension(end_mass):
    cable = replace(DRONE.cable, breaking_tension=100.0)
    limits = limited(tension_fraction=0.5)
    assert of_end_mass(end_mass, limits, cable, greatest_tension=49.9) == set()
    above = of_end_mass(end_mass, limits, cable, greatest_tension=50.1)
    assert above == {WarningCode.TENSION_LIMIT}
    unknown = replace(DRONE.cable, breaking_tension=inf)
    assert of_end_mass(end_mass, limits, unknown, greatest_tension=1e6) == set()


def texts_of(end_mass, **changed):
    state = replace(end_mass.state, **{k: v for k, v in changed.items() if "tension" in k})
    rest = {k: v for k, v in changed.items() if "tension" not in k}
    cable = replace(DRONE.cable, breaking_tension=100.0)
    changed = replace(end_mass, state=state, **rest)
    limits = limited(tension_fraction=0.5, minimum_height=20.0)
    return [w.text for w in end_mass_warnings(changed, cable, limits)]


def test_tension_beyond_breaking_and_a_mass_below_ground_are_said_to_be_so(end_mass):
    assert texts_of(end_mass, greatest_tension=99.0) == [
        "tension 99.0 N is above 50 % of the breaking tension 100 N"
    ]
    assert texts_of(end_mass, greatest_tension=101.0) == [
        "tension 101.0 N is above the breaking tension 100 N"
    ]
    assert texts_of(end_mass, height_above_home=12.0) == [
        "end mass 12 m above home (limit 20 m above)"
    ]
    assert texts_of(end_mass, height_above_home=-12.0) == [
        "end mass 12 m BELOW home (limit 20 m above)"
    ]


def test_a_cable_overloaded_only_between_its_ends_is_warned_of():
    for share, warned in ((0.85, True), (1.1, False)):
        configuration, speed = taut_inside(share)
        flight = orbiting(100.0, speed, 1.3, height=900.0)
        last = [p for p in predict(samples_of(flight), configuration) if p.valid][-10]
        state, limit = last.end_mass.state, 0.5 * configuration.cable.breaking_tension
        assert max(state.tension_tow_point, state.tension_end_mass) < 0.93 * limit
        assert (WarningCode.TENSION_LIMIT in codes(last)) is warned


def test_ground_proximity_is_below_the_minimum_height_and_silent_where_no_height_is_known(
    end_mass,
):
    limits = limited(minimum_height=20.0)
    assert of_end_mass(end_mass, limits, height_above_home=20.1) == set()
    near = {WarningCode.GROUND_PROXIMITY}
    assert of_end_mass(end_mass, limits, height_above_home=19.9) == near
    assert of_end_mass(end_mass, limits, height_above_home=-50.0) == near
    assert of_end_mass(end_mass, limits, height_above_home=nan) == set()


@pytest.mark.parametrize(("ground", "near"), [(nan, False), (190.0, True), (170.0, False)])
def test_ground_proximity_is_of_the_end_mass_above_home_or_the_set_ground(ground, near):
    # 200 m above home at 100 m AMSL, the end mass about 97 m lower.
    configuration = replace(DRONE, limits=limited(ground_level_amsl=ground))
    predictions = predict(samples_of(orbiting(height=200.0)), configuration)
    assert (WarningCode.GROUND_PROXIMITY in codes(*predictions)) is near


def test_wind_is_told_from_the_ground_speed_and_modelled():
    flight = orbiting(turns=2.0, wind=(0.0, 4.0))
    last = [p for p in predict(samples_of(flight, wind=(0.0, 4.0))) if p.valid][-30]
    assert WarningCode.WIND_UNMODELLED not in codes(last)
    assert last.end_mass.in_wind is not None
    off = last.end_mass.circle_center - last.orbit.center
    assert off[1] > 20.0  # the small drone's end mass, downwind


def test_wind_without_a_periodic_motion_is_told_with_the_reason():
    # A cable that does not stretch.
    cable = replace(DRONE.cable, youngs_modulus=inf)
    flight = orbiting(turns=2.0, wind=(0.0, 4.0))
    samples = samples_of(flight, wind=(0.0, 4.0))
    last = [p for p in predict(samples, replace(DRONE, cable=cable)) if p.valid][-30]
    (text,) = (w.text for w in last.warnings if w.code is WarningCode.WIND_UNMODELLED)
    assert "m/s from 180 deg" in text
    assert "by the flight" in text
    assert "a cable that stretches" in text
    assert "do not use it" in text
    assert "ground" in text
    assert last.end_mass.in_wind is None


def test_in_a_wind_without_the_motion_in_it_nothing_holds_and_the_ground_is_not_judged():
    # No wind is told without velocities; in still air the end mass is far below the limit.
    cable = replace(DRONE.cable, youngs_modulus=inf)
    low = replace(DRONE, cable=cable, limits=limited(minimum_height=1000.0))
    flight, told = orbiting(turns=1.5), WarningCode.GROUND_PROXIMITY
    samples = samples_of(flight, velocities=False)
    windy = [replace(sample, wind=(0.0, 8.0, 0.0), wind_accuracy=0.5) for sample in samples]
    for flown, holds in ((samples, True), (windy, False)):
        last = [p for p in predict(flown, low) if p.valid][-30]
        assert WarningCode.WIND_UNMODELLED in codes(last)
        assert last.pose_holds is holds
        assert (told in codes(last)) is holds
        record = prediction_record(last)
        assert record["pose_holds"] is holds
        for place in (
            "end_mass_lowest_above_home_m", "end_mass_east_m", "end_mass_east_std_m",
            "end_mass_yaw_rad", "end_mass_height_above_home_m", "end_mass_mean_up_m",
            "end_mass_excursion_m",
        ):  # fmt: skip
            assert (record[place] is not None) is holds
        assert record["end_mass_radius_m"] is not None
        assert (record["wind_unmodelled_because"] is None) is holds
        assert replace(last.end_mass, time_on_orbit=1e9).settled is holds
    tally = Tally()
    for prediction in predict(windy, low):
        tally.add(prediction)
    assert tally.as_dict()["wind_unmodelled_because"] == {
        last.end_mass.unmodelled_because: tally.predictions
    }
    assert "youngs_modulus" in last.end_mass.unmodelled_because


def test_a_wind_in_which_no_motion_is_found_is_told_by_its_share_of_the_speed():
    samples = samples_of(orbiting(turns=2.0), velocities=False)
    windy = [replace(sample, wind=(0.0, 10.0, 0.0), wind_accuracy=0.5) for sample in samples]
    found = [p for p in predict(windy) if p.valid]
    assert not found[0].pose_holds
    assert found[0].end_mass.unmodelled_because == STILL_SOLVED
    because = found[-30].end_mass.unmodelled_because
    assert because.startswith("no motion found in this wind, 0.50 of the mean speed")
    assert "Newton" not in because
    assert kind_of_reason(because) == kind_of_reason(because.replace("0.50", "0.61"))


def test_what_looks_like_still_air_is_not_known_to_be_still_without_an_airspeed():
    # A ground speed that is held looks the same in any wind.
    flown = [p for p in predict(samples_of(orbiting(turns=2.0))) if p.valid]
    assert flown[-30].wind is None
    assert any(w.text.startswith(WIND_NOT_KNOWN) for w in flown[-30].warnings)


def test_samples_with_wind_are_counted_apart_from_those_where_it_is_not_known(calm, orbit):
    windy = Tally()
    for prediction in calm[:10]:
        for east in (nan, 0.02, 4.0, 6.0):
            wind = Wind(np.array([east, 0.0]), 0.01 * np.eye(2), WindSource.FLIGHT)
            told = wind_warnings(wind if east > 0.0 else None, orbit)
            windy.add(replace(prediction, warnings=tuple(told)))
    assert windy.as_dict()["warnings"] == {"WIND_UNMODELLED": 30}
    assert windy.as_dict()["wind_seen"] == 20


def test_a_circle_that_drifts_with_the_air_is_in_still_air(orbit):
    flight, wind = orbiting(turns=2.0), np.array([-3.0, 4.0])
    flight.position[:, :2] += np.outer(flight.time, wind)
    flight.velocity[:, :2] += wind
    flown = [p for p in predict(samples_of(flight)) if p.valid and p.orbit.drift.any()]
    assert len(flown) > 30
    assert WarningCode.WIND_UNMODELLED not in codes(*flown)
    # Half that drift is half the wind past the circle.
    air = Wind(wind, 0.01 * np.eye(2), WindSource.FLIGHT)
    (warning,) = wind_warnings(air, replace(orbit, drift=0.5 * wind))
    assert "wind 5.0 m/s from 143 deg" in warning.text
    assert "2.5 m/s past a drifting circle" in warning.text


def test_before_a_drift_can_be_seen_the_wind_past_the_circle_may_be_all_of_it_or_none():
    # A third of the square of what is between still air and the motion in all of the wind.
    told = [replace(s, wind=(0.0, 2.0, 0.0), wind_accuracy=0.05)
            for s in samples_of(orbiting(turns=1.5))]  # fmt: skip
    flown = [p for p in predict(told) if p.valid and p.end_mass.in_wind]
    seen = [bool(np.isfinite(p.orbit.covariance[7, 7])) for p in flown]
    assert 10 < seen.index(True) < len(seen) - 30

    def share(p):
        displaced = np.mean(p.end_mass.in_wind.path - p.orbit.center, axis=0)[:2]
        return displaced @ p.end_mass.covariance[:2, :2] @ displaced / (displaced @ displaced) ** 2

    early = [share(p) for p in flown[: seen.index(True)]]
    assert np.mean(early) == pytest.approx(1.0 / 3.0, rel=0.4)
    assert min(early) > 0.1
    assert share(flown[-10]) < 0.02  # the last lie where it leaves the circle


def test_a_wind_that_is_hardly_known_is_told(orbit):
    unsure = Wind(np.array([0.2, 0.0]), 9.0 * np.eye(2), WindSource.PARAMETER)
    (warning,) = wind_warnings(unsure, orbit)
    assert "+- 3.0 m/s (by parameters)" in warning.text


def test_wind_is_said_to_be_unknown_until_it_can_be_seen(orbit):
    (warning,) = wind_warnings(None, orbit)
    assert warning.text == WIND_NOT_KNOWN
    flown = [p for p in predict(samples_of(FLIGHT, velocities=False)) if p.valid]
    assert all(WarningCode.WIND_UNMODELLED in codes(p) for p in flown)
