"""Faults put into a recorded MAVLink log: what a link, a clock and a receiver do to a flight.

A log is a list of `Received`; each fault takes one and returns another, leaving the first alone.
"""

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from pymavlink.dialects.v20 import all as dialect

WRAP_MS = 2**32
STAMP = 8  # bytes of a receive stamp
# Messages that carry a position, by the id that MAVLink gives them.
POSITION = dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
RECEIVER = dialect.MAVLINK_MSG_ID_GPS_RAW_INT


@dataclass(frozen=True)
class Received:
    """One frame, and when it was received [us, Unix time]."""

    time_us: int
    frame: bytes

    @property
    def kind(self) -> int:
        """Id of the message."""
        if self.frame[0] == 0xFE:
            return self.frame[5]
        return int.from_bytes(self.frame[7:10], "little")

    @property
    def sender(self) -> tuple[int, int]:
        """System and component."""
        at = 3 if self.frame[0] == 0xFE else 5
        return self.frame[at], self.frame[at + 1]


Log = list[Received]


def read(path) -> Log:
    """The frames of an undamaged .tlog; cut by their lengths alone."""
    data, at, log = path.read_bytes(), 0, []
    while at < len(data):
        (time_us,) = struct.unpack_from(">Q", data, at)
        start, at = at + 8, at + 8
        if data[start] == 0xFE:
            at += 8 + data[start + 1]
        else:
            assert data[start] == 0xFD, f"{path} is damaged at byte {start}"
            at += 12 + data[start + 1] + (13 if data[start + 2] & 1 else 0)
        log.append(Received(time_us, data[start:at]))
    return log


def as_bytes(log: Log) -> bytes:
    """The .tlog."""
    return b"".join(struct.pack(">Q", r.time_us) + r.frame for r in log)


def count(log: Log, kind: int = POSITION) -> int:
    """Messages of a kind."""
    return sum(r.kind == kind for r in log)


def seconds(log: Log, start: float, end: float = np.inf) -> np.ndarray:
    """Which frames were received so many seconds after the first, as an array of bool."""
    since = (np.array([r.time_us for r in log]) - log[0].time_us) / 1e6
    return (since >= start) & (since < end)


# --- the link -----------------------------------------------------------------------------------


def lose(log: Log, share: float, random) -> Log:
    """Each frame lost by chance, independently."""
    return [r for r, lost in zip(log, random.random(len(log)) < share, strict=True) if not lost]


def lose_bursts(log: Log, share: float, length: int, random) -> Log:
    """Frames lost in runs of `length`, a part `share` of all in the mean."""
    starts = random.random(len(log)) < share / length
    lost = np.convolve(starts, np.ones(length))[: len(log)] > 0
    return [r for r, gone in zip(log, lost, strict=True) if not gone]


def gap(log: Log, start: float, duration: float) -> Log:
    """Nothing received for a time [s]."""
    return [r for r, gone in zip(log, seconds(log, start, start + duration), strict=True)
            if not gone]  # fmt: skip


def repeat(log: Log, share: float, random) -> Log:
    """Each frame received a second time, right after the first, by chance."""
    twice = random.random(len(log)) < share
    return [r for r, again in zip(log, twice, strict=True) for _ in range(1 + again)]


def delay(log: Log, most: float, random) -> Log:
    """Each frame later by a random time up to `most` [s], so that they overtake each other."""
    later = [
        replace(r, time_us=r.time_us + int(more * 1e6))
        for r, more in zip(log, random.uniform(0.0, most, len(log)), strict=True)
    ]
    return sorted(later, key=lambda r: r.time_us)


def corrupt(log: Log, share: float, random) -> tuple[bytes, Counter, int]:
    """The .tlog with random bytes overwritten.

    Returns
    -------
    data : bytes
    intact : Counter
        Messages unharmed, by their id.
    untold : int
        Of the others those whose id is hit: of a type not known, no checksum can be tested.
    """
    data = np.frombuffer(as_bytes(log), np.uint8).copy()
    hit = random.random(len(data)) < share
    # Another value each: a byte overwritten by itself is no damage.
    data[hit] += random.integers(1, 256, hit.sum(), dtype=np.uint8)
    intact, untold, at = Counter(), 0, 0
    for r in log:
        start, at = at + STAMP, at + STAMP + len(r.frame)
        if hit[start:at].any():
            untold += hit[start + 5] if r.frame[0] == 0xFE else hit[start + 7 : start + 10].any()
        else:
            intact[r.kind] += 1
    return data.tobytes(), intact, int(untold)


# --- what the messages say ----------------------------------------------------------------------


def change(log: Log, which: np.ndarray, alter: Callable) -> Log:
    """Messages of some frames altered in place by a function, and packed anew.

    Parameters
    ----------
    which : (n,) array of bool
        The frames.
    alter : callable
        Takes a decoded pymavlink message and changes its fields.
    """
    parser = dialect.MAVLink(None)

    def packed(frame: bytes) -> bytes:
        message = parser.decode(bytearray(frame))
        alter(message)
        sender = dialect.MAVLink(None, message.get_srcSystem(), message.get_srcComponent())
        sender.seq = message.get_seq()
        return message.pack(sender)

    return [
        replace(r, frame=packed(r.frame)) if chosen else r
        for r, chosen in zip(log, which, strict=True)
    ]


def step_clock(log: Log, which: np.ndarray, step_ms: int) -> Log:
    """The vehicle's time since boot moved, in every message that states it."""

    def alter(message):
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms = (message.time_boot_ms + step_ms) % WRAP_MS
        elif message.get_msgId() == RECEIVER:
            message.time_usec = (message.time_usec + step_ms * 1000) % (WRAP_MS * 1000)

    return change(log, which, alter)


def shift(log: Log, which: np.ndarray, north: float = 0.0, up: float = 0.0) -> Log:
    """Positions moved [m], those of the estimate and those of the receiver alike."""

    def alter(message):
        if message.get_msgId() in (POSITION, RECEIVER):
            message.lat += round(north / 111_200 * 1e7)
            message.alt += round(up * 1000)
            if message.get_msgId() == POSITION:
                message.relative_alt += round(up * 1000)
            else:
                message.alt_ellipsoid += round(up * 1000)

    return change(log, which, alter)


def freeze(log: Log, which: np.ndarray) -> Log:
    """Positions standing where they were at the first of the frames; velocities go on."""
    stands: dict[int, tuple] = {}

    def alter(message):
        kind = message.get_msgId()
        if kind in (POSITION, RECEIVER):
            message.lat, message.lon, message.alt = stands.setdefault(
                kind, (message.lat, message.lon, message.alt)
            )

    return change(log, which, alter)


def sent_by(log: Log, system: int) -> Log:
    """The same flight, flown by another vehicle."""

    def repacked(frame: bytes) -> bytes:
        message = parser.decode(bytearray(frame))
        sender = dialect.MAVLink(None, system, 1)
        sender.seq = message.get_seq()
        return message.pack(sender)

    parser = dialect.MAVLink(None)
    return [replace(r, frame=repacked(r.frame)) for r in log]


def interleave(*logs: Log) -> Log:
    """Several vehicles' frames on one link, in the order received."""
    return sorted((r for log in logs for r in log), key=lambda r: r.time_us)
