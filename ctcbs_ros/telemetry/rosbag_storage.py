"""Storages of a ROS 2 bag: its topics, and its messages as they are stored, one after the other.

SQLite files are read here, MCAP and compressed folders by rosbags. Of a damaged one all that can
be read comes, message by message, chunk by chunk; the rest is counted.
"""

import re
import sqlite3
from collections import deque
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader

from ctcbs_ros.telemetry.link import LinkStatistics

MCAP_START = b"\x89MCAP0\r\n"
SQLITE_START = b"SQLite format 3\0"
METADATA = "metadata.yaml"
# Damaged stretches of one MCAP file until the rest of it is given up.
MOST_STRETCHES = 1000


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


Storage = SqliteFile | McapFile | CompressedFolder


def open_storages(path: Path) -> list[Storage]:
    """The files of a bag in order, or the one file; empty where there is none.

    Parameters
    ----------
    path : Path
        A rosbag2 folder, or one of its files.
    """
    if not path.is_dir():
        return [kind(path) for kind in [file_class(path)] if kind]
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
    return [kind(file) for file in files if (kind := file_class(file))]


def _number(file: Path) -> int:
    numbers = re.findall(r"\d+", file.stem)
    return int(numbers[-1]) if numbers else 0


def file_class(path: Path) -> type[SqliteFile | McapFile] | None:
    """Class that reads a file, by how it begins; None where it is no file of a bag."""
    with suppress(OSError), open(path, "rb") as file:
        head = file.read(16)
        if head.startswith(MCAP_START):
            return McapFile
        if head == SQLITE_START:
            return SqliteFile
    return None


def _folder_size(path: Path) -> int:
    return max(1, sum(file.stat().st_size for file in path.iterdir() if file.is_file()))
