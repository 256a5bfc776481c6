"""The twin: the cable in time, flown beside the aircraft by its telemetry. No ROS, no MAVLink.

It begins in the periodic motion of the first orbit, or trailing behind where straight flight comes
first, and then goes on with every sample along the tow point's smoothed path in the wind believed:
entries, changes and what is left of them are in it. Where it can no longer be right (a gap, a
jump, another flight) it begins anew, and says so.
"""

from collections import Counter
from math import atan2, inf, isfinite, isnan, nan, pi, sqrt

import numpy as np

from ctcbs_ros.atmosphere import GRAVITY
from ctcbs_ros.configuration import Configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.twin.beginning import behind, on_orbit, settling_time_behind
from ctcbs_ros.twin.flown_path import FlownPath, Stretch
from ctcbs_ros.twin.flown_wind import FlownWind
from ctcbs_ros.twin.followed import FollowedCable, off_winds
from ctcbs_ros.twin.look_ahead import LookAhead, Settling
from ctcbs_ros.twin.seen import Seen
from ctcbs_ros.twin.simulated import Loss, Simulated, TwinState
from ctcbs_ros.twin.simulated_cable import axes_of, line_in_si

# See docs/twin.md.
SEGMENTS = 24
# The look-ahead goes so much faster than the samples.
SPEED_UP = 20.0
# Turns until it does so again where all has settled, on the orbit and in the wind of the last one.
_REST = 3.0
# Change of the length paid out that is reeled in the time to the next sample, over the length.
_REELED = 0.02
# Change of air density that makes another line.
_DENSITY = 1e-3
_UNKNOWN = 1e6  # variance of the attitude [rad^2]
# Of a pose's covariance: its diagonal, and the rows and columns that are known.
_DIAGONAL, _POSE = np.diag_indices(6), np.ix_([0, 1, 2, 5], [0, 1, 2, 5])
# What it begins with on an orbit.
_PERIODIC, _STILL = "periodic motion", "steady state in still air"


class Twin:
    """Simulates the end mass beside the telemetry.

    Parameters
    ----------
    configuration : Configuration
    segments : int
    """

    def __init__(self, configuration: Configuration, segments: int = SEGMENTS):
        self._configuration = configuration
        self._segments = segments
        self._cable_length = configuration.cable.length
        self._end_mass = configuration.end_mass.mass
        self._losses: Counter[Loss] = Counter()
        self._flight: int | None = None
        self._line = self._line_density = None
        self._path = FlownPath(configuration)
        self._forget()

    def _forget(self) -> None:
        self._last_time = nan
        self._path.forget()
        self._orbit: Orbit | None = None
        self._wind = FlownWind()
        self._stop()

    def _stop(self) -> None:
        self._followed: FollowedCable | None = None
        self._begun_as = ""
        self._ahead: LookAhead | None = None
        self._settling: Settling | None = None

    def change(self, cable_length: float | None = None, end_mass: float | None = None) -> None:
        """Take over what changes in flight: cable paid out [m], end mass [kg].

        Little by little the cable is reeled; by a jump it is another one, to begin with anew.
        """
        if cable_length is not None and cable_length != self._cable_length:
            if abs(cable_length / self._cable_length - 1.0) > _REELED:
                self._lose(Loss.CABLE_CHANGED)
            self._cable_length = cable_length
        if end_mass is not None:
            self._end_mass = end_mass
        self._line_density = None

    def update(self, seen: Seen) -> Simulated | None:
        """Take in a sample that is believed.

        Parameters
        ----------
        seen : Seen

        Returns
        -------
        Simulated or None
            None of a sample that has the time of the one before.
        """
        sample = seen.sample
        if sample.flight != self._flight or sample.time < self._last_time:
            self._lose(Loss.NEW_FLIGHT)
            self._forget()
            self._flight = sample.flight
        elif sample.time == self._last_time:
            return None
        before = self._line
        # What overflows ends as a number that is not finite, and is told by that.
        with np.errstate(all="ignore"):
            try:
                if self._take_line(seen):
                    self._follow(seen, before)
            except (ArithmeticError, ValueError):
                self._lose(Loss.NOT_FOLLOWED)
                self._path.forget()
        self._last_time = sample.time
        self._orbit = seen.orbit
        return self._simulated(sample)

    # --- the tow point and the air --------------------------------------------------------------

    def _follow(self, seen: Seen, before) -> None:
        time, wind_before = seen.sample.time, self._wind.velocity
        interval = time - self._last_time
        other_wind = seen.wind is not None and self._take_wind(seen.wind, interval)
        orbit = self._orbit if seen.orbit is not None else None
        flown = self._path.add(seen, interval, orbit, self._last_time, self._wind.velocity)
        if isinstance(flown, Loss):
            self._lose(flown)
        if not isinstance(flown, Stretch):
            return
        if other_wind:
            self._lose(Loss.OTHER_WIND)
        if self._may_begin_better(seen):
            self._stop()
        if self._followed is None:
            self._begin(seen)
            return
        begun = self._followed
        on_orbit_since = self._begun_as in (_PERIODIC, _STILL)
        # What is not known as it begins is taken for long, and may be found to be shorter.
        if on_orbit_since and begun.valid_from > time and isfinite(seen.settling_time):
            begun.valid_from = begun.since + seen.settling_time
        begun.led_elsewhere(time, flown.unsure)
        if not self._advance(flown.path, wind_before, before):
            self._lose(Loss.NOT_FOLLOWED)
            return
        self._look_ahead(interval, seen)

    def _take_line(self, seen: Seen) -> bool:
        density = seen.air_density
        if not isfinite(density):
            air, sample = self._configuration.air, seen.sample
            density = air.density_at(sample.altitude_amsl, sample.air_density)
        known = self._line_density
        if known is not None and not abs(density / known - 1.0) > _DENSITY:
            return True
        if not isfinite(density):
            return self._line is not None
        # Any radius and speed do: the line in SI has none.
        length = self._cable_length
        try:
            self._line = line_in_si(flight_point(
                self._configuration, length, sqrt(GRAVITY * length), density, length,
                self._end_mass,
            ))  # fmt: skip
        except InputError:
            return False
        self._line_density = density
        return True

    def _take_wind(self, wind: Wind, interval: float) -> bool:
        tow = self._path.tow
        speed = 0.0 if tow is None else float(np.linalg.norm(tow.velocity))
        return self._wind.take(wind, interval, speed, at_once=self._followed is None)

    # --- the cable ------------------------------------------------------------------------------

    def _begin(self, seen: Seen) -> None:
        time, orbit, tow = seen.sample.time, seen.orbit, self._path.tow
        errors, off_wind, wind = np.zeros((4, 4)), [], self._wind.velocity
        if orbit is not None and isfinite(seen.end_mass_radius):
            if seen.searching and seen.motion is None:
                return
            point = flight_point(
                self._configuration, orbit.radius, orbit.speed, seen.air_density,
                self._cable_length, self._end_mass,
            )  # fmt: skip
            begun = on_orbit(
                orbit, point, seen.end_mass_radius, wind[:2], seen.at_airspeed,
                seen.motion, self._segments,
            )  # fmt: skip
            if begun is None:
                return
            cable, self._begun_as = begun.cable, _PERIODIC if begun.periodic else _STILL
            errors = seen.errors if begun.periodic else None
            # Where that is not known yet it is added as soon as it is.
            valid_from = inf if isnan(seen.settling_time) else time + seen.settling_time
        elif orbit is None and self._path.is_straight(time):
            given = self._line, self._segments, tow.position, tow.velocity
            cable = behind(*given, wind)
            if cable is None:
                return
            off = off_winds(self._wind.covariance)
            off_wind = [behind(*given, wind + o) or cable.copy() for o in off]
            self._begun_as = "straight flight"
            valid_from = time + settling_time_behind(self._line, cable, wind)
        else:
            return
        self._followed = FollowedCable(
            cable, off_wind, time, valid_from, errors, self._cable_length
        )
        self._followed.move(tow.position - cable.positions[-1])
        if not cable.finite:
            self._lose(Loss.NOT_FOLLOWED)

    def _advance(self, path, wind_before, line_before) -> bool:
        length = self._cable_length if line_before is None else line_before.length
        return self._followed.advance(
            self._line, path, wind_before, self._wind.velocity, self._wind.covariance, length,
            axes_of(self._orbit, self._last_time),
        )  # fmt: skip

    def _may_begin_better(self, seen: Seen) -> bool:
        """Whether the motion in the wind has been found since it began without."""
        begun = self._followed
        return (
            begun is not None
            and self._begun_as == _STILL
            and seen.motion is not None
            and seen.sample.time < begun.valid_from
        )

    def _look_ahead(self, interval: float, seen: Seen) -> None:
        orbit = seen.orbit
        if orbit is None:
            self._ahead = self._settling = None
            return
        time = seen.sample.time
        if self._ahead is not None and not self._ahead.is_of(orbit, self._wind.velocity):
            self._ahead = self._settling = None
        if self._ahead is not None and self._ahead.ended and not self._is_due(time, orbit):
            return
        if self._ahead is None or self._ahead.ended:
            try:
                self._ahead = LookAhead(
                    time, self._followed.cable, orbit, self._line, self._wind.velocity,
                    seen.at_airspeed,
                )
            except InputError:
                self._ahead = None
                return
        found = self._ahead.go_on(SPEED_UP * interval)
        if found is not None:
            self._settling = found
        if self._ahead.lost:
            self._ahead = None

    def _is_due(self, time: float, orbit: Orbit) -> bool:
        """Whether to look ahead again: where all has settled, now and then is often enough."""
        settling = self._settling
        return not settling.settles_at <= time or (
            time - settling.begun >= _REST * 2.0 * pi / orbit.angular_rate
        )

    def _lose(self, why: Loss) -> None:
        if self._followed is not None:
            self._losses[why] += 1
        self._stop()

    # --- what is said of it ---------------------------------------------------------------------

    def _simulated(self, sample: Sample) -> Simulated:
        unknown = np.full(3, nan)
        begun = self._followed
        cable = None if begun is None else begun.cable
        since, valid_from = (nan, inf) if begun is None else (begun.since, begun.valid_from)
        if cable is None:
            state, position, velocity = TwinState.WAITING, unknown, unknown
            nodes = np.empty((0, 3))
        else:
            ready = sample.time >= valid_from
            state = TwinState.SYNCHRONISED if ready else TwinState.SETTLING
            position, velocity = cable.positions[0].copy(), cable.velocities[0].copy()
            nodes = cable.positions.copy()
        return Simulated(
            time=sample.time,
            stamp_ns=sample.stamp_ns,
            state=state,
            since=since,
            valid_from=valid_from,
            begun_as=self._begun_as,
            position=position,
            velocity=velocity,
            yaw=atan2(velocity[1], velocity[0]) if cable is not None else nan,
            covariance=self._covariance(sample),
            cable=nodes,
            tow_point=unknown if self._path.tow is None else self._path.tow.position,
            wind=self._wind.velocity.copy(),
            wind_known=self._wind.known,
            settling=self._settling,
            losses=dict(self._losses),
        )

    def _covariance(self, sample: Sample) -> np.ndarray:
        """Of the pose: tow point, wind and beginning; see `Simulated`."""
        covariance = np.zeros((6, 6))
        covariance[_DIAGONAL] = _UNKNOWN
        if self._followed is None:
            return covariance
        speed = max(float(np.hypot(*self._followed.cable.velocities[0, :2])), 1e-3)
        turned = self._path.velocity_sigma(sample) / speed
        covariance[_POSE] = self._followed.covariance(sample.time)
        covariance[_DIAGONAL] += [*self._path.variances(sample), 0.0, 0.0, turned**2]
        return covariance
