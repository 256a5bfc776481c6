"""Rows of bifurcation diagrams: the branches of one curve with their events, and its jumps.

A point is stable, or loses its steady state to flutter or to divergence, as
`ctcbs_ros.solver.stability` judges it.
"""

from itertools import pairwise
from math import hypot, log, nan

from ctcbs_ros.figures.rows import Row
from ctcbs_ros.solver.branches import Fold
from ctcbs_ros.solver.diagram import (
    OK,
    DiagramBranch,
    DiagramPoint,
    Event,
    diagram,
    first_minimum,
)
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.flown import landing
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import DIVERGENCE, Stability, stability
from ctcbs_ros.solver.steady_state import correct_state

COLUMNS = (
    "kind", "curve", "branch", "omega", "length", "end_mass", "cable_drag", "drag_ratio",
    "elasticity", "end_mass_radius", "growth_rate", "frequency", "stability", "event", "note",
)
FOLD, HOPF, FIRST_MINIMUM = "fold", "Hopf point", "first minimum"
# How far a drawn line may be from the branch, over the width and the height of the figure.
_SAG = 1e-4


def curve(
    name: str, parameters: Parameters, family: Family, value: float, low: float, high: float
) -> list[Row]:
    """All branches of a range, one row a point, events among them where they are on the branch.

    Parameters
    ----------
    name : str
        Of the curve.
    parameters : Parameters
        At `value` of what varies.
    family : Family
        What varies.
    value, low, high : float
        As for `ctcbs_ros.solver.diagram.diagram`.

    Returns
    -------
    list of dict
        Of kind "branch", and of kind "jump" two rows for each fold in omega: from and to.
    """
    branches = diagram(parameters, family, value, low, high)
    minimum = first_minimum(branches)
    scale = high - low, max(point.end_mass_radius for b in branches for point in b.points)
    rows = []
    for number, branch in enumerate(branches, 1):
        named = {"kind": "branch", "curve": name, "branch": number}
        rows += [
            named | _parameters(family.at(parameters, log(point["value"] / value))) | point
            for point in _points(parameters, family, value, scale, branch, minimum)
        ]
    if family.omega == 1.0:
        for branch in branches:
            for event in branch.folds:
                rows += _jump(name, parameters, value, branch, event)
    return rows


def _points(parameters, family, value, scale, branch: DiagramBranch, minimum) -> list[Row]:
    """Points and events in the order in which the branch passes them."""
    points = []
    for point in branch.points:
        state = _state(parameters, family, value, point.value, point.end_mass_radius, 0.05)
        # At a fold Newton's method stalls; the fold itself is among the events.
        if state is None:
            continue
        here = _described(point.value, state, point)
        if point.status != OK:
            here["note"] = point.status
        if points:
            points += _between(parameters, family, value, scale, points[-1], here)
        points.append(here)
    events = [(event, FOLD) for event in branch.folds] + [(event, HOPF) for event in branch.hopf]
    if minimum in branch.minima:
        events.append((minimum, FIRST_MINIMUM))
    for event, name in events:
        i = _place(points, event)
        # Of a state that diverges already, flutter changes nothing.
        if name == HOPF and points[i - 1]["stability"] == points[i]["stability"] == DIVERGENCE:
            continue
        points.insert(
            i,
            {
                "value": event.value, "end_mass_radius": event.end_mass_radius,
                "growth_rate": 0.0 if name == HOPF else nan,
                "frequency": event.frequency if name == HOPF else nan,
                # A marginal state is of neither side; a minimum is as its neighbours are.
                "stability": points[i - 1]["stability"] if name == FIRST_MINIMUM else "",
                "event": name,
            },
        )  # fmt: skip
    return points


def _between(parameters, family, value, scale, a: Row, b: Row, depth: int = 4) -> list[Row]:
    """States between two points of a branch, where the line between these would leave it."""
    varied = (a["value"] * b["value"]) ** 0.5
    guess = (a["end_mass_radius"] * b["end_mass_radius"]) ** 0.5
    reach = hypot(log(varied / a["value"]), log(guess / a["end_mass_radius"]))
    # The chord is this near to the branch: steps of a trace turn by less than 12 degrees.
    state = _state(parameters, family, value, varied, guess, 0.2 * reach)
    if state is None:
        return []
    line = _apart(a, b["value"], b["end_mass_radius"], scale)
    part = _apart(a, varied, state.end_mass_radius, scale)
    away = abs(line[0] * part[1] - line[1] * part[0]) / hypot(*line)
    if depth == 0 or away < _SAG:
        return []
    middle = _described(varied, state, stability(state))
    before = _between(parameters, family, value, scale, a, middle, depth - 1)
    after = _between(parameters, family, value, scale, middle, b, depth - 1)
    return [*before, middle, *after]


def _apart(a: Row, value: float, end_mass_radius: float, scale) -> tuple[float, float]:
    width, height = scale
    return (value - a["value"]) / width, (end_mass_radius - a["end_mass_radius"]) / height


def _state(parameters, family, value, varied, guess, max_step):
    return correct_state(family.at(parameters, log(varied / value)), guess, max_step)


def _described(varied, state, judged: Stability | DiagramPoint) -> Row:
    return {
        "value": varied, "end_mass_radius": state.end_mass_radius,
        "growth_rate": judged.growth_rate, "frequency": judged.frequency,
        "stability": judged.verdict,
    }  # fmt: skip


def _place(points: list[Row], event: Event) -> int:
    """Index before which an event belongs: where going over it is the least detour."""

    def apart(a, b):
        higher = log(a["end_mass_radius"] / b["end_mass_radius"])
        return hypot(log(a["value"] / b["value"]), higher)

    here = {"value": event.value, "end_mass_radius": event.end_mass_radius}
    detours = [
        apart(a, here) + apart(here, b) - apart(a, b)
        for a, b in pairwise(points)
    ]
    return detours.index(min(detours)) + 1


def _jump(name, parameters, value, branch: DiagramBranch, event: Event) -> list[Row]:
    """From a fold to the stable state beyond it."""
    near = min(branch.points, key=lambda p: abs(log(p.end_mass_radius / event.end_mass_radius)))
    direction = 1 if near.value < event.value else -1
    fold = Fold(log(event.value / value), event.end_mass_radius)
    lands = landing(parameters, fold, ANGULAR_RATE, direction)
    if lands is None:
        return []
    there = _parameters(lands.parameters) | {"omega": event.omega}
    return [
        {"kind": "jump", "curve": name, "end_mass_radius": radius, "note": note} | there
        for radius, note in ((event.end_mass_radius, "from"), (lands.end_mass_radius, "to"))
    ]


def _parameters(parameters: Parameters) -> Row:
    return {
        "omega": parameters.omega,
        "length": parameters.length,
        "end_mass": parameters.end_mass,
        "cable_drag": parameters.cable_drag,
        "drag_ratio": parameters.drag_ratio,
        "elasticity": parameters.elasticity,
    }
