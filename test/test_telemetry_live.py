"""Live links: real sockets and ports, peers that go away and come back, floods, wrong urls."""

import errno
import itertools
import os
import pty
import signal
import socket
import subprocess
import sys
import time

import pytest
from mavlink_bytes import Sender, gps_raw, heartbeat, position
from processes import LIMIT, wait_for
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry import live, own_messages, transport
from ctcbs_ros.telemetry.lateness import Lateness
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder, open_link
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.transport import Reconnecting
from ctcbs_ros.telemetry.vehicle_messages import VehicleDecoder

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


def collect(source, enough, timeout=LIMIT):
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
    begun = time.monotonic()
    first = vehicle(f"udpout:127.0.0.1:{port}", 600_000)
    before = collect(source, 20)
    assert source.vehicle == Vehicle(1, 1, "fixed wing")
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    wait_for(lambda: time.monotonic() - source.last_received > 0.3)
    before += source.poll()
    rebooted, rebooted_unix = time.monotonic(), time.time()
    vehicle(f"udpout:127.0.0.1:{port}", 5_000)
    after = collect(source, 20)
    assert {s.flight for s in before} == {0}
    assert {s.flight for s in after} == {1}
    times = [s.time for s in before + after]
    assert times == sorted(times)
    # The clock went on by what the link saw pass, not by the reboot's 595 s.
    assert 0.2 < after[0].time - before[-1].time < time.monotonic() - begun
    assert rebooted_unix < after[0].stamp_ns / 1e9 < time.time()
    assert source.dropped == 0
    assert rebooted < source.last_received <= time.monotonic()


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
        with pytest.raises(InputError, match=f"{port}.*another program listens on this port"):
            open_link(f"udpin:{port}")


@pytest.mark.parametrize(
    ("url", "number", "told"),
    [
        ("/dev/ttyACM0", errno.EACCES, "members of the device's group (often dialout)"),
        ("/dev/ttyACM0", errno.EBUSY, "another program has this device"),
        ("udpin:500", errno.EACCES, "ports from 1024 on need none"),
        ("udpin:8.8.8.8:5000", errno.EADDRNOTAVAIL, "this machine does not have that address"),
    ],
)
def test_link_that_the_system_refuses_is_told_with_what_to_do(monkeypatch, url, number, told):
    def refused(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(transport, "serial_device", refused)
    monkeypatch.setattr(transport, "UdpListener", refused)
    with pytest.raises(InputError) as refusal:
        open_link(url)
    assert str(refusal.value).startswith(f"link {url!r} cannot be opened: ")
    assert told in str(refusal.value)


@pytest.mark.parametrize(
    ("device", "told"),
    [("/dev/ttyNONE", "there is no such device"), ("/dev/null", "it is not a serial device")],
)
def test_what_is_no_serial_device_is_told_to_be_none(device, told):
    with pytest.raises(InputError, match=told):
        open_link(device)


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


def messages_of(data):
    """What is in some bytes, by pymavlink's own parser."""
    return dialect.MAVLink(None).parse_buffer(bytearray(data)) or []


def test_caller_is_answered_once_its_heartbeat_was_heard(link):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(LIMIT)
        source = link(f"udpout:127.0.0.1:{vehicle.getsockname()[1]}")
        hello, caller = vehicle.recvfrom(300)
        (found,) = messages_of(hello)
        assert found.get_type() == "HEARTBEAT"
        assert found.type == dialect.MAV_TYPE_ONBOARD_CONTROLLER
        assert found.autopilot == dialect.MAV_AUTOPILOT_INVALID
        # Not the system of ground stations, whose heartbeats hold off a failsafe.
        assert found.get_srcSystem() == 254
        send = Sender()
        vehicle.sendto(send(heartbeat()) + send(position(1000)), caller)
        assert collect(source, 1)[0].latitude == 47.4


def test_tcp_server_may_go_away_and_come_back(link):
    port = free_port(socket.SOCK_STREAM)
    source = link(f"tcp:127.0.0.1:{port}")
    wait_for(lambda: source.state() == "not up yet: Connection refused")
    send = Sender()
    for number, boot_ms in enumerate((1000, 3000), 1):
        with socket.create_server(("127.0.0.1", port)) as server:
            server.settimeout(LIMIT)
            connection, _ = server.accept()
            with connection:
                connection.sendall(send(heartbeat()) + send(position(boot_ms)))
                assert collect(source, 1)[0].time == boot_ms / 1000
                assert source._transport.trouble == ""
                assert source.connections == number
        wait_for(lambda: source.state() == "lost: Connection refused")


def test_link_that_is_refused_is_tried_ever_less_often(monkeypatch):
    monkeypatch.setattr(transport, "FIRST_RETRY", 0.1)
    tries = []

    def refused():
        tries.append(time.monotonic())
        raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")

    connection = Reconnecting(refused, None, None)
    wait_for(lambda: connection.read() == b"" and len(tries) == 4)
    pauses = [after - before for before, after in itertools.pairwise(tries)]
    for pause, least in zip(pauses, (0.1, 0.2, 0.4), strict=True):
        assert pause >= least


def test_whoever_connects_to_a_listening_tcp_link_is_read_and_the_newest_counts(link):
    port = free_port(socket.SOCK_STREAM)
    source = link(f"tcpin:{port}")
    assert source.state() == "not up yet: nobody has connected"
    send = Sender()
    with socket.create_connection(("127.0.0.1", port)) as first:
        first.sendall(send(heartbeat()) + send(position(1000)))
        assert collect(source, 1)[0].time == 1.0
        # The first one hangs, without a word; the vehicle connects anew.
        with socket.create_connection(("127.0.0.1", port)) as second:
            second.sendall(send(position(2000)))
            assert collect(source, 1)[0].time == 2.0
            assert source.connections == 2
        wait_for(lambda: source.state() == "lost: closed by the peer")
    with socket.create_connection(("127.0.0.1", port)) as third:
        third.sendall(send(position(3000)))
        assert collect(source, 1)[0].time == 3.0


def test_serial_device_may_be_unplugged_and_plugged_in_again(link, tmp_path):
    pytest.importorskip("serial", reason="pyserial is not installed")
    plug = tmp_path / "ttyUSB0"
    send = Sender()
    ends = pty.openpty()
    plug.symlink_to(os.ttyname(ends[1]))
    source = link(str(plug), baud=115200)
    for boot_ms in (1000, 3000):
        wait_for(lambda: source._transport.trouble == "")
        os.write(ends[0], send(heartbeat()) + send(position(boot_ms)))
        assert collect(source, 1)[0].time == boot_ms / 1000
        plug.unlink()
        for end in ends:
            os.close(end)
        wait_for(lambda: source.state().startswith("lost: "))
        ends = pty.openpty()
        plug.symlink_to(os.ttyname(ends[1]))
    wait_for(lambda: source.connections == 3)
    for end in ends:
        os.close(end)


def test_silence_of_a_udp_link_is_seen_and_its_end(link, monkeypatch):
    monkeypatch.setattr(live, "SILENT", 0.5)
    port = free_port()
    source = link(f"udpin:{port}")
    assert source.state() == "nothing received yet"
    send, radio = Sender(), Sender(51, 68)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        status = dialect.MAVLink_radio_status_message(200, 200, 90, 40, 40, 0, 0)

        def heard_as(state, *frames):
            wait_for(lambda: sender.send(b"".join(frames)) and source.state() == state)

        heard_as("up, but no vehicle to follow is heard", radio(status))
        heard_as("up: system 1, component 1, fixed wing", send(heartbeat()), send(position(1000)))
        wait_for(lambda: source.state().startswith("lost: nothing received for "))
        heard_as("up, but system 1, component 1 is silent", radio(status))
        heard_as("up: system 1, component 1, fixed wing", send(position(2000)))
    assert {s.flight for s in collect(source, 2)} == {0}


def test_samples_that_a_link_holds_back_are_late_until_it_has_caught_up(link):
    port = free_port()
    source = link(f"udpin:{port}")
    send = Sender()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))

        def arrives(boot_ms):
            sender.send(send(position(boot_ms)))
            collect(source, 1)

        sender.send(send(heartbeat()))
        begun = time.monotonic()
        arrives(10_000)
        time.sleep(1.0)
        arrives(10_100)  # held back since 0.9 s at least, and for no longer than all this took
        assert 0.8 < source.late < time.monotonic() - begun
        arrives(10_050)  # overtaken: says nothing
        assert source.late > 0.8

        def has_caught_up():
            arrives(10_000 + round(1000 * (time.monotonic() - begun)))
            return source.late < 0.2

        wait_for(has_caught_up)


def test_clocks_that_drift_apart_make_nothing_late():
    lateness = Lateness()
    for second in range(86_400):
        lateness.add(Sample(time=second * (1 - 5e-5), stamp_ns=0), 1000.0 + second)
        assert lateness.seconds < 1e-3


# --- what is said on the link -------------------------------------------------------------------


class Autopilot:
    """A vehicle on a UDP link that takes commands; its answers are by message id."""

    def __init__(self, port, results):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.settimeout(0.1)
        self._send = Sender()
        self._results = results
        self.boot_ms = 100_000
        self.heard = []

    def run_until(self, condition, timeout=LIMIT):
        """Send heartbeats and positions, and answer, until a condition holds."""
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, [m.to_dict() for m in self.heard]
            self.boot_ms += 100
            self._socket.send(self._send(heartbeat()) + self._send(position(self.boot_ms)))
            try:
                found = messages_of(self._socket.recv(65535))
            except OSError:
                continue
            for message in found:
                self.heard.append(message)
                result = None
                if message.get_type() == "COMMAND_LONG":
                    result = self._results.get(message.param1, 0)
                if result is not None:
                    answer = dialect.MAVLink_command_ack_message(
                        message.command, result, 0, 0, message.get_srcSystem(), 0
                    )
                    self._socket.send(self._send(answer))

    def close(self):
        self._socket.close()


@pytest.fixture
def autopilot():
    """Starts autopilots, and closes them after the test."""
    started = []

    def start(*args):
        started.append(Autopilot(*args))
        return started[-1]

    yield start
    for one in started:
        one.close()


def test_nothing_is_sent_unless_it_is_asked_for(link, autopilot):
    port = free_port()
    source = link(f"udpin:{port}")
    vehicle = autopilot(port, {})
    samples = []
    vehicle.run_until(lambda: samples.extend(source.poll()) or len(samples) > 8)
    assert vehicle.heard == []


def test_heartbeat_of_a_companion_computer_is_sent_where_it_is_asked_for(link, autopilot):
    port = free_port()
    link(f"udpin:{port}", heartbeat=True)
    vehicle = autopilot(port, {})
    vehicle.run_until(lambda: len(vehicle.heard) == 2)
    for message in vehicle.heard:
        assert message.get_type() == "HEARTBEAT"
        assert message.type == dialect.MAV_TYPE_ONBOARD_CONTROLLER
        assert (message.get_srcSystem(), message.get_srcComponent()) == (254, 191)
    first, second = (message.get_seq() for message in vehicle.heard)
    assert second == first + 1


def test_rates_are_requested_one_by_one_and_again_after_a_reboot(link, autopilot, monkeypatch):
    monkeypatch.setattr(own_messages, "ANSWER_WITHIN", 0.5)
    port = free_port()
    source = link(f"udpin:{port}", request_rate=10.0)
    denied, silent = dialect.MAVLINK_MSG_ID_WIND_COV, dialect.MAVLINK_MSG_ID_VFR_HUD
    vehicle = autopilot(port, {denied: dialect.MAV_RESULT_DENIED, silent: None})
    vehicle.run_until(lambda: len(source.answers) == len(own_messages.REQUESTED))
    assert source.answers["GLOBAL_POSITION_INT"] == "accepted"
    assert source.answers["WIND_COV"] == "denied"
    assert source.answers["VFR_HUD"] == "no answer"
    requests = [(m.param1, m.param2) for m in vehicle.heard]
    assert requests.count((silent, 200_000.0)) >= own_messages.TRIES
    assert requests[0] == (dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 100_000.0)
    assert {m.command for m in vehicle.heard} == {dialect.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert {(m.target_system, m.target_component) for m in vehicle.heard} == {(1, 1)}
    vehicle.heard.clear()
    vehicle.boot_ms = 3000
    vehicle.run_until(lambda: vehicle.heard)
    assert vehicle.heard[0].param1 == dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT


# --- what comes over it -------------------------------------------------------------------------


@pytest.mark.parametrize("version", [1, 2])
def test_both_versions_and_damage_between_messages_are_read_and_counted(link, version):
    port = free_port()
    source = link(f"udpin:{port}")
    send = Sender(version=version)
    whole = [send(heartbeat()), *(send(position(1000 + 200 * i)) for i in range(20))]
    assert whole[0][0] == {1: 0xFE, 2: 0xFD}[version]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        for number, frame in enumerate(whole):
            if number in (5, 11):  # a byte wrong: the checksum fails
                frame = frame[:15] + bytes([frame[15] ^ 0x10]) + frame[16:]
            if number == 8:
                frame = b"\x00\xff noise" + frame
            sender.send(frame)
        samples = collect(source, 18)
    assert samples[-1].time == 4.8
    assert source.link.messages == 19
    assert source.link.lost[1, 1] == 2
    assert source.link.bad_runs == 3
    assert source.link.bad_bytes == 8 + len(whole[5]) + len(whole[11])


def test_message_that_the_decoder_fails_on_costs_no_other_and_is_counted(link, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(VehicleDecoder, "_wind", fail)
    port = free_port()
    source = link(f"udpin:{port}")
    send = Sender()
    wind = dialect.MAVLink_wind_message(direction=270.0, speed=7.0, speed_z=0.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for message in (heartbeat(), position(1000), wind, position(1200)):
            sender.sendto(send(message), ("127.0.0.1", port))
        assert [s.time for s in collect(source, 2)] == [1.0, 1.2]
    assert source.failures == 1


def test_signed_messages_are_read_though_the_key_is_not_known(link):
    port = free_port()
    source = link(f"udpin:{port}")
    signer = dialect.MAVLink(None, 1, 1)
    signer.signing.secret_key = bytes(range(32))
    signer.signing.sign_outgoing = True
    frames = [message.pack(signer) for message in (heartbeat(), position(1000))]
    assert frames[0][2] & 1  # MAVLINK_IFLAG_SIGNED
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"".join(frames), ("127.0.0.1", port))
        assert collect(source, 1)[0].time == 1.0
    assert source.link.bad_bytes == 0


def test_of_all_that_share_a_link_the_aircraft_is_followed_or_the_one_asked_for(link):
    first, asked = (link(f"udpin:{free_port()}", system=wanted) for wanted in (None, 9))
    others = [
        ((255, 190), dialect.MAV_TYPE_GCS),
        ((1, 154), dialect.MAV_TYPE_GIMBAL),
        ((1, 100), dialect.MAV_TYPE_CAMERA),
        ((1, 156), dialect.MAV_TYPE_ADSB),
        ((2, 1), dialect.MAV_TYPE_ANTENNA_TRACKER),
        ((9, 191), dialect.MAV_TYPE_ONBOARD_CONTROLLER),
    ]
    radio, plane, boat = Sender(51, 68), Sender(3, 1), Sender(9, 1)
    frames = [Sender(*ids)(heartbeat(kind, 3)) for ids, kind in others]
    frames += [radio(dialect.MAVLink_radio_status_message(200, 200, 90, 40, 40, 0, 0))]
    frames += [boat(heartbeat(dialect.MAV_TYPE_SURFACE_BOAT)), plane(heartbeat())]
    frames += [plane(position(1000)), boat(position(5000, lat=10.0))]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for source in (first, asked):
            sender.sendto(b"".join(frames), source._transport._socket.getsockname())
    assert [s.latitude for s in collect(first, 1)] == [47.4]
    assert [s.latitude for s in collect(asked, 1)] == [10.0]
    assert first.vehicle == Vehicle(3, 1, "fixed wing")
    assert asked.vehicle == Vehicle(9, 1, "surface boat")


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
    samples, sent = [], 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))

        def say(message):
            nonlocal sent
            sender.send(send(message))
            sent += 1

        def newest_came():
            """Send one more, as long as the kernel drops it for want of room."""
            say(position(2000 + sent))
            time.sleep(0.1)
            samples.extend(source.poll())
            return samples and samples[-1].time > 11.5

        say(heartbeat())
        while sent < 10_000:
            say(position(1000 + sent))
            if sent % 50 == 0:
                time.sleep(0.005)  # 10,000 a second
        wait_for(newest_came)
    source.close()
    samples += source.poll()
    # What the kernel drops shows in the sequence numbers, up to their wrap at 256.
    assert source.link.received[1, 1] + source.link.lost[1, 1] <= sent
    assert len(samples) + source.dropped == source.link.received[1, 1] - 1
