"""The predictor: telemetry samples in, predictions out. No ROS, no MAVLink.

Each sample goes down the one way of docs/architecture.md: screened, placed in the local frame,
fitted to an orbit, scaled, solved on the tracked branch, described in SI units with its warnings.
"""

from dataclasses import asdict, replace
from math import inf, isfinite, isnan, nan, radians

import numpy as np

from ctcbs_ros.configuration import Configuration, WarningLimits
from ctcbs_ros.errors import InputError
from ctcbs_ros.geodesy import Datum, point_to_geodetic, to_geodetic
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.orbit.wind_of_turn import WindEstimator, WindSettings
from ctcbs_ros.periodic.tow_path import AIRSPEED, GROUND_SPEED
from ctcbs_ros.prediction.branch import Tracked
from ctcbs_ros.prediction.codes import Warning
from ctcbs_ros.prediction.history import History, Outlook
from ctcbs_ros.prediction.in_si import end_mass_in_si, settling_time, state_in_si
from ctcbs_ros.prediction.pose import end_mass_position
from ctcbs_ros.prediction.prediction import (
    EndMass,
    EndMassState,
    Geodetic,
    MotionInWind,
    Prediction,
)
from ctcbs_ros.prediction.warnings import (
    end_mass_warnings,
    envelope_warnings,
    is_windy,
    no_solution,
    not_orbiting,
    skip_warnings,
    stale_telemetry,
    track_broken,
    tracking_warnings,
    wind_warnings,
)
from ctcbs_ros.prediction.wind_choice import WindChoice, user_wind
from ctcbs_ros.prediction.wind_follower import WindFollower
from ctcbs_ros.prediction.wind_reasons import STILL_SOLVED
from ctcbs_ros.prediction.wind_unknown import (
    Responses,
    mean_square,
    past_the_circle,
    spread,
    wind_share,
)
from ctcbs_ros.scaling import FlightPoint, flight_point
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states
from ctcbs_ros.table.table import Table
from ctcbs_ros.telemetry.continuity import Continuity, Track
from ctcbs_ros.telemetry.local_frame import LocalFrame, LocalSample
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.twin.seen import Seen
from ctcbs_ros.twin.twin import Twin

# Without telemetry for longer [s], nothing is known of what was flown meanwhile.
_LONGEST_GAP = 30.0
# Worse than this [m], [m/s] nothing is measured, and squares of it stay finite.
_POOREST_ACCURACY = 1e3
# How much longer motions in wind take to settle than in still air, beyond what was seen (3.4).
_LONGER_IN_WIND = 4.0
# East, north, up and yaw of a pose.
_POSE = np.ix_([0, 1, 2, 5], [0, 1, 2, 5])


class Predictor:
    """Predicts the end mass from the telemetry of the tow aircraft, sample by sample.

    Parameters
    ----------
    configuration : Configuration
    table : Table, optional
        Continuation table of the configuration; without one every state is solved in full.
    with_twin : bool
        Whether the twin (`ctcbs_ros.twin.twin`) goes with every sample.
    """

    def __init__(
        self, configuration: Configuration, table: Table | None = None, with_twin: bool = False
    ):
        self._configuration = configuration
        self._table = table
        self._cable_length = configuration.cable.length
        self._end_mass = configuration.end_mass.mass
        self._limits = configuration.limits
        self._screen = Screen()
        self._frame = LocalFrame()
        self._continuity = Continuity()
        self._estimator = OrbitEstimator(OrbitSettings(**asdict(configuration.receiver)))
        self._wind_of_turn = WindEstimator(
            WindSettings(velocity_sigma=configuration.receiver.velocity_sigma)
        )
        self._wind = WindChoice(user_wind(configuration.wind))
        self._history = History()
        self._follower = WindFollower(in_time=with_twin)
        self._responses = Responses()
        self._at_airspeed = False
        self._orbiting = False
        self._flight: int | None = None
        self._last_time = nan
        self._twin = Twin(configuration) if with_twin else None

    @property
    def datum(self) -> Datum | None:
        """Origin of the local frame; None before the first believed geodetic position."""
        return self._frame.datum

    @property
    def frame(self) -> LocalFrame:
        """The local frame, for placing others in it; not to be changed."""
        return self._frame

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
        before = self._cable_length, self._end_mass
        if cable_length is not None:
            self._cable_length = cable_length
        if end_mass is not None:
            self._end_mass = end_mass
        if (self._cable_length, self._end_mass) != before:
            self._history.disturb()
        if self._twin is not None:
            self._twin.change(cable_length, end_mass)
        if limits is not None:
            self._limits = limits

    def stale(self, seconds_without_sample: float) -> Warning | None:
        """The warning due after a time without a sample [s], None while that is within limits."""
        return stale_telemetry(seconds_without_sample, self._limits, over=False)

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
        prediction = self._predicted(sample)
        if self._twin is None or prediction.skip is not None:
            return prediction
        end_mass = prediction.end_mass
        in_wind = None if end_mass is None else end_mass.in_wind
        seen = Seen(
            sample, prediction.tow_point, prediction.orbit, prediction.wind,
            prediction.air_density,
            end_mass_radius=end_mass.state.radius if end_mass else nan,
            settling_time=self._settling_time(end_mass),
            motion=in_wind.motion if in_wind else None,
            errors=end_mass.covariance[_POSE] if end_mass else None,
            searching=self._follower.searching,
            at_airspeed=self._at_airspeed,
        )  # fmt: skip
        return replace(prediction, simulated=self._twin.update(seen))

    def _settling_time(self, end_mass: EndMass | None) -> float:
        """For the twin: where it will not be known in this wind, the longest that was seen."""
        if end_mass is None:
            return inf
        if isnan(end_mass.settling_time) and not self._follower.judging:
            return _LONGER_IN_WIND * settling_time(end_mass.state)
        return end_mass.settling_time

    def _predicted(self, sample: Sample) -> Prediction:
        skip = self._screen.check(sample)
        if skip is not None:
            return self._skipped(sample, skip)
        if sample.flight != self._flight or sample.time < self._last_time:
            self._flight = sample.flight
            self._last_time = nan
            self._frame.new_flight()
            self._continuity.reset()
            self._estimator.reset()
            self._wind_of_turn.reset()
            self._wind.reset()
            self._history.end()
            self._follower.reset()
            self._orbiting = False
        local = self._frame.localize(sample)
        if local is None:
            return self._skipped(sample, SkipCode.NOT_FINITE)
        warnings = []
        track = self._continuity.check(sample, local.position)
        if track is Track.STRAYS:
            return self._skipped(sample, SkipCode.JUMP)
        if track is Track.BREAKS:
            self._estimator.reset()
            warnings.append(track_broken())
        gap = sample.time - self._last_time
        self._last_time = sample.time
        if isfinite(gap) and (stale := stale_telemetry(gap, self._limits, over=True)):
            warnings.append(stale)
        if gap > _LONGEST_GAP:
            self._history.end()
        fix = self._estimator.add(
            sample.time,
            local.position,
            None if sample.velocity is None else np.array(sample.velocity),
            _stated(sample.horizontal_accuracy),
            _stated(sample.speed_accuracy),
        )
        self._wind_of_turn.add(
            sample.time, sample.velocity, _stated(sample.speed_accuracy), sample.airspeed,
            radians(sample.heading),
        )
        if sample.wind is not None:
            self._wind.told(sample.time, sample.wind, sample.wind_accuracy)
        if fix.orbit is None:
            self._orbiting = False
            self._history.flown_without_orbit(local.position, self._cable_length)
            warnings.append(not_orbiting(fix.reason))
            return self._prediction(sample, None, local, None, nan, warnings)
        if not self._orbiting:
            self._wind_of_turn.begin()
            self._orbiting = True
        time_on_orbit = self._history.flown_on_orbit(fix.orbit)
        return self._predict(sample, local, fix.orbit, time_on_orbit, warnings)

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
        return state_in_si(point, nearest, stability(nearest))

    def _point(self, radius: float, speed: float, density: float) -> FlightPoint:
        return flight_point(
            self._configuration, radius, speed, density, self._cable_length, self._end_mass
        )

    def _predict(
        self, sample, local: LocalSample, orbit: Orbit, time_on_orbit: float, warnings
    ) -> Prediction:
        density = self._air_density(local, sample.air_density)
        warnings += envelope_warnings(
            orbit.radius, orbit.speed, self._configuration.envelope
        )
        self._wind.shown(self._wind_of_turn.estimate(orbit))
        wind = self._wind.at(orbit.time)
        try:
            point = self._point(orbit.radius, orbit.speed, density)
        except InputError as error:
            reason = str(error)
            if not isfinite(density):
                reason = (
                    f"no air density: {local.altitude_amsl:.0f} m above sea level is outside "
                    "the standard atmosphere, -5 to 20 km"
                )
            warnings.append(no_solution(reason))
            warnings += wind_warnings(wind, orbit)
            return self._prediction(sample, orbit, local, None, density, warnings)
        guesses = self._table.guesses(point) if self._table is not None else None
        tracked = self._history.track(point.parameters, guesses)
        warnings += tracking_warnings(tracked, orbit.radius)
        if tracked.state is None:
            warnings += wind_warnings(wind, orbit)
            return self._prediction(sample, orbit, local, None, density, warnings)
        try:
            may_end = self._table is None or self._table.may_end(point)
            outlook = self._history.outlook(tracked, may_end)
            in_wind = self._in_wind(
                wind, orbit, density, tracked.state, outlook.stability.functions
            )
            by_wind = None
            if in_wind is None:
                by_wind = wind_share(
                    self._responses.update(tracked.state), orbit, mean_square(wind, orbit)
                )
                warnings += wind_warnings(wind, orbit, self._follower.reason, spread(by_wind))
            windy = in_wind is None and is_windy(wind, orbit)
            because = (self._follower.reason or STILL_SOLVED) if windy else ""
            end_mass = self._described(
                orbit, time_on_orbit, local, point, tracked, outlook, in_wind, because, by_wind
            )
        except ArithmeticError as error:
            warnings.append(no_solution(str(error)))
            return self._prediction(sample, orbit, local, None, density, warnings)
        if end_mass is not None:
            warnings += end_mass_warnings(end_mass, self._configuration.cable, self._limits)
        return self._prediction(sample, orbit, local, end_mass, density, warnings)

    def _described(
        self, orbit: Orbit, time_on_orbit: float, local: LocalSample, point: FlightPoint,
        tracked: Tracked, outlook: Outlook, in_wind: MotionInWind | None, unmodelled_because: str,
        by_wind: np.ndarray | None,
    ) -> EndMass | None:
        if in_wind is None:
            position = end_mass_position(orbit, point, tracked.state)
        else:
            position = in_wind.position
        if not np.all(np.isfinite(position)):
            return None
        ground_up = self._frame.up_of_amsl(self._limits.ground_level_amsl)
        if not isfinite(ground_up):
            ground_up = local.home_up
        geodetic = self._geodetic(position)
        return end_mass_in_si(
            orbit, time_on_orbit, point, tracked, outlook, position, geodetic, ground_up,
            in_wind, unmodelled_because, by_wind,
        )

    def _in_wind(
        self, wind: Wind | None, orbit: Orbit, density: float, state: SteadyState, functions: int
    ) -> MotionInWind | None:
        """The motion in the wind believed; None where there is none, or no such motion."""
        if wind is None:
            self._follower.reset()
            return None
        past, covariance = past_the_circle(wind, orbit)
        self._at_airspeed = self._wind_of_turn.holds_airspeed(wind.velocity, self._at_airspeed)
        kind = AIRSPEED if self._at_airspeed else GROUND_SPEED
        return self._follower.update(
            orbit, lambda radius, speed: self._point(radius, speed, density).parameters,
            state, past, covariance, kind, functions,
        )  # fmt: skip

    def _geodetic(self, position: np.ndarray) -> Geodetic:
        datum = self.datum
        if datum is None:
            return Geodetic(nan, nan, nan, False)
        return Geodetic(*point_to_geodetic(datum, *position.tolist()), datum.ellipsoidal)

    def _air_density(self, local: LocalSample, measured: float) -> float:
        altitude = local.altitude_amsl
        if not isfinite(altitude):
            # A local frame alone: its origin is taken for the ground, or else for sea level.
            ground = self._limits.ground_level_amsl
            altitude = local.position[2] + (ground if isfinite(ground) else 0.0)
        return self._configuration.air.density_at(altitude, measured)

    def _skipped(self, sample: Sample, skip: SkipCode) -> Prediction:
        return Prediction(
            sample.time, sample.stamp_ns, sample.flight, skip, None, None, None, nan,
            skip_warnings(skip),
        )

    def _prediction(self, sample, orbit, local, end_mass, density, warnings) -> Prediction:
        return Prediction(
            sample.time, sample.stamp_ns, sample.flight, None, orbit, local.position, end_mass,
            density, tuple(warnings), self._wind.at(sample.time),
        )


def _stated(accuracy: float) -> float:
    """An accuracy, no poorer than still counts in a fit; nan (not known) where it is none."""
    return min(accuracy, _POOREST_ACCURACY) if accuracy > 0.0 else nan

