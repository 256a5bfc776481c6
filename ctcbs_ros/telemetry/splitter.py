"""Messages of a format without checksums, in a stream of bytes that may be damaged.

A message counts where the head of another, or the end of the stream, follows it. Bytes between are
counted as bad, and the search goes on at what may be the next head.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

from ctcbs_ros.telemetry.link import LinkStatistics

LEAST = 3  # bytes of a head


class MessageSplitter(ABC):
    """Cuts a stream into messages; the format is the subclass's.

    Parameters
    ----------
    link : LinkStatistics
        Where messages and bad bytes are counted.

    Attributes
    ----------
    LOOK_AHEAD : int
        Bytes behind a message in which its follower shows.
    """

    LOOK_AHEAD: int

    def __init__(self, link: LinkStatistics):
        self._link = link
        self._rest = b""

    def split(self, data: bytes, last: bool = False) -> Iterator[Any]:
        """Wanted messages completed by more bytes; with `last` nothing follows them."""
        buffer = self._rest + data
        position = 0
        while position + LEAST <= len(buffer):
            end = self._end(buffer, position)
            begins = end > position
            # Whether it is intact shows in what follows it.
            if begins and end + self.LOOK_AHEAD > len(buffer) and not last:
                break
            if not begins or not self._is_whole(buffer, position, end):
                resume = self._next_head(buffer, position)
                self._link.count_bad_bytes(resume - position)
                position = resume
                continue
            self._link.count_message()
            message = self._decode(buffer, position, end)
            position = end
            if message is not None:
                yield message
        self._rest = buffer[position:]
        if last:
            self._link.count_bad_bytes(len(self._rest))
            self._rest = b""

    @abstractmethod
    def _end(self, buffer: bytes, position: int) -> int:
        """Where the message at `position` ends; `position` if none begins there."""

    @abstractmethod
    def _is_whole(self, buffer: bytes, position: int, end: int) -> bool:
        """Whether a message is all there, and followed by another or the end."""

    @abstractmethod
    def _next_head(self, buffer: bytes, position: int) -> int:
        """Where the next message behind `position` may begin."""

    @abstractmethod
    def _decode(self, buffer: bytes, position: int, end: int) -> Any:
        """The message, or None if it is not wanted."""
