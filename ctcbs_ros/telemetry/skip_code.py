"""Skip codes: stable names that logs, diagnostics and other tools rely on."""

from enum import Enum


class SkipCode(Enum):
    """Why a telemetry sample was not used; every skipped sample has exactly one."""

    BAD_FIX = "BAD_FIX"  # no 3D fix, accuracy too poor, or a start-up position
    NOT_FINITE = "NOT_FINITE"  # NaN, infinite or out of range
    JUMP = "JUMP"  # position contradicts the velocity and the samples before
    DUPLICATE = "DUPLICATE"  # same time and position as a sample already used
    OUT_OF_ORDER = "OUT_OF_ORDER"  # older than a sample already used
    AHEAD = "AHEAD"  # more than 10 s after the sample before, and none has followed it yet
    FROZEN = "FROZEN"  # position stands still while the velocity says it moves
