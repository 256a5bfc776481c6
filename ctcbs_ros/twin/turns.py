"""The motion on a circle in a steady wind by flying it, turn after turn, until they are the same.

It also knows what the periodic solution (`ctcbs_ros.periodic`) does not: a cable that goes slack
once a turn, and a motion that never repeats.
"""

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from math import hypot, nan, pi

import numpy as np
from scipy.interpolate import CubicSpline

from ctcbs_ros.dynamics.cable import CableState, Drive, drive, simulate
from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.dynamics.settled import SPAN, approached, oscillates
from ctcbs_ros.dynamics.signal import constant, linear, spline
from ctcbs_ros.periodic.elements import interpolated
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.tow_path import TowPath
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.twin.decay import decay

# Times of a turn that are kept, odd as `fourier` wants them; pieces that a turn is flown in, and
# points through which the tow point's path goes.
TIMES, _PIECES, _PATH_POINTS = 65, 13, 180
# Elements that the cable's shape is told in.
_ELEMENTS = 6
# The wind rises over so many turns, as the periodic solution's is raised from still air.
_RISING = 2
# Steps of a segment that are a unit of work, as `ctcbs_ros.periodic.newton.work` counts it.
_A_UNIT = 60_000.0
# Change from one turn to the next, of the tow radius, up to which it is the same motion still.
REPEATS = 0.02


@dataclass(frozen=True)
class Flying:
    """How a motion is flown.

    Attributes
    ----------
    segments : int
    left : float
        What may be left of the approach [a].
    most_turns : int
        3 `SPAN` at least, from which on an oscillation is told.
    tolerance : float
        Of a step, see `ctcbs_ros.dynamics.cable.simulate`.
    most_steps : int
        In a part of a turn, a thirteenth.
    """

    segments: int = 24
    left: float = 1e-3
    most_turns: int = 3 * SPAN + 3
    tolerance: float = 1e-3
    most_steps: int = 20_000

    @property
    def half(self) -> "Flying":
        """The same with half as many segments."""
        return replace(self, segments=self.segments // 2)


@dataclass(frozen=True)
class Flown:
    """What the turns came to.

    Attributes
    ----------
    motion : PeriodicMotion or None
        The last turn; None where the turns do not repeat. Its residual is `left`.
    reason : str
        Why there is none.
    left : float
        Greatest change from the turn before; where it was not `approached`, of late [a].
    changes : (k,) ndarray
        From each turn to the next, root mean square of the end mass's way over the turn [a].
    turns : int
    least_distance, greatest_distance : float
        Of the end mass from the circle's axis, over the last turns [a].
    slack : float
        Share of the last turn at which some of the cable bears no tension.
    state : CableState or None
        At the end of a turn, to go on from.
    """

    motion: PeriodicMotion | None
    reason: str
    left: float = nan
    changes: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    turns: int = 0
    least_distance: float = nan
    greatest_distance: float = nan
    slack: float = nan
    state: CableState | None = field(default=None, repr=False)

    @property
    def growth_rate(self) -> float:
        """Of what was left, per radian of orbit, by `changes`; nan where those tell nothing."""
        return decay([self.changes]).growth_rate


def turns_search(
    parameters: Parameters, path: TowPath, begun: CableState, still: bool, how: Flying
) -> Generator[float, None, Flown]:
    """Fly turns until they repeat, piece by piece: yields work as `newton_steps` does.

    Parameters
    ----------
    parameters : Parameters
    path : TowPath
    begun : CableState
        With the tow point at (1, 0, 0), non-dimensional, of any number of segments.
    still : bool
        Whether that is of still air: then the wind rises over two turns.
    how : Flying
    """
    line = line_of(parameters)
    tow = _round(path)
    air = np.array([path.air_velocity, 0.0, 0.0])
    state = in_segments(begun, how.segments)
    orbits, last = [], np.empty(0)
    while True:
        turn = len(orbits)
        if still and turn < _RISING:
            share = np.array([turn, turn + 1.0])[:, None] / _RISING
            wind = linear([0.0, 2.0 * pi], share * air)
        else:
            wind = constant(air)
        try:
            last, state = yield from _a_turn(line, drive(line, tow, wind), state, how)
        except ArithmeticError as error:
            return Flown(None, f"the cable in time: {error}", turns=turn)
        orbits.append(last[:, 0])
        steady = np.array(orbits[_RISING if still else 0 :])
        done = approached(steady, how.left)
        if done or oscillates(steady, REPEATS) or len(orbits) >= how.most_turns:
            return _judged(parameters, path, line, steady, last, state, done)


def refined_turns_search(
    parameters: Parameters, path: TowPath, begun: CableState, still: bool, how: Flying
) -> Generator[float, None, tuple[Flown, Flown]]:
    """The same with half as many segments first, and then as many, from there.

    The error falls by the square of their number: by what they differ the residual of the finer
    motion has it too. Where there is none, both are what was flown last.
    """
    coarse = yield from turns_search(parameters, path, begun, still, how.half)
    if coarse.motion is None:
        return coarse, coarse
    fine = yield from turns_search(parameters, path, coarse.state, False, how)
    if fine.motion is None:
        return fine, fine
    change = fine.motion.values[:, :, 0] - coarse.motion.values[:, :, 0]
    coarseness = float(np.linalg.norm(change, axis=1).max()) / 3.0
    motion = replace(fine.motion, residual=hypot(coarseness, fine.left))
    return coarse, replace(fine, motion=motion)


def _a_turn(line: Line, driven: Drive, state: CableState, how: Flying):
    """Positions at `TIMES` times of a turn, the first 0, and the state at its end."""
    times = 2.0 * pi * np.arange(TIMES + 1) / TIMES
    state = replace(state, time=0.0)
    seen = [state.positions[None]]
    for part in np.array_split(times[1:], _PIECES):
        motion = simulate(line, driven, state, part, how.tolerance, how.most_steps)
        state = motion.end
        seen.append(motion.positions)
        yield (motion.steps + motion.rejected) * how.segments / _A_UNIT
    seen[0] = seen[0].copy()
    seen[0][0, -1] = driven.tow_point.at(0.0)
    return np.concatenate(seen)[:-1], state


def _judged(parameters, path, line, orbits, last, state, done) -> Flown:
    steps = np.diff(orbits, axis=0)
    changes = np.abs(steps).max(axis=(1, 2))
    sizes = np.sqrt(np.mean(np.sum(steps**2, axis=2), axis=1))
    late = orbits[-1:] if done else orbits[-SPAN:]
    distance = np.hypot(late[..., 0], late[..., 1])
    left = float(changes[-1]) if done else float(changes[-SPAN:].max(initial=0.0))
    motion, reason = None, ""
    strain = _stretch(line, last) - 1.0
    if done or left < REPEATS:
        tension = max(0.0, line.stiffness * float(strain.min())) * parameters.omega**2
        motion = PeriodicMotion(parameters, path, _in_elements(last, line.length), left, tension)
    else:
        reason = (
            f"the turns do not repeat: after {len(orbits)} of them the end mass is between "
            f"{distance.min():.2f} and {distance.max():.2f} tow radii from the circle's axis"
        )
    return Flown(
        motion, reason, left, sizes, len(orbits), float(distance.min()),
        float(distance.max()), float((strain <= 0.0).any(axis=1).mean()), state,
    )  # fmt: skip


def _round(path: TowPath):
    """The tow point's path over a turn."""
    times = np.linspace(0.0, 2.0 * pi, _PATH_POINTS + 1)
    places = path.motion(times)[0]
    places[-1] = places[0]
    return spline(times, places, periodic=True)


def _stretch(line: Line, positions) -> np.ndarray:
    """Of the segments at all times, (..., n)."""
    size = line.length / (positions.shape[-2] - 1)
    return np.linalg.norm(np.diff(positions, axis=-2), axis=-1) / size


def _in_elements(positions, length: float) -> np.ndarray:
    """Coefficients of the shapes, (k, n + 1, 3), as `PeriodicMotion` has them: (k, 3, m)."""
    nodes = np.linspace(0.0, length, positions.shape[1])
    shapes = np.moveaxis(positions - positions[:, -1:], 1, 2)
    # Not along straight segments: a stiff cable's small motions go by the direction of each point.
    through = CubicSpline(nodes, np.eye(nodes.size))

    def at(arc_lengths):
        return shapes @ through(arc_lengths).T

    return interpolated(at, length, _ELEMENTS)


def in_segments(state: CableState, segments: int) -> CableState:
    """The same cable in another number of segments, along the straight ones that it has."""
    before, now = (np.linspace(0.0, 1.0, k) for k in (len(state.positions), segments + 1))
    if before.size == now.size:
        return state
    part = np.stack([np.interp(now, before, unit) for unit in np.eye(before.size)], axis=1)
    return CableState(state.time, part @ state.positions, part @ state.velocities)


def of_length(state: CableState, share: float) -> CableState:
    """The same shape, that of a cable longer by a factor, the tow point at (1, 0, 0)."""
    top = state.positions[-1]
    return CableState(0.0, top + share * (state.positions - top), state.velocities)
