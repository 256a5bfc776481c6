"""The real node on live telemetry: a TCP server that goes away; mavros's topics in sim time."""

import contextlib
import socket
import threading
import time

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import (
    PoseStamped,
    PoseWithCovarianceStamped,
    TwistStamped,
    TwistWithCovarianceStamped,
)
from mavlink_bytes import Sender, gps_raw, heartbeat, position
from pymavlink.dialects.v20 import all as dialect
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from running_node import RunningNode
from sample_flights import orbiting, samples_of
from std_msgs.msg import String

from ctcbs_ros.replay.through_node import quoted

FLIGHT = orbiting(radius=60.0, speed=20.0, turns=3.0)


def values(status):
    return {pair.key: pair.value for pair in status.values}


class Server:
    """An aircraft on its circle behind a TCP server, faster than real time, until it is closed."""

    def __init__(self, port, start_ms):
        self._server = socket.create_server(("127.0.0.1", port))
        self._start_ms = start_ms
        self._received = b""
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        self._server.settimeout(0.1)
        while not self._closing.is_set():
            try:
                connection, _ = self._server.accept()
            except OSError:  # nobody came, or closed
                continue
            with connection:
                self._fly(connection)

    def _fly(self, connection):
        send = Sender()
        connection.sendall(send(heartbeat()) + send(gps_raw(alt=547_000, alt_ellipsoid=594_000)))
        for sample in samples_of(FLIGHT):
            if self._closing.wait(0.01):
                return
            east, north, up = (round(100 * v) for v in sample.velocity)
            message = position(
                self._start_ms + round(1000 * sample.time), sample.latitude, sample.longitude,
                alt=round(1000 * sample.altitude_amsl), vx=north, vy=east, vz=-up,
            )  # fmt: skip
            try:
                connection.sendall(send(gps_raw(alt=message.alt)) + send(message))
            except OSError:
                return
            self._receive(connection)
        while not self._closing.wait(0.05):
            self._receive(connection)

    def _receive(self, connection):
        with contextlib.suppress(OSError):
            self._received += connection.recv(65535, socket.MSG_DONTWAIT)

    def heard(self):
        """Types of the messages that came."""
        found = dialect.MAVLink(None).parse_buffer(bytearray(self._received)) or []
        return {message.get_type() for message in found}

    def close(self):
        # The listening socket first: else the node may be back before it is gone.
        self._server.close()
        self._closing.set()
        self._thread.join()


def test_tcp_server_that_goes_away_is_told_and_predictions_go_on_when_it_is_back(
    tmp_path, drone_table
):
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    parameters = {
        "mavlink.url": f"tcp:127.0.0.1:{port}",
        "mavlink.heartbeat": "true",
        "mavlink.request_rate": 5.0,
        "table.file": quoted(str(drone_table)),
        "limits.stale_after": 0.5,
        "diagnostics.period": 0.1,
    }
    with RunningNode(tmp_path, parameters) as node:
        poses = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", 100)
        arrays = node.messages(DiagnosticArray, "/diagnostics")

        def telemetry_says(text, level):
            return arrays and text in arrays[-1].status[0].message and (
                arrays[-1].status[0].level == level
            )

        node.wait_until_ready()
        node.wait_until(
            lambda: telemetry_says("link not up yet: Connection refused", DiagnosticStatus.ERROR)
        )
        for number, start_ms in enumerate((100_000, 400_000), 1):
            before = len(poses)
            server = Server(port, start_ms)
            try:
                node.wait_until(lambda: len(poses) > before + 10)  # noqa: B023
                if number == 1:
                    node.wait_until(
                        lambda: server.heard() == {"HEARTBEAT", "COMMAND_LONG"}  # noqa: B023
                    )
            finally:
                server.close()
            assert "following fixed wing, system 1, component 1" in node.output
            node.wait_until(
                lambda: telemetry_says("link lost: Connection refused", DiagnosticStatus.ERROR)
            )
            assert all(s.level == DiagnosticStatus.ERROR for s in arrays[-1].status)
            assert values(arrays[-1].status[0])["link connections"] == str(number)
            # What had come before may still wait at that moment.
            arrays.clear()
            node.wait_until(lambda: len(arrays) > 3)
            predicted = values(arrays[-1].status[0])["valid predictions"]
            arrays.clear()
            node.wait_until(lambda: len(arrays) > 3)
            assert values(arrays[-1].status[0])["valid predictions"] == predicted


def stamp(message, nanoseconds):
    message.header.frame_id = "map"
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, 10**9)
    return message


def test_mavros_pose_velocity_and_wind_give_predictions_in_simulated_time(tmp_path, drone_table):
    parameters = {
        "use_sim_time": "true",
        "table.file": quoted(str(drone_table)),
        "limits.stale_after": 0.5,
        "diagnostics.period": 0.1,
    }
    with RunningNode(tmp_path, parameters) as node:
        records = node.messages(String, "/predictor/prediction", 100)
        found = node.messages(PoseWithCovarianceStamped, "/predictor/end_mass/pose", 100)
        arrays = node.messages(DiagnosticArray, "/diagnostics")
        create = node.observer.create_publisher
        clock = create(Clock, "/clock", 10)
        poses = create(PoseStamped, "/mavros/local_position/pose", qos_profile_sensor_data)
        twists = create(
            TwistStamped, "/mavros/local_position/velocity_local", qos_profile_sensor_data
        )
        winds = create(
            TwistWithCovarianceStamped, "/mavros/wind_estimation", qos_profile_sensor_data
        )
        node.wait_until(
            lambda: all(p.get_subscription_count() for p in (clock, poses, twists, winds))
        )
        node.wait_until_ready()

        def set_clock(nanoseconds):
            now = Clock()
            now.clock.sec, now.clock.nanosec = divmod(nanoseconds, 10**9)
            clock.publish(now)

        for sample in samples_of(FLIGHT, local=True, start=1000.0):
            pose, twist = PoseStamped(), TwistStamped()
            (
                pose.pose.position.x, pose.pose.position.y, pose.pose.position.z
            ) = map(float, sample.local_position)  # fmt: skip
            (
                twist.twist.linear.x, twist.twist.linear.y, twist.twist.linear.z
            ) = map(float, sample.velocity)  # fmt: skip
            last_ns, before = sample.stamp_ns, len(records)
            while len(records) == before:  # best effort: what is lost is sent again
                winds.publish(stamp(TwistWithCovarianceStamped(), last_ns))
                set_clock(last_ns)
                twists.publish(stamp(twist, last_ns))
                poses.publish(stamp(pose, last_ns))
                node.spin(1.0, until=lambda: len(records) > before)  # noqa: B023
            if len(found) > 20:
                break
        node.wait_until(lambda: len(found) > 20)
        assert 1000 < found[-1].header.stamp.sec <= last_ns // 10**9
        arrays.clear()
        node.wait_until(lambda: len(arrays) > 2)
        telemetry = values(arrays[-1].status[0])
        assert int(telemetry["samples"]) > 20
        assert "/mavros/local_position/pose" in telemetry["source"]
        # The clock stands still: nothing is stale, however long that takes here.
        time.sleep(1.0)
        arrays.clear()
        node.wait_until(lambda: len(arrays) > 2)
        assert "STALE_TELEMETRY" not in arrays[-1].status[0].message
        set_clock(last_ns + 5_000_000_000)
        node.wait_until(lambda: "STALE_TELEMETRY" in arrays[-1].status[0].message)
        assert arrays[-1].status[0].level == DiagnosticStatus.ERROR
