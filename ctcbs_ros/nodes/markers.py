"""What RViz shows of a prediction: cable, tow circle, circles of end mass and other solutions."""

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from ctcbs_ros.nodes.messages import header, point
from ctcbs_ros.prediction.codes import Level
from ctcbs_ros.prediction.prediction import Prediction

CIRCLE_POINTS = 73
CABLE = ColorRGBA(r=0.1, g=0.1, b=0.1, a=1.0)
TOW = ColorRGBA(r=0.2, g=0.4, b=0.9, a=1.0)
OTHER = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.8)
# The end mass's circle by the gravest warning.
BY_LEVEL = {
    None: ColorRGBA(r=0.1, g=0.7, b=0.2, a=1.0),
    Level.WARN: ColorRGBA(r=1.0, g=0.6, b=0.0, a=1.0),
    Level.ERROR: ColorRGBA(r=0.9, g=0.1, b=0.1, a=1.0),
}
Name = tuple[str, int]  # namespace and id


def cable_markers(prediction: Prediction, frame_id: str, lifetime: int) -> list[Marker]:
    """Markers of a valid prediction.

    Parameters
    ----------
    prediction : Prediction
    frame_id : str
    lifetime : int
        Seconds for which they stand when nothing follows.
    """
    markers = []
    for (name, number), (points, color) in _lines(prediction).items():
        marker = Marker(
            header=header(prediction, frame_id),
            ns=name,
            id=number,
            type=Marker.LINE_STRIP,
            action=Marker.ADD,
            lifetime=Duration(sec=lifetime),
            points=points,
            color=color,
        )
        marker.pose.orientation.w = 1.0
        marker.scale.x = 0.01 * prediction.orbit.radius  # width of the line [m]
        markers.append(marker)
    return markers


def deletions(names: set[Name], frame_id: str) -> list[Marker]:
    """What takes markers away."""
    return [
        Marker(header=Header(frame_id=frame_id), ns=name, id=number, action=Marker.DELETE)
        for name, number in sorted(names)
    ]


def _lines(prediction: Prediction) -> dict[Name, tuple[list[Point], ColorRGBA]]:
    """Points and colour of each line, by namespace and id."""
    orbit, end_mass = prediction.orbit, prediction.end_mass
    levels = {warning.level for warning in prediction.warnings}
    gravest = next((level for level in (Level.ERROR, Level.WARN) if level in levels), None)
    lines = {
        ("cable", 0): ([point(position) for position in end_mass.cable], CABLE),
        ("tow_circle", 0): (_circle(orbit.center, orbit.radius), TOW),
        ("end_mass_circle", 0): (
            _closed(end_mass.circle(CIRCLE_POINTS - 1)),
            BY_LEVEL[gravest],
        ),
    }
    for number, other in enumerate(end_mass.others):
        center = orbit.center - (0.0, 0.0, other.depth)
        lines["other_solutions", number] = (_circle(center, other.radius), OTHER)
    return lines


def _closed(path: np.ndarray) -> list[Point]:
    return [point(position) for position in (*path, path[0])]


def _circle(center: np.ndarray, radius: float) -> list[Point]:
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS)
    east, north = center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)
    return [
        Point(x=x, y=y, z=float(center[2]))
        for x, y in zip(east.tolist(), north.tolist(), strict=True)
    ]
