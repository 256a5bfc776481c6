"""The end masses that a flight's summary is made from: one in ten seconds, in a block of memory.

Of the predictions of these the one that knows most is kept. The block holds a day; of a
longer flight every second one goes, and from then on there is one in twenty seconds, and so on.
"""

from math import inf, isfinite, nan, sqrt

import numpy as np

from ctcbs_ros.orbit.wind import WindSource
from ctcbs_ros.prediction.prediction import MarginOf, Prediction
from ctcbs_ros.replay.motion_kind import IN_WIND, KINDS, motion_kind
from ctcbs_ros.twin.look_ahead import Ending
from ctcbs_ros.twin.simulated import TwinState

EVERY = 10.0  # s of flight to a moment, at first
MOST = 8640  # moments: a day of them, 1.9 MB
SOURCES, MARGINS_OF, ENDINGS = tuple(WindSource), tuple(MarginOf), tuple(Ending)
# Where a look-ahead ends: about which place, from the circle's centre, and how far around it [m].
AHEAD = ("ahead_east_m", "ahead_north_m", "ahead_depth_m", "ahead_radius_m")
# Of the end mass's motion in wind, about the circle's centre.
MOTION = (
    "end_mass_east_m", "end_mass_north_m", "end_mass_downwind_m", "end_mass_crosswind_m",
    "end_mass_excursion_m", "end_mass_least_depth_m", "end_mass_greatest_depth_m",
    "end_mass_lowest_above_home_m",
)  # fmt: skip
LOOP_POINTS = 12  # by which the loop of that is kept

MOMENT = np.dtype([
    ("time", "f8"),  # vehicle clock [s]
    ("worth", "f4"),  # the more it is, the more is known
    ("count", "i4"),  # predictions from this one on to the next
    ("not_modelled", "i4"),  # those of them in a wind that is not modelled
    ("radius", "f4"),  # of the end mass in still air [m]
    ("density", "f4"),  # of the air [kg/m3]
    ("wind_speed", "f4"),  # [m/s]; nan, as the next two, where nobody knows
    ("wind_sigma", "f4"),
    ("wind_from", "f4"),  # [deg]; nan also in a wind weaker than its error
    ("wind_source", "i1"),  # of `SOURCES`, or -1
    ("kind", "i1"),  # of `KINDS`
    ("spread", "f4"),  # one sigma of the end mass's place [m]; nan where no pose holds
    ("motion", "f4", len(MOTION)),  # nan where there is none in the wind
    ("loop", "f4", (LOOP_POINTS, 2)),  # east and north of the circle's centre [m], likewise
    ("margin", "f4"),  # decay of a disturbance [1/s], nan where not known
    ("margin_of", "i1"),  # of `MARGINS_OF`
    ("settled", "?"),  # whether the prediction counts as settled
    # From the simulated end mass to the predicted one [m], that over what is stated of both, and
    # whether both are settled; nan where either is not known.
    ("apart", "f4"),
    ("apart_stated", "f4"),
    ("apart_settled", "?"),
    ("ending", "i1"),  # of the look-ahead, of `ENDINGS`, or -1
    ("settles_at", "f8"),  # by it, vehicle clock [s]; nan where it does not
    ("ahead", "f4", len(AHEAD)),
])  # fmt: skip


class Moments:
    """Remembers valid predictions, in constant memory.

    Parameters
    ----------
    most : int
        An even number of moments that there is room for.
    """

    def __init__(self, most: int = MOST):
        # Written to at once: memory that is only promised would be a growth of the flight's.
        self._block = np.full(most, 0, MOMENT)
        self._size = 0
        self._every, self._next_due, self._newest = EVERY, -inf, -inf

    @property
    def all(self) -> np.ndarray:
        """Moments in the order of their time, (n,) of `MOMENT`; a view."""
        return self._block[: self._size]

    def between(self, start: float, end: float) -> np.ndarray:
        """Those from a time on up to another [s]; a view."""
        first = np.searchsorted(self.all["time"], start)
        return self.all[first : np.searchsorted(self.all["time"], end, "right")]

    def forget_after(self, time: float) -> None:
        """Forget what is later than a time [s]: its time stamps were wrong."""
        if time < self._newest:
            self._size = int(np.searchsorted(self.all["time"], time, "right"))
            self._next_due = self._newest = -inf

    def add(self, prediction: Prediction) -> None:
        """Remember a valid prediction, in the place of the newest if it knows more than that."""
        kind = motion_kind(prediction)
        worth = _worth(prediction, kind)
        if not self._size or prediction.time >= self._next_due:
            if self._size == len(self._block):
                self._thin()
            self._next_due = prediction.time + self._every
            self._size += 1
            self._keep(prediction, kind, worth, (0, 0))
        elif worth > self._block["worth"][self._size - 1]:
            newest = self.all[-1]
            self._keep(prediction, kind, worth, (newest["count"], newest["not_modelled"]))
        self._block["count"][self._size - 1] += 1
        self._block["not_modelled"][self._size - 1] += not prediction.pose_holds

    def _keep(
        self, prediction: Prediction, kind: str, worth: float, counts: tuple[int, int]
    ) -> None:
        """As the newest."""
        self._block[self._size - 1] = _moment(prediction, kind, worth, counts)
        self._newest = prediction.time

    def _thin(self) -> None:
        """Keep of each two the one that knows more."""
        pairs = self._block.reshape(-1, 2)
        kept = pairs[np.arange(len(pairs)), np.argmax(pairs["worth"], axis=1)]
        for number in ("count", "not_modelled"):
            kept[number] = pairs[number].sum(axis=1)
        self._size = len(kept)
        self._block[: self._size] = kept
        self._every *= 2.0


def _worth(prediction: Prediction, kind: str) -> float:
    """By which of two predictions some seconds apart the one that knows more is told."""
    end_mass = prediction.end_mass
    return 4.0 * (kind == IN_WIND) + 2.0 * end_mass.margin.known + 1.0 * end_mass.settled


def _moment(prediction: Prediction, kind: str, worth: float, counts: tuple[int, int]) -> tuple:
    """The fields of `MOMENT`."""
    wind, end_mass = prediction.wind, prediction.end_mass
    told = wind is not None and wind.speed > wind.sigma
    ahead = prediction.simulated and prediction.simulated.settling
    return (
        prediction.time,
        worth,
        *counts,
        end_mass.state.radius,
        prediction.air_density,
        nan if wind is None else wind.speed,
        nan if wind is None else wind.sigma,
        wind.from_direction if told else nan,
        -1 if wind is None else SOURCES.index(wind.source),
        KINDS.index(kind),
        _spread(prediction),
        _motion(prediction, kind),
        _loop(prediction, kind),
        end_mass.margin.per_second,
        MARGINS_OF.index(end_mass.margin.of),
        end_mass.settled,
        *_apart(prediction),
        -1 if ahead is None else ENDINGS.index(ahead.ending),
        nan if ahead is None else ahead.settles_at,
        _place_ahead(prediction),
    )


def _spread(prediction: Prediction) -> float:
    """One sigma of the end mass's place along its worse horizontal axis [m]."""
    if not prediction.pose_holds:
        return nan
    return sqrt(np.linalg.eigvalsh(prediction.end_mass.covariance[:2, :2])[-1])


def _motion(prediction: Prediction, kind: str) -> tuple[float, ...]:
    """The numbers of `MOTION`."""
    if kind != IN_WIND:
        return (nan,) * len(MOTION)
    end_mass, wind, center = prediction.end_mass, prediction.wind, prediction.orbit.center
    east, north, _ = end_mass.circle_center - center
    off = complex(nan, nan)
    if wind.speed > wind.sigma:
        off = complex(east, north) / complex(*wind.velocity) * wind.speed
    depth = center[2] - end_mass.circle()[:, 2]
    return (
        east, north, off.real, off.imag, end_mass.excursion, depth.min(), depth.max(),
        end_mass.lowest_height_above_home,
    )  # fmt: skip


def _loop(prediction: Prediction, kind: str) -> np.ndarray:
    """(`LOOP_POINTS`, 2) east and north of the circle's centre over a turn [m]; nan as above."""
    if kind != IN_WIND:
        return np.full((LOOP_POINTS, 2), nan)
    path = prediction.end_mass.circle()[:, :2] - prediction.orbit.center[:2]
    return path[:: len(path) // LOOP_POINTS]


def _apart(prediction: Prediction) -> tuple[float, float, bool]:
    """Distance of simulated and predicted end mass [m], over their stated errors, both settled.

    Over the errors it is about 1 where they are what they are stated to be: the root mean square
    along the axes of the joint covariance, as if the two had none of their errors in common. It is
    nan where nobody knows the wind: that moves both alike, and is most of what is stated of both.
    """
    simulated, end_mass = prediction.simulated, prediction.end_mass
    if simulated is None or simulated.state is TwinState.WAITING or not end_mass.holds:
        return nan, nan, False
    apart = simulated.position - end_mass.position
    stated = nan
    if prediction.wind is not None:
        known = simulated.covariance[:3, :3] + end_mass.covariance[:3, :3]
        stated = sqrt(apart @ np.linalg.solve(known, apart) / 3.0)
    return float(np.linalg.norm(apart)), stated, simulated.valid and end_mass.settled


def _place_ahead(prediction: Prediction) -> tuple[float, ...]:
    """The numbers of `AHEAD`; nan without a look-ahead."""
    simulated, orbit = prediction.simulated, prediction.orbit
    ahead = None if simulated is None else simulated.settling
    if ahead is None:
        return (nan,) * len(AHEAD)
    # The centre as it will be, where it drifts or climbs.
    at = ahead.settles_at if isfinite(ahead.settles_at) else ahead.begun
    moved = (at - orbit.time) * np.array([*orbit.drift, orbit.climb_rate])
    east, north, up = ahead.mean - orbit.center - moved
    return east, north, -up, ahead.radius
