"""A live link read in the background: the newest samples win, and what is dropped is counted."""

import threading
import time
from collections import deque

from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.transport import Transport

CAPACITY = 1000


class LiveSource:
    """Samples of a live link, read by a thread of its own until `close`.

    A sender that goes away is waited for; nothing needs restarting when it returns.

    Parameters
    ----------
    transport : Transport
        Where the bytes come from.
    decoder : MavlinkDecoder
    capacity : int
        Samples kept until they are polled; when full, the oldest gives way.

    Attributes
    ----------
    dropped : int
        Samples that gave way before they were polled.
    last_received : float or None
        `time.monotonic()` at the newest bytes [s].
    """

    def __init__(self, transport: Transport, decoder, capacity: int = CAPACITY):
        self._transport = transport
        self._decoder = decoder
        self._samples: deque[Sample] = deque(maxlen=capacity)
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self.dropped = 0
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
    def wind(self) -> Vector | None:
        """Newest wind of the autopilot, velocity towards east, north, up [m/s]."""
        return self._decoder.wind

    def poll(self) -> list[Sample]:
        """Samples that came since the last call, oldest first; returns at once."""
        with self._lock:
            samples = list(self._samples)
            self._samples.clear()
        return samples

    def close(self) -> None:
        """Stop reading and give up the port; samples not polled yet stay."""
        self._closing.set()
        self._thread.join()
        self._transport.close()

    def _read(self) -> None:
        while not self._closing.is_set():
            data = self._transport.read()
            if not data:
                continue
            self.last_received = time.monotonic()
            for sample in self._decoder.feed(data, time.time_ns() // 1000):
                with self._lock:
                    self.dropped += len(self._samples) == self._samples.maxlen
                    self._samples.append(sample)
