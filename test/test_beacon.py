"""Measured minus predicted position of a payload with a beacon, held against known truths."""

import csv
import json
import re
from dataclasses import replace
from math import nan

import faults_log
import numpy as np
import pytest
from beacon_flight import DRONE, OFFSET, SYSTEM, TURN, errors, fly
from pymavlink.dialects.v20 import all as dialect
from scipy.stats import chi2

from ctcbs_ros.beacon.comparer import place_of
from ctcbs_ros.beacon.comparison import Standing, Unmatched
from ctcbs_ros.beacon.difference import REGION_95, difference
from ctcbs_ros.beacon.motion import LONGEST_GAP, Motion, Place
from ctcbs_ros.beacon.record import comparison_record
from ctcbs_ros.beacon.statistics import DifferenceStatistics
from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.cli.main import main
from ctcbs_ros.replay.text import STANDINGS, UNMATCHED, _beacon_lines
from ctcbs_ros.telemetry.beacon import BeaconWanted
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.source import open_log

# In the last turn nothing is left of the entry: then the cable in time and the predictor, which
# share no code, agree to this [m]; the logs' positions are in steps of 1.1 cm.
AGREE = 0.06
SETTLED_FOR = 55.0  # s after the first settled prediction
SPEED = 10.3  # m/s of the end mass, on a circle of 31 m
LATER = 0.02  # s by which the beacon's messages take longer than the aircraft's


@pytest.fixture(scope="module")
def table(drone_table):
    from beacon_flight import STILL

    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.table.storage import load_table

    return load_table(drone_table, load_configuration(DRONE, STILL))


@pytest.fixture(scope="module")
def flight(tmp_path_factory, table):
    return fly(tmp_path_factory.mktemp("beacon"), table, turns=6.0, with_twin=True)


# --- the flight ---------------------------------------------------------------------------------


def last_turn(found):
    """Errors while nothing is left of the entry, and before the exit is noticed."""
    all_of_it = errors(found, SETTLED_FOR)
    return all_of_it[: int(0.7 * TURN * 5)]


def test_what_the_beacon_is_wrong_by_comes_back_as_the_difference(flight):
    found, tally = flight.clean
    assert tally.outcomes[Standing.SETTLED] > 300
    assert np.abs(last_turn(found)).max() < AGREE
    assert tally.reports == sum(tally.outcomes.values()) == len(found)
    # a difference of 3.7 m is no error that the beacon states (0.1 m), nor its time explains
    late = [one for one in found if one.settled][-200:]
    assert np.mean([one.predicted.inside_95 for one in late]) < 0.1


def _without_offset(one):
    """In stated standard deviations, of what the beacon is wrong by known."""
    return difference(one.predicted.enu, OFFSET, one.predicted.covariance).distance


def test_what_is_left_of_the_entry_lies_inside_the_stated_error_from_the_first_to_the_last(flight):
    """By the margin of still air it decays from a cable's length: here 122 m, at 0.110 1/s."""
    found, tally = flight.clean
    settled = [one for one in found if one.settled]
    off = np.linalg.norm([one.predicted.enu - OFFSET for one in settled[:20]], axis=1)
    assert off.min() > 3.0  # metres, where 0.1 m is stated of the beacon
    assert max(map(_without_offset, settled)) ** 2 < REGION_95
    # and no more than that: the share is gone with the entry
    assert np.sqrt(settled[-1].predicted.covariance[0, 0]) < 2.1
    figures = tally.predicted[Standing.SETTLED].as_dict()
    off = np.subtract(figures["mean_m"], OFFSET)
    assert 0.2 < np.abs(off).max() < 1.0
    assert (np.abs(off) < figures["mean_std_m"]).all()


def test_no_report_after_the_exit_began_counts_as_settled(flight):
    """The orbit is seen for some seconds longer: it is fitted through a turn."""
    found, tally = flight.clean
    orbit = [p.orbit for p in flight.predictions if p.orbit is not None][-20]
    away = [
        abs(np.hypot(*(p.tow_point - orbit.center)[:2]) - orbit.radius) for p in flight.predictions
    ]
    left = flight.predictions[np.flatnonzero(np.array(away) < 0.1)[-1]].time
    last = [p for p in flight.predictions if p.valid][-1]
    assert last.end_mass.settled
    assert last.time > left + 1.0
    settled = [one.time for one in found if one.settled]
    assert left - 0.35 * TURN < settled[-1] < left
    unconfirmed = [one for one in found if one.outcome is Standing.UNCONFIRMED]
    assert min(one.time for one in unconfirmed) > settled[-1]
    assert len(unconfirmed) == pytest.approx(0.25 * TURN * 5, abs=2)
    assert tally.predicted[Standing.UNCONFIRMED].count == len(unconfirmed)


def test_a_log_that_ends_on_a_circle_leaves_its_last_quarter_turn_unconfirmed(flight, tmp_path):
    start = flight.log[0].time_us
    log = [one for one in flight.log if one.time_us <= start + 100_000_000]
    cut = tmp_path / "cut.tlog"
    cut.write_bytes(faults_log.as_bytes(log))
    heard = sum(1 for _ in open_log(cut, system=1))
    _, tally = replace(flight, predictions=flight.predictions[:heard]).compared(log)
    assert tally.outcomes[Standing.UNCONFIRMED] == pytest.approx(0.25 * TURN * 5, abs=2)


def test_clockwise_comes_back_as_well(tmp_path, table):
    found, _ = fly(tmp_path, table, sense=-1, turns=6.0).compared()
    assert np.abs(last_turn(found)).max() < AGREE


def test_in_wind_it_comes_back_as_well(tmp_path, table):
    """The end mass is metres downwind: where the periodic motion has it, at its phase."""
    found, tally = fly(tmp_path, table, turns=6.0, wind=(2.0, 0.0)).compared()
    assert tally.outcomes[Standing.SETTLED] > 200
    assert np.abs(last_turn(found)).max() < 0.5


def test_only_a_settled_prediction_counts_as_an_error(flight):
    found, tally = flight.clean
    first = next(p for p in flight.predictions if p.valid and p.end_mass.settled)
    for one in found:
        if one.outcome is Standing.SETTLED:
            assert one.time >= first.time
    settling = [one for one in found if one.outcome is Standing.SETTLING]
    assert len(settling) > 50
    assert all(one.time < first.time for one in settling)
    # On the way there it is tens of metres off: that is not counted as the prediction's error.
    worst = tally.predicted[Standing.SETTLING].as_dict()["horizontal_95_m"]
    assert worst > 5 * tally.predicted[Standing.SETTLED].as_dict()["horizontal_95_m"]
    assert tally.outcomes[Unmatched.NO_PREDICTION] > 0


def test_without_a_known_settling_time_no_prediction_counts_as_settled(flight):
    """As in a wind whose motion's stability is not known: however well damped still air is."""
    settled = [p for p in flight.predictions if p.valid and p.end_mass.settled][-1]
    length = flight.configuration.cable.length
    assert place_of(settled, length).standing == Standing.SETTLED.value
    assert settled.end_mass.state.stable
    unknown = replace(settled, end_mass=replace(settled.end_mass, settling_time=np.nan))
    assert place_of(unknown, length).standing == Standing.SETTLING.value


def test_the_twin_is_where_the_beacon_is_on_the_way_into_the_circle_as_well(flight):
    """Both are the cable in time: this is of clocks, frames and the tow point's path."""
    found, tally = flight.clean
    settling = [one for one in found if one.outcome is Standing.SETTLING]
    off = np.array([(one.predicted.enu, one.simulated.enu) for one in settling]) - OFFSET
    assert np.linalg.norm(off[:, 0], axis=1).max() > 20.0
    assert np.linalg.norm(off[:, 1], axis=1).max() < 0.4
    assert all(one.simulated_settled for one in settling)
    assert tally.simulated[Standing.SETTLED].count > tally.predicted[Standing.SETTLED].count
    began = [one for one in found if one.simulated_standing is Standing.SETTLING]
    assert len(began) == tally.simulated[Standing.SETTLING].count > 10
    assert not any(one.simulated_settled for one in began)


def test_a_simulation_in_a_wind_that_nobody_knows_is_counted_apart(flight):
    unknown = [
        replace(p, simulated=p.simulated and replace(p.simulated, wind_known=False))
        for p in flight.predictions
    ]
    _, tally = replace(flight, predictions=unknown).compared()
    assert tally.simulated[Standing.SETTLED].count == 0
    assert tally.simulated[Standing.UNMODELLED].count > 500


def test_where_wind_is_not_known_it_is_counted_apart(flight):
    unknown = [
        replace(p, warnings=(*p.warnings, _wind_warning())) if p.valid else p
        for p in flight.predictions
    ]
    _, tally = replace(flight, predictions=unknown).compared()
    assert tally.outcomes[Standing.SETTLED] == tally.outcomes[Standing.SETTLING] == 0
    assert tally.outcomes[Standing.UNMODELLED] > 300


def _wind_warning():
    from ctcbs_ros.prediction.codes import Level, Warning, WarningCode

    return Warning(WarningCode.WIND_UNMODELLED, Level.WARN, "wind is not known")


def test_the_prediction_is_taken_at_the_time_of_the_report(flight):
    """Taken at the prediction next to it, 0.07 s early, it would be 0.7 m off."""
    newest = next(p for p in reversed(flight.predictions) if p.valid)
    speed = newest.end_mass.state.radius * newest.orbit.angular_rate
    assert speed == pytest.approx(SPEED, rel=0.05)
    found, _ = flight.clean
    moving = next(one for one in reversed(found) if one.outcome is Standing.SETTLED)
    times = {round(p.time, 3) for p in flight.predictions}
    assert all(round(one.time, 3) not in times for one in found if one.time == one.time)
    assert moving.stamp_ns / 1e9 % 0.2 == pytest.approx(0.07, abs=1e-3)


def test_a_replay_writes_sums_up_and_draws_what_the_beacon_measured(
    flight, drone_table, tmp_path, capsys
):
    text = DRONE.read_text().replace("system_id: 0", f"system_id: {SYSTEM}")
    text = text.replace("speed: .nan", "speed: 0.0").replace("direction: .nan", "direction: 0.0")
    (tmp_path / "drone.yaml").write_text(text.replace("accuracy: 2.0", "accuracy: 0.2"))
    out = tmp_path / "out"
    assert main([
        "replay", str(flight.folder / "flight.tlog"), "--config", str(tmp_path / "drone.yaml"),
        "--table", str(drone_table), "--out", str(out),
    ]) == 0  # fmt: skip
    _, tally = flight.clean
    summary = json.loads((out / "summary.json").read_text())["beacon"]
    assert summary["reports"] == tally.reports
    assert summary["measured_minus_predicted"] == tally.as_dict()["measured_minus_predicted"]
    with open(out / "beacon.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == tally.reports
    settled = [row for row in rows if row["outcome"] == "settled"]
    east = np.mean([float(row["measured_minus_predicted_east_m"]) for row in settled])
    assert east == pytest.approx(summary["measured_minus_predicted"]["settled"]["mean_m"][0])
    assert float(settled[-1]["time_s"]) == pytest.approx(len(rows) / 5, abs=20)
    printed = capsys.readouterr().out
    assert f"Beacon of the payload (system {SYSTEM}, component 1): {len(rows)} reports" in printed
    assert re.search(rf"predicted, settled +{len(settled)} +\d", printed)
    assert "NO_PREDICTION" in printed
    assert (out / "beacon.png").stat().st_size > 10_000


def _right(found):
    """The difference of a prediction that is right."""
    return found and replace(found, enu=np.zeros(3), distance=0.0)


def test_a_wrong_cable_length_is_said_in_the_summary_and_a_right_one_or_a_glitch_is_not(flight):
    def summed_up(outcomes):
        tally = BeaconTally()
        for one in outcomes:
            tally.add(one)
        return "\n".join(_beacon_lines({"vehicle": None, **tally.as_dict()}))

    found = [replace(one, predicted=_right(one.predicted)) for one in flight.clean[0]]
    assert "cable.length" not in summed_up(found)
    off = summed_up(flight.clean[0])  # the beacon is wrong by 3.7 m
    assert "most is outside of where the stated errors put it: check cable.length" in off
    out = replace(found[-1], outcome=Unmatched.OUT_OF_REACH, predicted=None, simulated=None)
    assert "cable.length" not in summed_up([out] * 40 + found[50:])
    shorter = replace(flight.configuration.cable, length=80.0)
    wrong = replace(flight, configuration=replace(flight.configuration, cable=shorter))
    found, tally = wrong.compared()
    beside = len(found) - sum(
        n for code, n in tally.outcomes.items()
        if code in (Unmatched.NO_AIRCRAFT, Unmatched.NO_COMMON_TIME)
    )  # fmt: skip
    share = tally.outcomes[Unmatched.OUT_OF_REACH] / beside
    assert share > 0.1
    assert f"{100 * share:.0f} % of them are farther from the aircraft than the cable is" in (
        text := summed_up(found)
    )
    assert "check cable.length" in text.splitlines()[2]


def test_every_reason_and_standing_is_told_in_words():
    assert set(UNMATCHED) == set(Unmatched)
    assert set(STANDINGS["predicted"]) == set(Standing)
    assert set(STANDINGS["simulated"]) == set(Standing) - {Standing.UNCONFIRMED}


# --- clocks -------------------------------------------------------------------------------------


def without_system_time(log):
    return [one for one in log if one.kind != dialect.MAVLINK_MSG_ID_SYSTEM_TIME]


def test_clocks_hours_apart_are_tied_by_the_unix_time_that_both_tell(flight):
    found, tally = flight.clean
    assert set(tally.times_by) == {"Unix time"}
    assert all(one.time_sigma == 0.0 for one in found if one.time_by)


def test_without_unix_time_clocks_are_tied_by_when_messages_are_received(flight):
    found, tally = flight.compared(without_system_time(flight.log))
    assert set(tally.times_by) == {"receive times"}
    # The beacon's messages take 20 ms longer than the aircraft's: as much is its time off.
    on_time = {one.stamp_ns: one.time for one in flight.clean[0] if one.settled}
    for one in found:
        if one.settled:
            near = min(on_time, key=lambda stamp: abs(stamp - one.stamp_ns))
            assert one.time - on_time[near] == pytest.approx(LATER, abs=2e-3)
    assert np.abs(last_turn(found)).max() < AGREE + LATER * SPEED


def test_delays_that_vary_do_not_shift_the_time(flight):
    random = np.random.default_rng(5)
    log = faults_log.delay(without_system_time(flight.log), 0.8, random)
    # Messages of one sender keep their order on most links.
    found, tally = flight.compared(sorted(log, key=lambda one: one.time_us))
    assert tally.outcomes[Standing.SETTLED] > 200
    assert np.abs(last_turn(found)).max() < 0.3


def test_a_log_without_receive_times_is_tied_by_the_order_and_says_how_well(flight):
    raw = b"".join(one.frame for one in without_system_time(flight.log))
    found, tally = flight.compared(raw)
    assert set(tally.times_by) == {"order received"}
    assert max(one.time_sigma for one in found if one.settled) == pytest.approx(0.2, abs=0.05)
    # The newest of the aircraft is up to 0.2 s old.
    assert np.abs(last_turn(found)).max() < SPEED * 0.2


def test_a_beacon_whose_unix_time_was_never_set_is_tied_by_receive_times(flight):
    def years_off(message):
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_SYSTEM_TIME:
            message.time_unix_usec -= 5 * 365 * 86_400 * 1_000_000

    found, tally = flight.compared(faults_log.change(flight.log, flight.of_beacon(), years_off))
    assert set(tally.times_by) == {"receive times"}
    assert np.abs(last_turn(found)).max() < AGREE + LATER * SPEED


def test_clocks_that_contradict_each_other_by_seconds_make_the_time_that_unsure(flight):
    def early(message):
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_SYSTEM_TIME:
            message.time_unix_usec -= 3_000_000

    found, _ = flight.compared(faults_log.change(flight.log, flight.of_beacon(), early))
    settled = [one for one in found if one.settled]
    assert np.median([one.time_sigma for one in settled]) == pytest.approx(3.0, abs=0.1)
    # and so wide is the region along the motion
    for one in settled[100:200]:
        widest = np.sqrt(np.linalg.eigvalsh(one.predicted.covariance)[-1])
        assert widest == pytest.approx(3.0 * SPEED, rel=0.1)


# --- faults of the beacon -----------------------------------------------------------------------


def clean_times(flight):
    return {round(one.time, 3) for one in flight.clean[0] if one.settled}


def test_a_silent_beacon_leaves_a_gap_and_nothing_else(flight):
    silent = flight.of_beacon(90.0, 100.0)
    log = [one for one, gone in zip(flight.log, silent, strict=True) if not gone]
    found, tally = flight.compared(log)
    settled = {round(one.time, 3) for one in found if one.settled}
    missing = clean_times(flight) - settled
    assert len(missing) == pytest.approx(50, abs=2)
    assert np.abs(last_turn(found)).max() < AGREE
    # the first after more than 10 s is believed when another follows
    assert sum(tally.outcomes[code] for code in SkipCode) == tally.outcomes[SkipCode.AHEAD] <= 1


def test_a_frozen_beacon_is_skipped_from_where_its_velocity_has_led_away(flight):
    log = faults_log.freeze(flight.log, flight.of_beacon(90.0, 100.0))
    found, tally = flight.compared(log)
    # a metre in the first sample: from the second on
    assert 44 <= tally.outcomes[SkipCode.FROZEN] <= 50
    assert np.abs(errors(found, SETTLED_FOR)[:20]).max() < 1.5


def test_a_position_that_stands_still_without_a_velocity_is_not_believed_for_long(flight):
    def without_velocity(message):
        if hasattr(message, "vx"):
            message.vx = message.vy = message.vz = 0
            message.lat, message.lon = 474_000_000, 85_000_000

    log = faults_log.change(flight.log, flight.of_beacon(90.0, 110.0), without_velocity)
    _, tally = flight.compared(log)
    assert tally.outcomes[SkipCode.FROZEN] + tally.outcomes[SkipCode.JUMP] >= 70


def test_a_beacon_at_0_0_is_never_compared(flight):
    def nowhere(message):
        if hasattr(message, "lat"):
            message.lat = message.lon = 0

    found, tally = flight.compared(
        faults_log.change(flight.log, flight.of_beacon(90.0, 100.0), nowhere)
    )
    assert tally.outcomes[SkipCode.ZERO_POSITION] == pytest.approx(50, abs=1)
    assert np.abs(last_turn(found)).max() < AGREE


def test_a_beacon_without_a_fix_is_never_compared(flight):
    def no_fix(message):
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_GPS_RAW_INT:
            message.fix_type = 1

    _, tally = flight.compared(
        faults_log.change(flight.log, flight.of_beacon(90.0, 100.0), no_fix)
    )
    assert tally.outcomes[SkipCode.BAD_FIX] == pytest.approx(50, abs=2)


def test_a_glitch_of_the_beacon_is_skipped_and_one_that_lasts_is_out_of_reach(flight):
    short = faults_log.shift(flight.log, flight.of_beacon(90.0, 90.7), north=100.0)
    found, tally = flight.compared(short)
    assert tally.outcomes[SkipCode.JUMP] in (3, 4)
    assert np.abs(last_turn(found)).max() < AGREE
    # 300 m away from an aircraft that tows 150 m of cable
    far = faults_log.shift(flight.log, flight.of_beacon(90.0, 100.0), north=300.0)
    found, tally = flight.compared(far)
    assert tally.outcomes[SkipCode.JUMP] >= 4
    assert tally.outcomes[Unmatched.OUT_OF_REACH] > 30
    assert np.abs(errors(found)[:, 1]).max() < 100.0


def test_a_rebooted_beacon_goes_on_and_the_aircraft_knows_nothing_of_it(flight):
    def reboot(log):
        return faults_log.step_clock(log, flight.of_beacon(90.0), -10_900_000)

    found, tally = flight.compared(reboot(flight.log))
    assert tally.outcomes[Unmatched.NO_COMMON_TIME] <= 10
    assert np.abs(last_turn(found)).max() < AGREE
    # also where only the receive times tie it
    found, tally = flight.compared(without_system_time(reboot(flight.log)))
    assert tally.outcomes[Unmatched.NO_COMMON_TIME] <= 10
    assert np.abs(last_turn(found)).max() < AGREE + LATER * SPEED


def test_another_component_of_the_beacons_system_is_not_the_beacon(flight):
    found, _ = flight.compared(wanted=BeaconWanted(SYSTEM, 7))
    assert found == []


# --- motion between predictions -----------------------------------------------------------------


def circling(times, radius=50.0, rate=0.35, sense=1):
    """Places on a circle."""
    angle = sense * rate * np.asarray(times)
    for t, a in zip(times, angle, strict=True):
        position = radius * np.array([np.cos(a), np.sin(a), 0.0])
        velocity = sense * rate * radius * np.array([-np.sin(a), np.cos(a), 0.0])
        yield Place(t, position, velocity, np.eye(3) * (1.0 + t))


@pytest.mark.parametrize("sense", [1, -1])
def test_motion_is_followed_round_the_circle_at_one_position_a_second(sense):
    motion = Motion()
    for place in circling(np.arange(0.0, 8.0), sense=sense):
        motion.add(place.time, place)
    times = np.linspace(0.0, 7.0, 211)
    truth = list(circling(times, sense=sense))
    off = [np.abs(motion.at(t).position - p.position).max() for t, p in zip(times, truth)]  # noqa: B905
    fast = [np.abs(motion.at(t).velocity - p.velocity).max() for t, p in zip(times, truth)]  # noqa: B905
    # the chord between two positions would be 0.76 m inside
    assert max(off) < 50.0 * 0.35**4 / 384 * 1.01
    assert max(fast) < 0.05
    assert motion.at(2.5).covariance[0, 0] == pytest.approx(3.5)


def test_motion_is_never_told_beyond_its_ends_nor_across_a_gap():
    motion = Motion(worst=("settled", "settling"))
    first, second, third = circling([0.0, 0.2, 0.2 + LONGEST_GAP + 0.1])
    motion.add(first.time, replace(first, standing="settled"))
    assert motion.at(0.1) is None
    assert motion.at(-0.1) is None
    motion.add(second.time, replace(second, standing="settling"))
    assert motion.at(0.1).standing == "settling"
    motion.add(third.time, third)
    assert motion.at(0.3) is None
    assert motion.at(third.time) is third
    motion.add(third.time + 0.2, None)
    assert motion.at(third.time + 0.1) is None
    assert motion.covers(third.time + 0.1)
    motion.add(third.time + 30.0, first)
    assert motion.is_before(third.time)


# --- figures ------------------------------------------------------------------------------------


def test_region_of_95_per_cent_holds_95_per_cent_of_normal_errors():
    assert chi2.ppf(0.95, 3) == pytest.approx(REGION_95, rel=1e-12)
    random = np.random.default_rng(1)
    shape = random.normal(size=(3, 3))
    covariance = shape @ shape.T + np.eye(3)
    off = random.multivariate_normal(np.zeros(3), covariance, 4000)
    found = [difference(one, np.zeros(3), covariance) for one in off]
    # 4000 of them: one standard deviation is 0.34 %
    assert np.mean([one.inside_95 for one in found]) == pytest.approx(0.95, abs=0.012)
    statistics = DifferenceStatistics()
    for one in found:
        statistics.add(one)
    figures = statistics.as_dict()
    horizontal = np.hypot(*off[:, :2].T)
    np.testing.assert_allclose(figures["mean_m"], off.mean(axis=0), atol=1e-12)
    assert figures["rms_horizontal_m"] == pytest.approx(np.sqrt((horizontal**2).mean()))
    assert figures["rms_up_m"] == pytest.approx(np.sqrt((off[:, 2] ** 2).mean()))
    assert figures["horizontal_95_m"] == pytest.approx(np.quantile(horizontal, 0.95), rel=0.011)
    assert figures["vertical_95_m"] == pytest.approx(np.quantile(abs(off[:, 2]), 0.95), rel=0.011)


def test_no_figures_of_nothing():
    figures = DifferenceStatistics().as_dict()
    assert figures.pop("count") == 0
    assert set(figures.values()) == {None}


def test_a_record_has_no_number_that_is_not_known(flight):
    found, _ = flight.clean
    for one in (found[0], next(one for one in found if one.settled)):
        record = comparison_record(one)
        assert all(value == value for value in record.values())  # no nan
    assert record["outcome"] == "settled"
    assert record["measured_minus_predicted_east_m"] == pytest.approx(OFFSET[0], abs=5.0)
    assert record["measured_minus_simulated_east_m"] == pytest.approx(OFFSET[0], abs=0.4)
    assert comparison_record(found[0])["measured_minus_simulated_east_m"] is None
    assert comparison_record(replace(found[0], time=nan))["vehicle_time_s"] is None
