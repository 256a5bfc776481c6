"""A log pumped through the node: paced, nothing dropped, parameters answered meanwhile."""

import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ctcbs_ros.nodes.outputs import Outputs
from ctcbs_ros.telemetry.beacon import BeaconSample
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.source import LogSource

PERIOD = 0.001  # s between two chunks
CHUNK_TIME = 0.05  # s that a chunk may take
SLOW_SUBSCRIBER = 5.0  # s until a subscriber that holds up the log is reported


class LogPump:
    """Feeds a log's samples to the node in chunks, from a timer.

    A sample is taken when all before it is published, and publishing waits for room: the slowest
    reliable subscriber sets the pace.

    Parameters
    ----------
    node : Node
    log : LogSource
    outputs : Outputs
    rate : float
        Speed over the log's own clock; 0 for as fast as it goes.
    wait : float
        How long to wait for a subscriber of the pose at the start [s].
    take : callable
        Called with each sample.
    at_end : callable
        Called once after the last one; what it publishes is waited for too.
    when_received : callable
        Called when all of that has been received, too.
    """

    def __init__(
        self,
        node: Node,
        log: LogSource,
        outputs: Outputs,
        rate: float,
        wait: float,
        take: Callable[[Sample | BeaconSample], None],
        at_end: Callable[[], None],
        when_received: Callable[[], None],
    ):
        self._logger = node.get_logger()
        self._outputs = outputs
        self._rate = rate
        self._take = take
        self._at_end, self._when_received = at_end, when_received
        self._samples = iter(log)
        self._next: Sample | BeaconSample | None = None
        self._wait_until = time.monotonic() + wait
        self._begun = False
        self._ended = False
        # time.monotonic() less the log's time over the rate, once the aircraft has told the time
        self._started: float | None = None
        self._last_room = 0.0  # time.monotonic() when a sample was last taken
        self._timer = node.create_timer(
            PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _tick(self) -> None:
        if not self._begun:
            if not self._outputs.awaited and time.monotonic() < self._wait_until:
                return
            self._begin()
        if not self._ended:
            self._pump()
        elif self._outputs.are_received():
            self._timer.cancel()
            self._when_received()

    def _begin(self) -> None:
        self._begun = True
        self._last_room = time.monotonic()
        self._next = next(self._samples, None)

    def _is_early(self, now: float) -> bool:
        """Whether the next sample is not due yet; a beacon's comes when it is read."""
        if not self._rate or isinstance(self._next, BeaconSample):
            return False
        if self._started is None:
            self._started = now - self._next.time / self._rate
        return now < self._started + self._next.time / self._rate

    def _pump(self) -> None:
        until = time.monotonic() + CHUNK_TIME
        while (now := time.monotonic()) < until:
            if self._next is None:
                self._ended = True
                self._at_end()
                return
            if self._is_early(now):
                return
            if not self._outputs.flush():
                self._report_slow_subscriber(now)
                return
            self._last_room = now
            self._take(self._next)
            self._next = next(self._samples, None)

    def _report_slow_subscriber(self, now: float) -> None:
        if now - self._last_room > SLOW_SUBSCRIBER:
            self._logger.warning(
                "the log waits for a subscriber that does not take what is published",
                throttle_duration_sec=SLOW_SUBSCRIBER,
            )
