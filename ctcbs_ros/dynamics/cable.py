"""A towed cable in time: its state, what drives it, and its integration from one time to another.

The state is that of n + 1 nodes at equal fractions of the length, the end mass first and the tow
point last, in the ground frame with z up.
"""

from dataclasses import dataclass, replace

import numpy as np

from ctcbs_ros.dynamics.line import Line
from ctcbs_ros.dynamics.signal import Signal, constant
from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels import cable_motion

# Error of a step in units of the cable's length and of the tow speed. What it costs and gives:
# docs/theory.md, "The cable in time".
TOLERANCE = 1e-4
# Errors of tensions, in units of weight and drag, may be so many times larger.
_TENSION = 10.0
MOST_STEPS = 1_000_000
_FAILURES = {
    cable_motion.TOO_MANY_STEPS: "too many steps are needed",
    cable_motion.NOT_FINITE: "no step is short enough",
    cable_motion.NO_LENGTH: "the cable's length falls to zero",
}


@dataclass(frozen=True)
class CableState:
    """A cable at one time.

    Attributes
    ----------
    time : float
    positions, velocities : (n + 1, 3) ndarrays
        Of the nodes, the end mass first and the tow point last.
    step : float
        Time step that the integration may go on with; 0 where it is not known.
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    step: float = 0.0


@dataclass(frozen=True)
class Drive:
    """What acts on a line from outside, in time.

    Attributes
    ----------
    tow_point : Signal
        Position, 3 components, without jumps.
    wind : Signal
        Velocity of the air, 3 components.
    length : Signal
        Unstretched length paid out, without jumps.
    end : Signal
        Mass, net weight and drag of the end mass (`Line.end`). Where it jumps the velocity does
        not: what is picked up moves with the end mass already.
    """

    tow_point: Signal
    wind: Signal
    length: Signal
    end: Signal

    @property
    def stops(self) -> np.ndarray:
        """Times of all jumps, rising."""
        signals = (self.tow_point, self.wind, self.length, self.end)
        return np.unique(np.concatenate([s.stops for s in signals]))

    @property
    def compiled(self) -> tuple:
        """What the kernels take."""
        return tuple(s.compiled for s in (self.tow_point, self.wind, self.length, self.end))


@dataclass(frozen=True)
class Motion:
    """The motion of a cable.

    Attributes
    ----------
    times : (m,) ndarray
    positions, velocities : (m, n + 1, 3) ndarrays
    end : CableState
        To go on from.
    steps, rejected : int
        Time steps accepted and tried in vain.
    """

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    end: CableState
    steps: int
    rejected: int


def drive(
    line: Line,
    tow_point: Signal,
    wind: Signal | None = None,
    length: Signal | None = None,
    end: Signal | None = None,
) -> Drive:
    """What drives a line; by default still air, and its own length and end mass for ever.

    Raises
    ------
    InputError
        If a signal has the wrong number of components.
    """
    made = Drive(
        tow_point,
        constant(np.zeros(3)) if wind is None else wind,
        constant(line.length) if length is None else length,
        constant(line.end) if end is None else end,
    )
    for name, size in (("tow_point", 3), ("wind", 3), ("length", 1), ("end", 3)):
        found = getattr(made, name).coefficients.shape[2]
        if found != size:
            raise InputError(f"{name}: {size} components are needed, got {found}")
    return made


def simulate(
    line: Line, driven: Drive, state: CableState, times, tolerance: float = TOLERANCE,
    most_steps: int = MOST_STEPS,
) -> Motion:  # fmt: skip
    """Integrate the motion from a state to the last of some times.

    Parameters
    ----------
    line : Line
    driven : Drive
    state : CableState
        At or before the first time. Its tow point is replaced by that of `driven`.
    times : (m,) array_like
        Rising; the states at these are given.
    tolerance : float
        Error of a step in units of the length and of the greatest speed of the tow point; ten
        times that of tensions in units of the weight and the end mass's drag.
    most_steps : int
        Accepted or not, after which the motion counts as one that cannot be followed.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        If the times do not rise from the state's, or length or end mass falls to zero.
    ArithmeticError
        If the motion cannot be followed; the message says at what time.
    """
    times = np.ascontiguousarray(times, float)
    if times.size == 0 or np.any(np.diff(times) <= 0.0) or times[0] < state.time:
        raise InputError(f"times: they must rise, from {state.time:g} on")
    x = np.array(state.positions, float)
    v = np.array(state.velocities, float)
    if x.ndim != 2 or x.shape[0] < 2 or x.shape[1] != 3 or v.shape != x.shape:
        raise InputError(f"state: (n + 1, 3) arrays are needed, got {x.shape} and {v.shape}")
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(v))):
        raise InputError("state: it must be finite, and is not")
    end = float(times[-1])
    span = np.linspace(state.time, end, 400)
    lengths, ends = driven.length.at(span), driven.end.at(span)
    if lengths.min() <= 0.0:
        raise InputError(f"length: {lengths.min():g} is not allowed, it must be above 0")
    if ends[:, 0].min() <= 0.0:
        raise InputError(f"end mass: {ends[:, 0].min():g} is not allowed, it must be above 0")
    scale_x = float(lengths.max())
    # The tow point's speed, or what the cable would fall with, whichever is more.
    along = driven.tow_point.at(span)
    gap = max(span[1] - span[0], 1e-300)
    speed = np.linalg.norm(np.diff(along, axis=0), axis=1).max(initial=0.0) / gap
    fall = np.sqrt(abs(line.weight_per_length) / line.mass_per_length * scale_x)
    scale_v = float(max(speed, fall))
    # A stiff cable's tension is far off before its positions are.
    loads = ends[:, 1] + ends[:, 2] * scale_v**2
    scale_t = _TENSION * float(loads.max() + abs(line.weight_per_length) * scale_x)
    first = state.step if state.step > 0.0 else 1e-3 * scale_x / scale_v
    out_x = np.empty((times.size, *x.shape))
    out_v = np.empty_like(out_x)
    status, reached, step, steps, rejected = cable_motion.advance(
        driven.compiled, line.packed(), driven.stops, tolerance, scale_x, scale_v, scale_t,
        most_steps, state.time, end, first, x, v, times, out_x, out_v, cable_motion.GROUND,
    )  # fmt: skip
    if status != cable_motion.OK:
        kind = InputError if status == cable_motion.NO_LENGTH else ArithmeticError
        raise kind(f"the cable cannot be followed past {reached:g}: {_FAILURES[status]}")
    return Motion(times, out_x, out_v, CableState(end, x, v, step), steps, rejected)


def hanging(line: Line, segments: int, tow_point=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    """A cable that hangs vertically at rest, or moves as a whole with a velocity.

    Parameters
    ----------
    line : Line
    segments : int
    tow_point, velocity : (3,) array_like

    Returns
    -------
    CableState
        At time 0.
    """
    h = line.length / segments
    below = line.end_weight + line.weight_per_length * h * (np.arange(segments) + 0.5)
    down = np.concatenate([[0.0], np.cumsum((h * (1.0 + below / line.stiffness))[::-1])])[::-1]
    positions = np.tile(np.asarray(tow_point, float), (segments + 1, 1))
    positions[:, 2] -= down
    velocities = np.tile(np.asarray(velocity, float), (segments + 1, 1))
    return CableState(0.0, positions, velocities)


def with_disturbance(state: CableState, positions=0.0, velocities=0.0) -> CableState:
    """The same state with displacements and velocities added to every node but the tow point."""
    x, v = state.positions.copy(), state.velocities.copy()
    x[:-1] += np.broadcast_to(positions, x.shape)[: len(x) - 1]
    v[:-1] += np.broadcast_to(velocities, v.shape)[: len(v) - 1]
    return replace(state, positions=x, velocities=v, step=0.0)
