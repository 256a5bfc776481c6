"""MAVLink frames in a stream of bytes, whatever damage lies between them.

Every frame found is intact by its checksum. After damage the search goes on at the very next byte,
so that a corrupt length does not take the frames behind it along.
"""

import re
from collections.abc import Callable, Iterator

from ctcbs_ros.telemetry.link import LinkStatistics

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
ANY_MAGIC = re.compile(b"[\xfd\xfe]")
STAMP_BYTES = 8
SIGNED = 0x01
SIGNATURE_BYTES = 13


class FrameSplitter:
    """Cuts a stream into MAVLink 1 and 2 messages.

    Parameters
    ----------
    decode : callable
        Takes the bytes of one frame; returns the message, or None where the checksum fails. An id
        below zero marks a message of unknown type, which has no checksum that could be tested.
    stamped : bool
        Whether each frame follows its receive stamp (.tlog): 8 bytes, big-endian, Unix time [us].
    link : LinkStatistics
        Where messages, losses and bad bytes are counted.
    """

    def __init__(self, decode: Callable, stamped: bool, link: LinkStatistics):
        self._decode = decode
        self._lead = STAMP_BYTES if stamped else 0
        self._link = link
        self._rest = b""

    def split(self, data: bytes, last: bool = False) -> Iterator[tuple[int | None, object]]:
        """Messages completed by more bytes, each with its receive stamp [us] or None.

        With `last` nothing follows `data`: what is left unfinished then counts as bad bytes.
        """
        buffer = self._rest + data
        lead, position = self._lead, 0
        while (start := position + lead) < len(buffer):
            end = _frame_end(buffer, start)
            if end is None or end > len(buffer):
                if not last:
                    break
                message = None
            else:
                message = self._decode(buffer[start:end]) if end > start else None
            if message is not None and message.get_msgId() < 0:
                follower = end + lead
                if follower >= len(buffer) and not last:
                    break
                # Only its neighbours can tell an unknown message from damage that looks like one.
                followed = follower >= len(buffer) or buffer[follower] in (MAGIC_1, MAGIC_2)
                if not (followed and self._link.in_step):
                    message = None
            if message is None:
                magic = ANY_MAGIC.search(buffer, start + 1)
                resume = (magic.start() if magic else len(buffer)) - lead
                self._link.count_bad_bytes(resume - position)
                position = resume
                continue
            self._count(buffer, start)
            stamp = int.from_bytes(buffer[position:start], "big") if lead else None
            position = end
            yield stamp, message
        self._rest = buffer[position:]
        if last:
            self._link.count_bad_bytes(len(self._rest))
            self._rest = b""

    def _count(self, buffer: bytes, start: int) -> None:
        at = start + (2 if buffer[start] == MAGIC_1 else 4)
        self._link.count_message()
        self._link.count_sequence((buffer[at + 1], buffer[at + 2]), buffer[at])


def _frame_end(buffer: bytes, start: int) -> int | None:
    """Where the frame at `start` ends; `start` if none begins there, None if it is cut short."""
    if buffer[start] == MAGIC_1:
        if start + 1 >= len(buffer):
            return None
        return start + 6 + buffer[start + 1] + 2
    if buffer[start] == MAGIC_2:
        if start + 2 >= len(buffer):
            return None
        flags = buffer[start + 2]
        if flags & ~SIGNED:  # MAVLink 2: a frame with flags not understood must be discarded
            return start
        return start + 10 + buffer[start + 1] + 2 + (SIGNATURE_BYTES if flags & SIGNED else 0)
    return start
