"""MAVLink messages out of streams with damage in them."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mavlink_bytes import Sender, gps_raw, heartbeat, position, stamped

from ctcbs_ros.telemetry.frames import FrameSplitter
from ctcbs_ros.telemetry.link import LinkStatistics
from ctcbs_ros.telemetry.mavlink import frame_decoder


def some_frames(count, version=2):
    send = Sender(version=version)
    kinds = [heartbeat, gps_raw]
    return [
        send(position(60_000 + 200 * i) if i % 3 else kinds[i // 3 % 2]()) for i in range(count)
    ]


def split(data, is_stamped, chunk=None):
    """All messages of some bytes, given in chunks, and the link's statistics."""
    link = LinkStatistics()
    splitter = FrameSplitter(frame_decoder(), is_stamped, link)
    chunk = chunk or max(1, len(data))
    found = []
    for start in range(0, len(data), chunk):
        found += splitter.split(data[start : start + chunk])
    found += splitter.split(b"", last=True)
    return found, link


def sequences(found):
    return [message.get_seq() for _, message in found]


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("is_stamped", [True, False])
@pytest.mark.parametrize("chunk", [1, 7, 64, None])
def test_every_message_is_found_however_the_bytes_arrive(version, is_stamped, chunk):
    frames = some_frames(30, version)
    data = stamped(frames) if is_stamped else b"".join(frames)
    found, link = split(data, is_stamped, chunk)
    assert sequences(found) == list(range(30))
    assert (link.messages, link.bad_runs, link.bad_bytes) == (30, 0, 0)
    assert link.received == {(1, 1): 30}
    assert link.lost == {(1, 1): 0}


def test_receive_stamps_are_those_before_each_message():
    found, _ = split(stamped(some_frames(3), start_us=10**15, step_us=7), True)
    assert [stamp for stamp, _ in found] == [10**15, 10**15 + 7, 10**15 + 14]


def test_mavlink_1_and_2_may_be_mixed():
    frames = [f for pair in zip(some_frames(9, 1), some_frames(9, 2), strict=True) for f in pair]
    found, link = split(stamped(frames), True)
    assert len(found) == 18
    assert link.bad_bytes == 0


def test_one_corrupt_byte_costs_one_message_at_most_wherever_it_is():
    frames = some_frames(6)
    data = stamped(frames)
    for at in range(len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 0x55
        found, link = split(bytes(damaged), True)
        assert len(found) >= 5, f"byte {at}"
        assert link.bad_runs == 6 - len(found)


def test_bytes_are_either_of_messages_or_counted_as_bad():
    noise = random.Random(3)
    data = b""
    for frame in some_frames(200):
        data += stamped([frame]) + (
            noise.randbytes(noise.randrange(40)) if noise.random() < 0.2 else b""
        )
    found, link = split(data, True)
    good = sum(8 + len(message.get_msgbuf()) for _, message in found)
    assert good + link.bad_bytes == len(data)
    assert len(found) > 190
    assert link.bad_runs > 10


def test_file_may_end_at_any_byte():
    frames = some_frames(4)
    data = stamped(frames)
    ends = [len(stamped(frames[:n])) for n in range(5)]
    for length in range(len(data) + 1):
        found, link = split(data[:length], True)
        whole = max(n for n in range(5) if ends[n] <= length)
        assert len(found) == whole
        assert link.bad_bytes == length - ends[whole]


def test_losses_are_counted_for_each_system_and_component():
    one, other = Sender(1, 1), Sender(1, 191)
    frames = [send(heartbeat()) for _ in range(300) for send in (one, other)]
    del frames[40:60:2]  # ten of the first sender
    _, link = split(b"".join(frames), False)
    assert link.lost == {(1, 1): 10, (1, 191): 0}
    assert link.received == {(1, 1): 290, (1, 191): 300}


def test_late_and_repeated_messages_are_no_losses():
    send = Sender()
    frames = [send(heartbeat()) for _ in range(20)]
    frames[5], frames[6] = frames[6], frames[5]
    frames.insert(12, frames[11])
    _, link = split(b"".join(frames), False)
    assert (link.lost[1, 1], link.repeated[1, 1]) == (0, 1)
    assert link.received[1, 1] == 21


def test_message_of_a_type_not_known_is_passed_over_whole():
    # id 9,999,999 is in no dialect; its checksum cannot be known.
    unknown = bytes([0xFD, 4, 0, 0, 1, 1, 1]) + (9_999_999).to_bytes(3, "little") + bytes(6)
    send = Sender()
    frames = [send(heartbeat()), unknown, send(heartbeat())]
    found, link = split(stamped(frames), True)
    assert len(found) == 3
    assert link.bad_bytes == 0


@settings(max_examples=300)
@given(st.binary(max_size=600), st.booleans())
def test_no_bytes_make_it_raise(data, is_stamped):
    split(data, is_stamped)


@settings(max_examples=200)
@given(st.data())
def test_no_damage_to_a_log_makes_it_raise_or_grow(data):
    log = bytearray(stamped(some_frames(12)))
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(log)))
        log[at : at + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=30))
    found, link = split(bytes(log), True)
    assert len(found) <= 13
    good = sum(8 + len(message.get_msgbuf()) for _, message in found)
    assert good + link.bad_bytes == len(log)
