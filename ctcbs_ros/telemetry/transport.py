"""Bytes from a live link: a UDP or TCP socket or a serial port that outlives its peer's absence.

`read` waits a little and returns what came, or nothing; neither it nor `send` ever raises. A peer
that goes away is waited for; a TCP server or serial device is tried again, after half a second and
then ever less often. (pymavlink's own links share a taken UDP port silently, print, and sleep
while they reconnect.)
"""

import errno
import os
import select
import socket
import sys
import time
from collections.abc import Callable
from typing import Protocol

from ctcbs_ros.errors import InputError

LOOPBACK = "127.0.0.1"
WAIT = 0.1  # s that `read` waits at most
FIRST_RETRY, LAST_RETRY = 0.5, 8.0  # s between attempts to reconnect, doubled each time
CONNECTING = 1.0  # s that an attempt may take
LARGEST_READ = 65535  # one UDP datagram at most
TELL_DROPPED = 40  # SO_RXQ_OVFL of Linux: with a datagram comes how many were dropped before it
# A UDP link answers whoever has sent something lately, and not more of them than this.
PEER_VALID = 30.0  # s
MOST_PEERS = 8
# A TCP peer that vanished without a word is missed after 5 + 3 * 2 s.
KEEPALIVE = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
ALLOWED = (
    "allowed: udpin:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:[HOST:]PORT "
    "or a serial device"
)
SCHEMES = ("udpin", "udpout", "tcp", "tcpin")


class Transport(Protocol):
    """Where the bytes of a live link come from.

    Attributes
    ----------
    trouble : str
        Why nothing can come just now, "Connection refused"; empty while something can.
    connections : int
        How often the link has been made.
    """

    trouble: str
    connections: int

    def read(self) -> bytes:
        """Bytes that came within a tenth of a second; empty if none did."""

    def send(self, data: bytes) -> None:
        """Send to the peer, if there is one just now."""

    def close(self) -> None:
        """Give up the socket or device."""


class UdpListener:
    """`udpin`: datagrams sent to a local port, by whomever; who sent lately is answered.

    Attributes
    ----------
    dropped : int
        Datagrams that the system had no room for, where it tells (Linux).
    """

    trouble, connections = "", 1

    def __init__(self, address: tuple[str, int]):
        self.dropped = 0
        self._peers: dict[tuple[str, int], float] = {}  # when each was heard last
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(WAIT)
        if sys.platform == "linux":
            self._socket.setsockopt(socket.SOL_SOCKET, TELL_DROPPED, 1)

    def read(self) -> bytes:
        try:
            data, told, _, peer = self._socket.recvmsg(LARGEST_READ, socket.CMSG_SPACE(4))
        except OSError:
            return b""
        for _, kind, value in told:
            if kind == TELL_DROPPED:
                self.dropped = int.from_bytes(value, sys.byteorder)
        self._peers.pop(peer, None)
        self._peers[peer] = time.monotonic()  # the dict's order is that of their newest data
        if len(self._peers) > MOST_PEERS:
            del self._peers[next(iter(self._peers))]
        return data

    def send(self, data: bytes) -> None:
        for peer, heard in self._peers.items():
            if time.monotonic() - heard < PEER_VALID:
                try:
                    self._socket.sendto(data, peer)
                except OSError:
                    continue

    def close(self) -> None:
        self._socket.close()


class UdpCaller:
    """`udpout`: datagrams from a peer that answers whoever has sent it something."""

    connections = 1

    def __init__(self, address: tuple[str, int]):
        self.trouble = ""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.settimeout(WAIT)

    def read(self) -> bytes:
        try:
            data = self._socket.recv(LARGEST_READ)
        except TimeoutError:
            return b""
        except OSError as error:  # the peer's port is closed as yet
            self.trouble = error.strerror or str(error)
            time.sleep(WAIT)
            return b""
        self.trouble = ""
        return data

    def send(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def close(self) -> None:
        self._socket.close()


class TcpServer:
    """`tcpin`: a stream from whoever connects; the newest connection counts."""

    def __init__(self, address: tuple[str, int]):
        self.trouble, self.connections = "nobody has connected", 0
        self._server = socket.create_server(address)
        self._peer: socket.socket | None = None

    def read(self) -> bytes:
        try:
            waiting = [self._server] if self._peer is None else [self._server, self._peer]
            ready, _, _ = select.select(waiting, [], [], WAIT)
            if self._server in ready:
                self._drop("")
                self._peer, _ = self._server.accept()
                self._peer.settimeout(WAIT)
                keep_alive(self._peer)
                self.connections += 1
                return b""
            data = self._peer.recv(LARGEST_READ) if ready else None
        except OSError as error:
            self._drop(error.strerror or str(error))
            return b""
        if data == b"":
            self._drop("closed by the peer")
        return data or b""

    def send(self, data: bytes) -> None:
        if self._peer is not None:
            try:
                self._peer.sendall(data)
            except OSError as error:
                self._drop(error.strerror or str(error))

    def _drop(self, trouble: str) -> None:
        self.trouble = trouble
        if self._peer is not None:
            self._peer.close()
            self._peer = None

    def close(self) -> None:
        self._drop("closed")
        self._server.close()


class Reconnecting:
    """A connection that is made anew, ever less often while that fails.

    Parameters
    ----------
    connect : callable
        Makes the connection; raises OSError where that fails.
    receive : callable
        Takes the connection; returns bytes that came within a tenth of a second, empty if none
        did; raises OSError where the connection is lost.
    transmit : callable
        Takes the connection and bytes; raises OSError likewise.
    connection : object, optional
        The first connection, where it is there already.
    """

    def __init__(self, connect: Callable, receive: Callable, transmit: Callable, connection=None):
        self._connect, self._receive, self._transmit = connect, receive, transmit
        self._connection = connection
        self._delay = FIRST_RETRY
        self._next_try = 0.0
        self.connections = int(connection is not None)
        self.trouble = "" if connection is not None else "not connected yet"

    def read(self) -> bytes:
        try:
            if self._connection is None:
                time.sleep(min(WAIT, max(0.0, self._next_try - time.monotonic())))
                if time.monotonic() < self._next_try:
                    return b""
                self._next_try = time.monotonic() + self._delay
                self._delay = min(2 * self._delay, LAST_RETRY)
                self._connection = self._connect()
                self.connections += 1
                self.trouble = ""
            data = self._receive(self._connection)
        except OSError as error:
            self._drop(error)
            return b""
        if data:  # a peer that takes the connection and drops it is no reason to hurry
            self._delay = FIRST_RETRY
        return data

    def send(self, data: bytes) -> None:
        if self._connection is not None:
            try:
                self._transmit(self._connection, data)
            except OSError as error:
                self._drop(error)

    def _drop(self, error: OSError) -> None:
        self.close()
        self.trouble = error.strerror or str(error)

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def tcp_client(address: tuple[str, int]) -> Reconnecting:
    """`tcp`: a stream from a server, which need not be there yet."""

    def connect() -> socket.socket:
        connection = socket.create_connection(address, timeout=CONNECTING)
        connection.settimeout(WAIT)
        keep_alive(connection)
        return connection

    def receive(connection: socket.socket) -> bytes:
        try:
            data = connection.recv(LARGEST_READ)
        except TimeoutError as error:
            if error.errno is None:  # none came; otherwise the peer does not answer any more
                return b""
            raise
        if not data:
            raise ConnectionError("closed by the server")
        return data

    return Reconnecting(connect, receive, socket.socket.sendall)


def serial_device(device: str, baud: int) -> Reconnecting:
    """A serial port, which may be unplugged and plugged in again."""
    try:
        import serial  # pyserial: needed by those with a serial device only
    except ImportError as error:
        _test_device(device)  # what is none is not helped by pyserial
        raise InputError(f"link {device!r} needs pyserial: pip install pyserial") from error

    def attempt(action: Callable, *arguments):
        """pyserial lets through what termios and a closed port raise."""
        try:
            return action(*arguments)
        except OSError:
            raise
        except Exception as error:
            raise OSError(str(error)) from error

    def connect():
        return attempt(lambda: serial.Serial(device, baud, timeout=WAIT, write_timeout=WAIT))

    def receive(port) -> bytes:
        return attempt(lambda: port.read(max(1, port.in_waiting)))

    return Reconnecting(
        connect, receive, lambda port, data: attempt(port.write, data), connection=connect()
    )


def _test_device(device: str) -> None:
    """Raise OSError for what is no serial device, or may not be opened."""
    handle = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        if not os.isatty(handle):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
    finally:
        os.close(handle)


def keep_alive(connection: socket.socket) -> None:
    """Have a peer that vanished without a word missed after seconds instead of hours."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in KEEPALIVE.items():
        if hasattr(socket, name):  # not on every system
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def open_transport(url: str, baud: int) -> Transport:
    """Open the transport that a url names.

    Parameters
    ----------
    url : str
        See `ctcbs_ros.telemetry.mavlink.open_link`.
    baud : int
        Rate of a serial device.

    Raises
    ------
    InputError
        If the url is malformed, the port is taken or the device cannot be opened.
    """
    scheme, _, rest = url.partition(":")
    try:
        if scheme == "udpin":
            return UdpListener(_address(url, rest, LOOPBACK))
        if scheme == "udpout":
            return UdpCaller(_address(url, rest))
        if scheme == "tcp":
            return tcp_client(_address(url, rest))
        if scheme == "tcpin":
            return TcpServer(_address(url, rest, LOOPBACK))
        return serial_device(url, baud)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"link {url!r} cannot be opened: {_reason(url, error)}") from error


def _reason(url: str, error: Exception) -> str:
    """Why a link cannot be opened, and what to do about it."""
    is_device = url.partition(":")[0] not in SCHEMES
    number = getattr(error, "errno", None)
    if isinstance(error, socket.gaierror):
        return f"no such host is known; {ALLOWED}"
    if number == errno.EADDRINUSE:
        return "another program listens on this port: end that one, or take another port"
    if number == errno.EADDRNOTAVAIL:
        return "this machine does not have that address; without HOST it is 127.0.0.1"
    if number in (errno.EACCES, errno.EPERM):
        if is_device:
            return "no permission; members of the device's group (often dialout) have it"
        return "no permission; ports from 1024 on need none"
    if number == errno.ENOENT:
        return f"there is no such device; {ALLOWED}"
    if number == errno.EBUSY:
        return "another program has this device"
    reason = getattr(error, "strerror", None) or str(error)
    if os.strerror(errno.ENOTTY) in reason:
        reason = "it is not a serial device"
    return f"{reason}; {ALLOWED}"


def _address(url: str, rest: str, default_host: str = "") -> tuple[str, int]:
    """Numeric host and port of HOST:PORT."""
    host, _, port = rest.rpartition(":")
    host = host or default_host
    if not host or ":" in host:
        raise InputError(f"link {url!r}: {rest!r} is not HOST:PORT; {ALLOWED}")
    if not (port.isdecimal() and port.isascii() and 1 <= int(port) <= 65535):
        raise InputError(
            f"link {url!r}: the port {port!r} is not a number from 1 to 65535; {ALLOWED}"
        )
    return socket.gethostbyname(host), int(port)
