"""A flight of a day through the real node: does it grow, does it lose a prediction?

    python test/soak.py --hours 24 --rate 5

writes a log of one long orbit, whose radius, airspeed and wind change all the time, with gaps of
the link and one reboot; replays it through the node as fast as that goes; and prints how much the
node's resident memory grew after the first ten minutes of flight. `make soak` runs it.
"""

import argparse
import json
import struct
import sys
import tempfile
import time
from array import array
from dataclasses import dataclass, field
from math import atan2, cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np
from mavlink_bytes import Sender, gps_raw, heartbeat, position, system_time
from pymavlink.dialects.v20 import all as dialect

START_US = 1_767_268_800_000_000  # 2026-01-01 12:00 UTC
WARM = 600.0  # s of flight after which memory counts
GROWTH = 5.0  # MB that it may grow then
GAP_EVERY = 1900.0  # s; each a little longer than the one before, from 3 s to 30 s
TURN = 2 * pi * 90.0 / 18.0  # s, of the slowest turn
METRES_A_DEGREE = 111_200.0


@dataclass
class Log:
    """What was written: samples, and when the link or the vehicle was not there [s]."""

    samples: int = 0
    breaks: list[tuple[float, float]] = field(default_factory=list)


def write_log(path: Path, hours: float, rate: float, seed: int = 1) -> Log:
    """Write the log, sample by sample.

    Parameters
    ----------
    path : Path
    hours : float
    rate : float
        Positions a second [Hz].
    """
    random, log, send = np.random.default_rng(seed), Log(), Sender()
    duration, angle = hours * 3600.0, 0.0
    reboot, boot = 0.55 * duration, -60.0
    gap_until, next_gap, gap = 0.0, GAP_EVERY, 3.0
    steps = max(1, round(10.0 / rate))  # of the integration, to a sample
    with open(path, "wb") as file:

        def write(second: float, message) -> None:
            stamp = START_US + round((second + 0.04) * 1e6)
            file.write(struct.pack(">Q", stamp) + send(message))

        for i in range(int(duration * rate)):
            t = i / rate
            if boot < 0.0 and t >= reboot:
                log.breaks.append((t, t + 20.0))
                boot, gap_until = t + 15.0, t + 20.0
            if t >= next_gap:
                log.breaks.append((t, t + gap))
                gap_until, gap = t + gap, min(gap + 1.0, 30.0)
                next_gap += GAP_EVERY
            radius = 70.0 + 20.0 * sin(2 * pi * t / 5000.0)
            spiral = 20.0 * cos(2 * pi * t / 5000.0) * 2 * pi / 5000.0
            airspeed = 20.0 + 2.0 * sin(2 * pi * t / 3100.0)
            blows = 2 * pi * t / 20_000.0
            strength = 2.0 + 2.0 * sin(2 * pi * t / 7700.0)
            wind = strength * cos(blows), strength * sin(blows)
            for _ in range(steps):
                tangent = -sin(angle), cos(angle)
                across = tangent[0] * wind[1] - tangent[1] * wind[0]
                along = tangent[0] * wind[0] + tangent[1] * wind[1]
                speed = along + sqrt(airspeed**2 - across**2)
                here = radius * cos(angle), radius * sin(angle)
                angle += speed / radius / rate / steps
            if t < gap_until:
                continue
            east, north, up = random.normal((*here, 300.0), 1.0)
            velocity = [
                speed * tangent[k] + spiral * here[k] / radius + random.normal(0.0, 0.2)
                for k in (0, 1)
            ]
            boot_ms = round((t - boot) * 1000)
            if i % max(1, round(rate)) == 0:
                write(t, heartbeat())
                write(t, system_time(START_US + round(t * 1e6), boot_ms))
                direction = np.degrees(atan2(-wind[0], -wind[1])) % 360.0
                write(t, dialect.MAVLink_wind_message(direction, hypot(*wind), 0.0))
            place = {
                "lat": 47.4 + north / METRES_A_DEGREE,
                "lon": 8.5 + east / METRES_A_DEGREE / cos(np.radians(47.4)),
            }
            raw = {name: round(value * 1e7) for name, value in place.items()}
            heights = {"alt": round((100.0 + up) * 1000)}
            write(t, gps_raw(**raw, **heights, time_usec=boot_ms * 1000, h_acc=1000, vel_acc=200))
            write(t, position(
                boot_ms, **place, **heights, relative_alt=round(up * 1000),
                vx=round(velocity[1] * 100), vy=round(velocity[0] * 100),
            ))  # fmt: skip
            log.samples += 1
    return log


@dataclass
class Soak:
    """What came of it."""

    summary: dict
    records: int  # predictions received, valid or not
    poses: int
    holding: int  # records whose pose holds: in a wind, with the motion in it
    growth_mb: float  # of the resident memory, most after the first ten minutes
    resident_mb: float  # at ten minutes
    wall_s: float
    unexpected: list[float]  # times without a valid prediction that nothing explains [s]

    def assert_good(self, log: Log) -> None:
        """Nothing lost, nothing grown."""
        assert self.summary["samples"] == self.records == log.samples
        assert self.poses == self.holding
        assert self.summary["predictions"] > 0.9 * log.samples
        assert not self.unexpected, f"no prediction at {self.unexpected[:5]} s"
        assert self.growth_mb < GROWTH


def soak(path: Path, log: Log, folder: Path) -> Soak:
    """Replay a log through the node, and watch it."""
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
    from running_node import RunningNode
    from std_msgs.msg import String

    everything = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
    latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    # After each break half a turn or a whole one is flown before an orbit is known again.
    breaks = [(0.0, 0.0), *log.breaks]
    known = [(start, end + 1.3 * TURN) for start, end in breaks]
    seen = {"records": 0, "poses": 0, "holding": 0, "time": 0.0, "first": None}
    unexpected = array("d")
    resident = array("d")
    started = time.monotonic()

    def add_pose(_) -> None:
        seen["poses"] += 1

    def add_record(message) -> None:
        seen["records"] += 1
        record = json.loads(message.data)
        seen["holding"] += record["pose_holds"]
        stamp = record["stamp_ns"] / 1e9 - START_US / 1e6
        seen["time"] = stamp
        if not record["valid"] and not any(start <= stamp < end for start, end in known):
            unexpected.append(stamp)

    parameters = {"mavlink.url": f"'{path}'", "replay.wait_for_subscribers": 60.0}
    with RunningNode(folder, parameters) as node:
        create = node.observer.create_subscription
        create(PoseWithCovarianceStamped, "/predictor/end_mass/pose", add_pose, everything)
        create(String, "/predictor/prediction", add_record, everything)
        summaries = node.messages(String, "/predictor/summary", latched)
        node.wait_until_ready()
        warm = 0.0
        shown = 0.0
        while not summaries or seen["records"] < json.loads(summaries[0].data)["samples"]:
            before = seen["records"]
            node.wait_until(lambda before=before: seen["records"] > before or summaries, 120.0)
            node.spin(0.5)
            resident.append(resident_mb(node.process.pid))
            if not warm and seen["time"] >= WARM:
                warm, first = resident[-1], len(resident) - 1
            if seen["time"] >= shown:
                shown = seen["time"] + 3600.0
                print(f"{seen['time'] / 3600:5.1f} h  {resident[-1]:7.1f} MB", file=sys.stderr)
        node.spin(2.0)
        resident.append(resident_mb(node.process.pid))
    return Soak(
        json.loads(summaries[0].data), seen["records"], seen["poses"],
        seen["holding"], max(resident[first:]) - warm, warm, time.monotonic() - started,
        list(unexpected),
    )  # fmt: skip


def resident_mb(process: int) -> float:
    """Resident memory of a process [MB]."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise OSError(f"process {process} has no memory")


def main() -> None:
    """Write, replay, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0, help="of flight (default 24)")
    parser.add_argument("--rate", type=float, default=5.0, help="positions a second (default 5)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "soak.tlog"
        log = write_log(path, arguments.hours, arguments.rate)
        print(f"{log.samples} samples, {path.stat().st_size / 1e6:.0f} MB", file=sys.stderr)
        found = soak(path, log, Path(name))
    print(
        f"{arguments.hours:g} h at {arguments.rate:g} Hz in {found.wall_s:.0f} s: "
        f"{found.records} of {log.samples} samples received, "
        f"{found.summary['predictions']} with a valid prediction, "
        f"{found.poses} of {found.holding} poses, {len(found.unexpected)} missing; "
        f"skipped {found.summary['skipped']}; "
        f"memory {found.resident_mb:.1f} MB after 10 minutes, {found.growth_mb:+.2f} MB since"
    )
    found.assert_good(log)


if __name__ == "__main__":
    main()
