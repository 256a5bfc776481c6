"""What the node takes of a core beside a live link, with its twin and without.

    python test/live_cost.py --wind 3,230

sends a simulated flight to the node by UDP as fast as it was flown, and prints the processor time
of the node's process once the first half minute is over.
"""

import argparse
import os
import socket
import tempfile
import time
from pathlib import Path

from links import free_port
from pymavlink import mavutil
from running_node import DRONE, RunningNode

from ctcbs_ros.cli.main import main as ctcbs

FROM = 30.0  # s of flight: the node has loaded all it needs


def messages(log: Path) -> list[tuple[float, bytes]]:
    """Every message of a log with its time [s]."""
    link, found = mavutil.mavlink_connection(str(log)), []
    while (message := link.recv_match()) is not None:
        found.append((message._timestamp, bytes(message.get_msgbuf())))
    link.close()
    return found


def share(log: Path, folder: Path, with_twin: bool) -> float:
    """Processor time of the node over the time of the flight."""
    port, flight = free_port(), messages(log)
    parameters = {
        "mavlink.url": f"udpin:127.0.0.1:{port}", "twin.enabled": str(with_twin).lower(),
    }  # fmt: skip
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with link, RunningNode(folder, parameters) as node:
        node.wait_until_ready()
        begun, first = time.monotonic() - flight[0][0], None
        for stamp, message in flight:
            time.sleep(max(0.0, begun + stamp - time.monotonic()))
            link.sendto(message, ("127.0.0.1", port))
            if first is None and stamp - flight[0][0] > FROM:
                first = stamp, cpu_seconds(node.process.pid)
        return (cpu_seconds(node.process.pid) - first[1]) / (stamp - first[0])


def cpu_seconds(process: int) -> float:
    """User and system time of a process: fields 14 and 15 of proc(5)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Simulate, send, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", default="10", help="positions a second (default 10)")
    parser.add_argument("--turns", default="6", help="of 22 s (default 6)")
    parser.add_argument("--wind", default="0,0", help="as of ctcbs simulate (default none)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "flight.tlog"
        ctcbs([
            "simulate", "--config", str(DRONE), "--radius", "70", "--speed", "20",
            "--turns", arguments.turns, "--rate", arguments.rate, "--wind", arguments.wind,
            "--position-noise", "1", "--velocity-noise", "0.2", "-o", str(log),
        ])  # fmt: skip
        for with_twin in (False, True):
            found = share(log, Path(name), with_twin)
            print(f"{100.0 * found:.1f} % of a core {'with' if with_twin else 'without'} twin")


if __name__ == "__main__":
    main()
