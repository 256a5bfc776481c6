"""What this program says on a MAVLink link, each only when asked for: heartbeats, rate requests.

It speaks as system 254, as a companion computer: a heartbeat of system 255 would keep ArduPilot's
failsafe for a lost ground station from acting.
"""

import time
from collections import deque

from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.link import Vehicle

SYSTEM, COMPONENT = 254, dialect.MAV_COMP_ID_ONBOARD_COMPUTER
HEARTBEAT_PERIOD = 1.0  # s
# The messages worth asking for, and the highest rate worth having [1/s].
REQUESTED = {
    "GLOBAL_POSITION_INT": float("inf"),
    "GPS_RAW_INT": 5.0,
    "VFR_HUD": 5.0,
    "SYSTEM_TIME": 1.0,
    "SYS_STATUS": 1.0,
    "SCALED_PRESSURE": 1.0,
    "WIND": 1.0,
    "WIND_COV": 1.0,
}
ANSWER_WITHIN = 1.0  # s
TRIES = 3
ASK_AGAIN = 30.0  # s after which what was not answered is asked for again
# A vehicle silent for longer [s], or whose clock steps back, may have forgotten the rates.
SILENT = 5.0
REBOOT_MS = 2000


class OwnMessages:
    """Frames to send on a link, and the answers to them.

    Requests are sent one at a time, as an answer does not say which of them it is for.

    Parameters
    ----------
    heartbeat : bool
        Whether a heartbeat is sent each second.
    request_rate : float
        Rate of position messages to ask the vehicle for [1/s]; 0 to ask for nothing.

    Attributes
    ----------
    answers : dict
        By message asked for: "accepted", "denied", ... or "no answer".
    heard : float or None
        `time.monotonic()` at the newest message of the vehicle followed [s].
    """

    def __init__(self, heartbeat: bool = False, request_rate: float = 0.0):
        self.answers: dict[str, str] = {}
        self._heartbeat = heartbeat
        self._rate = request_rate
        self._sender = dialect.MAVLink(None, SYSTEM, COMPONENT)
        self._next_heartbeat = 0.0
        self._asked_vehicle: tuple[int, int] | None = None
        self._to_ask: deque[str] = deque()
        self._tries = 0
        self._wait_until = 0.0
        self.heard: float | None = None
        self._boot_ms = 0

    def hear(self, message) -> None:
        """Take in a message of the vehicle followed."""
        now, boot_ms = time.monotonic(), getattr(message, "time_boot_ms", self._boot_ms)
        has_been_silent = self.heard is not None and now - self.heard > SILENT
        if has_been_silent or boot_ms < self._boot_ms - REBOOT_MS:
            self._asked_vehicle = None
        self.heard, self._boot_ms = now, boot_ms
        if message.get_type() == "COMMAND_ACK":
            self._hear_answer(message)

    def due(self, vehicle: Vehicle | None) -> list[bytes]:
        """Frames to send now."""
        frames, now = [], time.monotonic()
        if self._heartbeat and now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_PERIOD
            frames.append(self._frame(own_heartbeat()))
        if self._rate > 0.0 and vehicle is not None:
            request = self._request(vehicle, now)
            if request is not None:
                frames.append(self._frame(request))
        return frames

    def _request(self, vehicle: Vehicle, now: float):
        if self._asked_vehicle != (vehicle.system, vehicle.component):
            self._asked_vehicle = (vehicle.system, vehicle.component)
            self.answers = {}
            self._ask(list(REQUESTED))
        if now < self._wait_until:
            return None
        if self._to_ask and self._tries == TRIES:
            self.answers[self._to_ask[0]] = "no answer"
            self._next_one()
        if not self._to_ask:
            self._ask([name for name, answer in self.answers.items() if answer == "no answer"])
            self._wait_until = now + ASK_AGAIN
            return None
        self._tries += 1
        self._wait_until = now + ANSWER_WITHIN
        name = self._to_ask[0]
        return dialect.MAVLink_command_long_message(
            vehicle.system,
            vehicle.component,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            getattr(dialect, f"MAVLINK_MSG_ID_{name}"),
            round(1e6 / min(self._rate, REQUESTED[name])),
            0, 0, 0, 0, 0,
        )  # fmt: skip

    def _ask(self, names: list[str]) -> None:
        self._to_ask = deque(names)
        self._tries = 0
        self._wait_until = 0.0

    def _next_one(self) -> None:
        self._to_ask.popleft()
        self._tries = 0
        self._wait_until = 0.0

    def _hear_answer(self, message) -> None:
        is_mine = message.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and self._tries > 0
        # MAVLink 1 does not say whom the answer is for.
        is_mine = is_mine and message.target_system in (0, SYSTEM)
        if is_mine and self._to_ask and message.result != dialect.MAV_RESULT_IN_PROGRESS:
            entry = dialect.enums["MAV_RESULT"].get(message.result)
            name = entry.name.removeprefix("MAV_RESULT_") if entry else f"result {message.result}"
            self.answers[self._to_ask[0]] = name.replace("_", " ").lower()
            self._next_one()

    def _frame(self, message) -> bytes:
        frame = message.pack(self._sender)
        self._sender.seq = (self._sender.seq + 1) % 256
        return bytes(frame)


def own_heartbeat():
    """The heartbeat of a companion computer, no autopilot and no ground station."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_ONBOARD_CONTROLLER,
        dialect.MAV_AUTOPILOT_INVALID,
        base_mode=0,
        custom_mode=0,
        system_status=dialect.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )
