"""A way flown: the state followed along a family of parameters, jumping where its branch ends."""

from dataclasses import dataclass
from math import log

import numpy as np

from ctcbs_ros.solver.branches import beyond, trace
from ctcbs_ros.solver.family import Family
from ctcbs_ros.solver.flown import landing
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState

_MOST_JUMPS = 5
# The trace begins a little before its start and ends a little behind its end.
_SLACK = 1e-3


@dataclass(frozen=True)
class Stretch:
    """A part of the way without a fold.

    Attributes
    ----------
    way : (n,) ndarray
        |tau| from the start of the whole way, rising.
    u : (n,) ndarray
        ln(end-mass radius over tow radius).
    side : float
        A number of the sign that `SteadyState.slope` has on this side of a fold.
    """

    way: np.ndarray
    u: np.ndarray
    side: float

    def nearest(self, states, way: float) -> SteadyState | None:
        """The state that lies on this stretch, among all of one point of the way."""
        near = float(np.interp(way, self.way, self.u))
        same = [state for state in states if state.slope * self.side > 0.0]
        return min(same, key=lambda s: abs(log(s.end_mass_radius) - near), default=None)


@dataclass(frozen=True)
class WayJump:
    """A fold on the way: how far along, the parameters there, and the state landed on.

    Attributes
    ----------
    way : float
    parameters : Parameters
        Just beyond the fold.
    end_mass_radius : float
        At the fold, over the tow radius.
    landed : SteadyState or None
        None where no stable state remains.
    """

    way: float
    parameters: Parameters
    end_mass_radius: float
    landed: SteadyState | None


def follow_way(
    state: SteadyState, family: Family, direction: int, length: float
) -> tuple[tuple[Stretch, ...], tuple[WayJump, ...]]:
    """Follow a state along a family.

    Parameters
    ----------
    state : SteadyState
        At the start.
    family : Family
    direction : int
        +1 or -1: the way tau goes.
    length : float
        How far, in |tau|.

    Returns
    -------
    stretches : tuple of Stretch
        They end early where a jump lands on nothing stable, or the trace is lost.
    jumps : tuple of WayJump
    """
    flown, stretches, jumps = 0.0, [], []
    for _ in range(_MOST_JUMPS):
        rest = length - flown + _SLACK
        reach = (-_SLACK, rest) if direction > 0 else (-rest, _SLACK)
        path = trace(state.parameters, state.end_mass_radius, family, direction, reach)
        way, u = direction * path.tau, np.log(path.end_mass_radius)
        turned = np.flatnonzero(np.diff(way) < 0.0)
        if turned.size:
            way, u = way[: turned[0] + 1], u[: turned[0] + 1]
        fold = path.folds[0] if path.folds else None
        if fold is not None:
            before = way < direction * fold.tau
            way = np.append(way[before], direction * fold.tau)
            u = np.append(u[before], log(fold.end_mass_radius))
        stretches.append(Stretch(way + flown, u, state.slope))
        if fold is None or direction * fold.tau >= rest - _SLACK:
            break
        there = beyond(state.parameters, fold, family, direction)
        landed = landing(state.parameters, fold, family, direction)
        flown += direction * fold.tau
        jumps.append(WayJump(flown, there, fold.end_mass_radius, landed))
        if landed is None:
            break
        state = landed
    return tuple(stretches), tuple(jumps)


def stretch_at(stretches, way: float) -> Stretch | None:
    """The stretch that a point of the way lies on; None behind the last one."""
    return next((s for s in stretches if way <= s.way[-1] + 1e-9), None)


def on_way(stretches, way: float, states) -> SteadyState | None:
    """The state flown at a point of the way, among all that there are."""
    if len(states) == 1:
        return states[0]
    stretch = stretch_at(stretches, way)
    return None if stretch is None else stretch.nearest(states, way)
