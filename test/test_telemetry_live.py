"""Live links: real sockets, a sender that is killed and comes back, floods, wrong urls."""

import os
import pty
import signal
import socket
import subprocess
import sys
import time

import pytest
from mavlink_bytes import Sender, gps_raw, heartbeat, position

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder, open_link

# A vehicle in a process of its own, by pymavlink's link: 20 positions a second from a boot time.
VEHICLE = """
import os, sys, time
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
url, boot_ms = sys.argv[1], int(sys.argv[2])
link = mavutil.mavlink_connection(url, source_system=1, source_component=1)
link.mav.heartbeat_send(1, 3, 0, 0, 4)
start = time.monotonic()
while True:
    ms = boot_ms + int((time.monotonic() - start) * 1000)
    link.mav.global_position_int_send(
        ms, 474000000, 85000000, 500000, 400000, 2000, 0, 0, 0)
    time.sleep(0.05)
"""


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def collect(source, enough, timeout=10.0):
    """Samples polled until there are enough; fails when they do not come."""
    samples, deadline = [], time.monotonic() + timeout
    while len(samples) < enough:
        assert time.monotonic() < deadline, f"{len(samples)} of {enough} samples came"
        samples += source.poll()
        time.sleep(0.01)
    return samples


@pytest.fixture
def link():
    """Opens links and closes them after the test."""
    opened = []

    def open_it(*args, **kwargs):
        opened.append(open_link(*args, **kwargs))
        return opened[-1]

    yield open_it
    for source in opened:
        source.close()


@pytest.fixture
def vehicle():
    """Starts vehicles, each a process, and ends them after the test."""
    started = []

    def start(url, boot_ms):
        started.append(subprocess.Popen([sys.executable, "-c", VEHICLE, url, str(boot_ms)]))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def test_sender_may_be_killed_and_come_back_rebooted(link, vehicle):
    port = free_port()
    source = link(f"udpin:{port}")
    first = vehicle(f"udpout:127.0.0.1:{port}", 600_000)
    before = collect(source, 20)
    assert source.vehicle == Vehicle(1, 1, "fixed wing")
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    time.sleep(0.3)
    source.poll()
    vehicle(f"udpout:127.0.0.1:{port}", 5_000)
    after = collect(source, 20)
    assert {s.flight for s in before} == {0}
    assert {s.flight for s in after} == {1}
    times = [s.time for s in before + after]
    assert times == sorted(times)
    # The clock went on by what the link saw pass, a second or a few, not by the reboot's 595 s.
    assert 0.2 < after[0].time - before[-1].time < 9.0
    assert abs(after[-1].stamp_ns / 1e9 - time.time()) < 5.0
    assert source.dropped == 0
    assert time.monotonic() - source.last_received < 1.0


def test_udp_listens_on_loopback_unless_told_otherwise(link):
    port = free_port()
    source = link(f"udpin:{port}")
    assert source._transport._socket.getsockname() == ("127.0.0.1", port)
    other = free_port()
    assert link(f"udpin:0.0.0.0:{other}")._transport._socket.getsockname()[0] == "0.0.0.0"


def test_port_that_is_taken_is_refused():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"{port}.*in use"):
            open_link(f"udpin:{port}")


def test_port_is_free_again_after_close():
    port = free_port()
    for _ in range(3):
        open_link(f"udpin:{port}").close()


@pytest.mark.parametrize(
    "url",
    [
        "", "udpin:", "udpin:port", "udpin:0", "udpin:70000", "udpin:1.2.3:4:5", "udpout:14550",
        "tcp:localhost", "tcp::5760", "tcp:no host here:5760", "/dev/no_such_device",
        "udpin:14\u066050", "udpin:-14550", "flight.tlog", "udp:127.0.0.1:14550",
    ],
)  # fmt: skip
def test_malformed_url_is_refused_with_what_is_allowed(url):
    with pytest.raises(InputError, match=r"udpin:\[HOST:\]PORT|1 to 65535") as refusal:
        open_link(url)
    assert repr(url) in str(refusal.value)


def test_caller_is_answered_once_its_heartbeat_was_heard(link):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(10)
        source = link(f"udpout:127.0.0.1:{vehicle.getsockname()[1]}")
        hello, caller = vehicle.recvfrom(300)
        (found,) = MavlinkDecoder(False)._frames.split(hello)
        assert found[1].get_type() == "HEARTBEAT"
        assert found[1].autopilot == 8  # MAV_AUTOPILOT_INVALID: not one that others would follow
        send = Sender()
        vehicle.sendto(send(heartbeat()) + send(position(1000)), caller)
        assert collect(source, 1)[0].latitude == 47.4


def test_tcp_server_may_go_away_and_come_back(link):
    port = free_port(socket.SOCK_STREAM)
    source = link(f"tcp:127.0.0.1:{port}")
    send = Sender()
    for boot_ms in (1000, 3000):
        with socket.create_server(("127.0.0.1", port)) as server:
            server.settimeout(10)
            connection, _ = server.accept()
            with connection:
                connection.sendall(send(heartbeat()) + send(position(boot_ms)))
                assert collect(source, 1)[0].time == boot_ms / 1000


def test_serial_device_is_read(link):
    pytest.importorskip("serial", reason="pyserial is not installed")
    controller, device = pty.openpty()
    source = link(os.ttyname(device), baud=115200)
    send = Sender()
    os.write(controller, send(heartbeat()) + send(position(1000)))
    assert collect(source, 1)[0].time == 1.0
    os.close(device)
    os.close(controller)  # unplugged: reading goes on without raising
    time.sleep(0.3)
    assert source._thread.is_alive()


def test_flood_keeps_the_newest_samples_and_counts_the_rest():
    class Flood:
        """All of a flood's bytes at once, then silence."""

        def __init__(self, count):
            send = Sender()
            self.frames = [send(heartbeat()), send(gps_raw())]
            self.frames += [send(position(1000 + 20 * i)) for i in range(count)]

        def read(self):
            return self.frames.pop(0) if self.frames else b""

        def close(self):
            pass

    flood = Flood(5000)
    source = LiveSource(flood, MavlinkDecoder(False), capacity=100)
    while flood.frames:
        time.sleep(0.01)
    source.close()
    samples = source.poll()
    assert len(samples) == 100
    assert samples[-1].time == pytest.approx(1.0 + 0.02 * 4999)
    assert source.dropped == 4900
    assert source.link.messages == 5002


def test_real_flood_over_udp_is_read_to_its_newest_sample(link):
    port = free_port()
    source = link(f"udpin:{port}")
    send = Sender()
    total = 10_000
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        sender.send(send(heartbeat()))
        for i in range(total - 2):
            sender.send(send(position(1000 + i)))
            if i % 50 == 0:
                time.sleep(0.005)  # 10,000 a second
        time.sleep(0.5)
        sender.send(send(position(1000 + total)))
    deadline = time.monotonic() + 10
    samples = []
    while not samples or samples[-1].time < (1000 + total) / 1000:
        assert time.monotonic() < deadline
        samples += source.poll()
        time.sleep(0.01)
    # What the kernel drops shows in the sequence numbers, up to their wrap at 256.
    assert source.link.received[1, 1] + source.link.lost[1, 1] <= total
    assert len(samples) + source.dropped == source.link.received[1, 1] - 1
