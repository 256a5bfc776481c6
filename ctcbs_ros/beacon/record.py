"""A comparison as a flat record, as `ctcbs_ros.prediction.record` has predictions."""

import numpy as np

from ctcbs_ros.beacon.comparison import Comparison
from ctcbs_ros.beacon.difference import Difference
from ctcbs_ros.prediction.record import Record, finite

_AXES = ("east", "north", "up")
MEASURED = tuple(f"measured_{axis}_m" for axis in _AXES)


def names(candidate: str) -> tuple[str, ...]:
    """Names of the figures of measured minus a candidate ("predicted", "simulated")."""
    what = f"measured_minus_{candidate}"
    return (
        *(f"{what}_{axis}_m" for axis in _AXES),
        *(f"{what}_{axis}_std_m" for axis in _AXES),
        f"{what}_distance_std",
        f"{what}_inside_95",
    )


def comparison_record(comparison: Comparison) -> Record:
    """All that one report of the beacon came to; None for what is not known.

    "outcome" is the prediction's `Standing` where it was compared with that, else the code of why
    not; "simulated" alike, or None.
    """
    record: Record = {
        "vehicle_time_s": finite(comparison.time),
        "stamp_ns": comparison.stamp_ns,
        "flight": comparison.flight,
        "outcome": comparison.outcome.value,
        "time_by": comparison.time_by or None,
        "time_std_s": finite(comparison.time_sigma),
    }
    record |= dict(zip(MEASURED, _finite(comparison.measured, 3), strict=True))
    for candidate in ("predicted", "simulated"):
        figures = _figures(getattr(comparison, candidate))
        record |= dict(zip(names(candidate), figures, strict=True))
    standing = comparison.simulated_standing
    record["simulated"] = None if standing is None else standing.value
    return record


def _figures(found: Difference | None) -> list:
    if found is None:
        return [None] * 8
    deviations = np.sqrt(np.diag(found.covariance))
    return [
        *_finite(found.enu, 3), *_finite(deviations, 3), finite(found.distance), found.inside_95
    ]  # fmt: skip


def _finite(values: np.ndarray | None, size: int) -> list[float | None]:
    return [None] * size if values is None else [finite(value) for value in values]
