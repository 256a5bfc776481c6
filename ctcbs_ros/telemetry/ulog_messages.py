"""Messages of PX4's ULog format in a stream of bytes.

The format describes itself: F messages give the fields of each topic, A messages number the
topics that follow, D messages hold their data. pyulog loads a log whole, so the stream is cut
into messages here, and a log of any size is read as it comes.
"""

import re
import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from pyulog import ULog

from ctcbs_ros.telemetry.link import LinkStatistics
from ctcbs_ros.telemetry.splitter import MessageSplitter

START = ULog.HEADER_BYTES
SYNC = ULog.SYNC_BYTES
HEADER = 16  # bytes: magic, version, time stamp

# Of the information and the parameters of a log, those that are kept.
FACTS = ("sys_name", "MAV_SYS_ID")

CODES = {
    "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i",
    "uint32_t": "I", "int64_t": "q", "uint64_t": "Q", "float": "f", "double": "d",
    "bool": "?", "char": "x",
}  # fmt: skip
INTEGERS = {
    "timestamp", "time_utc_usec", "timestamp_time_relative", "fix_type", "satellites_used",
}  # fmt: skip
# Message types, with the bytes that each has at least.
LEAST = {
    ord(kind): size
    for kind, size in {
        "B": 40, "F": 3, "I": 4, "M": 5, "P": 4, "Q": 5, "A": 4, "R": 2, "D": 2, "L": 9,
        "C": 11, "S": 8, "O": 2,
    }.items()
}  # fmt: skip
# What the beginning of a message can look like, for finding the next one after damage.
HEAD = re.compile(rb"(?s)(?=..[BFIMPQARDLCSO])")
TEXT = re.compile(rb"[\x20-\x7e]+")
LARGEST_UNKNOWN = 10_000  # bytes of a message of a type that came after this was written

Values = dict[str, Any]


class Data(NamedTuple):
    """One message of a topic; several receivers or estimators number themselves by instance."""

    topic: str
    instance: int
    values: Values


@dataclass(frozen=True)
class Layout:
    """Where the plain fields of a topic stand; arrays are passed over."""

    names: tuple[str, ...]
    fields: struct.Struct
    largest: int  # bytes with the padding at the end, which the logger leaves out


class UlogSplitter(MessageSplitter):
    """Cuts a ULog stream into messages, by the topics that the stream itself declares.

    A message must be formed as its type demands.

    Parameters
    ----------
    link : LinkStatistics
        Where messages and bad bytes are counted.
    topics : collection of str
        Those that are wanted.

    Attributes
    ----------
    facts : dict
        Of the log's information and parameters those in `FACTS`.
    """

    LOOK_AHEAD = 5

    def __init__(self, link: LinkStatistics, topics: Collection[str]):
        super().__init__(link)
        self.facts: Values = {}
        self._wanted = topics
        self._in_header = True
        self._layouts: dict[str, Layout | None] = {}
        self._topics: dict[int, tuple[str, int]] = {}

    def split(self, data: bytes, last: bool = False) -> Iterator[Data]:
        """Wanted messages completed by more bytes; with `last` nothing follows them."""
        if self._in_header:
            data, self._rest = self._rest + data, b""
            if len(data) < HEADER and not last:
                self._rest = data
                return
            self._in_header = False
            data = data[HEADER if data.startswith(START) else 0 :]
        yield from super().split(data, last)

    def _end(self, buffer: bytes, position: int) -> int:
        if not self._is_head(buffer, position, self._link.in_step):
            return position
        return position + 3 + int.from_bytes(buffer[position : position + 2], "little")

    def _next_head(self, buffer: bytes, position: int) -> int:
        found = HEAD.search(buffer, position + 1)
        return found.start() if found else max(position + 1, len(buffer) - 2)

    def _is_head(self, buffer: bytes, position: int, in_step: bool) -> bool:
        """Whether a message can begin there, as far as its first 5 bytes are there to tell.

        In step with what comes before, also one of a type or a topic that is not known.
        """
        if position + 3 > len(buffer):
            return True
        size, kind = struct.unpack_from("<HB", buffer, position)
        if kind not in LEAST:
            return in_step and 65 <= kind <= 90 and 0 < size <= LARGEST_UNKNOWN
        if size < LEAST[kind]:
            return False
        if kind == ord("D") and position + 5 <= len(buffer):
            number = int.from_bytes(buffer[position + 3 : position + 5], "little")
            if number not in self._topics:
                return in_step
            layout = self._layouts.get(self._topics[number][0])
            return layout is None or layout.fields.size <= size - 2 <= layout.largest
        return True

    def _is_whole(self, buffer: bytes, position: int, end: int) -> bool:
        if end > len(buffer) or not self._is_head(buffer, end, True):
            return False
        kind, content = chr(buffer[position + 2]), buffer[position + 3 : end]
        if kind == "S":
            return content == SYNC
        if kind in "FA":
            return TEXT.fullmatch(content[3 if kind == "A" else 0 :]) is not None
        if kind in "IMPQ":
            key = _key(content[kind in "MQ" :])
            return key is not None and TEXT.fullmatch(key) is not None
        if kind in "LC":
            return content[:1] in b"01234567"
        return len(content) == 2 if kind == "O" else True

    def _decode(self, buffer: bytes, position: int, end: int) -> Data | None:
        content = buffer[position + 3 : end]
        match chr(buffer[position + 2]):
            case "F":
                self._declare(content)
            case "A":
                instance, number = struct.unpack_from("<BH", content)
                name = content[3:].decode()
                self._topics[number] = name if name in self._wanted else "", instance
            case "R":
                self._topics.pop(int.from_bytes(content[:2], "little"), None)
            case "I" | "P":
                self._take_fact(content)
            case "D":
                return self._data(content)
        return None

    def _declare(self, content: bytes) -> None:
        """Take in the fields of a topic; one that cannot be read is not decoded."""
        name = content.split(b":")[0].decode()
        if name not in self._wanted:
            return
        try:
            self._layouts[name] = _layout(ULog.MessageFormat(content, None).fields)
        except (KeyError, ValueError, IndexError, struct.error):
            self._layouts[name] = None

    def _take_fact(self, content: bytes) -> None:
        key = _key(content)
        kind, _, name = key.decode().partition(" ")
        if name not in FACTS:
            return
        value = content[1 + len(key) :]
        if kind.startswith("char["):
            self.facts[name] = value.decode(errors="replace").rstrip("\0")
        elif kind == "int32_t" and len(value) == 4:
            self.facts[name] = int.from_bytes(value, "little", signed=True)

    def _data(self, content: bytes) -> Data | None:
        topic, instance = self._topics.get(int.from_bytes(content[:2], "little"), ("", 0))
        layout = self._layouts.get(topic)
        if layout is None or len(content) - 2 < layout.fields.size:
            return None
        values = layout.fields.unpack_from(content, 2)
        return Data(topic, instance, dict(zip(layout.names, values, strict=True)))


def _layout(fields: list[tuple[str, int, str]]) -> Layout:
    """Layout of (type, array size, name); KeyError for a type that is a topic itself."""
    names, formats, trailing = [], "<", ""
    for kind, count, name in fields:
        code = CODES[kind]
        if name.startswith("_padding"):
            trailing += f"{struct.calcsize('<' + code) * (count or 1)}x"
            continue
        formats += trailing
        trailing = ""
        if count:
            formats += f"{struct.calcsize('<' + code) * count}x"
        elif code == "x":
            formats += code
        elif name in INTEGERS and code in "fd?":
            raise ValueError(f"{name}: {kind}")
        else:
            names.append(name)
            formats += code
    largest = struct.calcsize(formats + trailing)
    return Layout(tuple(names), struct.Struct(formats), largest)


def _key(content: bytes) -> bytes | None:
    """The "type name" of an information or a parameter; None where it is cut short."""
    key = content[1 : 1 + content[0]]
    return key if len(key) == content[0] and b" " in key else None
