"""What is said on a live link: nothing unasked, heartbeats, requests of rates."""

import socket
import time

import pytest
from links import collect, free_port
from mavlink_bytes import Sender, heartbeat, position
from processes import LIMIT
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry import own_messages


def messages_of(data):
    """What is in some bytes, by pymavlink's own parser."""
    return dialect.MAVLink(None).parse_buffer(bytearray(data)) or []


class Clock:
    """A clock that stands still until an answer is overdue: no load makes any other so."""

    now = 100.0

    def monotonic(self):
        return self.now

    def pass_an_answer(self):
        self.now += own_messages.ANSWER_WITHIN


class Autopilot:
    """A vehicle on a UDP link that takes commands.

    Its answers are by message id; what can be called is, instead of an answer.
    """

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
                if callable(result):
                    result()
                elif result is not None:
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
    clock = Clock()
    monkeypatch.setattr(own_messages, "time", clock)
    port = free_port()
    source = link(f"udpin:{port}", request_rate=10.0)
    denied, silent = dialect.MAVLINK_MSG_ID_WIND_COV, dialect.MAVLINK_MSG_ID_VFR_HUD
    vehicle = autopilot(port, {denied: dialect.MAV_RESULT_DENIED, silent: clock.pass_an_answer})
    vehicle.run_until(lambda: len(source.answers) == len(own_messages.REQUESTED))
    assert source.answers["GLOBAL_POSITION_INT"] == "accepted"
    assert source.answers["WIND_COV"] == "denied"
    assert source.answers["VFR_HUD"] == "no answer"
    requests = [(m.param1, m.param2) for m in vehicle.heard]
    assert requests.count((silent, 200_000.0)) == own_messages.TRIES
    assert requests[0] == (dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 100_000.0)
    assert {m.command for m in vehicle.heard} == {dialect.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert {(m.target_system, m.target_component) for m in vehicle.heard} == {(1, 1)}
    vehicle.heard.clear()
    vehicle.boot_ms = 3000
    vehicle.run_until(lambda: vehicle.heard)
    assert vehicle.heard[0].param1 == dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
