"""The payload's beacon on a topic of a process of its own, beside a live MAVLink aircraft.

Three processes: the beacon answers each prediction that it hears with a report of that time, and
the aircraft flies on when that is sent. No clock decides what comes of it.
"""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from beacon_flight import STILL
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3Stamped
from links import free_port
from mavlink_bytes import Sender, gps_raw, heartbeat, position, system_time
from running_node import RunningNode
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import String
from test_beacon_node import (
    AXES,
    CENTER,
    INTERVAL,
    KEEP_ALL,
    RADIUS,
    RATE,
    START_NS,
    aircraft_at,
    beside_aircraft,
)

from ctcbs_ros.geodesy import to_geodetic
from ctcbs_ros.replay.through_node import quoted
from ctcbs_ros.telemetry.topics import nanoseconds

BEACON = """
import json
import rclpy
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import String
from test_beacon_node import INTERVAL, START_NS, beacon_at, fix_at

rclpy.init()
node = rclpy.create_node("beacon")
publisher = node.create_publisher(NavSatFix, "payload/fix", 10)

def answer(message):
    stamp = json.loads(message.data)["stamp_ns"]
    fix = fix_at(beacon_at(round((stamp - START_NS) / 1e9 / INTERVAL)))
    fix.header.stamp.sec, fix.header.stamp.nanosec = divmod(stamp, 10**9)
    publisher.publish(fix)

every = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
node.create_subscription(String, "/predictor/prediction", answer, every)
rclpy.spin(node)
"""
BOOT_MS = 600_000
GEOID = 47.0  # m


@pytest.fixture
def beacon():
    """Starts the process of the beacon in a ROS domain, and ends it after the test."""
    started = []

    def start(domain):
        paths = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        }  # fmt: skip
        started.append(subprocess.Popen([sys.executable, "-c", BEACON], env=environment))

    yield start
    for process in started:
        process.kill()
        process.wait()


def frames(send, number):
    """One moment of the aircraft on its circle."""
    east, north, up = aircraft_at(number)
    latitude, longitude, altitude = to_geodetic(CENTER, east, north, up)
    above_sea = round(1000 * (altitude - GEOID))
    time_ms = BOOT_MS + round(1000 * number * INTERVAL)
    vx, vy = round(100 * RATE * east), round(-100 * RATE * north)  # north, east
    fix = gps_raw(
        lat=round(latitude * 1e7), lon=round(longitude * 1e7), alt=above_sea,
        alt_ellipsoid=round(1000 * altitude), vel=round(100 * RADIUS * RATE),
    )  # fmt: skip
    return b"".join(map(send, (
        heartbeat(), system_time(START_NS // 1000 + 1000 * (time_ms - BOOT_MS), time_ms), fix,
        position(time_ms, latitude, longitude, alt=above_sea, vx=vx, vy=vy),
    )))  # fmt: skip


def test_a_beacon_of_another_process_is_held_against_an_aircraft_heard_live(
    tmp_path, drone_table, beacon
):
    port = free_port()
    parameters = {
        "table.file": quoted(str(drone_table)), "beacon.topic": "payload/fix",
        "mavlink.url": f"udpin:{port}", "limits.stale_after": 600.0,
        **dict(setting.split("=") for setting in STILL),
    }  # fmt: skip
    aircraft, send = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Sender()
    with aircraft, RunningNode(tmp_path, parameters) as node:
        off = node.messages(
            Vector3Stamped, "/predictor/end_mass/measured_minus_predicted", KEEP_ALL
        )
        told = node.messages(String, "/predictor/beacon", KEEP_ALL)
        taken = node.messages(String, "/predictor/prediction", KEEP_ALL)
        poses = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", KEEP_ALL)
        sent = node.messages(NavSatFix, "payload/fix", KEEP_ALL)
        node.wait_until_ready()
        beacon(node.context.get_domain_id())
        node.wait_until(lambda: node.observer.count_publishers("payload/fix"))

        def fly(number):
            stamp = START_NS + round(number * INTERVAL * 1e9)

            def is_taken():
                heard = any(json.loads(one.data)["stamp_ns"] == stamp for one in taken[-5:])
                return heard and any(nanoseconds(one.header.stamp) == stamp for one in sent[-5:])

            while not is_taken():  # a datagram, or what is first on a topic, may be lost
                aircraft.sendto(frames(send, number), ("127.0.0.1", port))
                node.spin(2.0, is_taken)
            return stamp

        for number in range(110):
            last = fly(number)
        # What is settled comes once a quarter of a turn more has been flown; some may be lost.
        due = last - (0.25 * 2.0 * 3.1416 / RATE + 6.0 * INTERVAL) * 1e9
        node.wait_until(lambda: off and nanoseconds(off[-1].header.stamp) >= due)
        settled = {
            record["stamp_ns"]: record
            for record in (json.loads(one.data) for one in told)
            if record["outcome"] == "settled"
        }
        node.wait_until(lambda: {nanoseconds(m.header.stamp) for m in off} >= set(settled))
        off = [message for message in off if nanoseconds(message.header.stamp) in settled]
        flown = {r["stamp_ns"]: r for r in (json.loads(one.data) for one in taken)}
        places = {nanoseconds(one.header.stamp): one.pose.pose.position for one in poses}
        held = 0  # of those heard before the aircraft was a second on
        for message in off:
            stamp = nanoseconds(message.header.stamp)
            if stamp not in places or settled[stamp]["time_by"] != "header stamps":
                continue
            held += 1
            number = round((stamp - START_NS) / 1e9 / INTERVAL)
            for axis, name, beside in zip("xyz", AXES, beside_aircraft(number), strict=True):
                measured = flown[stamp][f"tow_point_{name}_m"] + beside
                expected = measured - getattr(places[stamp], axis)
                assert getattr(message.vector, axis) == pytest.approx(expected, abs=0.05)
        assert held > 10
