"""ArduPilot's DataFlash logs as text (.log): one message a line, formats declared as in a .BIN."""

import re
from collections.abc import Iterator

from pymavlink.DFReader import DFFormat, DFMessage

from ctcbs_ros.telemetry.dataflash import WANTED
from ctcbs_ros.telemetry.link import LinkStatistics

START = re.compile(rb"(?m)^FMT, ?\d+, ?\d+, ?\w{1,4},")
NAME = re.compile(r"\w{1,4}", re.ASCII)
LONGEST_LINE = 4096  # bytes; a message has 255 at most


class LineSplitter:
    """Cuts a stream into DataFlash messages, one a line; as `dataflash.DataflashSplitter`.

    Parameters
    ----------
    link : LinkStatistics
        Where messages and bad bytes are counted.
    """

    def __init__(self, link: LinkStatistics):
        self._link = link
        self._formats: dict[str, DFFormat | None] = {}
        self._rest = b""

    def split(self, data: bytes, last: bool = False) -> Iterator[DFMessage]:
        """Wanted messages completed by more bytes; with `last` nothing follows them."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            self._link.count_bad_bytes(len(self._rest))
            self._rest = b""
        for line in lines:
            message = self._decoded(line)
            if message is not None:
                yield message
        if last:
            # Of a line without its end no one knows whether its last number is whole.
            self._link.count_bad_bytes(len(self._rest))
            self._rest = b""

    def _decoded(self, line: bytes) -> DFMessage | None:
        """The message of a line, if it is wanted; a line that is none is counted."""
        if not line.strip():
            return None
        name, *values = re.split(", ?", line.decode(errors="replace").rstrip("\r"))
        try:
            if name == "FMT":
                self._declare(values)
                message = None
            elif name in self._formats:
                message = self._message(name, values)
            else:
                raise ValueError(name)
        except (ValueError, IndexError, KeyError):
            self._link.count_bad_bytes(len(line) + 1)
            return None
        self._link.count_message()
        return message

    def _declare(self, values: list[str]) -> None:
        kind, length, name, layout, *columns = values
        if not NAME.fullmatch(name):
            raise ValueError(name)
        self._formats[name] = None
        usable = WANTED.get(name, {None}).issubset(columns) and len(columns) == len(layout)
        if usable:
            declared = int(kind), name, int(length), layout, ",".join(columns)
            try:
                self._formats[name] = DFFormat(*declared)
            except Exception as error:  # it raises its own and others for unknown letters
                raise ValueError(name) from error

    def _message(self, name: str, values: list[str]) -> DFMessage | None:
        layout = self._formats[name]
        if layout is None:
            return None
        count = len(layout.columns)
        if len(values) < count or (len(values) > count and layout.format[-1] != "Z"):
            raise ValueError(name)
        elements = [*values[: count - 1], ", ".join(values[count - 1 :])]
        for kind, element in zip(layout.msg_types, elements, strict=True):
            if kind is int and abs(int(element)) >= 2**64:  # no field of the format is longer
                raise ValueError(name)
            kind(element)  # a number that is none
        return DFMessage(layout, elements, False, None)
