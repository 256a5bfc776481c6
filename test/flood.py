"""A MAVLink sender in a process of its own that sends positions by UDP faster than any vehicle."""

import select
import socket
import sys
import time
from pathlib import Path

from mavlink_bytes import Sender, gps_raw, heartbeat, position
from processes import wait_for

BOOT_MS = 10_000
SPEED = 20.0  # m/s, northwards


def position_at(start: float):
    """The message of a time after the start [s]."""
    north = SPEED * start / 111_200.0
    return position(BOOT_MS + round(start * 1000), lat=47.4 + north)


def flood(port: int, rate: float, duration: float, stop) -> tuple[int, float]:
    """Send a heartbeat, a fix, then positions alone until a file can be read.

    Parameters
    ----------
    port : int
        On loopback.
    rate : float
        Positions a second.
    duration : float
        Of so many seconds at least.
    stop : file
        Where something can be read from it, the flood ends. A last position follows once the
        listener has emptied its socket: for that one there is room.

    Returns
    -------
    sent : int
        Datagrams, one message each.
    last : float
        Boot time of the last position [s].
    """
    send, count = Sender(), 2
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect(("127.0.0.1", port))
        link.send(send(heartbeat()))
        link.send(send(gps_raw()))
        wait_for(lambda: not waiting_bytes(port), "that the first two are read")
        started = time.monotonic()
        while count < rate * duration or not can_be_read(stop):
            now = time.monotonic() - started
            for _ in range(int(now * rate) - count):
                link.send(send(position_at(now)))
                count += 1
            time.sleep(0.001)
        wait_for(lambda: not waiting_bytes(port), "that the flood is read")
        last = time.monotonic() - started + 1.0
        link.send(send(position_at(last)))
    return count + 1, BOOT_MS / 1000 + round(last * 1000) / 1000


def can_be_read(file) -> bool:
    return bool(select.select([file], [], [], 0.0)[0])


def waiting_bytes(port: int) -> int:
    """What a UDP socket of this machine has received, and its program has not read [bytes]."""
    address = f"0100007F:{port:04X}"  # 127.0.0.1, as Linux shows it
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        _, local, _, _, queues, *_ = line.split()
        if local == address:
            return int(queues.partition(":")[2], 16)
    raise ProcessLookupError(f"nobody listens on port {port}")


if __name__ == "__main__":
    print(*flood(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), sys.stdin))
