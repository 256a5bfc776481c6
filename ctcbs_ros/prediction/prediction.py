"""The prediction: what the predictor makes of one sample, in SI units and ENU."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf, log, nan

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.prediction.codes import Warning
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.twin.simulated import Simulated


@dataclass(frozen=True)
class EndMassState:
    """A steady state of the end mass at the orbit flown, in SI units.

    `phase_lag` [rad, 0..2 pi) is how far the end mass trails the tow point in the sense of
    rotation; tensions in N, the greatest along the cable; `margin` is the decay rate of the least
    damped mode per radian of orbit and `margin_per_s` per second; `frequency_per_s` in rad/s, in
    the rotating frame.
    """

    radius: float
    depth: float
    phase_lag: float
    tension_end_mass: float
    tension_tow_point: float
    greatest_tension: float
    margin: float
    margin_per_s: float
    frequency_per_s: float
    stable: bool
    residual: float


@dataclass(frozen=True)
class Jump:
    """The nearest end (fold) of the tracked branch along one quantity that a pilot can change.

    Attributes
    ----------
    at : float
        Value of the quantity at the fold (rad/s, m/s or m).
    relative : float
        Signed change to it over the present value, (at - now) / now.
    landing_radius : float
        End-mass radius [m] of the state that the end mass settles to beyond the fold; nan if none
        is stable there.
    """

    at: float
    relative: float
    landing_radius: float


@dataclass(frozen=True)
class Geodetic:
    """A position for NavSatFix; `altitude` is ellipsoidal or else above mean sea level."""

    latitude: float
    longitude: float
    altitude: float
    ellipsoidal: bool


class MotionSource(Enum):
    """How the motion in a wind is known."""

    PERIODIC = "periodic"  # the solution of the equations over a turn
    IN_TIME = "time-domain"  # the cable flown in time until its turns are the same


class MarginOf(Enum):
    """Whose stability a prediction tells."""

    STILL_AIR = "still air"
    WIND = "wind"
    NOT_YET = "not known yet"
    NOT_KNOWN = "not known"


# A disturbance has settled when it has decayed to 5 %.
_SETTLED = log(20.0)


@dataclass(frozen=True)
class Margin:
    """How stable the end mass's motion is; all is nan or None where that is not known.

    Attributes
    ----------
    of : MarginOf
        Still air is a circle's in no wind, `EndMass.state`'s.
    per_radian, per_second : float
        Decay rate of the least damped mode, per radian of orbit and per second.
    frequency : float
        Of that mode, in the rotating frame [rad/s].
    nearest_loss : str or None
        "divergence" or "flutter": the way in which it would lose stability.
    because : str
        Why it is not known, in words; empty where it is.
    """

    of: MarginOf
    per_radian: float = nan
    per_second: float = nan
    frequency: float = nan
    nearest_loss: str | None = None
    because: str = ""

    @property
    def known(self) -> bool:
        """Whether it says anything."""
        return self.of in (MarginOf.STILL_AIR, MarginOf.WIND)

    @property
    def stable(self) -> bool | None:
        """Whether every small disturbance in the band decays; None where that is not known."""
        return self.per_second > 0.0 if self.known else None

    @property
    def settling_time(self) -> float:
        """Seconds until a small disturbance has decayed to 5 %; inf if it does not."""
        if not self.known:
            return nan
        return _SETTLED / self.per_second if self.per_second > 0.0 else inf


@dataclass(frozen=True)
class MotionInWind:
    """Where the end mass is on a circle in a steady wind, once settled.

    Attributes
    ----------
    position : (3,) ndarray
        East, north, up at the orbit's phase [m].
    yaw : float
        ENU direction in which it moves over the ground [rad].
    covariance : (4, 4) ndarray
        Of east, north, up and yaw, from the orbit's and the wind's.
    cable : (CABLE_POINTS, 3) ndarray
        East, north, up [m] from the end mass up.
    path : (n, 3) ndarray
        Over the turn from now on, at equal times [m].
    motion : PeriodicMotion
        As it was solved, for a flight nearby.
    source : MotionSource
    margin : Margin
        How stable it is.
    """

    position: np.ndarray
    yaw: float
    covariance: np.ndarray
    cable: np.ndarray
    path: np.ndarray
    motion: PeriodicMotion = field(repr=False)
    source: MotionSource = MotionSource.PERIODIC
    margin: Margin = Margin(MarginOf.NOT_YET)

    @property
    def mean(self) -> np.ndarray:
        """Mean position over a turn, (3,) [m]."""
        return self.path.mean(axis=0)


@dataclass(frozen=True)
class EndMass:
    """The end mass on the tracked branch: where it is at the present phase, and its circle.

    That is where it is once it has settled on the orbit flown, see `settled`.

    Attributes
    ----------
    state : EndMassState
    branch : str
        Name of the branch, e.g. "main" (see `ctcbs_ros.prediction.branch`).
    position : (3,) ndarray
        East, north, up [m] at the prediction's time.
    yaw : float
        ENU direction [rad] of its motion over the ground.
    covariance : (6, 6) ndarray
        Of (east, north, up, roll, pitch, yaw) in SI units, as in PoseWithCovariance.
    fold_distance : float
        To the end of the branch, in standard deviations of the orbit; inf where it does not end.
        Below about 3 the end mass may have jumped and the covariance is a rough one.
    geodetic : Geodetic
        The same position in latitude, longitude, altitude; nan where no datum is known.
    height_above_home : float
        Height of the end mass above home, or above the set ground level [m]; nan if unknown.
    circle_center : (3,) ndarray
        Mean place of the end mass over a turn [m]; in still air the centre of its circle, the
        radius of which is `state.radius`.
    cable : (n, 3) ndarray
        East, north, up [m] of points along the cable, from the end mass to the tow point.
    settling_time : float
        Seconds until a small disturbance has decayed to 5 %; inf if it does not, nan where that is
        not known.
    time_on_orbit : float
        Seconds for which this orbit, cable and load have been flown.
    nearest_loss : str or None
        "divergence" or "flutter": the way in which the least damped mode would lose stability;
        None where that is not known.
    others : tuple of EndMassState
        The other steady states of the same orbit, in rising radius.
    jump_in_angular_rate, jump_in_speed, jump_in_radius : Jump or None
        Nearest fold in angular rate and in speed (both at this radius), and in radius (at this
        speed); None where the branch has no end there.
    method : str
        "table and Newton", "continuation" or "full solve": how the state was found.
    in_wind : MotionInWind or None
        The motion in the wind believed, of which position, yaw, covariance and cable then are;
        None where that is not known or has no periodic motion. `state`, the others and the jumps
        are those of still air all the same; settling time and nearest loss are `margin`'s.
    unmodelled_because : str
        Why the motion is not known in the wind that there is; then everything here is that of
        still air and does not hold. Empty where it holds, or nobody knows the wind.
    sense : int
        Of the orbit, +1 anticlockwise, -1 clockwise.
    """

    state: EndMassState
    branch: str
    position: np.ndarray
    yaw: float
    covariance: np.ndarray
    fold_distance: float
    geodetic: Geodetic
    height_above_home: float
    circle_center: np.ndarray
    cable: np.ndarray
    settling_time: float
    time_on_orbit: float
    nearest_loss: str | None
    others: tuple[EndMassState, ...]
    jump_in_angular_rate: Jump | None
    jump_in_speed: Jump | None
    jump_in_radius: Jump | None
    method: str
    in_wind: MotionInWind | None = None
    unmodelled_because: str = ""
    sense: int = 1

    @property
    def holds(self) -> bool:
        """Whether the position is to be used: not that of still air in a wind."""
        return not self.unmodelled_because

    @property
    def margin(self) -> Margin:
        """How stable the motion predicted is: in the wind, where there is one, else `state`'s."""
        if self.in_wind is not None:
            return self.in_wind.margin
        if not self.holds:
            return Margin(MarginOf.NOT_KNOWN, because=self.unmodelled_because)
        s = self.state
        return Margin(
            MarginOf.STILL_AIR, s.margin, s.margin_per_s, s.frequency_per_s, self.nearest_loss
        )

    @property
    def settled(self) -> bool:
        """Whether this orbit has been flown for the settling time; never where nothing `holds`.

        Until then the end mass is on its way to where it is predicted.
        """
        return self.holds and self.time_on_orbit >= self.settling_time

    @property
    def excursion(self) -> float:
        """Greatest horizontal distance from `circle_center` in a turn [m]."""
        if self.in_wind is None:
            return self.state.radius
        return float(np.hypot(*(self.in_wind.path - self.circle_center)[:, :2].T).max())

    @property
    def lowest_height_above_home(self) -> float:
        """As `height_above_home`, where it is lowest in a turn; nan where nothing `holds`."""
        if not self.holds:
            return float("nan")
        if self.in_wind is None:
            return self.height_above_home
        return self.height_above_home + float(self.in_wind.path[:, 2].min() - self.position[2])

    def circle(self, count: int = 72) -> np.ndarray:
        """Positions over one orbit from now on, (count, 3) east, north, up [m].

        In wind they are those of `MotionInWind.path`.
        """
        if self.in_wind is not None:
            return self.in_wind.path
        start = self.position[:2] - self.circle_center[:2]
        # The motion about the centre is to the left of the radius if anticlockwise.
        left = self.sense * np.array([-start[1], start[0]])
        angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
        ring = np.tile(self.circle_center, (count, 1))
        ring[:, :2] += np.cos(angle) * start + np.sin(angle) * left
        return ring

    @property
    def jump_margin(self) -> float:
        """Signed change of angular rate to the nearest fold over the present rate; inf if none."""
        return self.jump_in_angular_rate.relative if self.jump_in_angular_rate else float("inf")


@dataclass(frozen=True)
class Prediction:
    """What is known after one sample. `end_mass` is None unless the prediction is valid.

    Valid means that the orbit is known and where the end mass settles on it; whether it has had
    the time to is another matter: `EndMass.settled`.

    Attributes
    ----------
    time : float
        Vehicle clock [s] of the sample.
    stamp_ns : int
        The same instant in nanoseconds since the Unix epoch.
    flight : int
        Number of the flight in the source.
    skip : SkipCode or None
        Why the sample was not used; then `orbit` and `end_mass` are None.
    orbit : Orbit or None
        The circle flown; None while not orbiting.
    tow_point : (3,) ndarray or None
        Measured tow point, east, north, up [m].
    end_mass : EndMass or None
    air_density : float
        Density used [kg/m^3]; nan where there is no orbit.
    warnings : tuple of Warning
    wind : Wind or None
        The wind believed, see `ctcbs_ros.prediction.wind_choice`.
    simulated : Simulated or None
        What the twin says; None of a sample that was skipped, or where there is no twin.
    """

    time: float
    stamp_ns: int
    flight: int
    skip: SkipCode | None
    orbit: Orbit | None
    tow_point: np.ndarray | None
    end_mass: EndMass | None
    air_density: float
    warnings: tuple[Warning, ...]
    wind: Wind | None = None
    simulated: Simulated | None = None

    @property
    def valid(self) -> bool:
        """Whether the orbit is known and a steady state on it."""
        return self.end_mass is not None

    @property
    def pose_holds(self) -> bool:
        """Whether there is an end-mass position to be used: valid, and not without its wind."""
        return self.end_mass is not None and self.end_mass.holds
