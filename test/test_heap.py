"""The node's heap: large blocks go back to the system, whatever stays between them."""

import platform
import subprocess
import sys

import pytest

# A large block is freed, by which glibc learns to put such into the heap; then so are many that
# have small ones between them, which stay.
GROWTH = """
import sys
from ctcbs_ros.nodes.heap import keep_large_blocks_apart
if sys.argv[1] == "apart":
    assert keep_large_blocks_apart()

def resident_mb():
    for line in open("/proc/self/status"):
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0

for _ in range(3):
    block = bytearray(16 << 20)
    del block
before, large, small = resident_mb(), [], []
for _ in range(40):
    large.append(bytearray(b"1" * (1 << 20)))
    small.append(bytearray(b"1" * 100_000))
del large
print(resident_mb() - before)
"""


def growth_mb(how):
    done = subprocess.run(
        [sys.executable, "-c", GROWTH, how], capture_output=True, text=True, check=True
    )
    return float(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc has the option")
def test_blocks_that_are_done_with_leave_no_heap_behind_and_would_without_the_option():
    assert growth_mb("apart") < 8.0
    assert growth_mb("together") > 20.0
