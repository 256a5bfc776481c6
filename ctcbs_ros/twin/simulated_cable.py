"""The cable in time, in SI, advanced piece by piece: light enough to go beside the telemetry.

The equations and the integrator are those of `ctcbs_ros.dynamics.cable`; what that checks of a
whole run is known here. Waves of stretch along the cable, which hardly move the end mass, are not
followed closely: noise would stir them up all the time, and nothing damps them.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi

import numpy as np

from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.kernels import cable_motion
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.twin.tow_point import Pieces

# Error of a step in units of the cable's length and of the tow speed. The end mass is off by less
# than 1e-4 of the tow radius for it: what is let through is stretch, which decays.
_TOLERANCE = 1e-2
# Errors of tensions, in units of weight and drag, may be so many times larger: as in a whole run.
_TENSION = 10.0
# Least damping of stretch, times pi and the speed of its waves over the length: it takes the first
# wave by half in two of its periods.
_DAMPING = 0.1
# A second takes a hundred; what needs so many is lost.
_MOST_STEPS = 5000
# Strain of a cable that is said not to stretch, under all its weight.
_STIFF = 1e-3
_NONE = np.empty(0)


@dataclass
class SimulatedCable:
    """Nodes of a cable, the end mass first and the tow point last; they move in place.

    Attributes
    ----------
    positions, velocities : (n + 1, 3) ndarrays
        [m], [m/s]
    step : float
        Time step to go on with [s].
    """

    positions: np.ndarray
    velocities: np.ndarray
    step: float = 0.0

    def copy(self) -> "SimulatedCable":
        """One that moves on its own."""
        return SimulatedCable(self.positions.copy(), self.velocities.copy(), self.step)

    def advance(
        self, line: Line, tow_point: Pieces, wind_before, wind,
        length_before: float | None = None, seen=None, axes=cable_motion.GROUND,
        stops=None,
    ) -> bool:  # fmt: skip
        """Go on along a stretch of the tow point's path.

        Parameters
        ----------
        line : Line
            With the length at the stretch's end.
        tow_point : Pieces
        wind_before, wind : (3,) array_like
            At its beginning and end; straight in between [m/s].
        length_before : float, optional
            At its beginning [m].
        seen : (k, n + 1, 3) ndarray, optional
            Written: the positions at the k ends of the path's pieces.
        stops : (k,) ndarray, optional
            Times that no step passes.
        axes : (7,) ndarray, optional
            That turn with the aircraft, to step in: see `axes_of`.

        Returns
        -------
        bool
            False where it cannot be followed: the nodes are then of no use.
        """
        span = float(tow_point.breaks[-1])
        packed, length, end = _at_rest(line)
        if length_before is not None and length_before != line.length:
            length = _straight([length_before], [line.length], span)
        air = _straight(wind_before, wind, span)
        drive = (tow_point.breaks, tow_point.coefficients), air, length, end
        fall = (abs(line.weight_per_length) / line.mass_per_length * line.length) ** 0.5
        scale_v = max(tow_point.fastest, fall)
        scale_t = _TENSION * (
            line.end_weight + line.end_drag * scale_v**2
            + abs(line.weight_per_length) * line.length
        )  # fmt: skip
        first = self.step if self.step > 0.0 else 1e-3 * line.length / scale_v
        times = _NONE if seen is None else tow_point.breaks[1:]
        if seen is None:
            seen = np.empty((0, *self.positions.shape))
        status, _, self.step, _, _ = cable_motion.advance(
            drive, packed, _NONE if stops is None else stops, _TOLERANCE, line.length, scale_v,
            scale_t, _MOST_STEPS, 0.0, span, first, self.positions, self.velocities, times, seen,
            np.empty_like(seen), axes,
        )  # fmt: skip
        return status == cable_motion.OK and self.finite

    @property
    def finite(self) -> bool:
        """Whether every number is."""
        return bool(np.isfinite(self.positions).all() and np.isfinite(self.velocities).all())


def axes_of(orbit: Orbit | None, time: float) -> np.ndarray:
    """Axes that turn with an orbit, and go along with its centre, from a time on, (7,).

    Without an orbit, those of the ground.
    """
    if orbit is None:
        return cable_motion.GROUND
    moves = np.append(orbit.drift, orbit.climb_rate)
    centre = orbit.center + (time - orbit.time) * moves
    return np.concatenate([[orbit.sense * orbit.angular_rate], centre, moves])


def elastic(parameters: Parameters) -> Parameters:
    """Parameters of a cable that stretches: one said not to does by a thousandth."""
    if parameters.elastic:
        return parameters
    load = parameters.end_weight + abs(parameters.density) * parameters.length
    return replace(parameters, elasticity=load / _STIFF)


def line_in_si(point: FlightPoint) -> Line:
    """The cable and its end mass [m, s, kg]."""
    parameters = elastic(point.parameters)
    mass = point.mass_per_length * point.radius
    line = line_of(parameters).scaled(point.radius, 1.0 / point.angular_rate, mass)
    wave = (line.stiffness / line.mass_per_length) ** 0.5
    return replace(line, damping=max(line.damping, _DAMPING * line.length / (pi * wave)))


@lru_cache(maxsize=4)
def _at_rest(line: Line):
    """What the kernel takes of a line: itself, and its length and end mass as they stay."""
    once = np.array([0.0, 1.0])
    length, end = np.zeros((4, 1, 1)), np.zeros((4, 1, line.end.size))
    length[0, 0], end[0, 0] = line.length, line.end
    return line.packed(), (once, length), (once, end)


def _straight(before, after, span):
    coefficients = np.zeros((4, 1, len(before)))
    coefficients[0, 0] = before
    coefficients[1, 0] = (np.asarray(after) - before) / span
    return np.array([0.0, span]), coefficients
