"""Warning and skip codes: stable names that logs, diagnostics and other tools rely on."""

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """Severity of a warning, as /diagnostics shows it."""

    WARN = "WARN"
    ERROR = "ERROR"


class WarningCode(Enum):
    """What can be wrong with the flight or with the prediction."""

    NOT_ORBITING = "NOT_ORBITING"
    STALE_TELEMETRY = "STALE_TELEMETRY"
    BAD_FIX = "BAD_FIX"
    OUTSIDE_ENVELOPE = "OUTSIDE_ENVELOPE"
    NO_SOLUTION = "NO_SOLUTION"
    MULTIPLE_SOLUTIONS = "MULTIPLE_SOLUTIONS"
    NEAR_JUMP = "NEAR_JUMP"
    JUMPED = "JUMPED"
    UNSTABLE = "UNSTABLE"
    LOW_MARGIN = "LOW_MARGIN"
    TENSION_LIMIT = "TENSION_LIMIT"
    GROUND_PROXIMITY = "GROUND_PROXIMITY"
    WIND_UNMODELLED = "WIND_UNMODELLED"


class SkipCode(Enum):
    """Why a telemetry sample was not used; every skipped sample has exactly one."""

    BAD_FIX = "BAD_FIX"  # no 3D fix, accuracy too poor, or a start-up position
    NOT_FINITE = "NOT_FINITE"  # NaN, infinite or out of range
    JUMP = "JUMP"  # position contradicts the velocity and the samples before
    DUPLICATE = "DUPLICATE"  # same time and position as a sample already used
    OUT_OF_ORDER = "OUT_OF_ORDER"  # older than a sample already used
    AHEAD = "AHEAD"  # more than 10 s after the sample before, and none has followed it yet
    FROZEN = "FROZEN"  # position stands still while the velocity says it moves


@dataclass(frozen=True)
class Warning:
    """One warning of a prediction."""

    code: WarningCode
    level: Level
    text: str
