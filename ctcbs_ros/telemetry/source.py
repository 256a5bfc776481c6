"""Flight logs as streams of samples, whatever their format; it is told by content, not by name."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted
from ctcbs_ros.telemetry.dataflash import START as DATAFLASH_START
from ctcbs_ros.telemetry.dataflash import DataflashDecoder
from ctcbs_ros.telemetry.dataflash_text import START as DATAFLASH_TEXT_START
from ctcbs_ros.telemetry.dataflash_text import LineSplitter
from ctcbs_ros.telemetry.link import LinkStatistics, Vehicle
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.ulog import UlogDecoder
from ctcbs_ros.telemetry.ulog_messages import START as ULOG_START

if TYPE_CHECKING:
    from ctcbs_ros.telemetry.rosbag import BagSource

CHUNK = 1 << 14
# Bytes in which a log must show its format, and tell its vehicle if it can; and those in which a
# MAVLink log usually does both.
HEAD = 1 << 20
SHORT_HEAD = 1 << 14
# Bytes in which a log as text declares its first format.
TEXT_HEAD = 1 << 12
MAVLINK = "a MAVLink log"
# Random bytes hold a frame with a right checksum now and then; of a log, this part is messages.
LEAST_GOOD_PART = 1e-3

Decoder = MavlinkDecoder | DataflashDecoder | UlogDecoder


class LogSource:
    """A flight log: iterate over it for its samples, from the start each time.

    Parameters
    ----------
    path : Path
    new_decoder : callable
        Makes the decoder of the log's format.

    Attributes
    ----------
    path : Path
    size : int
        Bytes.
    """

    def __init__(self, path: Path, new_decoder: Callable[[], Decoder]):
        self.path = path
        self.size = path.stat().st_size
        self._new_decoder = new_decoder
        self._decoder = new_decoder()
        self._read = 0

    def __iter__(self) -> Iterator[Sample | BeaconSample]:
        self._decoder = self._new_decoder()
        self._read = 0
        with open(self.path, "rb") as log:
            while data := log.read(CHUNK):
                self._read += len(data)
                yield from self._decoder.feed(data)
            yield from self._decoder.feed(b"", last=True)

    @property
    def progress(self) -> float:
        """Part of the log's bytes that has been read, 0 to 1."""
        return min(1.0, self._read / self.size)

    @property
    def link(self) -> LinkStatistics:
        """Counts over what has been read."""
        return self._decoder.link

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle whose samples these are."""
        return self._decoder.vehicle

    @property
    def beacon(self) -> Vehicle | None:
        """The payload's beacon, once it is heard."""
        return getattr(self._decoder, "beacon", None)

    @property
    def beacon_link(self) -> LinkStatistics | None:
        """Counts of the beacon's messages alone; None without one."""
        return getattr(self._decoder, "beacon_link", None)

    @property
    def wind(self) -> Vector | None:
        """Wind by the autopilot at the newest sample, velocity towards east, north, up [m/s]."""
        return self._decoder.wind


def open_log(
    path: str | Path,
    system: int | None = None,
    component: int | None = None,
    beacon: BeaconWanted | None = None,
) -> "LogSource | BagSource":
    """Open a flight log.

    Parameters
    ----------
    path : str or Path
        A MAVLink log with receive stamps (.tlog) or without, an ArduPilot DataFlash log (.BIN, or
        as text .log), a PX4 log (.ulg), a rosbag2 folder, or a file of one (.db3, .mcap).
    system, component : int, optional
        MAVLink ids of the vehicle wanted; without them the first aircraft, see
        `ctcbs_ros.telemetry.mavlink.VehicleDecoder`. The other logs have one vehicle only.
    beacon : BeaconWanted, optional
        Whose positions are the payload's; they come among the aircraft's as `BeaconSample`.

    Returns
    -------
    LogSource or BagSource

    Raises
    ------
    InputError
        If the file cannot be read, has no message of these formats in its first MiB, or cannot
        have the beacon asked for.
    """
    # A node that listens to a link opens no log, and does without rosbags.
    from ctcbs_ros.telemetry.rosbag import is_bag, open_bag

    path = Path(path)
    if is_bag(path):
        _require_beacon(path, beacon, "a bag", of_system=False, of_topic=True)
        return open_bag(path, beacon.topic if beacon else "")
    try:
        with open(path, "rb") as log:
            head = log.read(HEAD)
    except OSError as error:
        raise InputError(f"log {path}: cannot be read: {error.strerror or error}") from error
    if not head:
        raise InputError(f"log {path}: the file is empty")

    if beacon is not None:
        kind = _kind(head)
        _require_beacon(path, beacon, kind, of_system=kind == MAVLINK, of_topic=False)
    if head.startswith(DATAFLASH_START):
        trial = _tried(DataflashDecoder(), head)
        decoder = partial(DataflashDecoder, vehicle=trial.vehicle, unix_anchor=trial.unix_anchor)
    elif DATAFLASH_TEXT_START.search(head[:TEXT_HEAD]):
        trial = _tried(DataflashDecoder(splitter=LineSplitter), head)
        decoder = partial(DataflashDecoder, trial.vehicle, trial.unix_anchor, LineSplitter)
    elif head.startswith(ULOG_START):
        trial = _tried(UlogDecoder(), head)
        decoder = partial(UlogDecoder, trial.vehicle, trial.unix_anchor, trial.position_topic)
    else:
        stamped, trial = _tried_stamps(head[:SHORT_HEAD], system, component, beacon)
        if trial.vehicle is None or trial.link.bad_bytes > SHORT_HEAD // 2:
            stamped, trial = _tried_stamps(head, system, component, beacon)
        else:
            head = head[:SHORT_HEAD]
        trial.choose_any()
        if trial.vehicle is None and trial.beacon is not None:
            raise InputError(
                f"log {path}: only system {beacon.system} sends positions, which is the beacon's "
                "by beacon.system_id; it must not be the aircraft's"
            )
        decoder = partial(
            MavlinkDecoder, stamped, system, component, vehicle=trial.vehicle, beacon=beacon
        )

    good = len(head) - trial.link.bad_bytes
    if trial.link.messages == 0 or good < LEAST_GOOD_PART * len(head):
        raise InputError(
            f"log {path}: no message of a known format found; allowed: a .tlog, a MAVLink "
            "stream without time stamps, an ArduPilot .BIN or .log, a PX4 .ulg, or a rosbag2 "
            "(.db3, .mcap)"
        )
    return LogSource(path, decoder)


def _kind(head: bytes) -> str:
    """The format of a log by its first bytes, in words."""
    if head.startswith(DATAFLASH_START) or DATAFLASH_TEXT_START.search(head[:TEXT_HEAD]):
        return "an ArduPilot DataFlash log"
    return "a PX4 log" if head.startswith(ULOG_START) else MAVLINK


def _require_beacon(
    path: Path, beacon: BeaconWanted | None, kind: str, of_system: bool, of_topic: bool
) -> None:
    """Refuse a beacon that a kind of log cannot have."""
    if beacon is None:
        return
    if of_topic if beacon.topic else of_system:
        return
    instead = (
        "use beacon.topic" if of_topic else "use beacon.system_id" if of_system else
        "allowed: a .tlog or raw MAVLink log (beacon.system_id), a rosbag2 (beacon.topic)"
    )  # fmt: skip
    wanted = "beacon.topic" if beacon.topic else "beacon.system_id"
    raise InputError(f"log {path}: {wanted}: {kind} cannot have it; {instead}")


def _tried(decoder, head: bytes):
    """The decoder after it has read the head of a log."""
    for _ in decoder.feed(head, last=True):
        pass
    return decoder


def _tried_stamps(
    head: bytes, system: int | None, component: int | None, beacon: BeaconWanted | None
) -> tuple[bool, MavlinkDecoder]:
    """Whether a MAVLink log is stamped, and the decoder that has read its head."""
    trials = {
        stamped: _tried(
            MavlinkDecoder(stamped, system, component, beacon=beacon, looking_ahead=True), head
        )
        for stamped in (True, False)
    }
    # Read the wrong way, a log is damaged at every stamp.
    stamped = trials[True].link.bad_bytes <= trials[False].link.bad_bytes
    return stamped, trials[stamped]
