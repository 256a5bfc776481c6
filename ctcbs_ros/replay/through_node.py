"""A log replayed through the real node, which runs in its own process and reads the log itself.

What comes back are the node's messages: each record (`~/prediction`), each pose, the summary.
"""

import ctypes
import importlib.util
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ctcbs_ros.errors import InputError
from ctcbs_ros.prediction.record import Record

NODE = "predictor"
# Domains whose UDP ports lie below those that Linux gives to others, less 0, where users are.
DOMAINS = range(1, 102)
READY = b"ready, telemetry from"  # of what the node says
FIRST_MESSAGE = 120.0  # s to wait for its discovery, once it is ready
LAST_MESSAGES = 20.0  # s to wait for what is missing when the summary is there
TERMINATION = 10.0  # s
SAID_AT_START = 1 << 16  # bytes
PR_SET_PDEATHSIG = 1  # linux/prctl.h


class NodeFailure(RuntimeError):
    """The node ended or fell silent before its log was through."""


def replay_through_node(
    log: str | Path,
    configuration: str | Path,
    table: str,
    rate: float,
    take: Callable[[Record, float], None],
    take_comparison: Callable[[Record], None] | None = None,
) -> dict[str, Any]:
    """Replay a log through the node.

    Parameters
    ----------
    log, configuration : str or Path
        The log and the parameter file.
    table : str
        Table file; empty for that in the user's cache.
    rate : float
        Speed over the log's own clock; 0 for as fast as it goes.
    take : callable
        Called with the record of each sample's prediction, the end mass's position as in the pose
        published, and the part of the log read (0 to 1).
    take_comparison : callable, optional
        Called with the record of each report of the beacon, where the configuration has one.

    Returns
    -------
    dict
        The summary that the node published.

    Raises
    ------
    InputError
        If the node refuses its parameters.
    NodeFailure
        If the node fails, or a record or pose is lost.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions

    namespace = f"/replay_{os.getpid()}"
    domain = free_domain()
    # Nothing leaves this machine, and nothing else on it listens in.
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    parameters = {
        "mavlink.url": quoted(str(Path(log).absolute())),
        "table.file": quoted(str(Path(table).absolute()) if table else ""),
        "replay.rate": repr(float(rate)),
        "replay.wait_for_subscribers": repr(FIRST_MESSAGE),
        "replay.exit_at_end": "false",  # it stays until everything is received
    }
    with _node_process(namespace, configuration, parameters) as (process, output):
        context = Context()
        rclpy.init(
            context=context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        receiver = None
        try:
            receiver = _Receiver(context, f"{namespace}/{NODE}", take, take_comparison)
            return receiver.receive(lambda: _is_ready(process, output))
        finally:
            if receiver is not None:
                receiver.close()
            context.try_shutdown()


def require_ros() -> None:
    """Raise InputError where rclpy is not installed."""
    if importlib.util.find_spec("rclpy") is None:
        raise InputError(
            "--through node needs ROS 2 (rclpy): source a ROS installation, "
            "or pip install 'ctcbs_ros[ros]'"
        )


def free_domain() -> int:
    """A DDS domain that no participant on this machine uses."""
    candidates = random.sample(DOMAINS, len(DOMAINS))
    return next((domain for domain in candidates if _is_free(domain)), candidates[0])


def quoted(text: str) -> str:
    """Text as a ROS parameter's value on a command line, where a bare 12 would be a number."""
    return "'" + text.replace("'", "''") + "'"


def _is_free(domain: int) -> bool:
    """Whether the port of a domain's first participant is free (RTPS 2.2, section 9.6.1)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7400 + 250 * domain + 10))
        except OSError:
            return False
    return True


@contextmanager
def _node_process(namespace: str, configuration: str | Path, parameters: dict[str, str]):
    """The node, running until the block is left; yields its process and the file of its output."""
    command = [sys.executable, "-m", "ctcbs_ros.nodes.predictor", "--ros-args"]
    command += ["-r", f"__ns:={namespace}", "-r", f"__node:={NODE}"]
    command += ["--params-file", str(configuration)]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={value}"]
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,  # Ctrl-C is for this process, which ends the node
            preexec_fn=_end_with_parent,
        )
        try:
            yield process, output
        finally:
            process.terminate()
            try:
                process.wait(TERMINATION)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _end_with_parent() -> None:
    """In the child: be told to end when the parent does, however that ends."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _is_ready(process: subprocess.Popen, output) -> bool:
    """Whether the node listens; raises where it has ended."""
    code = process.poll()
    if code is None:
        # Not by seek and read: the node writes where that leaves off.
        return READY in os.pread(output.fileno(), SAID_AT_START, 0)
    output.seek(0)
    lines = output.read().strip().splitlines() or ["it said nothing"]
    if code == 2:
        raise InputError(lines[-1].removeprefix("predictor: "))
    how = f"by {signal.Signals(-code).name}" if code < 0 else f"with {code}"
    raise NodeFailure(f"the node ended {how}: " + " | ".join(lines[-3:]))


class _Receiver:
    """Subscriber to a node that replays a log; brings its records and poses together."""

    def __init__(
        self, context, node_name: str, take: Callable[[Record, float], None],
        take_comparison: Callable[[Record], None] | None,
    ):  # fmt: skip
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
        from std_msgs.msg import String

        self._take = take
        self._take_comparison = take_comparison
        self._compared = 0
        self._summary: dict[str, Any] | None = None
        self._taken = 0
        self._records: deque[Record] = deque()
        self._poses: dict[int, deque] = {}
        self._messages = 0
        node = Node("replay", context=context, enable_rosout=False)
        everything = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        # The pose last: the node starts when it sees this one.
        node.create_subscription(String, f"{node_name}/summary", self._add_summary, latched)
        node.create_subscription(String, f"{node_name}/prediction", self._add_record, everything)
        if take_comparison is not None:
            node.create_subscription(
                String, f"{node_name}/beacon", self._add_comparison, everything
            )
        node.create_subscription(
            PoseWithCovarianceStamped, f"{node_name}/end_mass/pose", self._add_pose, everything
        )
        self._node = node
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)

    def close(self) -> None:
        """End the subscriptions, while the context that they live in still does."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()

    def receive(self, node_is_ready: Callable[[], bool]) -> dict[str, Any]:
        """Receive everything; returns the summary."""
        silent_since, heard = time.monotonic(), 0
        while not self._complete:
            self._executor.spin_once(timeout_sec=0.1)
            if self._messages > heard:
                silent_since, heard = time.monotonic(), self._messages
                continue
            if not node_is_ready():  # it compiles and builds for as long as that takes here
                silent_since = time.monotonic()
                continue
            silence = time.monotonic() - silent_since
            if not heard and silence > FIRST_MESSAGE:
                raise NodeFailure(f"the node was not heard within {FIRST_MESSAGE:g} s")
            if self._summary is not None and silence > LAST_MESSAGES:
                raise NodeFailure(
                    f"of {self._summary['samples']} records and their poses, "
                    f"{self._taken} came through"
                )
        return self._summary

    @property
    def _complete(self) -> bool:
        if self._summary is None or self._taken < self._summary["samples"]:
            return False
        return self._take_comparison is None or (
            self._compared == self._summary["beacon"]["reports"]
        )

    def _add_summary(self, message) -> None:
        self._messages += 1
        self._summary = json.loads(message.data)

    def _add_record(self, message) -> None:
        self._messages += 1
        self._records.append(json.loads(message.data))
        self._take_matched()

    def _add_comparison(self, message) -> None:
        self._messages += 1
        self._compared += 1
        self._take_comparison(json.loads(message.data))

    def _add_pose(self, message) -> None:
        self._messages += 1
        stamp = message.header.stamp
        stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
        self._poses.setdefault(stamp_ns, deque()).append(message.pose.pose.position)
        self._take_matched()

    def _take_matched(self) -> None:
        """Take the records, in their order, as far as their poses are there."""
        while self._records:
            record = self._records[0]
            if record["pose_holds"]:
                poses = self._poses.get(record["stamp_ns"])
                if not poses:
                    return
                position = poses.popleft()
                if not poses:
                    del self._poses[record["stamp_ns"]]
                record["end_mass_east_m"] = position.x
                record["end_mass_north_m"] = position.y
                record["end_mass_up_m"] = position.z
            self._records.popleft()
            self._taken += 1
            self._take(record, record.pop("log_progress"))
