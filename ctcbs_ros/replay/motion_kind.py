"""What a predicted end mass is of: the motion in wind, or still air, and whether that holds."""

from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.warnings import is_told_from_none

STILL_AIR, IN_WIND = "still air", "in wind"
# Holds if there is no wind; does not hold.
UNKNOWN, UNMODELLED = "still air, wind not known", "still air, wind not modelled"
KINDS = (STILL_AIR, IN_WIND, UNKNOWN, UNMODELLED)


def motion_kind(prediction: Prediction) -> str:
    """Of `KINDS`, of a valid prediction: a wind that cannot be told from none is none."""
    wind = prediction.wind
    if wind is None:
        return UNKNOWN
    if not prediction.pose_holds:
        return UNMODELLED
    if prediction.end_mass.in_wind is None:
        return STILL_AIR
    return IN_WIND if is_told_from_none(wind, prediction.orbit) else STILL_AIR
