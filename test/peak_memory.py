"""Reads logs to their end, in a process of its own, and prints what its memory has come to.

For each log a line: samples, then the most memory resident up to then [kB].
"""

import re
import sys
from pathlib import Path

from ctcbs_ros.telemetry.source import open_log


def peak() -> int:
    """Most memory of this process that was ever resident [kB].

    Not by `getrusage`, which begins with that of the process that started this one.
    """
    return int(re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())[1])


if __name__ == "__main__":
    for path in sys.argv[1:]:
        samples = sum(1 for _ in open_log(path))
        print(samples, peak())
