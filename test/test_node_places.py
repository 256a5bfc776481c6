"""Poses, fixes and markers at the edges of the Earth, in wind, by a geodesy of their own.

Near the poles, across 180 degrees of longitude, on both hemispheres and in both senses. The
closed formulas of an ellipsoid (Hofmann-Wellenhof, GNSS, section 8.2) and the figures of WGS 84.
"""

from math import cos, radians, sin, sqrt

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
from running_node import DRONE, RunningNode
from sensor_msgs.msg import NavSatFix
from visualization_msgs.msg import Marker, MarkerArray

from ctcbs_ros.cli.main import main
from ctcbs_ros.replay.through_node import quoted

KEEP_ALL = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
RADIUS, WIND_TO = 70.0, radians(90.0 - 70.0)  # blowing from 250 deg, ENU angle


def earth_fixed(fix):
    """Cartesian coordinates [m] of latitude, longitude and height."""
    a, e2 = 6378137.0, 2.0 / 298.257223563 - 298.257223563**-2
    latitude, longitude = radians(fix.latitude), radians(fix.longitude)
    normal = a / sqrt(1.0 - e2 * sin(latitude) ** 2)
    across = (normal + fix.altitude) * cos(latitude)
    return np.array([
        across * cos(longitude), across * sin(longitude),
        (normal * (1.0 - e2) + fix.altitude) * sin(latitude),
    ])  # fmt: skip


def local(fix, datum):
    """East, north, up [m] of a position from another."""
    la, lo = radians(datum.latitude), radians(datum.longitude)
    axes = np.array([
        [-sin(lo), cos(lo), 0.0],
        [-sin(la) * cos(lo), -sin(la) * sin(lo), cos(la)],
        [cos(la) * cos(lo), cos(la) * sin(lo), sin(la)],
    ])  # fmt: skip
    return axes @ (earth_fixed(fix) - earth_fixed(datum))


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def place(point):
    return np.array([point.x, point.y, point.z])


def by_stamp(messages):
    return {stamp(m): m for m in messages}


@pytest.mark.parametrize(
    ("latitude", "longitude", "sense", "name"),
    [(80.0, 179.9999, 1, "ccw"), (-80.0, -179.9999, -1, "cw")],
)
def test_at_the_edges_of_the_earth_in_wind_all_messages_are_of_one_place(
    tmp_path, drone_table, latitude, longitude, sense, name
):
    log = tmp_path / "flight.tlog"
    flight = f"--radius {RADIUS} --speed 20 --turns 3.5 --sense {name} --wind 3,250"
    command = f"simulate --config {DRONE} {flight} --center={latitude},{longitude} -o {log}"
    assert main(command.split()) == 0
    parameters = {"mavlink.url": quoted(str(log)), "table.file": quoted(str(drone_table))}
    with RunningNode(tmp_path, parameters | {"replay.wait_for_subscribers": 30.0}) as node:
        poses, simulated = (
            node.messages(PoseWithCovarianceStamped, f"/predictor/end_mass/{topic}", KEEP_ALL)
            for topic in ("pose", "simulated_pose")
        )
        fixes = node.messages(NavSatFix, "/predictor/end_mass/fix", KEEP_ALL)
        cables = node.messages(MarkerArray, "/predictor/cable", KEEP_ALL)
        datums = node.messages(NavSatFix, "/predictor/datum", LATCHED)
        node.wait_until(lambda: "end of the log" in node.output and datums, 120.0)
        node.wait_until(lambda: poses and {*by_stamp(poses)} == {*by_stamp(fixes)})
        newest = max(by_stamp(poses))
        node.wait_until(lambda: len({*by_stamp(simulated)} & {*by_stamp(poses)}) > 100)
        node.wait_until(lambda: newest in {stamp(a.markers[0]) for a in cables})
    # By their stamps: where the end mass is, and that it is the same place in each message.
    (datum, *_), fixes, poses = datums, by_stamp(fixes), by_stamp(poses)
    found = {s: place(m.pose.pose.position) for s, m in poses.items()}
    assert len(found) > 150
    for s, enu in found.items():
        assert local(fixes[s], datum) == pytest.approx(enu, abs=1e-3)
    center = NavSatFix(latitude=latitude, longitude=longitude, altitude=datum.altitude)
    center = local(center, datum)[:2]
    stamps = sorted(found)[-110:]  # a turn of 22 s at 5 Hz
    off = np.mean([found[s] for s in stamps], axis=0)[:2] - center
    # Of wind towards east-north-east; across it to the left where the circle is anticlockwise.
    along, left = (np.array([cos(WIND_TO), sin(WIND_TO)]), np.array([-sin(WIND_TO), cos(WIND_TO)]))
    assert off @ along > 10.0
    assert sense * (off @ left) > 5.0
    # The heading is that of the track, x forward, east being nought and north a quarter turn.
    for before, after in zip(stamps[:-1:10], stamps[1::10], strict=False):
        way = (found[after] - found[before])[:2]
        q = poses[before].pose.pose.orientation
        assert q.x == q.y == 0.0
        yaw = 2.0 * np.arctan2(q.z, q.w)
        turned = np.angle((way[0] + 1j * way[1]) * np.exp(-1j * yaw))
        assert abs(turned) < 0.15
        # Both go round in the sense of the flight: by half of what is turned in the step.
        assert sense * turned > -0.01
    # The cable in time, once it has forgotten its beginning, is at the same place.
    both = [s for s in by_stamp(simulated) if s in found and s >= stamps[0]]
    assert len(both) > 20
    places = by_stamp(simulated)
    apart = [np.linalg.norm(place(places[s].pose.pose.position) - found[s]) for s in both]
    assert np.median(apart) < 2.0
    # The cable hangs between the aircraft's circle and the end mass, whose path is closed.
    for array in cables:
        lines = {m.ns: m for m in array.markers if m.action == Marker.ADD}
        if not lines or stamp(lines["cable"]) not in stamps:
            continue
        points = [place(p) for p in lines["cable"].points]
        assert points[0] == pytest.approx(found[stamp(lines["cable"])], abs=1e-6)
        assert np.hypot(*(points[-1][:2] - center)) == pytest.approx(RADIUS, abs=1.5)
        path = np.array([place(p) for p in lines["end_mass_circle"].points])
        assert path[0] == pytest.approx(path[-1])
        assert np.linalg.norm(path - points[0], axis=1).min() < 1e-6
        east, north = (path[:-1, :2] - path[:-1, :2].mean(axis=0)).T
        following = np.roll(east, -1), np.roll(north, -1)
        assert sense * np.sum(east * following[1] - north * following[0]) > 0.0
