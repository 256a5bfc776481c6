"""Logs of any size: each format is read as it comes, in memory that does not grow with the log.

A log here is mostly messages that nobody asks for, as real logs are; a process of its own reads
a short one first, which loads all code, then the long one, and tells its peak.
"""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import test_telemetry_dataflash as dataflash
import test_telemetry_dataflash_text as dataflash_text
from bags import FIX, ODOM, fix, header, make, odometry, write_bag
from mavlink_bytes import START_US, Sender, heartbeat, position
from pymavlink.dialects.v20 import all as dialect
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from ulog_bytes import UlogWriter, gps
from ulog_bytes import message as ulog_message

MB = 1_000_000
SHORT, LONG = 2 * MB, 20 * MB
# A log that is loaded takes all of its size and more, one that is streamed 2 MB.
MOST = 6 * MB


def tlog(size, stamped=True):
    """Of every 50 frames one is a position, the others are as long as a frame can be."""
    send = Sender()
    longest = dialect.MAVLink_file_transfer_protocol_message(1, 255, 190, [255] * 251)
    others = [send(longest) for _ in range(48)]
    written = boot_ms = 0
    while written < size:
        boot_ms += 200
        frames = [send(heartbeat()), send(position(boot_ms)), *others]
        stamp = struct.pack(">Q", START_US + boot_ms * 1000) if stamped else b""
        block = b"".join(stamp + frame for frame in frames)
        written += len(block)
        yield block


def dataflash_binary(size):
    declared = struct.pack("<BB4s16s64s", 200, 255, b"FILE", b"Z" * 3 + b"a" * 2, b"A,B,C,D,E")
    other = b"\xa3\x95\xc8" + b"\x55" * 252
    yield dataflash.declarations() + b"\xa3\x95\x80" + declared
    for number in range(size // (50 * len(other))):
        yield dataflash.gps(1_000_000 + 200_000 * number) + 50 * other


def dataflash_lines(size):
    yield dataflash_text.declarations() + b"FMT, 200, 255, FILE, Z, Data\n"
    other = b"FILE, " + b"5" * 240 + b"\n"
    for number in range(size // (50 * len(other))):
        yield dataflash_text.gps(1_000_000 + 200_000 * number) + 50 * other


def ulog(size):
    writer = UlogWriter()
    yield writer.start
    # A topic that nobody declared, and a text that someone logged.
    others = ulog_message("D", struct.pack("<H", 999) + bytes(9000))
    others += ulog_message("L", b"6" + bytes(8) + b"abc " * 250)
    for number in range(size // len(others)):
        values = gps(1_000_000 + 200_000 * number)
        yield writer.log("vehicle_gps_position", **values) + others


def bag(path, size, kind, mode=None):
    """A bag with a picture beside each of its positions; noise, so that nothing compresses it."""
    random = np.random.default_rng(1)

    def messages():
        for number in range(size // 50_000):
            picture = random.integers(256, size=50_000, dtype=np.uint8)
            stamp = 10**18 + number * 200_000_000
            yield ODOM, odometry(stamp)
            yield FIX, fix(stamp)
            yield "/camera", make("sensor_msgs/CompressedImage", header(stamp), "jpeg", picture)

    compression = (mode, CompressionFormat.ZSTD) if mode else None
    return write_bag(path, messages(), kind, compression=compression)


def cut(folder):
    """The file of a bag, as a recorder leaves it whose power fails: no index at its end."""
    (file,) = folder.glob("*.mcap")
    with open(file, "r+b") as log:
        log.truncate(file.stat().st_size - 20_000)
    return file


STREAMS = {
    "tlog": tlog,
    "raw": lambda size: tlog(size, stamped=False),
    "BIN": dataflash_binary,
    "log": dataflash_lines,
    "ulg": ulog,
}
BAGS = {
    "db3": ("db3", None),
    "mcap": ("mcap", None),
    "cut mcap": ("mcap", None),
    "mcap of compressed chunks": ("mcap", CompressionMode.STORAGE),
    "compressed messages": ("db3", CompressionMode.MESSAGE),
    "compressed files": ("db3", CompressionMode.FILE),
}


def log_of(folder, kind, size):
    """Write a log; returns its path."""
    path = folder / f"{kind} {size}"
    if kind in BAGS:
        written = bag(path, size, *BAGS[kind])
        return cut(written) if kind.startswith("cut") else written
    with open(path, "wb") as file:
        file.writelines(STREAMS[kind](size))
    return path


def size_of(path):
    return sum(f.stat().st_size for f in path.iterdir()) if path.is_dir() else path.stat().st_size


@pytest.fixture
def folder(tmp_path):
    """A folder that is gone after the test, for pytest keeps those of three runs."""
    yield tmp_path
    shutil.rmtree(tmp_path)


@pytest.mark.parametrize("kind", [*STREAMS, *BAGS])
def test_memory_does_not_grow_with_the_log(kind, folder):
    short, long = (log_of(folder, kind, size) for size in (SHORT, LONG))
    assert size_of(long) > 0.9 * LONG
    command = [sys.executable, Path(__file__).with_name("peak_memory.py"), short, long]
    told = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    before, after = (tuple(map(int, line.split())) for line in told.stdout.splitlines())
    assert after[0] > 8 * before[0] > 0
    assert (after[1] - before[1]) * 1024 < MOST
