"""Bytes from a live link: a UDP or TCP socket or a serial port that outlives its peer's absence.

`read` waits a little and returns what came, or nothing; it never raises. A peer that goes away is
waited for, and a TCP server or serial device is tried again every second. (pymavlink's own links
share a taken UDP port silently, print, and sleep while they reconnect.)
"""

import socket
import time
from collections.abc import Iterator
from typing import Protocol

from ctcbs_ros.errors import InputError

LOOPBACK = "127.0.0.1"
WAIT = 0.1  # s that `read` waits at most
RETRY = 1.0  # s between attempts to reconnect
LARGEST_READ = 65535  # one UDP datagram at most
ALLOWED = "allowed: udpin:[HOST:]PORT, udpout:HOST:PORT, tcp:HOST:PORT or a serial device"


class Transport(Protocol):
    """Where the bytes of a live link come from."""

    def read(self) -> bytes:
        """Bytes that came within a tenth of a second; empty if none did."""

    def close(self) -> None:
        """Give up the socket or device."""


class UdpListener:
    """`udpin`: datagrams sent to a local port, by whomever."""

    def __init__(self, address: tuple[str, int]):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(WAIT)

    def read(self) -> bytes:
        try:
            return self._socket.recv(LARGEST_READ)
        except OSError:
            return b""

    def close(self) -> None:
        self._socket.close()


class UdpCaller:
    """`udpout`: datagrams from a peer that answers whoever has sent it a heartbeat."""

    def __init__(self, address: tuple[str, int], heartbeats: Iterator[bytes]):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.settimeout(WAIT)
        self._heartbeats = heartbeats
        self._next_heartbeat = 0.0

    def read(self) -> bytes:
        try:
            if time.monotonic() >= self._next_heartbeat:
                self._next_heartbeat = time.monotonic() + 1.0
                self._socket.send(next(self._heartbeats))
            return self._socket.recv(LARGEST_READ)
        except OSError:  # none came, or the peer's port is closed as yet
            return b""

    def close(self) -> None:
        self._socket.close()


class TcpClient:
    """`tcp`: a stream from a server."""

    def __init__(self, address: tuple[str, int]):
        self._address = address
        self._socket: socket.socket | None = None
        self._next_try = 0.0

    def read(self) -> bytes:
        try:
            if self._socket is None:
                self._connect()
            data = self._socket.recv(LARGEST_READ) if self._socket else b""
        except TimeoutError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.close()
        return data

    def _connect(self) -> None:
        time.sleep(min(WAIT, max(0.0, self._next_try - time.monotonic())))
        if time.monotonic() < self._next_try:
            return
        self._next_try = time.monotonic() + RETRY
        self._socket = socket.create_connection(self._address, timeout=RETRY)
        self._socket.settimeout(WAIT)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class SerialDevice:
    """A serial port, which may be unplugged and plugged in again."""

    def __init__(self, device: str, baud: int):
        try:
            import serial  # pyserial: needed by those with a serial device only
        except ImportError as error:
            raise InputError(f"link {device!r} needs pyserial: pip install pyserial") from error
        self._open = lambda: serial.Serial(device, baud, timeout=WAIT)
        self._port = self._open()
        self._next_try = 0.0

    def read(self) -> bytes:
        try:
            if self._port is None:
                self._reopen()
            return self._port.read(max(1, self._port.in_waiting)) if self._port else b""
        except OSError:
            self.close()
            return b""

    def _reopen(self) -> None:
        time.sleep(min(WAIT, max(0.0, self._next_try - time.monotonic())))
        if time.monotonic() < self._next_try:
            return
        self._next_try = time.monotonic() + RETRY
        self._port = self._open()

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None


def open_transport(url: str, baud: int, heartbeats: Iterator[bytes]) -> Transport:
    """Open the transport that a url names.

    Parameters
    ----------
    url : str
        See `ctcbs_ros.telemetry.mavlink.open_link`.
    baud : int
        Rate of a serial device.
    heartbeats : iterator of bytes
        What a `udpout` link sends once a second.

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
            return UdpCaller(_address(url, rest), heartbeats)
        if scheme == "tcp":
            return TcpClient(_address(url, rest))
        return SerialDevice(url, baud)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"link {url!r} cannot be opened: {reason}; {ALLOWED}") from error


def _address(url: str, rest: str, default_host: str = "") -> tuple[str, int]:
    """Numeric host and port of HOST:PORT."""
    host, _, port = rest.rpartition(":")
    host = host or default_host
    if not host or ":" in host:
        raise InputError(f"link {url!r}: {rest!r} is not HOST:PORT; {ALLOWED}")
    if not (port.isdecimal() and port.isascii() and 1 <= int(port) <= 65535):
        raise InputError(f"link {url!r}: the port {port!r} is not a number from 1 to 65535")
    return socket.gethostbyname(host), int(port)
