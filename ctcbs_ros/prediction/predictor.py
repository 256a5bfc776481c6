"""The predictor: telemetry samples in, predictions out. No ROS, no MAVLink.

Each sample goes down the one way of docs/architecture.md: screened, placed in the local frame,
fitted to an orbit, scaled, solved on the tracked branch, described in SI units with its warnings.
"""

from dataclasses import replace
from math import inf, isfinite, log, nan

import numpy as np

from ctcbs_ros.configuration import Configuration, WarningLimits
from ctcbs_ros.errors import InputError
from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.ground_speed import GroundSpeedVariation
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction import pose
from ctcbs_ros.prediction.branch import BranchTracker, Tracked
from ctcbs_ros.prediction.codes import SkipCode, Warning
from ctcbs_ros.prediction.jumps import JumpFinder
from ctcbs_ros.prediction.margin import MarginFollower
from ctcbs_ros.prediction.prediction import EndMass, EndMassState, Geodetic, Jump, Prediction
from ctcbs_ros.prediction.straight_flight import StraightFlight
from ctcbs_ros.prediction.warnings import (
    end_mass_warnings,
    envelope_warnings,
    not_orbiting,
    skip_warnings,
    stale_telemetry,
    tracking_warnings,
    wind_warnings,
)
from ctcbs_ros.scaling import FlightPoint, flight_point
from ctcbs_ros.solver.stability import Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states
from ctcbs_ros.table.table import Table
from ctcbs_ros.telemetry.local_frame import LocalFrame, LocalSample
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.screen import Screen

# A disturbance has settled when it has decayed to 5 %.
_SETTLED = log(20.0)
# Without telemetry for longer [s], nothing is known of what was flown meanwhile.
_LONGEST_GAP = 30.0
# Worse than this [m], [m/s] nothing is measured, and squares of it stay finite.
_POOREST_ACCURACY = 1e3


class Predictor:
    """Predicts the end mass from the telemetry of the tow aircraft, sample by sample.

    Parameters
    ----------
    configuration : Configuration
    table : Table, optional
        Continuation table of the configuration; without one every state is solved in full.
    """

    def __init__(self, configuration: Configuration, table: Table | None = None):
        self._configuration = configuration
        self._table = table
        self._cable_length = configuration.cable.length
        self._end_mass = configuration.end_mass.mass
        self._limits = configuration.limits
        self._screen = Screen()
        self._frame = LocalFrame()
        self._estimator = OrbitEstimator()
        self._ground_speed = GroundSpeedVariation()
        self._tracker = BranchTracker()
        self._jumps = JumpFinder()
        self._margins: list[MarginFollower] = []
        self._straight = StraightFlight()
        self._sense = 0
        self._flight: int | None = None
        self._last_time = nan

    @property
    def datum(self) -> Datum | None:
        """Origin of the local frame; None before the first believed geodetic position."""
        return self._frame.datum

    def to_geodetic(self, positions: np.ndarray) -> np.ndarray:
        """Latitude, longitude [deg], altitude [m] of local positions, (n, 3); nan without datum.

        The altitude is of the kind of the datum's (`Datum.ellipsoidal`).
        """
        datum = self.datum
        if datum is None:
            return np.full((len(positions), 3), nan)
        return np.column_stack(to_geodetic(datum, *positions.T))

    def change(
        self,
        cable_length: float | None = None,
        end_mass: float | None = None,
        limits: WarningLimits | None = None,
    ) -> None:
        """Take over what changes in flight: cable paid out [m], end mass [kg], warning limits."""
        if cable_length is not None:
            self._cable_length = cable_length
        if end_mass is not None:
            self._end_mass = end_mass
        if limits is not None:
            self._limits = limits

    def stale(self, seconds_without_sample: float) -> Warning | None:
        """The warning due after a time without a sample [s], None while that is within limits."""
        return stale_telemetry(seconds_without_sample, self._limits)

    def update(self, sample: Sample) -> Prediction:
        """Take in one sample.

        Parameters
        ----------
        sample : Sample
            Anything a reader may yield; what cannot be believed is skipped with its code.

        Returns
        -------
        Prediction
        """
        skip = self._screen.check(sample)
        if skip is not None:
            return self._skipped(sample, skip)
        if sample.flight != self._flight:
            self._flight = sample.flight
            self._last_time = nan
            self._frame.new_flight()
            self._lose_orbit()
            self._forget_history()
            self._estimator.reset()
        local = self._frame.localize(sample)
        if local is None:
            return self._skipped(sample, SkipCode.NOT_FINITE)
        warnings = []
        gap = sample.time - self._last_time
        self._last_time = sample.time
        if isfinite(gap) and (stale := self.stale(gap)):
            warnings.append(stale)
        if gap > _LONGEST_GAP:
            self._forget_history()
        fix = self._estimator.add(
            sample.time,
            local.position,
            None if sample.velocity is None else np.array(sample.velocity),
            _stated(sample.horizontal_accuracy),
            _stated(sample.speed_accuracy),
        )
        if fix.orbit is None:
            self._lose_orbit()
            if self._straight.add(local.position, self._cable_length):
                self._forget_history()
            warnings.append(not_orbiting(fix.reason))
            return self._prediction(sample, None, local, None, nan, warnings)
        self._straight.reset()
        if fix.orbit.sense == -self._sense:
            self._forget_history()
        self._sense = fix.orbit.sense
        self._ground_speed.add(sample.time, sample.velocity)
        return self._predict(sample, local, fix.orbit, warnings)

    def state_at(
        self, radius: float, speed: float, air_density: float, near_radius: float
    ) -> EndMassState | None:
        """The steady state of an orbit that is nearest to an end-mass radius.

        Parameters
        ----------
        radius, speed, air_density, near_radius : float
            Tow radius [m], speed [m/s], density [kg/m^3], end-mass radius [m].

        Returns
        -------
        EndMassState or None
            None where the orbit has no steady state.
        """
        try:
            point = self._point(radius, speed, air_density)
        except InputError:
            return None
        states = steady_states(point.parameters).states
        if not states:
            return None
        nearest = min(states, key=lambda s: abs(s.end_mass_radius * radius - near_radius))
        return _in_si(point, nearest, stability(nearest))

    def _point(self, radius: float, speed: float, density: float) -> FlightPoint:
        return flight_point(
            self._configuration, radius, speed, density, self._cable_length, self._end_mass
        )

    def _predict(self, sample, local: LocalSample, orbit: Orbit, warnings) -> Prediction:
        density = self._air_density(local)
        warnings += envelope_warnings(orbit, self._configuration.envelope)
        warnings += wind_warnings(self._ground_speed.variation(orbit))
        try:
            point = self._point(orbit.radius, orbit.speed, density)
        except InputError as error:
            reason = str(error)
            if not isfinite(density):
                reason = (
                    f"no air density: {local.altitude_amsl:.0f} m above sea level is outside "
                    "the standard atmosphere, -5 to 20 km"
                )
            warnings += tracking_warnings(Tracked(None, "", (), "", 0, reason))
            return self._prediction(sample, orbit, local, None, density, warnings)
        guesses = self._table.guesses(point) if self._table is not None else None
        tracked = self._tracker.update(point.parameters, guesses)
        warnings += tracking_warnings(tracked)
        if tracked.state is None:
            self._jumps.reset()
            return self._prediction(sample, orbit, local, None, density, warnings)
        try:
            end_mass = self._end_mass_of(orbit, local, point, tracked)
        except ArithmeticError as error:
            warnings += tracking_warnings(replace(tracked, state=None, reason=str(error)))
            return self._prediction(sample, orbit, local, None, density, warnings)
        if end_mass is not None:
            warnings += end_mass_warnings(end_mass, self._configuration.cable, self._limits)
        return self._prediction(sample, orbit, local, end_mass, density, warnings)

    def _end_mass_of(
        self, orbit: Orbit, local: LocalSample, point: FlightPoint, tracked: Tracked
    ) -> EndMass | None:
        state = tracked.state
        if tracked.jumps:
            self._jumps.reset()
        may_end = self._table is None or self._table.may_end(point)
        jumps = self._jumps.update(state, may_end)
        states = (state, *tracked.others)
        while len(self._margins) < len(states):
            self._margins.append(MarginFollower())
        damping, *of_others = (m.update(s) for m, s in zip(self._margins, states, strict=False))
        si = _in_si(point, state, damping)
        position = pose.end_mass_position(orbit, point, state)
        if not np.all(np.isfinite(position)):
            return None
        ground_up = self._frame.up_of_amsl(self._limits.ground_level_amsl)
        if not isfinite(ground_up):
            ground_up = local.home_up
        return EndMass(
            state=si,
            branch=tracked.branch,
            position=position,
            yaw=pose.motion_yaw(orbit, state),
            covariance=pose.pose_covariance(orbit, point, state),
            geodetic=self._geodetic(position),
            height_above_home=float(position[2] - ground_up),
            circle_center=orbit.center - np.array([0.0, 0.0, si.depth]),
            cable=pose.cable_points(orbit, point, state),
            settling_time=_SETTLED / si.margin_per_s if si.margin_per_s > 0.0 else inf,
            nearest_loss=damping.nearest_loss,
            others=tuple(
                _in_si(point, s, d) for s, d in zip(tracked.others, of_others, strict=True)
            ),
            jump_in_angular_rate=_scaled(jumps["angular_rate"], point.angular_rate, point.radius),
            jump_in_speed=_scaled(jumps["angular_rate"], point.speed, point.radius),
            jump_in_radius=_scaled(jumps["radius"], point.radius, point.radius),
            method=tracked.method,
        )

    def _geodetic(self, position: np.ndarray) -> Geodetic:
        latitude, longitude, altitude = self.to_geodetic(position[None])[0]
        datum = self.datum
        return Geodetic(
            float(latitude), float(longitude), float(altitude),
            datum is not None and datum.ellipsoidal,
        )

    def _air_density(self, local: LocalSample) -> float:
        altitude = local.altitude_amsl
        if not isfinite(altitude):
            # A local frame alone: its origin is taken for the ground, or else for sea level.
            ground = self._limits.ground_level_amsl
            altitude = local.position[2] + (ground if isfinite(ground) else 0.0)
        return self._configuration.air.density_at(altitude)

    def _lose_orbit(self) -> None:
        self._ground_speed.reset()

    def _forget_history(self) -> None:
        """Begin a new history: nothing is left of how the end mass moved before."""
        self._tracker.reset()
        self._jumps.reset()
        self._margins.clear()
        self._straight.reset()
        self._sense = 0

    def _skipped(self, sample: Sample, skip: SkipCode) -> Prediction:
        return Prediction(
            sample.time, sample.stamp_ns, sample.flight, skip, None, None, None, nan,
            skip_warnings(skip),
        )

    def _prediction(self, sample, orbit, local, end_mass, density, warnings) -> Prediction:
        return Prediction(
            sample.time, sample.stamp_ns, sample.flight, None, orbit, local.position, end_mass,
            density, tuple(warnings),
        )


def _stated(accuracy: float) -> float:
    """An accuracy, no poorer than still counts in a fit; nan (not known) where it is none."""
    return min(accuracy, _POOREST_ACCURACY) if accuracy > 0.0 else nan


def _in_si(point: FlightPoint, state: SteadyState, damping: Stability) -> EndMassState:
    si = point.state_si(state, damping)
    return EndMassState(
        radius=si["end_mass_radius_m"],
        depth=si["depth_m"],
        phase_lag=state.phase_lag,
        tension_end_mass=si["tension_end_mass_n"],
        tension_tow_point=si["tension_tow_point_n"],
        margin=damping.margin,
        margin_per_s=-si["growth_rate_per_s"],
        frequency_per_s=si["frequency_per_s"],
        stable=damping.stable,
        residual=state.residual,
    )


def _scaled(jump: Jump | None, unit: float, tow_radius: float) -> Jump | None:
    """A jump relative to the present flight, in SI units."""
    if jump is None:
        return None
    return replace(jump, at=jump.at * unit, landing_radius=jump.landing_radius * tow_radius)


