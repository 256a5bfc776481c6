"""Where the end mass is in the local frame: position, motion, covariance, cable."""

from math import cos, pi, sin

import numpy as np

from ctcbs_ros.orbit.orbit import ORBIT_STATE, Orbit
from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.sensitivity import sensitivities
from ctcbs_ros.solver.steady_state import SteadyState

# Variance of what is not known: attitude of the end mass [rad^2], and anything that overflows.
UNKNOWN_VARIANCE = 1e6
_UNKNOWN = np.diag(np.full(6, UNKNOWN_VARIANCE))
# Position and yaw are known.
_KNOWN = np.ix_([0, 1, 2, 5], [0, 1, 2, 5])
CABLE_POINTS = 41
# Tow radius at fixed angular rate: omega^2 and every length are proportional to it.
RADIUS_AT_RATE = Family(
    "radius at rate", omega=0.5, length=-1.0, mass=-1.0, cable_drag=1.0, elasticity=-1.0
)


def end_mass_azimuth(orbit: Orbit, state: SteadyState) -> float:
    """ENU angle of the end mass about the circle's centre [rad]: it trails the tow point."""
    return orbit.phase - orbit.sense * state.phase_lag


def end_mass_position(orbit: Orbit, point: FlightPoint, state: SteadyState) -> np.ndarray:
    """East, north, up of the end mass [m], (3,)."""
    azimuth = end_mass_azimuth(orbit, state)
    radius = state.end_mass_radius * point.radius
    return orbit.center + np.array(
        [radius * cos(azimuth), radius * sin(azimuth), -state.depth * point.radius]
    )


def motion_yaw(orbit: Orbit, state: SteadyState) -> float:
    """ENU direction in which the end mass moves [rad], in (-pi, pi]."""
    yaw = end_mass_azimuth(orbit, state) + orbit.sense * 0.5 * pi
    return -((-yaw + pi) % (2.0 * pi) - pi)


def cable_points(orbit: Orbit, point: FlightPoint, state: SteadyState) -> np.ndarray:
    """East, north, up along the cable [m], (CABLE_POINTS, 3), from the end mass up."""
    arc = np.linspace(0.0, point.parameters.length, CABLE_POINTS)
    x, y, z = point.radius * state.cable(arc)[0].T
    azimuth = end_mass_azimuth(orbit, state)
    # A clockwise orbit is the mirror image of the solver's anticlockwise one.
    y = orbit.sense * y
    c, s = cos(azimuth), sin(azimuth)
    depth = state.depth * point.radius
    return orbit.center + np.column_stack([c * x - s * y, s * x + c * y, z - depth])


def pose_covariance(orbit: Orbit, point: FlightPoint, state: SteadyState) -> np.ndarray:
    """Covariance of (east, north, up, roll, pitch, yaw), (6, 6), from the orbit's covariance.

    First order, by the derivatives of the steady state; it grows without bound towards a fold.
    """
    moves = sensitivities(state, (RADIUS_AT_RATE, ANGULAR_RATE))
    a, rate = orbit.radius, orbit.angular_rate
    x_d, depth = state.end_mass_radius, state.depth
    # Derivatives of radius, depth [m] and lag [rad] by tow radius [m] and angular rate [rad/s].
    by_radius = np.array([moves[0, 0] + x_d, moves[0, 1] + depth, moves[0, 2] / a])
    by_rate = np.array([moves[1, 0] * a, moves[1, 1] * a, moves[1, 2]]) / rate
    azimuth = end_mass_azimuth(orbit, state)
    c, s = cos(azimuth), sin(azimuth)
    radius = x_d * a

    jacobian = np.zeros((4, len(ORBIT_STATE)))
    jacobian[0, 0] = jacobian[1, 1] = jacobian[2, 2] = 1.0
    for column, (d_radius, d_depth, d_lag) in ((3, by_radius), (4, by_rate)):
        d_azimuth = -orbit.sense * d_lag
        jacobian[:, column] = (
            c * d_radius - radius * s * d_azimuth,
            s * d_radius + radius * c * d_azimuth,
            -d_depth,
            d_azimuth,
        )
    jacobian[:, 5] = (-radius * s, radius * c, 0.0, 1.0)
    covariance = _UNKNOWN.copy()
    with np.errstate(all="ignore"):
        known = jacobian @ orbit.covariance @ jacobian.T
    if np.isfinite(known).all() and known.trace() < 3.0 * UNKNOWN_VARIANCE:
        covariance[_KNOWN] = 0.5 * (known + known.T)
    return covariance
