"""What a link does to a flight: every loss is counted, and none makes a prediction wrong."""

from pathlib import Path

import faults_log
import numpy as np
import pytest
from faults_replay import BOOT_MS, outside, replay
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.source import open_log

FLIGHTS = Path(__file__).parents[2] / "shared" / "flights"
# A sequence number of 8 bits tells a gap of up to 191 messages from messages that come late.
LONGEST_TOLD = 191
# Frames of the first seconds: what they tell of vehicle and receiver is needed for all others.
START = 60


@pytest.fixture
def random():
    return np.random.default_rng(7)


def missing(log, faulty):
    """Lengths of the runs of frames that are missing, but for those before and after all others.

    A log's frames are told apart by their bytes, which hold a time.
    """
    came = set(r.frame for r in faulty)
    there = np.flatnonzero([r.frame in came for r in log])
    runs = np.diff(there) - 1
    return runs[runs > 0]


def assert_within(found, clean):
    """Predictions differ from those of all the data as their covariances say: 95 % regions."""
    distances = outside(found, clean)
    assert np.mean(distances <= 1.0) >= 0.95
    assert distances.max() < 1.3


def boot_times(log):
    """`time_boot_ms` of the position messages, in the order received."""
    parser = dialect.MAVLink(None)
    return [
        parser.decode(bytearray(r.frame)).time_boot_ms
        for r in log
        if r.kind == faults_log.POSITION
    ]


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_loss_is_counted_and_predictions_stay_within_their_regions(
    share, log, clean, tmp_path, random
):
    faulty = log[:START] + faults_log.lose(log[START:], share, random)
    found = replay(faulty, tmp_path)
    assert found.summary["samples"] == faults_log.count(faulty)
    assert found.skipped == {}
    assert found.link["lost"] == missing(log, faulty).sum()
    assert found.valid > 0.9 * (1.0 - share) * clean.valid
    assert_within(found, clean)


def test_bursts_of_loss_are_counted_too(log, clean, tmp_path, random):
    faulty = faults_log.lose_bursts(log, 0.4, 40, random)
    found = replay(faulty, tmp_path)
    runs = missing(log, faulty)
    assert runs.max() <= LONGEST_TOLD
    assert found.link["lost"] == runs.sum() > 0.1 * len(log)
    assert found.summary["samples"] == faults_log.count(faulty)
    assert found.skipped == {}
    assert_within(found, clean)


@pytest.mark.parametrize("duration", [3.0, 12.0, 30.0])
def test_gap_is_told_and_what_follows_it_is_right(duration, log, clean, tmp_path):
    faulty = faults_log.gap(log, 27.0, duration)
    found = replay(faulty, tmp_path)
    # A time more than 10 s ahead is believed with the second sample.
    assert found.skipped == ({"AHEAD": 1} if duration > 10.0 else {})
    assert found.summary["warnings"]["STALE_TELEMETRY"] == 1
    (run,) = missing(log, faulty)
    if run <= LONGEST_TOLD:
        assert found.link["lost"] == run
    assert_within(found, clean)
    after = sum(p.valid and p.time > BOOT_MS / 1000 + 27.0 + duration for p in found.predictions)
    # The circle is left at 48 s, 5 samples a second.
    assert after > 5 * (48.0 - 27.0 - duration - 2.0)


def test_repeated_messages_are_duplicates_and_change_nothing(log, clean, tmp_path, random):
    faulty = faults_log.repeat(log, 0.3, random)
    found = replay(faulty, tmp_path)
    twice = faults_log.count(faulty) - faults_log.count(log)
    assert found.skipped == {"DUPLICATE": twice}
    assert (found.link["repeated"], found.link["lost"]) == (len(faulty) - len(log), 0)
    assert found.valid == clean.valid
    assert outside(found, clean).max() < 1e-6


@pytest.mark.parametrize("most", [0.3, 2.0])
def test_messages_that_overtake_each_other_are_late_and_not_lost(
    most, log, clean, tmp_path, random
):
    faulty = log[:START] + faults_log.delay(log[START:], most, random)
    found = replay(faulty, tmp_path)
    times = np.array(boot_times(faulty))
    late = times < np.maximum.accumulate(times)
    assert late.sum() > 10
    assert found.skipped == {"OUT_OF_ORDER": late.sum()}
    assert (found.link["lost"], found.link["repeated"]) == (0, 0)
    assert found.summary["flights"] == 1
    assert found.valid > 0.35 * clean.valid
    assert_within(found, clean)


@pytest.mark.parametrize("share", [1e-3, 1e-2])
def test_corrupted_bytes_cost_the_messages_they_hit_and_no_other(
    share, log, clean, tmp_path, random
):
    start = log[:START]
    data, intact, untold = faults_log.corrupt(log[START:], share, random)
    found = replay(faults_log.as_bytes(start) + data, tmp_path)
    positions = intact[faults_log.POSITION] + faults_log.count(start)
    assert found.summary["samples"] == positions < faults_log.count(log)
    assert 0 <= found.link["messages"] - START - sum(intact.values()) <= untold
    assert found.link["bad_bytes"] > 20 * (len(log) - found.link["messages"]) > 0
    assert found.skipped == {}
    assert found.summary["flights"] == 1
    assert_within(found, clean)


def test_log_cut_anywhere_gives_the_samples_before_the_cut(log, tmp_path):
    short = log[:70]
    data = faults_log.as_bytes(short)
    ends = np.cumsum([faults_log.STAMP + len(r.frame) for r in short])
    positions = np.array([r.kind == faults_log.POSITION for r in short])
    path = tmp_path / "cut.tlog"
    path.write_bytes(data)
    whole = list(map(str, open_log(path)))
    assert len(whole) == positions.sum()
    for cut in range(1, len(data), 11):
        path.write_bytes(data[:cut])
        complete = ends <= cut
        if not complete.any():
            with pytest.raises(InputError, match="no message of a known format"):
                open_log(path)
            continue
        source = open_log(path)
        assert list(map(str, source)) == whole[: positions[complete].sum()], cut
        assert source.link.messages == complete.sum()
        assert source.link.bad_bytes == cut - ends[complete].max()


def test_replay_of_a_cut_log_predicts_until_the_cut(log, clean, tmp_path):
    data = faults_log.as_bytes(log)
    cut = len(data) // 2
    ends = np.cumsum([faults_log.STAMP + len(r.frame) for r in log])
    found = replay(data[:cut], tmp_path)
    assert len(found.predictions) == faults_log.count(log[: np.sum(ends <= cut)])
    assert (found.link["bad_runs"], found.link["lost"]) == (1, 0)
    assert outside(found, clean).max() < 1e-6


@pytest.mark.parametrize(("wanted", "flown"), [({}, 1), ({"system": 2}, 2)])
def test_second_vehicle_on_the_link_is_counted_and_not_followed(
    wanted, flown, log, clean, tmp_path
):
    everywhere = faults_log.seconds(log, 0.0)
    other = faults_log.sent_by(faults_log.shift(log, everywhere, north=3000.0), 2)
    found = replay(faults_log.interleave(log, other), tmp_path, **wanted)
    assert found.summary["vehicle"]["system"] == flown
    assert found.summary["samples"] == faults_log.count(log)
    positions = faults_log.count(other) + faults_log.count(other, faults_log.RECEIVER)
    assert found.link["other_positions"] == positions
    assert found.link["lost"] == 0
    assert found.skipped == {}
    assert found.valid == clean.valid
    if flown == 1:
        assert outside(found, clean).max() < 1e-6


@pytest.mark.parametrize("name", ["plane_sitl_loiter.tlog", "plane_real_wind.tlog"])
def test_recorded_flight_with_every_fault_of_a_link_adds_up(name, tmp_path, random):
    path = FLIGHTS / name
    if not path.is_file():
        pytest.skip(f"recorded flight not here: {path}")
    log = faults_log.read(path)[:4000]
    faulty = faults_log.lose(log, 0.2, random)
    faulty = faults_log.delay(faults_log.repeat(faulty, 0.2, random), 1.0, random)
    data, intact, untold = faults_log.corrupt(faulty, 1e-3, random)
    found = replay(data, tmp_path)
    assert 0 <= found.link["messages"] - sum(intact.values()) <= untold
    assert found.link["bad_bytes"] > 0
    vehicle = found.summary["vehicle"]
    mine = (vehicle["system"], vehicle["component"])
    of_all = sum(r.kind == faults_log.POSITION and r.sender == mine for r in faulty)
    assert 0.9 * of_all < found.summary["samples"] <= of_all
    assert sum(found.skipped.values()) > 0
