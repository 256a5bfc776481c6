"""Skip codes: stable names that logs, diagnostics and other tools rely on."""

from enum import Enum


class SkipCode(Enum):
    """Why a telemetry sample was not used; every skipped sample has exactly one."""

    BAD_FIX = "BAD_FIX"  # no 3D fix, too few satellites, accuracy too poor, or no evidence yet
    NOT_FINITE = "NOT_FINITE"  # a value missing, NaN or infinite
    OUT_OF_RANGE = "OUT_OF_RANGE"  # a value no aircraft has, as degrees times 1e7
    ZERO_POSITION = "ZERO_POSITION"  # at latitude and longitude 0 or near, as before the first fix
    MIRRORED = "MIRRORED"  # where the aircraft is but for a sign, or latitude for longitude
    JUMP = "JUMP"  # position contradicts the velocity and the samples before
    DUPLICATE = "DUPLICATE"  # same time and position as a sample already used
    OUT_OF_ORDER = "OUT_OF_ORDER"  # older than a sample already used
    AHEAD = "AHEAD"  # more than 10 s after the sample before, and none has followed it yet
    FROZEN = "FROZEN"  # position stands still while the velocity says it moves


# The codes in words.
SKIPS = {
    SkipCode.BAD_FIX: "no 3D fix yet, few satellites or poor accuracy",
    SkipCode.NOT_FINITE: "a value missing or not a number",
    SkipCode.OUT_OF_RANGE: "a value that no aircraft has",
    SkipCode.ZERO_POSITION: "at latitude and longitude 0, as before the first fix",
    SkipCode.MIRRORED: "a wrong sign, or latitude and longitude exchanged",
    SkipCode.JUMP: "position contradicts the velocity and the samples before",
    SkipCode.DUPLICATE: "a sample already used, sent again",
    SkipCode.OUT_OF_ORDER: "older than a sample already used",
    SkipCode.AHEAD: "time far ahead of the samples before, followed by none as yet",
    SkipCode.FROZEN: "position stands still while the velocity says it moves",
}
