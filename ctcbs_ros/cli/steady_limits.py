"""What the configuration's envelope and limits say of a point and of its steady states."""

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.prediction.codes import Warning
from ctcbs_ros.prediction.in_si import jump_in_si, state_in_si, still_air_margin
from ctcbs_ros.prediction.jumps import JumpFinder
from ctcbs_ros.prediction.warnings import (
    envelope_warnings,
    ground_warnings,
    jump_warnings,
    stability_warnings,
    tension_warnings,
)
from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.stability import Stability
from ctcbs_ros.solver.steady_state import SteadyState


def point_warnings(configuration: Configuration, flight: FlightPoint) -> list[Warning]:
    """OUTSIDE_ENVELOPE, as the predictor has it."""
    return envelope_warnings(flight.radius, flight.speed, configuration.envelope)


def state_warnings(
    configuration: Configuration,
    flight: FlightPoint,
    state: SteadyState,
    stability: Stability,
    altitude: float,
) -> list[Warning]:
    """What the predictor would warn of if a state were flown.

    Parameters
    ----------
    altitude : float
        Of the tow point above mean sea level [m]; nan where it is not known.
    """
    limits = configuration.limits
    in_si = state_in_si(flight, state, stability)
    jumps = JumpFinder().update(state)
    in_speed = jump_in_si(jumps["angular_rate"], flight.speed, flight)
    in_radius = jump_in_si(jumps["radius"], flight.radius, flight)
    height = altitude - in_si.depth - limits.ground_level_amsl
    return [
        *stability_warnings(still_air_margin(in_si, stability), limits),
        *jump_warnings(in_speed, in_radius, limits),
        *tension_warnings(in_si.greatest_tension, configuration.cable, limits),
        *ground_warnings(height, limits),
    ]
