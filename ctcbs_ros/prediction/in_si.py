"""The tracked state described in SI units and in the local frame: what a prediction publishes."""

from dataclasses import replace
from math import isfinite

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction import pose
from ctcbs_ros.prediction.branch import Tracked
from ctcbs_ros.prediction.history import Outlook
from ctcbs_ros.prediction.prediction import (
    EndMass,
    EndMassState,
    Geodetic,
    Jump,
    Margin,
    MarginOf,
    MotionInWind,
)
from ctcbs_ros.scaling import FlightPoint
from ctcbs_ros.solver.stability import Stability
from ctcbs_ros.solver.steady_state import SteadyState


def end_mass_in_si(
    orbit: Orbit,
    time_on_orbit: float,
    point: FlightPoint,
    tracked: Tracked,
    outlook: Outlook,
    position: np.ndarray,
    geodetic: Geodetic,
    ground_up: float,
    in_wind: MotionInWind | None = None,
    unmodelled_because: str = "",
    by_wind: np.ndarray | None = None,
) -> EndMass:
    """Everything that is known of the end mass on a tracked branch.

    Parameters
    ----------
    orbit : Orbit
    time_on_orbit : float
        For which it has been flown [s].
    point : FlightPoint
        The orbit scaled.
    tracked : Tracked
        With a state.
    outlook : Outlook
    position : (3,) ndarray
        Of the end mass, see `pose.end_mass_position` [m].
    geodetic : Geodetic
        The same position.
    ground_up : float
        Up coordinate of the ground [m]; nan if unknown.
    in_wind : MotionInWind, optional
        Where the wind is known; then `position` is that of this motion.
    by_wind : (4, 4) ndarray, optional
        See `pose.pose_covariance`.

    Raises
    ------
    ArithmeticError
        If the cable cannot be integrated.
    """
    state = state_in_si(point, tracked.state, outlook.stability)
    in_angular_rate = jump_in_si(outlook.in_angular_rate, point.angular_rate, point)
    in_radius = jump_in_si(outlook.in_radius, point.radius, point)
    distance = pose.fold_distance(orbit, in_angular_rate, in_radius)
    landed = _landed(point, tracked, in_angular_rate or in_radius)
    margin = still_air_margin(state, outlook.stability) if in_wind is None else in_wind.margin
    if unmodelled_because:
        margin = Margin(MarginOf.NOT_KNOWN, because=unmodelled_because)
    if in_wind is None:
        yaw, known = pose.motion_yaw(orbit, tracked.state), None
        center = orbit.center - np.array([0.0, 0.0, state.depth])
        cable = pose.cable_points(orbit, point, tracked.state)
    else:
        yaw, known, center = in_wind.yaw, in_wind.covariance, in_wind.mean
        cable = in_wind.cable
    return EndMass(
        state=state,
        branch=tracked.branch,
        position=position,
        yaw=yaw,
        covariance=pose.pose_covariance(
            orbit, point, tracked.state, distance, landed, known, by_wind
        ),
        fold_distance=distance,
        geodetic=geodetic,
        height_above_home=float(position[2] - ground_up),
        circle_center=center,
        cable=cable,
        settling_time=margin.settling_time,
        time_on_orbit=time_on_orbit,
        nearest_loss=margin.nearest_loss,
        others=tuple(
            state_in_si(point, other, stability)
            for other, stability in zip(tracked.others, outlook.of_others, strict=True)
        ),
        jump_in_angular_rate=in_angular_rate,
        jump_in_speed=jump_in_si(outlook.in_angular_rate, point.speed, point),
        jump_in_radius=in_radius,
        method=tracked.method,
        in_wind=in_wind,
        unmodelled_because=unmodelled_because,
        sense=orbit.sense,
    )


def still_air_margin(state: EndMassState, stability: Stability) -> Margin:
    """How stable a steady state in still air is."""
    return Margin(
        MarginOf.STILL_AIR, state.margin, state.margin_per_s, state.frequency_per_s,
        stability.nearest_loss,
    )  # fmt: skip


def settling_time(state: EndMassState) -> float:
    """Of a state in still air, see `Margin.settling_time`."""
    return Margin(MarginOf.STILL_AIR, per_second=state.margin_per_s).settling_time


def state_in_si(point: FlightPoint, state: SteadyState, stability: Stability) -> EndMassState:
    """A steady state of a flight point in SI units."""
    si = point.state_si(state, stability)
    return EndMassState(
        radius=si["end_mass_radius_m"],
        depth=si["depth_m"],
        phase_lag=state.phase_lag,
        tension_end_mass=si["tension_end_mass_n"],
        tension_tow_point=si["tension_tow_point_n"],
        greatest_tension=si["greatest_tension_n"],
        margin=stability.margin,
        margin_per_s=-si["growth_rate_per_s"],
        frequency_per_s=si["frequency_per_s"],
        stable=stability.stable,
        residual=state.residual,
    )


def _landed(point: FlightPoint, tracked: Tracked, jump: Jump | None) -> SteadyState | None:
    """The other state of this orbit that a jump leads to; None if there is none."""
    if jump is None or not isfinite(jump.landing_radius) or not tracked.others:
        return None
    wanted = jump.landing_radius / point.radius
    return min(tracked.others, key=lambda state: abs(state.end_mass_radius / wanted - 1.0))


def jump_in_si(jump: Jump | None, unit: float, point: FlightPoint) -> Jump | None:
    """A jump relative to the present flight, its quantity in the unit of the present one."""
    if jump is None:
        return None
    return replace(jump, at=jump.at * unit, landing_radius=jump.landing_radius * point.radius)
