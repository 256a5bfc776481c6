"""A MAVLink sender in a process of its own that sends positions by UDP faster than any vehicle."""

import socket
import sys
import time

from mavlink_bytes import Sender, gps_raw, heartbeat, position

BOOT_MS = 10_000
SPEED = 20.0  # m/s, northwards


def position_at(start: float):
    """The message of a time after the start [s]."""
    north = SPEED * start / 111_200.0
    return position(BOOT_MS + round(start * 1000), lat=47.4 + north)


def flood(port: int, rate: float, duration: float) -> int:
    """Send a heartbeat, a fix, then positions alone; returns how many datagrams, one message each.

    Parameters
    ----------
    port : int
        On loopback.
    rate : float
        Positions a second.
    duration : float
        [s]; a last position follows a second after.
    """
    send, count = Sender(), 2
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect(("127.0.0.1", port))
        link.send(send(heartbeat()))
        link.send(send(gps_raw()))
        time.sleep(0.3)
        started = time.monotonic()
        while (now := time.monotonic() - started) < duration:
            for _ in range(int(now * rate) - count):
                link.send(send(position_at(now)))
                count += 1
            time.sleep(0.001)
        time.sleep(1.0)
        link.send(send(position_at(duration + 1.0)))
    return count + 1


if __name__ == "__main__":
    print(flood(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])))
