"""The real node in its own process, and an observer of what it publishes, for tests."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import rclpy
from processes import LIMIT
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ctcbs_ros.replay.through_node import free_domain

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"


class RunningNode:
    """The node `predictor` in a process, with an observing node in this one.

    Parameters
    ----------
    folder : Path
        For the process's output, and its cache.
    parameters : dict
        Values by name, over those of the configuration.
    configuration : Path or None
        None for no parameter file.
    """

    def __init__(self, folder, parameters=None, configuration=DRONE, arguments=()):
        domain = free_domain()
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        command = [sys.executable, "-m", "ctcbs_ros.nodes.predictor", "--ros-args"]
        if configuration is not None:
            command += ["--params-file", str(configuration)]
        for name, value in (parameters or {}).items():
            command += ["-p", f"{name}:={value}"]
        self._output = open(folder / "node_output", "w+")  # noqa: SIM115
        self.process = subprocess.Popen(
            [*command, *arguments], env=environment, stdout=self._output, stderr=self._output
        )
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.observer = Node("observer", context=self.context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.observer)
        self._clients = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self._output.close()
        self.observer.destroy_node()
        self.context.try_shutdown()

    @property
    def output(self):
        """What the process has printed so far."""
        return Path(self._output.name).read_text()

    def messages(self, message_type, topic, qos=10):
        """List that the messages of a topic will be appended to."""
        received = []
        self.observer.create_subscription(message_type, topic, received.append, qos)
        return received

    def wait_until(self, condition, timeout=LIMIT):
        """Receive until a condition holds; fails where it does not, or where the node ends."""
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain; the node said: {self.output}"
            assert self.process.poll() is None, f"the node ended: {self.output}"
            self._executor.spin_once(timeout_sec=0.02)

    def wait_until_ready(self):
        """Wait until the node has its table and listens."""
        self.wait_until(lambda: "ready" in self.output)

    def spin(self, seconds, until=lambda: False):
        """Receive for a time, or until a condition holds."""
        end = time.monotonic() + seconds
        while not until() and (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.02))

    def call(self, service_type, name, request, timeout=LIMIT, again=2.0):
        """Call a service of the node; asked again where an answer is lost.

        A client sees a service before the service sees the client, and an answer to a client that
        is not seen yet is dropped by rmw_fastrtps after 0.1 s ("client will not receive
        response"). Requests here set or get a value, so that asking twice changes nothing.
        """
        if name not in self._clients:
            self._clients[name] = self.observer.create_client(service_type, name)
        client = self._clients[name]
        self.wait_until(client.service_is_ready, timeout)
        deadline = time.monotonic() + timeout
        futures = []
        while not any(future.done() for future in futures):
            assert time.monotonic() < deadline, f"no answer; the node said: {self.output}"
            assert self.process.poll() is None, f"the node ended: {self.output}"
            futures.append(client.call_async(request))
            self.spin(again, until=lambda: any(future.done() for future in futures))
        return next(future for future in futures if future.done()).result()

    def end(self, *signals):
        """Send signals, all at once; returns the exit code."""
        for number in signals or (signal.SIGINT,):
            self.process.send_signal(number)
        return self.process.wait(LIMIT)
