"""Transports of live links: real sockets and ports, peers that come and go, wrong urls."""

import errno
import itertools
import os
import pty
import socket
import sys
import termios
from pathlib import Path

import pytest
from links import collect, free_port
from mavlink_bytes import Sender, heartbeat, position
from processes import LIMIT, wait_for

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry import transport
from ctcbs_ros.telemetry.mavlink import open_link
from ctcbs_ros.telemetry.transport import Reconnecting


@pytest.mark.parametrize(
    ("kind", "table"), [(socket.SOCK_DGRAM, "udp"), (socket.SOCK_STREAM, "tcp")]
)
def test_links_listen_on_loopback_unless_told_otherwise(link, kind, table):
    def listening(port):
        """Addresses that the system says somebody listens on at a port."""
        lines = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
        local = [line.split()[1].split(":") for line in lines]
        return {address for address, number in local if int(number, 16) == port}

    port, other = free_port(kind), free_port(kind)
    link(f"{table}in:{port}")
    assert listening(port) == {"0100007F"}  # 127.0.0.1, as Linux shows it
    link(f"{table}in:0.0.0.0:{other}")
    assert listening(other) == {"00000000"}


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


@pytest.fixture
def no_pyserial(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)


@pytest.mark.parametrize(
    ("device", "told"),
    [
        ("/dev/ttyNONE", "there is no such device; allowed"),
        ("/dev/null", "it is not a serial device; allowed"),
        ("udp:127.0.0.1:14550", "there is no such device; allowed"),
    ],
)
def test_what_is_no_device_is_told_so_without_pyserial_too(no_pyserial, device, told):
    with pytest.raises(InputError, match=told):
        open_link(device)


def test_serial_device_without_pyserial_names_what_is_missing(no_pyserial):
    ends = pty.openpty()
    with pytest.raises(InputError, match="needs pyserial: pip install pyserial"):
        open_link(os.ttyname(ends[1]))
    for end in ends:
        os.close(end)


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


def test_tcp_server_may_go_away_and_come_back(link):
    port = free_port(socket.SOCK_STREAM)
    source = link(f"tcp:127.0.0.1:{port}")
    wait_for(lambda: source.state() == "not up yet: Connection refused")
    send = Sender()
    for number, boot_ms in enumerate((1000, 3000), 1):
        with socket.create_server(("127.0.0.1", port)) as server:
            server.settimeout(LIMIT)
            connection, _ = server.accept()
            server.close()  # first: else the link may be back before the server is gone
            with connection:
                connection.sendall(send(heartbeat()) + send(position(boot_ms)))
                assert collect(source, 1)[0].time == boot_ms / 1000
                assert source._transport.trouble == ""
                assert source.connections == number
        wait_for(lambda: source.state() == "lost: Connection refused")


def test_peer_that_is_called_may_be_absent_go_away_and_come_back(link):
    port = free_port()
    source = link(f"udpout:127.0.0.1:{port}")
    wait_for(lambda: source.state() == "not up yet: Connection refused")
    send = Sender()
    for boot_ms in (1000, 3000):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            vehicle.bind(("127.0.0.1", port))
            vehicle.settimeout(LIMIT)
            _, caller = vehicle.recvfrom(300)
            vehicle.sendto(send(heartbeat()) + send(position(boot_ms)), caller)
            assert collect(source, 1)[0].time == boot_ms / 1000
            assert source._transport.trouble == ""
        wait_for(lambda: source.state() == "lost: Connection refused")


def test_link_that_is_refused_is_tried_ever_less_often(monkeypatch):
    class Clock:
        """A clock that only sleep moves on."""

        now = 100.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += seconds

    clock, tries = Clock(), []
    monkeypatch.setattr(transport, "time", clock)

    def refused():
        tries.append(clock.now)
        raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")

    connection = Reconnecting(refused, None, None)
    while len(tries) < 7:
        assert connection.read() == b""
    pauses = [after - before for before, after in itertools.pairwise(tries)]
    assert pauses == pytest.approx([0.5, 1.0, 2.0, 4.0, 8.0, 8.0])


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
    source = link(str(plug), baud=57600)
    for boot_ms in (1000, 3000):
        wait_for(lambda: source._transport.trouble == "")
        *_, input_speed, output_speed, _ = termios.tcgetattr(ends[1])
        assert input_speed == output_speed == termios.B57600
        os.write(ends[0], send(heartbeat()) + send(position(boot_ms)))
        assert collect(source, 1)[0].time == boot_ms / 1000
        plug.unlink()
        for end in ends:
            os.close(end)
        wait_for(lambda: source._transport.trouble)
        assert source.state().startswith("lost: ")
        ends = pty.openpty()
        plug.symlink_to(os.ttyname(ends[1]))
    wait_for(lambda: source.connections == 3)
    for end in ends:
        os.close(end)
