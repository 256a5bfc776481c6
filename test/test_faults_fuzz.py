"""Random bytes into the reader, random messages into the predictor: nothing raises, nothing grows.

Every random number is that of a seed. The full runs (a million strings, a hundred thousand
messages) are slow; a hundredth of each is not.
"""

import gc
import sys
import tracemalloc
from collections import Counter

import faults_log
import numpy as np
import pytest
from faults_replay import DRONE, assert_numbers, replay
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.tally import Tally
from ctcbs_ros.prediction.warm_up import warm_up
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder
from ctcbs_ros.telemetry.skip_code import SkipCode

GROWTH = 300_000  # bytes: the tables of a link with all its 65,536 senders take more, slowly
MESSAGES = sorted(dialect.mavlink_map)
NUMBERS = {"char": "i1", "int8_t": "i1", "uint8_t": "u1", "int16_t": "i2", "uint16_t": "u2",
           "int32_t": "i4", "uint32_t": "u4", "int64_t": "i8", "uint64_t": "u8"}  # fmt: skip
EXTREMES = [np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 5e-324]


def traced():
    """Bytes allocated since `tracemalloc.start()` that are still held."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def framed(kind, payload, random):
    """A MAVLink 2 frame of any message with any payload and a right checksum."""
    senders = [(1, 1), (1, 1), (2, 1), (255, 190)]
    system, component = senders[random.integers(len(senders))]
    frame = bytes([0xFD, len(payload), 0, 0, random.integers(256), system, component])
    frame += int(kind).to_bytes(3, "little") + payload
    checksum = dialect.x25crc(frame[1:])
    checksum.accumulate(bytes([dialect.mavlink_map[kind].crc_extra]))
    return frame + checksum.crc.to_bytes(2, "little")


def strings(count, log, random):
    """Random byte strings, from plain noise to intact frames of nonsense."""
    for _ in range(count):
        way = random.integers(4)
        if way == 0:  # noise
            yield random.bytes(random.integers(1, 120))
        elif way == 1:  # noise that begins like a frame
            head = bytes([random.choice([0xFD, 0xFE]), random.integers(60), 0])
            yield head + random.bytes(random.integers(0, 60))
        elif way == 2:  # a real frame with a few bytes overwritten, maybe cut
            frame = bytearray(log[random.integers(len(log))].frame)
            for at in random.integers(0, len(frame), random.integers(0, 3)):
                frame[at] = random.integers(256)
            yield bytes(frame[: random.integers(1, 2 * len(frame))])
        else:  # nonsense with a right checksum
            kind = MESSAGES[random.integers(len(MESSAGES))]
            payload = random.bytes(random.integers(1, dialect.mavlink_map[kind].unpacker.size + 1))
            yield framed(kind, payload, random)


def assert_reader_holds(count, stamped, log):
    """A reader fed with random strings: it never raises, counts every byte, and does not grow."""
    random = np.random.default_rng(11)
    decoder = MavlinkDecoder(stamped)
    taken = samples = 0
    try:
        for number, string in enumerate(strings(count, log, random)):
            taken += len(string)
            receive_us = None if stamped else 1_700_000_000_000_000 + number * 20_000
            samples += sum(1 for _ in decoder.feed(string, receive_us))
            if number == count // 2:
                tracemalloc.start()
        samples += sum(1 for _ in decoder.feed(b"", last=True))
        grown = traced()
    finally:
        tracemalloc.stop()
    link = decoder.link
    assert link.messages == sum(link.received.values()) > 0.1 * count
    assert 0 < samples + link.other_positions < link.messages
    # What is no message is bad bytes: of a frame at least 8 are none.
    assert link.bad_bytes <= taken - 8 * link.messages
    assert link.bad_bytes > 0.2 * taken
    assert link.bad_runs > 0.1 * count
    assert grown < GROWTH


@pytest.mark.parametrize("stamped", [True, False])
def test_random_bytes_into_the_reader_raise_nothing_and_leave_nothing(stamped, log):
    assert_reader_holds(5_000, stamped, log)


@pytest.mark.slow
@pytest.mark.parametrize("stamped", [True, False])
def test_a_million_random_strings_into_the_reader(stamped, log):
    assert_reader_holds(500_000, stamped, log)


def mutate(message, random):
    """Another value in one field of a message, often an extreme one."""
    name = message.fieldnames[random.integers(len(message.fieldnames))]
    kind = message.fieldtypes[message.fieldnames.index(name)]
    value = getattr(message, name)
    if not isinstance(value, int | float):
        return
    if kind in NUMBERS:
        limits = np.iinfo(NUMBERS[kind])
        choices = [
            int(limits.min), int(limits.max), 0,
            int(random.integers(limits.min, limits.max, dtype=limits.dtype, endpoint=True)),
            min(max(int(value + random.normal(0.0, 1e4)), limits.min), limits.max),
        ]  # fmt: skip
        setattr(message, name, choices[random.integers(len(choices))])
    else:
        setattr(message, name, float(random.choice([*EXTREMES, random.normal(0.0, 1e3)])))


def random_messages(count, log, random):
    """Frames of a flight flown again and again, some changed, doubled, left out or exchanged."""
    parser = dialect.MAVLink(None)
    sender = dialect.MAVLink(None, 1, 1)
    kept = None
    for number in range(count):
        frame = log[number % len(log)].frame
        chance = random.random()
        if chance < 0.1:
            message = parser.decode(bytearray(frame))
            mutate(message, random)
            sender.seq = message.get_seq()
            try:
                frame = message.pack(sender)
            except Exception:  # a float that the field's 32 bits do not hold
                continue
            yield frame
        elif chance < 0.15:
            yield frame
            yield frame
        elif chance < 0.2:
            kept = frame  # overtaken by the next
            continue
        elif chance < 0.25:
            continue  # lost
        elif chance < 0.27:
            kind = MESSAGES[random.integers(len(MESSAGES))]
            size = dialect.mavlink_map[kind].unpacker.size
            yield framed(kind, random.bytes(size), random)
        else:
            yield frame
        if kept:
            yield kept
            kept = None


def assert_predictor_holds(count, log):
    """A predictor fed with random messages: nothing raised, each sample used or its code known."""
    random = np.random.default_rng(5)
    configuration = load_configuration(DRONE)
    warm_up(configuration)
    decoder, predictor = MavlinkDecoder(False), Predictor(configuration)
    tally, used = Tally(), 0
    try:
        for number, frame in enumerate(random_messages(count, log, random)):
            for sample in decoder.feed(frame, 1_700_000_000_000_000 + number * 50_000):
                prediction = predictor.update(sample)
                assert_numbers(prediction)
                tally.add(prediction)
                used += prediction.skip is None
            if number == count // 2:
                tracemalloc.start()
        grown = traced()
    finally:
        tracemalloc.stop()
    assert tally.samples == used + sum(tally.skipped.values())
    assert set(tally.skipped) <= {code.value for code in SkipCode}
    assert tally.predictions > 0.01 * tally.samples
    assert grown < GROWTH
    return tally


def test_random_messages_into_the_predictor_raise_nothing_and_leave_nothing(log):
    tally = assert_predictor_holds(2_500, log)
    # Many a reason, each its code.
    assert len(+Counter(tally.skipped)) >= 4


@pytest.mark.slow
def test_a_hundred_thousand_random_messages_into_the_predictor(log):
    tally = assert_predictor_holds(100_000, log)
    assert len(+Counter(tally.skipped)) >= 6


def test_every_fault_of_a_link_at_once_is_counted(log, tmp_path):
    random = np.random.default_rng(9)
    start = log[:60]
    faulty = faults_log.lose(log[60:], 0.2, random)
    faulty = faults_log.delay(faults_log.repeat(faulty, 0.2, random), 0.5, random)
    data, intact, _ = faults_log.corrupt(faulty, 5e-4, random)
    found = replay(faults_log.as_bytes(start) + data, tmp_path)
    positions = intact[faults_log.POSITION] + faults_log.count(start)
    assert found.summary["samples"] == positions
    assert set(found.skipped) == {"DUPLICATE", "OUT_OF_ORDER"}
    assert found.valid > 0


_heard: list | None = None


def _audit(event, arguments):
    if _heard is not None and event.split(".")[0] in {
        "open", "os", "subprocess", "socket", "exec", "compile", "import", "shutil", "pickle",
    }:  # fmt: skip
        _heard.append((event, arguments))


def test_nothing_that_a_link_says_opens_a_file_or_runs(log):
    """Messages with paths and code in all their bytes, heard by an audit hook (PEP 578)."""
    global _heard
    random = np.random.default_rng(2)
    frames = [r.frame for r in log[:60]]
    for kind in MESSAGES:
        size = dialect.mavlink_map[kind].unpacker.size
        text = random.choice([b"../../../tmp/escaped\0", b"__import__('os')\0", b"|touch x;\0"])
        frames.append(framed(kind, bytes((text * (size // len(text) + 1))[:size]), random))
    predictor = Predictor(load_configuration(DRONE))

    def fly():
        decoder = MavlinkDecoder(False)
        samples = [s for frame in frames for s in decoder.feed(frame, 1_700_000_000_000_000)]
        return decoder, [predictor.update(sample) for sample in samples]

    fly()  # what is loaded once is loaded
    sys.addaudithook(_audit)  # there is no way to take it off
    _heard = []
    try:
        decoder, predictions = fly()
        heard = _heard
    finally:
        _heard = None
    assert decoder.link.messages == len(frames)
    assert len(predictions) > 10
    assert heard == []
