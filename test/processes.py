"""Waiting for what another process does, by what can be seen of it.

No test may depend on the speed or the load of the machine: it waits for a state instead of a time,
and limits only bound a hang.
"""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from pathlib import Path

LIMIT = 300.0  # s


def wait_for(condition, what="what was waited for", limit=LIMIT):
    """Poll a condition until it holds; returns what it returned."""
    deadline = time.monotonic() + limit
    while not (found := condition()):
        assert time.monotonic() < deadline, f"{what} did not come within {limit:g} s"
        time.sleep(0.02)
    return found


def read_until(stream, pattern, limit=LIMIT):
    """Read from a pipe or terminal until a regular expression is in what it says.

    Returns
    -------
    str
        What was read, which may go on after the match.
    """
    number = stream if isinstance(stream, int) else stream.fileno()
    shown, deadline = b"", time.monotonic() + limit
    while not re.search(pattern, shown.decode(errors="replace")):
        readable, _, _ = select.select([number], [], [], max(0.0, deadline - time.monotonic()))
        assert readable, f"no {pattern!r} within {limit:g} s, only {shown!r}"
        more = _read(number)
        assert more, f"no {pattern!r} before the end, only {shown!r}"
        shown += more
    return shown.decode(errors="replace")


def read_to_end(number):
    """The rest of what a pipe or terminal says."""
    shown = b""
    while more := _read(number):
        shown += more
    return shown.decode(errors="replace")


def _read(number):
    try:
        return os.read(number, 65536)
    except OSError:  # a terminal's end, where no process holds it any more
        return b""


def start_on_terminal(command, **options):
    """Start a command whose standard error is a terminal; there progress bars move at once.

    Returns
    -------
    subprocess.Popen, int
        The process, and the file descriptor of what it says.
    """
    ours, its = pty.openpty()
    # 24 lines of 120 characters; tqdm says nothing on a terminal without a width.
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
    process = subprocess.Popen(
        list(map(str, command)), stdout=subprocess.DEVNULL, stderr=its, **options
    )
    os.close(its)
    return process, ours


def children(pid, program):
    """Process ids of the children of a process that run a program, by a part of its command."""
    try:
        listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [int(number) for number in listed if program in command_line(int(number))]


def command_line(pid):
    """Command of a process; empty where it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


def is_running(pid):
    """Whether a process runs; one that has ended and is not waited for yet does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
