"""What comes over live links: senders that end and return, silence, damage, strangers, floods."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest
from links import collect, free_port
from mavlink_bytes import Sender, gps_raw, heartbeat, position
from processes import wait_for
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry import live
from ctcbs_ros.telemetry.lateness import Lateness
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder
from ctcbs_ros.telemetry.sample import Sample
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
    wait_for(lambda: time.monotonic() - source.last_received > 1.0)
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
