"""Where the end mass is in the local frame: position, motion, covariance, cable."""

from math import cos, erfc, inf, pi, sin, sqrt

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction.prediction import Jump
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


def fold_distance(orbit: Orbit, in_angular_rate: Jump | None, in_radius: Jump | None) -> float:
    """Distance of the orbit to the end of the branch, in its own standard deviations.

    Parameters
    ----------
    orbit : Orbit
    in_angular_rate, in_radius : Jump or None
        At this radius, and at this speed; `relative` is used.

    Returns
    -------
    float
        inf where the branch does not end, or the orbit's covariance is not known.

    Notes
    -----
    To first order the fold is a line n.(d ln radius, d ln rate) = 1 through the two jumps; a
    change of the radius at constant speed is (1, -1).
    """
    rate = in_angular_rate.relative if in_angular_rate else inf
    radius = in_radius.relative if in_radius else inf
    if radius * rate > 0.0 and rate < inf:
        radius = inf  # a tighter circle turns faster: these are two folds
    normal = np.array([1.0 / radius + 1.0 / rate, 1.0 / rate]) if rate and radius else None
    if normal is None:
        return 0.0
    scale = np.array([1.0 / orbit.radius, 1.0 / orbit.angular_rate])
    with np.errstate(all="ignore"):
        variance = normal @ (orbit.covariance[3:5, 3:5] * np.outer(scale, scale)) @ normal
    return 1.0 / sqrt(variance) if 0.0 < variance < inf else inf


def pose_covariance(
    orbit: Orbit,
    point: FlightPoint,
    state: SteadyState,
    distance: float = inf,
    landed: SteadyState | None = None,
) -> np.ndarray:
    """Covariance of (east, north, up, roll, pitch, yaw), (6, 6), from the orbit's covariance.

    First order, by the derivatives of the steady state, which grow without bound towards a fold;
    beside it, the chance that the orbit lies beyond the fold and the end mass has jumped.

    Parameters
    ----------
    orbit : Orbit
    point : FlightPoint
    state : SteadyState
    distance : float
        `fold_distance`.
    landed : SteadyState, optional
        Of the same orbit: where the end mass is if it has jumped.
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

    # By east, north, up, radius, rate and phase: climb and drift move nothing at this time.
    jacobian = np.zeros((4, 6))
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
        known = jacobian @ orbit.covariance[:6, :6] @ jacobian.T
        if landed is not None:
            off = np.empty(4)
            off[:3] = end_mass_position(orbit, point, landed)
            off[:3] -= end_mass_position(orbit, point, state)
            turned = motion_yaw(orbit, landed) - motion_yaw(orbit, state)
            off[3] = (turned + pi) % (2.0 * pi) - pi
            known += 0.5 * erfc(distance / sqrt(2.0)) * np.outer(off, off)
    if np.isfinite(known).all() and known.trace() < 3.0 * UNKNOWN_VARIANCE:
        covariance[_KNOWN] = 0.5 * (known + known.T)
    return covariance
