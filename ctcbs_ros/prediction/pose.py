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
_ARC = np.linspace(0.0, 1.0, CABLE_POINTS)
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
    """ENU direction in which the end mass moves over the ground [rad], in (-pi, pi]."""
    yaw = end_mass_azimuth(orbit, state) + orbit.sense * 0.5 * pi
    if orbit.drift.any():
        yaw = float(np.angle(_velocity(orbit, state)))
    return -((-yaw + pi) % (2.0 * pi) - pi)


def _velocity(orbit: Orbit, state: SteadyState) -> complex:
    """Velocity over the ground, east + i north [m/s]: round the centre, and with its drift."""
    round_it = orbit.speed * state.end_mass_radius * orbit.sense * 1j
    return round_it * np.exp(1j * end_mass_azimuth(orbit, state)) + complex(*orbit.drift)


def cable_points(orbit: Orbit, point: FlightPoint, state: SteadyState) -> np.ndarray:
    """East, north, up along the cable [m], (CABLE_POINTS, 3), from the end mass up."""
    positions, _ = state.cable(_ARC * point.parameters.length)
    azimuth = end_mass_azimuth(orbit, state)
    c, s = cos(azimuth), sin(azimuth)
    # A clockwise orbit is the mirror image of the solver's anticlockwise one.
    turn = np.array([[c, s, 0.0], [-orbit.sense * s, orbit.sense * c, 0.0], [0.0, 0.0, 1.0]])
    points = (point.radius * positions) @ turn
    points += orbit.center
    points[:, 2] -= state.depth * point.radius
    return points


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
    if not (rate and radius):
        return 0.0
    by_radius = (1.0 / radius + 1.0 / rate) / orbit.radius
    by_rate = 1.0 / rate / orbit.angular_rate
    (of_radius, of_both), (_, of_rate) = orbit.covariance[3:5, 3:5].tolist()
    variance = by_radius**2 * of_radius + by_rate * (by_rate * of_rate + 2.0 * by_radius * of_both)
    return 1.0 / sqrt(variance) if 0.0 < variance < inf else inf


def pose_covariance(
    orbit: Orbit,
    point: FlightPoint,
    state: SteadyState,
    distance: float = inf,
    landed: SteadyState | None = None,
    known: np.ndarray | None = None,
    by_wind: np.ndarray | None = None,
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
    known : (4, 4) ndarray, optional
        Of east, north, up and yaw without that chance; by default what still air leaves of the
        orbit's.
    by_wind : (4, 4) ndarray, optional
        What a wind adds in which still air's is the position, see
        `ctcbs_ros.prediction.wind_unknown`.
    """
    covariance = _UNKNOWN.copy()
    with np.errstate(all="ignore"):
        known = _in_still_air(orbit, state) if known is None else known.copy()
        if by_wind is not None:
            known += by_wind
        if known[3, 3] > pi**2:
            # An end mass that hardly moves over the ground: any direction, at a place known.
            known[3, :] = known[:, 3] = 0.0
            known[3, 3] = pi**2
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


def _in_still_air(orbit: Orbit, state: SteadyState) -> np.ndarray:
    """Covariance of east, north, up and yaw of a steady state, (4, 4)."""
    by_radius, by_rate = sensitivities(state, (RADIUS_AT_RATE, ANGULAR_RATE)).tolist()
    a, rate = orbit.radius, orbit.angular_rate
    x_d, depth = state.end_mass_radius, state.depth
    azimuth = end_mass_azimuth(orbit, state)
    c, s = cos(azimuth), sin(azimuth)
    radius = x_d * a

    def moved(d_radius, d_depth, d_lag):
        """East, north, up and yaw by changes of radius, depth [m] and lag [rad]."""
        along = -orbit.sense * d_lag
        return (
            c * d_radius - radius * s * along, s * d_radius + radius * c * along, -d_depth, along
        )

    # By east, north, up, tow radius [m], angular rate [rad/s] and phase: climb and drift move
    # the end mass nowhere at this time.
    jacobian = np.eye(4, 6)
    jacobian[3, 3] = 0.0
    jacobian[:, 3] = moved(by_radius[0] + x_d, by_radius[1] + depth, by_radius[2] / a)
    jacobian[:, 4] = moved(by_rate[0] * a / rate, by_rate[1] * a / rate, by_rate[2] / rate)
    jacobian[:, 5] = (-radius * s, radius * c, 0.0, 1.0)
    if not orbit.drift.any():
        return jacobian @ orbit.covariance[:6, :6] @ jacobian.T
    # The yaw is the direction of the sum of two velocities, see `_velocity`.
    jacobian = np.hstack([jacobian, np.zeros((4, 3))])
    round_it, all_told = _velocity(orbit, state) - complex(*orbit.drift), _velocity(orbit, state)
    changes = 1j * jacobian[3] * round_it
    changes[3] += round_it * (by_radius[0] + x_d) / radius
    changes[4] += round_it * (by_rate[0] / x_d + 1.0) / rate
    changes[7:9] = 1.0, 1j
    jacobian[3] = np.imag(changes / all_told)
    return jacobian @ orbit.covariance[:9, :9] @ jacobian.T
