"""One case flown by MoorDyn and by the product, to be compared and drawn."""

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np

from ctcbs_ros.bench.cable_rows import entry
from ctcbs_ros.bench.peer_moordyn import DENSITY, RAMP, tow
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import circle, constant, linear
from ctcbs_ros.periodic.solve import periodic_motion
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.solver.stability import Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states
from ctcbs_ros.validation.cases import SEGMENTS, Case

# Orbits that the product flies in wind until nothing changes.
_SETTLED = 60
# Tenths of a second until one mode is left, and half waves of it that are measured.
_ONE_MODE, _HALF_WAVES = 4000, 16


@dataclass(frozen=True)
class SteadyRun:
    """Where the mass settles: end-mass radius, depth and phase lag, (3,) each.

    Attributes
    ----------
    case : Case
    moordyn, nodes, segments : dict
        By number of segments: MoorDyn's, and those of the product's cable with drag at the nodes
        and in the middle of the segments.
    solver : ndarray
        The product's steady state.
    """

    case: Case
    moordyn: dict
    nodes: dict
    segments: dict
    solver: np.ndarray


@dataclass(frozen=True)
class EntryRun:
    """From rest to the full rate.

    Attributes
    ----------
    case : Case
    angles : (m,) ndarray
        Flown by the tow point [rad].
    moordyn, product : (m, 3) ndarrays
        End-mass radius, depth and phase lag.
    """

    case: Case
    angles: np.ndarray
    moordyn: np.ndarray
    product: np.ndarray


@dataclass(frozen=True)
class DecayRun:
    """How fast a disturbance dies, per radian of orbit.

    Attributes
    ----------
    case : Case
    growth_rate, frequency : float
        Of MoorDyn's end mass.
    solver : Stability
        The product's eigenvalue.
    """

    case: Case
    growth_rate: float
    frequency: float
    solver: Stability


@dataclass(frozen=True)
class WindRun:
    """The last orbit in wind: positions of the end mass about the circle's centre, (m, 3) each.

    Attributes
    ----------
    case : Case
    moordyn, in_time : ndarray
        With the same segments, drag at the nodes.
    limit : ndarray
        MoorDyn's, extrapolated in its segments.
    periodic : ndarray or None
        None where there is none, for the `reason`.
    reason : str
    """

    case: Case
    moordyn: np.ndarray
    in_time: np.ndarray
    limit: np.ndarray
    periodic: np.ndarray | None
    reason: str


def fly_steady(case: Case, folder: Path) -> SteadyRun:
    """MoorDyn towed until it is settled, with half the segments and with all."""
    state = _steady(case)
    counts = (SEGMENTS // 2, SEGMENTS)
    return SteadyRun(
        case,
        {n: tow(folder, case.parameters, n, case.duration, case.step).end for n in counts},
        *({n: _figures(equilibrium(state, n, at_nodes).positions[0]) for n in (5, 10, 20, 40, 80)}
          for at_nodes in (True, False)),
        np.array([state.end_mass_radius, state.depth, state.phase_lag]),
    )  # fmt: skip


def fly_entry(case: Case, folder: Path) -> EntryRun:
    """The same entry by both."""
    reel = None if case.winch is None else partial(_reeled, case.winch)
    towed = tow(folder, case.parameters, SEGMENTS, case.duration, case.step, reel=reel)
    p = replace(case.parameters, density=DENSITY, damping=towed.damping)
    times = np.arange(1, len(towed.history) + 1) * 0.1 * towed.rate
    length = None
    if case.winch is not None:
        begin, end, part = case.winch
        length = linear([begin * towed.rate, end * towed.rate], p.length * np.array([[1], [part]]))
    found = entry(p, SEGMENTS, RAMP * towed.rate, times, length)
    return EntryRun(case, towed.history[:, 0], towed.history[:, 1:], found)


def _reeled(winch, time):
    """The length as a part of the first one, and its rate [1/s]."""
    begin, end, part = winch
    rate = (part - 1.0) / (end - begin)
    return 1.0 + rate * (min(max(time, begin), end) - begin), rate * (begin <= time < end)


def fly_decay(case: Case, folder: Path) -> DecayRun:
    """MoorDyn's approach to the steady state, once one mode is left of it."""
    towed = tow(folder, case.parameters, SEGMENTS, case.duration, case.step)
    state = _steady(case, towed.damping)
    angles, _, depth, _ = towed.history[_ONE_MODE:].T
    away = depth - np.mean(depth[-len(depth) // 5 :])
    crossings = np.flatnonzero(away[:-1] * away[1:] < 0.0)[:_HALF_WAVES]
    peaks = [np.abs(away[i:j]).max() for i, j in pairwise(crossings)]
    rate = np.polyfit(angles[crossings[:-1]], np.log(peaks), 1)[0]
    frequency = pi / np.diff(angles[crossings]).mean()
    return DecayRun(case, float(rate), float(frequency), stability(state))


def fly_in_wind(case: Case, folder: Path) -> WindRun:
    """The orbit that MoorDyn ends in, and the product's in time and by its periodic motion."""
    coarse, towed = (
        tow(folder, case.parameters, n, case.duration, case.step, wind=case.wind)
        for n in (SEGMENTS // 2, SEGMENTS)
    )
    angles = towed.history[:, 0]
    last = angles > angles[-1] - 2.0 * pi
    times = angles[last] - angles[last][0] + angles[last][0] % (2.0 * pi) + _SETTLED * 2.0 * pi
    state = _steady(case, towed.damping)
    line = line_of(state.parameters, drag_at_nodes=True)
    driven = drive(line, circle(1.0, 1.0, 0.0, times[-1]), constant([case.wind, 0.0, 0.0]))
    motion = simulate(line, driven, equilibrium(state, SEGMENTS, drag_at_nodes=True), times)
    found = periodic_motion(state, TowPath(GROUND_SPEED, case.wind))
    moordyn = towed.positions[last]
    return WindRun(
        case, moordyn, motion.positions[:, 0], _limit(coarse.positions[last], moordyn),
        None if found.motion is None else found.motion.end_mass(times), found.reason,
    )  # fmt: skip


def _limit(coarse, fine):
    """Of second order in the segments, half as many in the coarse one."""
    return fine + (fine - coarse) / 3.0


def _steady(case: Case, damping: float = 0.0) -> SteadyState:
    parameters = replace(case.parameters, density=DENSITY, damping=damping)
    return steady_states(parameters).states[0]


def _figures(end):
    """Radius, depth and lag behind (1, 0) of an end mass."""
    x, y, z = end
    return np.array([np.hypot(x, y), -z, -np.arctan2(y, x) % (2.0 * pi)])
