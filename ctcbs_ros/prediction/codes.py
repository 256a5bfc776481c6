"""Warning codes: stable names that logs, diagnostics and other tools rely on."""

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
    MARGIN_UNKNOWN = "MARGIN_UNKNOWN"
    TENSION_LIMIT = "TENSION_LIMIT"
    GROUND_PROXIMITY = "GROUND_PROXIMITY"
    WIND_UNMODELLED = "WIND_UNMODELLED"


@dataclass(frozen=True)
class Warning:
    """One warning of a prediction."""

    code: WarningCode
    level: Level
    text: str
