"""A live link read in the background: the newest samples win, and what is dropped is counted."""

import logging
import threading
import time
from collections import deque

from ctcbs_ros.telemetry.beacon import BeaconSample
from ctcbs_ros.telemetry.lateness import Lateness
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.transport import Transport

LOGGER = logging.getLogger(__name__)
CAPACITY = 1000
# Reports of a beacon kept beside them, as part of that: however it floods, the aircraft is heard.
BEACON_PART = 0.2
SILENT = 2.0  # s without a byte until a link counts as lost; heartbeats come every second


class LiveSource:
    """Samples of a live link, read by a thread of its own until `close`.

    A sender that goes away is waited for; nothing needs restarting when it returns.

    Parameters
    ----------
    transport : Transport
        Where the bytes come from.
    decoder : MavlinkDecoder
    own : OwnMessages, optional
        What to send.
    capacity : int
        Samples kept until they are polled; when full, the oldest gives way.

    Attributes
    ----------
    dropped : int
        Samples that gave way before they were polled.
    reports_dropped : int
        The same of the payload's beacon.
    failures : int
        Reads of which not everything was decoded, for a mistake in this program.
    last_received : float or None
        `time.monotonic()` at the newest bytes [s].
    """

    def __init__(self, transport: Transport, decoder, own=None, capacity: int = CAPACITY):
        self._transport = transport
        self._own = own
        self._decoder = decoder
        # Each with its number in the order received.
        self._samples: deque[tuple[int, Sample]] = deque(maxlen=capacity)
        self._reports: deque[tuple[int, BeaconSample]] = deque(maxlen=int(BEACON_PART * capacity))
        self._received = 0
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._lateness = Lateness()
        self.dropped = self.reports_dropped = 0
        self.failures = 0
        self.last_received: float | None = None
        self._thread = threading.Thread(target=self._read, name="telemetry", daemon=True)
        self._thread.start()

    @property
    def link(self) -> LinkStatistics:
        """Counts over everything received."""
        return self._decoder.link

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle followed, once it is known."""
        return self._decoder.vehicle

    @property
    def beacon(self) -> Vehicle | None:
        """The payload's beacon, once it is heard."""
        return self._decoder.beacon

    @property
    def beacon_link(self) -> LinkStatistics | None:
        """Counts of the beacon's messages alone; None without one."""
        return self._decoder.beacon_link

    @property
    def wind(self) -> Vector | None:
        """Newest wind of the autopilot, velocity towards east, north, up [m/s]."""
        return self._decoder.wind

    @property
    def datagrams_dropped(self) -> int:
        """Datagrams that came faster than they were read, as far as the system tells."""
        return getattr(self._transport, "dropped", 0)

    @property
    def connections(self) -> int:
        """How often the link has been made; 1 for UDP."""
        return self._transport.connections

    @property
    def late(self) -> float:
        """How late the newest sample came, beyond the link's least delay [s]."""
        return self._lateness.seconds

    @property
    def answers(self) -> dict[str, str]:
        """The vehicle's answers to the requests for rates, by message."""
        return {} if self._own is None else dict(self._own.answers)

    def state(self) -> str:
        """How the link is, in words: "up", "lost: Connection refused"."""
        trouble, received = self._transport.trouble, self.last_received
        if trouble:
            return f"not up yet: {trouble}" if received is None else f"lost: {trouble}"
        if received is None:
            return "nothing received yet"
        silent = time.monotonic() - received
        if silent > SILENT:
            return f"lost: nothing received for {silent:.1f} s"
        vehicle = self.vehicle
        if vehicle is None:
            return "up, but no vehicle to follow is heard"
        heard = self._own.heard if self._own is not None else None
        if heard is not None and time.monotonic() - heard > SILENT:
            return f"up, but system {vehicle.system}, component {vehicle.component} is silent"
        return f"up: system {vehicle.system}, component {vehicle.component}, {vehicle.type}"

    def take(self) -> Sample | BeaconSample | None:
        """The oldest sample not taken yet; None where there is none."""
        with self._lock:
            return self._oldest()

    def poll(self) -> list[Sample | BeaconSample]:
        """Samples that came since the last call, oldest first; returns at once."""
        with self._lock:
            samples = []
            while (sample := self._oldest()) is not None:
                samples.append(sample)
        return samples

    def _oldest(self) -> Sample | BeaconSample | None:
        queues = [queue for queue in (self._samples, self._reports) if queue]
        return min(queues, key=lambda queue: queue[0][0]).popleft()[1] if queues else None

    def close(self) -> None:
        """Stop reading and give up the port; samples not polled yet stay."""
        self._closing.set()
        self._thread.join()
        self._transport.close()

    def _read(self) -> None:
        while not self._closing.is_set():
            if self._own is not None:
                for frame in self._own.due(self.vehicle):
                    self._transport.send(frame)
            data = self._transport.read()
            if not data:
                continue
            self.last_received = time.monotonic()
            try:
                self._decode(data)
            except Exception:  # what no test foresaw must not end a day's reading
                self.failures += 1
                if self.failures == 1:  # the rest is counted
                    LOGGER.exception("some bytes of the link were not decoded")

    def _decode(self, data: bytes) -> None:
        for sample in self._decoder.feed(data, time.time_ns() // 1000):
            if isinstance(sample, Sample):
                self._lateness.add(sample, self.last_received)
            with self._lock:
                self._received += 1
                if isinstance(sample, Sample):
                    self.dropped += len(self._samples) == self._samples.maxlen
                    self._samples.append((self._received, sample))
                else:
                    self.reports_dropped += len(self._reports) == self._reports.maxlen
                    self._reports.append((self._received, sample))
