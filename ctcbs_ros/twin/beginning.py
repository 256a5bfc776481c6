"""Where the simulated cable begins: in the periodic motion of its orbit, or trailing behind."""

from dataclasses import dataclass
from math import cos, inf, log, sin

import numpy as np
from scipy.linalg import eigvals

from ctcbs_ros.atmosphere import GRAVITY
from ctcbs_ros.dynamics.equilibrium import equilibrium, trailing
from ctcbs_ros.dynamics.line import Line
from ctcbs_ros.kernels.cable_forces import derivatives, masses
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.periodic.circle import Circle
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.twin.course import circle_of
from ctcbs_ros.twin.simulated_cable import SimulatedCable, elastic

# Faster than so many times the pendulum of its length, a motion is one of the cable's stretch,
# hardly damped, which moves the end mass by little; so are those left out on a circle, above five
# times the orbit's rate.
_BAND = 5.0


@dataclass(frozen=True)
class Begun:
    """A cable to begin with.

    Attributes
    ----------
    cable : SimulatedCable
    periodic : bool
        Whether it is the motion in the wind; where that is not to be found it is still air's.
    """

    cable: SimulatedCable
    periodic: bool


def on_orbit(
    orbit: Orbit, point: FlightPoint, end_mass_radius: float, wind, at_airspeed: bool,
    motion: PeriodicMotion | None, segments: int,
) -> Begun | None:  # fmt: skip
    """The cable as it moves once it has settled on an orbit.

    Parameters
    ----------
    orbit : Orbit
    point : FlightPoint
    end_mass_radius : float
        Of the steady state in still air that is flown [m].
    wind : (2,) array_like
        Towards east, north [m/s].
    at_airspeed : bool
        Whether the circle is flown at constant airspeed.
    motion : PeriodicMotion or None
        In the wind, of a flight nearby.
    segments : int

    Returns
    -------
    Begun or None
        Its tow point is the orbit's at the orbit's time; None where there is no steady state.
    """
    if motion is not None:
        circle = circle_of(orbit, wind, at_airspeed)
        return Begun(_of_motion(circle, motion, orbit, point.parameters.length, segments), True)
    states = steady_states(elastic(point.parameters)).states
    if not states:
        return None
    state = min(states, key=lambda s: abs(s.end_mass_radius * point.radius - end_mass_radius))
    try:
        still = equilibrium(state, segments)
    except ArithmeticError:
        return None
    c, s = cos(orbit.phase), sin(orbit.phase)
    turn = np.array([[c, s, 0.0], [-orbit.sense * s, orbit.sense * c, 0.0], [0.0, 0.0, 1.0]])
    return Begun(
        SimulatedCable(
            orbit.center + orbit.radius * still.positions @ turn,
            np.append(orbit.drift, 0.0) + orbit.speed * still.velocities @ turn,
        ),
        not np.any(wind),
    )


def _of_motion(
    circle: Circle, motion: PeriodicMotion, orbit: Orbit, length: float, segments: int
) -> SimulatedCable:
    """The motion's shape at the orbit's phase, of a cable of a length over the tow radius."""
    arc = np.linspace(0.0, motion.parameters.length, 2 * segments + 1)
    short = 1e-3 * motion.parameters.length / segments

    def nodes(time):
        """Each segment as long as the cable in its middle is stretched, from the tow point down.

        A chord of a stiff cable's arc would be slack.
        """
        chord = np.diff(motion.cable(time, arc[::2]), axis=0)
        ends = motion.cable(time, np.concatenate([arc[1::2] - short, arc[1::2] + short]))
        stretch = np.linalg.norm(ends[segments:] - ends[:segments], axis=1) / (2.0 * short)
        chord *= (stretch * length / segments / np.linalg.norm(chord, axis=1))[:, None]
        found = np.empty((segments + 1, 3))
        found[-1] = motion.cable(time, arc[-1:])[0]
        found[:-1] = found[-1] - np.cumsum(chord[::-1], axis=0)[::-1]
        return found

    time, step = circle.time_at(orbit.phase), 1e-4
    places = circle.in_field(nodes(time))
    speeds = circle.in_field(nodes(time + step) - nodes(time - step)) / (2.0 * step)
    return SimulatedCable(
        orbit.center + orbit.radius * places,
        np.append(orbit.drift, 0.0) + orbit.speed * speeds,
    )


def behind(line: Line, segments: int, position, velocity, wind) -> SimulatedCable | None:
    """The cable as it trails behind in straight flight; None where it has no such shape.

    Parameters
    ----------
    line : Line
    segments : int
    position, velocity, wind : (3,) array_like
        Of the tow point and of the air [m], [m/s].
    """
    try:
        found = trailing(line, segments, position, velocity, wind)
    except ArithmeticError:
        return None
    return SimulatedCable(found.positions, found.velocities)


def settling_time_behind(line: Line, cable: SimulatedCable, wind) -> float:
    """Seconds until a small disturbance of a cable towed straight has decayed to 5 %.

    Parameters
    ----------
    line : Line
    cable : SimulatedCable
        As `behind` gives it.
    wind : (3,) array_like

    Returns
    -------
    float
        inf where it does not decay.
    """
    n = len(cable.positions) - 1
    by_x, by_v = np.zeros((3, n, 3, 3)), np.zeros((3, n, 3, 3))
    packed, mass = line.packed(), np.empty(n)
    derivatives(
        cable.positions, cable.velocities, packed, line.end, np.asarray(wind, float),
        line.length, 0.0, 0.0, by_x, by_v,
    )  # fmt: skip
    masses(packed, line.end, line.length, n, mass)
    matrix = np.zeros((6 * n, 6 * n))
    matrix[: 3 * n, 3 * n :] = np.eye(3 * n)
    for block, column in ((by_x, 0), (by_v, 3 * n)):
        for i in range(n):
            for k, j in enumerate((i - 1, i, i + 1)):
                if 0 <= j < n:
                    rows = slice(3 * n + 3 * i, 3 * n + 3 * i + 3)
                    columns = slice(column + 3 * j, column + 3 * j + 3)
                    matrix[rows, columns] = block[k, i] / mass[i]
    with one_blas_thread():
        rates = eigvals(matrix, check_finite=False)
    slow = rates[np.abs(rates.imag) <= _BAND * (GRAVITY / line.length) ** 0.5]
    growth = float(slow.real.max())
    return log(20.0) / -growth if growth < 0.0 else inf
