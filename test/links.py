"""Live links of the tests: free ports, and what comes over them."""

import socket
import time

from processes import LIMIT


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def collect(source, enough, timeout=LIMIT):
    """Samples polled until there are enough; fails when they do not come."""
    samples, deadline = [], time.monotonic() + timeout
    while len(samples) < enough:
        assert time.monotonic() < deadline, f"{len(samples)} of {enough} samples came"
        samples += source.poll()
        time.sleep(0.01)
    return samples
