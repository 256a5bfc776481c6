"""What a vehicle's clock does to a flight: wraps, reboots, steps; and no prediction is wrong."""

import faults_log
import numpy as np
import pytest
from faults_log import seconds, step_clock
from faults_replay import BOOT_MS, distance, replay

STEP = 33.0  # s after the first frame; the first half turn has been flown at 25 s


def against(found, clean):
    """Distances of valid predictions over their regions, sample by sample whatever the clock."""
    assert len(found.predictions) == len(clean.predictions)
    pairs = [(p, c) for p, c in zip(found.predictions, clean.predictions, strict=True) if p.valid]
    assert all(c.valid for _, c in pairs)
    return np.array([distance(p, c) for p, c in pairs])


def assert_in_order(found):
    """The time of what is used, and its stamp, only ever rise."""
    used = [p for p in found.predictions if p.skip is None]
    for values in ([p.time for p in used], [p.stamp_ns for p in used]):
        assert np.all(np.diff(values) > 0)


def test_wrap_of_the_clock_changes_nothing(log, clean, tmp_path):
    to_wrap = faults_log.WRAP_MS - BOOT_MS - round(STEP * 1000)
    found = replay(step_clock(log, seconds(log, 0.0), to_wrap), tmp_path)
    assert found.link["time_steps"] == {"wrap": 1}
    assert (found.summary["flights"], found.skipped) == (1, {})
    assert found.valid == clean.valid
    assert against(found, clean).max() < 1e-6
    assert_in_order(found)


@pytest.mark.parametrize("back", [85.0, 2.5])
def test_reboot_begins_a_flight_with_an_orbit_of_its_own(back, log, clean, tmp_path):
    found = replay(step_clock(log, seconds(log, STEP), round(-back * 1000)), tmp_path)
    assert found.link["time_steps"] == {"reboot": 1}
    assert (found.summary["flights"], found.skipped) == (2, {})
    assert against(found, clean).max() <= 1.0
    assert_in_order(found)
    # Between them the half turn that every first orbit takes.
    valid = [p.valid for p in found.predictions if STEP <= p.time - BOOT_MS / 1000 <= STEP + 8.0]
    assert not any(valid)


@pytest.mark.parametrize("ahead", [3.0, 1e5])
def test_step_ahead_that_no_receive_stamp_saw_begins_a_flight(ahead, log, clean, tmp_path):
    found = replay(step_clock(log, seconds(log, STEP), round(ahead * 1000)), tmp_path)
    assert found.link["time_steps"] == {"jump": 1}
    assert (found.summary["flights"], found.skipped) == (2, {})
    assert found.valid > 0.4 * clean.valid
    assert against(found, clean).max() <= 1.0
    assert_in_order(found)


@pytest.mark.parametrize("step", [0.5, 2.4, -0.5, -1.9])
def test_step_within_the_delays_of_links_breaks_the_track(step, log, clean, tmp_path):
    found = replay(step_clock(log, seconds(log, STEP), round(step * 1000)), tmp_path)
    assert found.link["time_steps"] == {}
    # As many samples are late as the step back holds, and four more until the fifth confirms.
    late = int(-step * 5) if step < 0.0 else 0
    assert found.skipped.get("OUT_OF_ORDER", 0) == late
    assert 4 <= found.skipped["JUMP"] <= 8
    assert found.summary["warnings"]["BAD_FIX"] >= found.skipped["JUMP"] + 1
    assert found.valid > 0.4 * clean.valid
    assert against(found, clean).max() <= 1.0
    assert_in_order(found)


@pytest.mark.parametrize("step", [60.0, 1.5])
def test_clock_that_steps_for_two_seconds_and_back_makes_nothing_wrong(step, log, clean, tmp_path):
    stepped = seconds(log, STEP, STEP + 2.0)
    found = replay(step_clock(log, stepped, round(step * 1000)), tmp_path)
    if abs(step) > 2.5:
        assert found.link["time_steps"] == {"jump": 1, "reboot": 1}
    assert found.valid > 0.3 * clean.valid
    assert against(found, clean).max() <= 1.0
    assert_in_order(found)
