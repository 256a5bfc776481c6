"""Peer: pymavlink alone reading a log, which no replay of it can be faster than by much."""


def read_positions(path: str) -> int:
    """Read every message of a log; returns the number of positions among them."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(path)
    count = 0
    while log.recv_match(type="GLOBAL_POSITION_INT") is not None:
        count += 1
    return count
