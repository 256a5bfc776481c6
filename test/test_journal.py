"""The node's log tells each change of link, orbit and warnings once, and nothing twice."""

from dataclasses import replace

import numpy as np
import pytest
from sample_flights import orbiting, samples_of

from ctcbs_ros.configuration import SetWind, load_configuration
from ctcbs_ros.nodes.journal import LEFT, LINK_LINES, OVER, Journal
from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.wind_reasons import STILL_SOLVED
from ctcbs_ros.telemetry.skip_code import SkipCode


class Log:
    """A logger that keeps its lines, and a clock that is set."""

    def __init__(self):
        self.lines, self.now = [], 100.0

    def info(self, text):
        self.lines.append(f"INFO {text}")

    def warning(self, text):
        self.lines.append(f"WARN {text}")

    def error(self, text):
        self.lines.append(f"ERROR {text}")

    def beginnings(self):
        return [line.partition(":")[0] for line in self.lines]


@pytest.fixture
def log():
    return Log()


@pytest.fixture
def journal(log):
    return Journal(log, lambda: log.now)


@pytest.fixture(scope="module")
def flight():
    predictor = Predictor(load_configuration("small_drone"))
    return [predictor.update(sample) for sample in samples_of(orbiting(turns=2.0))]


def test_an_orbit_is_told_when_it_is_found_and_when_it_is_left(flight, journal, log):
    for prediction in flight:
        journal.add(replace(prediction, warnings=[
            w for w in prediction.warnings if w.code is WarningCode.NOT_ORBITING
        ]))  # fmt: skip
    assert [line.partition(";")[0] for line in log.lines] == [
        "INFO orbit: radius 80.0 m, 20.0 m/s over the ground, anticlockwise", "INFO orbit left",
    ]  # fmt: skip
    mass = next(p for p in flight if p.valid).end_mass
    assert f"circle of {mass.state.radius:.1f} m" in log.lines[0]
    assert f"settled ({mass.settling_time:.0f} s)" in log.lines[0]


def test_where_the_end_mass_is_in_wind_is_told_when_the_motion_is_found(log, journal):
    # A wind of 3 m/s from the west carries the end mass east, to the left of it north.
    windy = replace(
        load_configuration("small_drone"), wind=SetWind(speed=3.0, from_direction=270.0)
    )
    predictor = Predictor(windy, with_twin=False)
    for sample in samples_of(orbiting(radius=70.0, turns=0.8, wind=(3.0, 0.0))):
        prediction = predictor.update(sample)
        journal.add(prediction)
        if prediction.pose_holds:
            break
    orbit, told = [line for line in log.lines if "end mass" in line and "INFO" in line]
    assert "end mass not predicted in this wind; in still air on a circle of" in orbit
    mass, center = prediction.end_mass, prediction.orbit.center
    off = mass.in_wind.path.mean(axis=0) - center
    bearing = {(1, 1): "north-east", (1, 0): "east", (0, 1): "north"}[
        tuple(np.round(off[:2] / np.hypot(*off[:2])).astype(int))
    ]
    assert told.startswith(
        "INFO end mass predicted in wind 3.0 m/s from 270 deg, about a place "
        f"{np.hypot(*off[:2]):.1f} m {bearing} of the circle's centre and {-off[2]:.1f} m below"
    )


def test_a_wind_that_nobody_knows_is_told_with_the_end_mass(flight, journal, log):
    journal.add(next(p for p in flight if p.valid and p.wind is None))
    assert "end mass predicted for still air, the wind is not known: on a circle" in log.lines[0]


def test_an_orbit_lost_for_a_moment_is_not_told(flight, journal, log):
    orbiting_still = [p for p in flight if p.valid]
    start = orbiting_still[0].time + 5.0
    for prediction in orbiting_still:
        lost = start < prediction.time < start + LEFT - 0.1
        journal.add(replace(prediction, warnings=(), orbit=None if lost else prediction.orbit))
    assert log.beginnings() == ["INFO orbit"]


def test_that_the_motion_in_the_wind_is_not_found_is_told_once(flight, journal, log):
    orbit = [p for p in flight if p.valid][:60]
    none = "no motion found in this wind, 0.{} of the speed"
    for number, prediction in enumerate(orbit):
        solving = number < 5 or number % 20 == 0  # tried again now and then
        because = STILL_SOLVED if solving else none.format(40 + number)
        warning = Warning(WarningCode.WIND_UNMODELLED, Level.WARN, f"windy; {because}")
        mass = replace(prediction.end_mass, unmodelled_because=because)
        journal.add(replace(prediction, end_mass=mass, warnings=(warning,)))
    assert log.lines[1:] == [
        f"WARN WIND_UNMODELLED: windy; {STILL_SOLVED}",
        f"WARN WIND_UNMODELLED: windy; {none.format(45)}",
    ]


def test_a_warning_is_told_once_while_it_stands_and_again_after_it_was_over(
    flight, journal, log
):
    orbit = [p for p in flight if p.valid]
    start = orbit[0].time
    low = Warning(WarningCode.LOW_MARGIN, Level.WARN, "slow")
    unstable = Warning(WarningCode.UNSTABLE, Level.ERROR, "flutter")
    for prediction in orbit:
        seconds = prediction.time - start
        low_now = seconds < 4.0 and int(seconds) % 2 == 0  # comes and goes
        again = 4.0 + OVER + 1.0 < seconds < 4.0 + OVER + 2.0
        warnings = ((low,) if low_now or again else ()) + ((unstable,) if seconds > 20.0 else ())
        journal.add(replace(prediction, warnings=warnings))
    assert log.lines[1:] == [
        "WARN LOW_MARGIN: slow", "INFO LOW_MARGIN is over, after 3 s", "WARN LOW_MARGIN: slow",
        "INFO LOW_MARGIN is over, after 1 s", "ERROR UNSTABLE: flutter",
    ]  # fmt: skip


def test_skipped_samples_are_told_once(flight, journal, log):
    bad = Warning(WarningCode.BAD_FIX, Level.WARN, "position not believed (JUMP)")
    skip = SkipCode.JUMP
    for prediction in flight[:20]:
        journal.add(replace(prediction, skip=skip, orbit=None, end_mass=None, warnings=(bad,)))
    assert log.lines == ["WARN BAD_FIX: position not believed (JUMP)"]


def test_silence_is_told_when_it_begins_and_when_it_ends(flight, journal, log):
    stale = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "no position for 2.5 s")
    for prediction in flight[:5]:
        journal.add(replace(prediction, warnings=()))
        journal.silence(None)
    for _ in range(3):
        journal.silence(stale)
    over = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "a gap, of 5.0 s")
    journal.add(replace(flight[5], warnings=(over,)))
    assert log.lines == [
        "WARN STALE_TELEMETRY: no position for 2.5 s", "INFO positions come in",
    ]  # fmt: skip


def test_silence_that_lasts_ends_the_orbit_and_its_warnings_and_both_are_told_anew(
    flight, journal, log
):
    low = Warning(WarningCode.LOW_MARGIN, Level.WARN, "slow")
    event = Warning(WarningCode.JUMPED, Level.WARN, "gone")
    stale = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "no position for 2.5 s")
    orbit = [p for p in flight if p.valid]
    journal.add(replace(orbit[0], warnings=(low, event)))
    for _ in range(20):
        journal.silence(stale)
        log.now += 1.0
    journal.add(replace(orbit[1], warnings=(low,)))
    assert log.lines[1:-2] == [
        "WARN LOW_MARGIN: slow", "WARN JUMPED: gone",
        "WARN STALE_TELEMETRY: no position for 2.5 s",
        "INFO as no position comes; orbit lost; no longer warned of LOW_MARGIN",
        "INFO positions come in",
    ]  # fmt: skip
    assert log.lines[-2].startswith("INFO orbit: radius")
    assert log.lines[-1] == "WARN LOW_MARGIN: slow"


def test_silence_of_a_moment_ends_nothing(flight, journal, log):
    low = Warning(WarningCode.LOW_MARGIN, Level.WARN, "slow")
    stale = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "no position for 2.5 s")
    for prediction in [p for p in flight if p.valid][:2]:
        journal.add(replace(prediction, warnings=(low,)))
        for _ in range(2):
            journal.silence(stale)
            log.now += 0.4 * OVER
    assert log.lines[1:] == [
        "WARN LOW_MARGIN: slow", "WARN STALE_TELEMETRY: no position for 2.5 s",
        "INFO positions come in", "WARN STALE_TELEMETRY: no position for 2.5 s",
    ]  # fmt: skip


def test_another_flight_is_told(flight, journal, log):
    for number, prediction in enumerate(flight[:10]):
        journal.add(replace(prediction, warnings=(), flight=1 + number // 5))
    assert log.beginnings() == ["INFO a new flight"]


def test_another_flight_ends_the_orbit(flight, journal, log):
    orbit = [p for p in flight if p.valid]
    for number, prediction in enumerate(orbit[:2]):
        journal.add(replace(prediction, warnings=(), flight=number))
    assert log.lines[1] == "INFO a new flight: the vehicle's clock has begun anew; orbit lost"
    assert log.lines[2].startswith("INFO orbit: radius")


def test_a_link_is_told_to_be_up_lost_and_back_and_not_each_time_that_it_flaps(journal, log):
    def last(state, seconds):
        for _ in range(round(seconds / 0.1)):
            log.now += 0.1
            journal.link(state.format(log.now))

    up = "up: system 1, component 1, fixed wing"
    last("nothing received yet", 0.5)
    last("up, but no vehicle to follow is heard", 0.8)
    last(up, 20.0)
    last("lost: nothing received for {:.0f} s", 30.0)
    for _ in range(3):
        last(up, 0.2)
        last("lost: nothing received for {:.0f} s", 0.2)
    last(up, LINK_LINES + 1.0)
    assert [line.partition(" for ")[0] for line in log.lines] == [
        f"INFO link: {up}", "WARN link: lost: nothing received", f"INFO link: {up}",
    ]  # fmt: skip


def test_another_system_that_sends_positions_is_told_once_with_how_it_may_be_the_beacon(
    journal, log
):
    for systems in ([], [1], [1, 42], [1, 42], [1, 42, 7]):
        journal.others(systems, followed=1, with_beacon=False)
    assert log.lines == [
        f"INFO positions of system {system} come too, and are not used; if it is the payload's "
        f"beacon, set beacon.system_id: {system}"
        for system in (42, 7)
    ]
    log.lines.clear()
    journal.others([9], followed=1, with_beacon=True)
    assert log.lines == ["INFO positions of system 9 come too, and are not used"]
