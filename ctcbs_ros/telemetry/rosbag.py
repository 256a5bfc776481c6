"""ROS 2 bags to samples: a rosbag2 folder, or one of its files, SQLite (.db3) or MCAP.

Nothing of ROS needs to be installed: rosbags reads MCAP and the messages, by its own definitions
of their types, never by those in the bag (which it would compile). A bag is read as it comes; of
a damaged one all that can be read, message by message, chunk by chunk.
"""

import re
import sqlite3
from collections import deque
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_typestore

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.link import LinkStatistics
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.topics import POSE, TopicSamples

MCAP_START = b"\x89MCAP0\r\n"
SQLITE_START = b"SQLite format 3\0"
METADATA = "metadata.yaml"
# Damaged stretches of one MCAP file until the rest of it is given up.
MOST_STRETCHES = 1000
# Samples in which a bag shows what kinds of position it has.
HEAD_SAMPLES = 1000


@dataclass(frozen=True)
class Role:
    """What a topic is for: its message type, its names by preference, and who takes it in."""

    type: str
    names: tuple[str, ...]
    handler: str  # of TopicSamples
    gives_position: bool
    only_named: str = ""  # a topic of another name must have this in it


ROLES = (
    Role(
        "sensor_msgs/msg/NavSatFix",
        ("/mavros/global_position/global", "/fix", "/mavros/global_position/raw/fix"),
        "fix",
        True,
    ),
    Role("nav_msgs/msg/Odometry", ("/mavros/local_position/odom", "/odom"), "odometry", True),
    Role("geometry_msgs/msg/PoseStamped", ("/mavros/local_position/pose",), "pose", True),
    Role(
        "geometry_msgs/msg/TwistStamped",
        ("/mavros/local_position/velocity_local", "/mavros/global_position/raw/gps_vel"),
        "twist",
        False,
    ),
    # Receivers publish their velocity as the same type.
    Role(
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        ("/mavros/wind_estimation",),
        "wind_estimation",
        False,
        only_named="wind",
    ),
)


@dataclass(frozen=True)
class Topic:
    """A topic of a storage, by the number that its messages carry there."""

    id: Any
    name: str
    type: str


@dataclass(frozen=True)
class Raw:
    """A message as it is stored."""

    id: Any
    receive_ns: int
    data: bytes
    progress: float  # part of the storage read, 0 to 1


class BagSource:
    """A bag: iterate over it for its samples, from the start each time.

    Parameters
    ----------
    path : Path
    storages : list
        Its files in order.
    used : dict
        Role of each topic used, by name.

    Attributes
    ----------
    path : Path
    size : int
        Bytes.
    link : LinkStatistics
        Counts over what has been read.
    vehicle : None
        A bag does not name its vehicle.
    progress : float
        Part of the bag that has been read, 0 to 1.
    is_empty : bool
        Whether there is not one sample in it.
    """

    vehicle = None

    def __init__(self, path: Path, storages: list, used: dict[str, Role]):
        self.path = path
        self.size = sum(storage.size for storage in storages)
        self._storages = storages
        self._used = used
        self._types = get_typestore(Stores.ROS2_JAZZY)
        # What kinds of position there are shows soon; the best is then used from the start.
        self._best = POSE
        self.is_empty = not list(islice(self, HEAD_SAMPLES))
        self._best = self._samples.best
        self._begin()

    @property
    def wind(self) -> Vector | None:
        """Wind by the autopilot at the newest sample, velocity towards east, north, up [m/s]."""
        return self._samples.wind

    def _begin(self) -> None:
        self.link = LinkStatistics()
        self.progress = 0.0
        self._samples = TopicSamples(VehicleClock(time_steps=self.link.time_steps), self._best)

    def __iter__(self) -> Iterator[Sample]:
        self._begin()
        before = 0
        for storage in self._storages:
            roles = {
                topic.id: self._used[topic.name]
                for topic in storage.topics
                if topic.name in self._used and self._used[topic.name].type == topic.type
            }
            for raw in storage.messages(set(roles), self.link):
                self.progress = (before + raw.progress * storage.size) / self.size
                sample = self._taken(roles[raw.id], raw)
                if sample is not None:
                    yield sample
            before += storage.size
        self.progress = 1.0

    def _taken(self, role: Role, raw: Raw) -> Sample | None:
        try:
            message = self._types.deserialize_cdr(raw.data, role.type)
        except Exception:  # whatever damaged bytes lead to
            self.link.count_bad_bytes(len(raw.data))
            return None
        self.link.count_message()
        return getattr(self._samples, role.handler)(message, raw.receive_ns // 1000)


def is_bag(path: Path) -> bool:
    """Whether a path is a folder, or a file that begins like a bag."""
    return path.is_dir() or _file_class(path) is not None


def open_bag(path: Path) -> BagSource:
    """Open a rosbag2 folder, or a file of one.

    Topics are taken by their mavros names (`ROLES`), else the only one of its type.

    Raises
    ------
    InputError
        If there is nothing to read, or no topic that tells where the aircraft is.
    """
    storages = _storages(path)
    if not storages:
        raise InputError(f"log {path}: no rosbag2 file (.db3 or .mcap) in it that can be read")
    topics = {topic for storage in storages for topic in storage.topics}
    used: dict[str, Role] = {}
    for role in ROLES:
        name = _chosen(role, {topic.name for topic in topics if topic.type == role.type})
        if name is not None:
            used[name] = role
    if not any(role.gives_position for role in used.values()):
        found = ", ".join(sorted({f"{topic.name} ({topic.type})" for topic in topics})[:10])
        raise InputError(
            f"log {path}: no topic tells the aircraft's position; needed: NavSatFix, Odometry or "
            f"PoseStamped, by its mavros name or the only one of its type; found: "
            f"{found or 'none'}"
        )
    source = BagSource(path, storages, used)
    if source.is_empty:
        raise InputError(f"log {path}: no message of {', '.join(used)} that can be read")
    return source


def _chosen(role: Role, names: set[str]) -> str | None:
    """The topic of a role among those of its type."""
    for name in role.names:
        if name in names:
            return name
    names = {name for name in names if role.only_named in name}
    return names.pop() if len(names) == 1 else None


# --- storages: topics, and messages as they come ------------------------------------------------


class SqliteFile:
    """A .db3 file. It is read in the order of writing, which needs none of its indices."""

    def __init__(self, path: Path):
        self._path = path
        self.size = path.stat().st_size
        self.topics: list[Topic] = []
        with open(path, "rb") as file:
            page = int.from_bytes(file.read(18)[16:], "big")
        page = 65536 if page == 1 else page
        # SQLite takes what is missing of a page for zeros: if the last one is cut, as many
        # bytes of messages at the end may not be what was written.
        self._last_page = page if page and self.size % page else 0
        with suppress(sqlite3.Error), closing(self._connection()) as connection:
            query = "SELECT id, name, type FROM topics WHERE serialization_format = 'cdr'"
            for row in connection.execute(query):
                if all(isinstance(text, str) for text in row[1:]):
                    self.topics.append(Topic(*row))

    def messages(self, wanted: set[int], link: LinkStatistics) -> Iterator[Raw]:
        """Messages of the topics wanted; what cannot be read is counted."""
        held: deque[tuple[int, Raw | None]] = deque()
        held_bytes = read = 0
        try:
            with closing(self._connection()) as connection:
                for topic, stamp, data in connection.execute(
                    "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"
                ):
                    size = len(data) if isinstance(data, bytes) else 0
                    read += size
                    usable = topic in wanted and size and isinstance(stamp, int)
                    part = min(1.0, read / self.size)
                    # of a message that goes on elsewhere, no less than this is in the page itself
                    kept = min(size, self._last_page // 9)
                    held.append((kept, Raw(topic, stamp, data, part) if usable else None))
                    held_bytes += kept
                    while held and held_bytes - held[0][0] >= self._last_page:
                        kept, raw = held.popleft()
                        held_bytes -= kept
                        if raw is not None:
                            yield raw
        except sqlite3.Error:
            link.count_bad_bytes(max(1, self.size - read))
        else:
            link.count_bad_bytes(held_bytes)

    def _connection(self) -> sqlite3.Connection:
        path = quote(str(self._path.absolute()))
        connection = sqlite3.connect(f"file:{path}?immutable=1", uri=True)
        # Otherwise a file shorter than its header says, as one cut off, is refused whole.
        connection.execute("PRAGMA writable_schema = ON")
        connection.text_factory = lambda text: text.decode(errors="replace")
        return connection


class McapFile:
    """An .mcap file, by its index, or, where that is damaged or cut off, from the start."""

    def __init__(self, path: Path):
        self._path = path
        self.size = path.stat().st_size
        self.topics: list[Topic] = []
        with suppress(Exception), closing(self._opened()) as reader:
            self.topics = [
                Topic(c.id, c.topic, c.msgtype)
                for c in reader.connections
                if c.ext.serialization_format == "cdr"
            ]

    def messages(self, wanted: set[int], link: LinkStatistics) -> Iterator[Raw]:
        """Messages of the topics wanted; what cannot be read is counted."""
        with closing(self._opened()) as reader:
            connections = [c for c in reader.connections if c.id in wanted]
            if not connections:
                return
            if reader.chunks:
                yield from self._by_index(reader, connections, link)
            else:
                yield from self._by_scan(reader, connections, link)

    def _by_index(self, reader, connections, link) -> Iterator[Raw]:
        chunks = sorted(reader.chunks, key=lambda chunk: chunk.message_start_time)
        for number, chunk in enumerate(chunks):
            reader.chunks = [chunk]  # one at a time: a damaged one costs no other
            try:
                for connection, stamp, data in reader.messages(connections):
                    yield Raw(connection.id, stamp, data, number / len(chunks))
            except Exception:  # whatever damaged bytes lead to
                link.count_bad_bytes(max(1, chunk.compressed_size))

    def _by_scan(self, reader, connections, link) -> Iterator[Raw]:
        for _ in range(MOST_STRETCHES):
            good = reader.data_start
            try:
                for connection, stamp, data in reader.messages_scan(connections):
                    good = reader.bio.tell()
                    yield Raw(connection.id, stamp, data, min(1.0, good / self.size))
                return
            except Exception:  # whatever damaged bytes lead to
                reader.data_start = min(max(reader.bio.tell(), good + 1), reader.data_end)
                link.count_bad_bytes(reader.data_start - good)
            if reader.data_start >= reader.data_end:
                return

    def _opened(self) -> McapReader:
        reader = McapReader(self._path)
        try:
            reader.open()
            if reader.connections:
                return reader
            reader.close()
        except Exception:  # whatever damaged bytes lead to
            reader = McapReader(self._path)
        reader.bio = self._path.open("rb")
        head = reader.bio.read(len(MCAP_START) + 9)
        reader.data_start = len(head) + int.from_bytes(head[-8:], "little")
        reader.data_end = self.size
        with suppress(Exception):
            reader.meta_scan()  # topics, as far as it can be read
        return reader


class CompressedFolder:
    """A folder whose files or messages are compressed, which only its metadata tell."""

    def __init__(self, path: Path, reader: DirectoryReader):
        self._path = path
        self.size = _folder_size(path)
        self.topics = [Topic(c.topic, c.topic, c.msgtype) for c in reader.connections]

    def messages(self, wanted: set[str], link: LinkStatistics) -> Iterator[Raw]:
        """Messages of the topics wanted; what cannot be read is counted."""
        reader = DirectoryReader(self._path)
        try:
            reader.open()
            connections = [c for c in reader.connections if c.topic in wanted]
            count = max(1, sum(c.msgcount for c in connections))
            for number, (c, stamp, data) in enumerate(reader.messages(connections)):
                yield Raw(c.topic, stamp, data, min(1.0, number / count))
        except Exception:  # whatever damaged bytes lead to
            link.count_bad_bytes(1)
        finally:
            if reader.stack is not None:
                reader.close()


def _storages(path: Path) -> list:
    if not path.is_dir():
        return [kind(path) for kind in [_file_class(path)] if kind]
    if (path / METADATA).is_file():
        reader = DirectoryReader(path)
        with suppress(Exception):  # metadata that are damaged: the files tell enough
            reader.open()
            compressed = bool(reader.metadata.compression_mode)
            storage = CompressedFolder(path, reader)
            reader.close()
            if compressed:
                return [storage]
    # The recorder numbers the files of a split bag: bag_0, bag_1, ... bag_10.
    files = sorted(path.iterdir(), key=lambda file: (_number(file), file.name))
    return [kind(file) for file in files if (kind := _file_class(file))]


def _number(file: Path) -> int:
    numbers = re.findall(r"\d+", file.stem)
    return int(numbers[-1]) if numbers else 0


def _file_class(path: Path) -> type | None:
    """Class that reads a file, by how it begins."""
    with suppress(OSError), open(path, "rb") as file:
        head = file.read(16)
        if head.startswith(MCAP_START):
            return McapFile
        if head == SQLITE_START:
            return SqliteFile
    return None


def _folder_size(path: Path) -> int:
    return max(1, sum(file.stat().st_size for file in path.iterdir() if file.is_file()))
