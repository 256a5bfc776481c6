"""Where the end mass of a simulated flight truly is: the cable in time, towed along its track.

It shares no code with the predictor, and has what that leaves out: wind, entries, transients.
"""

from dataclasses import dataclass, replace

import numpy as np

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.equilibrium import trailing
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.errors import InputError
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.simulated_flight import SimulatedFlight

# At 40 segments the radius of the design example is within 0.05 % of the tow radius.
SEGMENTS = 40
# Samples simulated at a time: kernels hear no Ctrl-C while they run.
_PIECE = 64


@dataclass(frozen=True)
class SimulatedPayload:
    """The true motion of the end mass, sampled, in the frame of the flight; n samples.

    `time` (n,) [s], whole milliseconds; `position`, `velocity` (n, 3), east, north, up [m], [m/s].
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


def simulate_payload(
    configuration: Configuration,
    flight: SimulatedFlight,
    rate: float = 5.0,
    late: float = 0.0,
    home_altitude: float = 100.0,
    tell=lambda part: None,
) -> SimulatedPayload:
    """Tow the configuration's cable along a flight, from straight flight on.

    Parameters
    ----------
    configuration : Configuration
        An inextensible cable is simulated with the thesis's gamma of 600.
    flight : SimulatedFlight
    rate : float
        Samples a second [Hz].
    late : float
        Time of the first sample [s].
    home_altitude : float
        Of the flight's origin above mean sea level [m], for the density of the air.
    tell : callable
        Called with the part of the flight (0 to 1) that has been simulated.

    Raises
    ------
    InputError
        If the cable cannot be towed along that flight.
    """
    radius, speed = float(np.nanmin(flight.radius)), flight.airspeed
    altitude = home_altitude + float(flight.position[0, 2])
    point = flight_point(configuration, radius, speed, configuration.air.density_at(altitude))
    line = line_of(point.parameters).scaled(
        radius, 1.0 / point.angular_rate, point.mass_per_length * radius
    )
    wind = np.array([*flight.wind, 0.0])
    driven = drive(
        line, spline(flight.time, flight.position, "flight"), constant(wind, "wind")
    )
    last = float(flight.time[-1])
    times = np.round(np.arange(late, last, 1.0 / rate), 3)
    try:
        start = trailing(line, SEGMENTS, flight.position[0], flight.velocity[0], wind)
        state = replace(start, time=0.0)
        positions, velocities = [], []
        for first in range(0, len(times), _PIECE):
            motion = simulate(line, driven, state, times[first : first + _PIECE])
            state = motion.end
            positions.append(motion.positions[:, 0])
            velocities.append(motion.velocities[:, 0])
            tell(min(1.0, (first + _PIECE) / len(times)))
    except ArithmeticError as error:
        raise InputError(f"the cable cannot be towed along this flight: {error}") from None
    return SimulatedPayload(times, np.concatenate(positions), np.concatenate(velocities))
