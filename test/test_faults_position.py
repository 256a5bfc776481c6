"""What a receiver and a barometer do to a flight: what they get wrong is not predicted from."""

import numpy as np
import pytest
from faults_log import freeze, seconds, shift
from faults_replay import BOOT_MS, outside, replay

FAULT = 33.0  # s after the first frame; the first half turn has been flown at 25 s


def samples(found, start, end):
    """Predictions of a time after the first sample [s]."""
    return [p for p in found.predictions if start <= p.time - BOOT_MS / 1000 < end - 1e-6]


@pytest.mark.parametrize("north", [100.0, -25.0])
def test_short_glitch_is_skipped_whole(north, log, clean, tmp_path):
    found = replay(shift(log, seconds(log, FAULT, FAULT + 0.8), north=north), tmp_path)
    assert {p.skip.value for p in samples(found, FAULT, FAULT + 0.8)} == {"JUMP"}
    # Two more where the screen, but not the track, went along with the last of the four.
    skipped = found.skipped["JUMP"]
    assert skipped == sum(found.skipped.values()) <= 6
    assert found.valid == clean.valid - skipped
    assert outside(found, clean).max() <= 1.0


@pytest.mark.parametrize("north", [100.0, 12.0])
def test_glitch_that_lasts_leaves_no_orbit_rather_than_a_wrong_one(north, log, clean, tmp_path):
    found = replay(shift(log, seconds(log, FAULT, FAULT + 3.0), north=north), tmp_path)
    assert not any(p.valid for p in samples(found, FAULT, FAULT + 3.0))
    # Four until five agree, there and back; the screen and the track may each ask for them.
    assert 8 <= found.skipped["JUMP"] <= 16
    assert found.skipped["JUMP"] == sum(found.skipped.values())
    assert outside(found, clean).max() <= 1.0


@pytest.mark.parametrize("duration", [1.0, 30.0])
def test_frozen_position_is_skipped_from_its_second_sample(duration, log, clean, tmp_path):
    found = replay(freeze(log, seconds(log, FAULT, FAULT + duration)), tmp_path)
    frozen = samples(found, FAULT, FAULT + duration)
    assert frozen[0].skip is None
    # On the straight flight behind the turn nothing but the two positions tells.
    assert {p.skip.value for p in frozen[1:]} == {"FROZEN"}
    assert found.skipped["FROZEN"] == len(frozen) - 1
    assert outside(found, clean).max() <= 1.0


@pytest.mark.parametrize("up", [300.0, -15.0])
def test_short_step_of_the_height_is_skipped_whole(up, log, clean, tmp_path):
    found = replay(shift(log, seconds(log, FAULT, FAULT + 0.8), up=up), tmp_path)
    assert found.skipped == {"JUMP": 4}
    assert found.valid == clean.valid - 4
    assert outside(found, clean).max() <= 1.0


@pytest.mark.parametrize("up", [300.0, 30.0])
def test_step_of_the_height_that_lasts_is_the_height_from_a_new_orbit_on(up, log, tmp_path):
    """A barometer that was set anew: the heights after it are the truth."""
    found = replay(shift(log, seconds(log, 24.0), up=up), tmp_path)
    truth = replay(shift(log, seconds(log, 0.0), up=up), tmp_path)
    assert 4 <= found.skipped["JUMP"] <= 8
    assert found.skipped["JUMP"] == sum(found.skipped.values())
    after = {t: p for t, p in found.by_time().items() if t >= BOOT_MS + 24_000}
    assert len(after) > 50
    distances = outside(found, truth)[-len(after):]
    assert distances.max() <= 1.0
    assert not any(p.valid for p in samples(found, 24.0, 32.0))


def test_stray_positions_all_through_a_flight_are_each_skipped(log, clean, tmp_path):
    stray = np.zeros(len(log), bool)
    for start in np.arange(20.0, 45.0, 1.4):
        stray |= seconds(log, start, start + 0.2)
    found = replay(shift(log, stray, north=40.0), tmp_path)
    assert found.skipped == {"JUMP": 18}
    assert outside(found, clean).max() <= 1.0
