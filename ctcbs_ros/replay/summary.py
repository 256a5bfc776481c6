"""What a flight came to: counts of samples, skips and warnings, and the orbits that were flown."""

from array import array
from bisect import bisect_left, bisect_right
from dataclasses import asdict
from math import inf, isfinite, nan, sqrt
from statistics import median
from typing import Any

import numpy as np

from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.geodesy import to_geodetic
from ctcbs_ros.orbit.segments import OrbitSegment, OrbitSegments
from ctcbs_ros.orbit.wind import WindSource
from ctcbs_ros.prediction.prediction import EndMassState, Margin, MarginOf, Prediction
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import finite, sense_name
from ctcbs_ros.prediction.tally import Tally
from ctcbs_ros.prediction.wind_choice import REJECTED
from ctcbs_ros.replay.motion_kind import IN_WIND, KINDS, motion_kind
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.source import LogSource
from ctcbs_ros.twin.look_ahead import Ending
from ctcbs_ros.twin.simulated import Simulated, TwinState

# Seconds between the end masses remembered for the orbits; a day's flight then takes 2 MB.
REMEMBERED_EVERY = 10.0
_SOURCES = tuple(WindSource)
_MARGINS_OF = tuple(MarginOf)
_ENDINGS = tuple(Ending)
# Where a look-ahead ends: about which place, from the circle's centre, and how far around it [m].
_AHEAD = ("ahead_east_m", "ahead_north_m", "ahead_depth_m", "ahead_radius_m")
# Of the end mass's motion in wind, about the circle's centre.
_MOTION = (
    "end_mass_east_m", "end_mass_north_m", "end_mass_downwind_m", "end_mass_crosswind_m",
    "end_mass_horizontal_std_m", "end_mass_excursion_m", "end_mass_least_depth_m",
    "end_mass_greatest_depth_m", "end_mass_lowest_above_home_m",
)  # fmt: skip
# Its loop is remembered by so many points, in steps of so much [m] and no more of them.
_LOOP_POINTS, _LOOP_STEP, _FARTHEST = 12, 0.1, 32_000
_LOOP_TOLD = 24  # points of a loop in the summary; those between are of its harmonics up to 5


class Summary:
    """Gathers the summary of a flight from its predictions, in constant memory but for the orbits.

    Parameters
    ----------
    predictor : Predictor
        The one that makes the predictions.
    """

    def __init__(self, predictor: Predictor):
        self.tally = Tally()
        self._predictor = predictor
        self._segments = OrbitSegments()
        self._first_time: float | None = None
        self._first_stamp: int | None = None
        # The autopilot's wind where the flight shows another: samples, and the newest in words.
        self._winds_rejected, self._wind_rejected = 0, ""
        self._flights: set[int] = set()
        # End masses of the flight, thinned: time, radius of the end mass, density of the air.
        self._times, self._radii, self._densities = array("d"), array("f"), array("f")
        # Wind of each: speed, where from [deg], nan where not known; its source by number, or -1.
        self._winds, self._directions, self._sources = array("f"), array("f"), array("b")
        self._wind_sigmas = array("f")
        # Predictions from each on to the next, and those of them in a wind that is not modelled.
        self._counts, self._not_modelled = array("i"), array("i")
        # What each is of (`KINDS`); its motion in the wind (`_MOTION`), nan where there is none,
        # with its loop seen from above: east and north of the circle's centre.
        self._kinds, self._motions, self._loops = array("b"), array("f"), array("h")
        # How fast a disturbance decays [1/s], nan where not known; in what, by number.
        self._margins, self._margins_of = array("f"), array("b")
        self._settled = array("b")  # whether it counts as settled
        # Distance of the simulated end mass from the predicted one, that over what is stated of
        # both, and whether both are settled; nan where either is not known.
        self._apart, self._apart_stated, self._apart_settled = array("f"), array("f"), array("b")
        # What the look-ahead comes to, by number, or -1; when it settles, nan where it does not.
        self._endings, self._settles_at = array("b"), array("d")
        self._places_ahead = array("f")  # `_AHEAD`
        # The newest may give way to one that knows more, until the next is due.
        self._newest_worth, self._next_due = inf, -inf
        self._twin: Simulated | None = None

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self.tally.add(prediction)
        if prediction.skip is not None:
            return
        if self._first_time is None:
            self._first_time, self._first_stamp = prediction.time, prediction.stamp_ns
        self._flights.add(prediction.flight)
        while self._times and self._times[-1] > prediction.time:  # of time stamps that were wrong
            self._forget_newest()
            self._newest_worth, self._next_due = inf, -inf
        self._segments.add(prediction.time, prediction.orbit, prediction.tow_point)
        if prediction.wind is not None and REJECTED in prediction.wind.note:
            self._winds_rejected += 1
            self._wind_rejected = prediction.wind.note.partition(REJECTED)[2]
        self._twin = prediction.simulated or self._twin
        if prediction.valid:
            self._take(prediction)

    def _take(self, prediction: Prediction) -> None:
        """Remember a valid prediction, in the place of the newest if it knows more than that."""
        kind = motion_kind(prediction)
        worth = _worth(prediction, kind)
        if not self._times or prediction.time >= self._next_due:
            self._remember(prediction, kind, (0, 0))
            self._newest_worth, self._next_due = worth, prediction.time + REMEMBERED_EVERY
        elif worth > self._newest_worth:
            counts = self._counts[-1], self._not_modelled[-1]
            self._forget_newest()
            self._remember(prediction, kind, counts)
            self._newest_worth = worth
        self._counts[-1] += 1
        self._not_modelled[-1] += not prediction.pose_holds

    def _forget_newest(self) -> None:
        for remembered in (
            self._times, self._radii, self._densities,
            self._winds, self._wind_sigmas, self._directions, self._sources, self._apart,
            self._kinds,
            self._counts, self._not_modelled, self._apart_stated, self._apart_settled,
            self._margins, self._margins_of, self._settled, self._endings, self._settles_at,
        ):  # fmt: skip
            remembered.pop()
        del self._motions[-len(_MOTION) :]
        del self._places_ahead[-len(_AHEAD) :]
        del self._loops[-2 * _LOOP_POINTS :]

    def _remember(self, prediction: Prediction, kind: str, counts: tuple[int, int]) -> None:
        self._times.append(prediction.time)
        self._radii.append(prediction.end_mass.state.radius)
        self._densities.append(prediction.air_density)
        wind = prediction.wind
        self._winds.append(nan if wind is None else wind.speed)
        self._wind_sigmas.append(nan if wind is None else wind.sigma)
        told = wind is not None and wind.speed > wind.sigma
        self._directions.append(wind.from_direction if told else nan)
        self._sources.append(-1 if wind is None else _SOURCES.index(wind.source))
        self._kinds.append(KINDS.index(kind))
        self._motions.extend(_motion(prediction, kind))
        self._loops.extend(_loop(prediction, kind))
        self._margins.append(prediction.end_mass.margin.per_second)
        self._margins_of.append(_MARGINS_OF.index(prediction.end_mass.margin.of))
        self._settled.append(prediction.end_mass.settled)
        apart, stated, settled = _apart(prediction)
        self._apart.append(apart)
        self._apart_stated.append(stated)
        self._apart_settled.append(settled)
        ahead = prediction.simulated and prediction.simulated.settling
        self._endings.append(-1 if ahead is None else _ENDINGS.index(ahead.ending))
        self._settles_at.append(nan if ahead is None else ahead.settles_at)
        self._places_ahead.extend(_place_ahead(prediction))
        self._counts.append(counts[0])
        self._not_modelled.append(counts[1])

    def finish(self) -> dict[str, Any]:
        """The summary, ready for JSON.

        Returns
        -------
        dict
            samples, predictions, skipped, warnings, wind_seen (of the samples warned of wind,
            those where there is some), wind_unmodelled_because (of the predictions in a wind
            whose motion is not known, how many for each reason), start: what is second 0, the
            first believed sample, by the vehicle's clock and by its stamp (None where none was
            believed),
            autopilot_wind_rejected: samples at which the flight showed another wind than the
            autopilot, and the newest of the autopilot's in words, and orbits: for each its start
            and end in seconds, turns, radius, speed, sense, centre, and the
            end mass's radius, depth, margin and settling time, which are None where no state was
            found or none settles, and the wind at its end, None where nobody knew.
            settled_at_s is when the end mass first counted as settled there, to 10 s, or None.
            Radius and depth are always those of still air, margin and settling time those that
            margin_of says: "still air", or the newest of "wind", or else "not known" in it, then
            they are None.
            end_mass_motion says what holds: "still air"; "still air, wind not known", if there is
            none; "still air, wind not modelled": nothing; or "in wind": not radius and depth, but
            the newest motion. wind_unmodelled_share is the share of the predictions of which
            nothing holds. Of the newest motion in wind there are: where its mean is from the
            circle's centre, east and north, downwind and across to the left of that (None in a
            wind weaker than its error),
            the standard deviation of the end mass in the worst horizontal direction, how far it
            goes from the mean, its least and greatest depth and its least height above home [m],
            and its loop seen from above, east and north of the circle's centre [m]; otherwise
            they are None. How far the
            simulated end mass was from the predicted one at moments at which both were settled,
            or, where there are none, on the way to it (whether settled, number of moments, median
            and greatest distance, and the median of that over the joint standard deviation,
            which is None where nobody knew the wind).
            What the simulation's look-ahead came to, and from when on the end mass would be within
            5 % of the tow radius of where it settles for good [s], None where it would not be;
            about which place that is, east and north of the circle's centre and below it, and how
            far around it on the average [m].
            predictions_outside_orbits counts those of arcs that came to no orbit, to within 10 s.
            flights counts the boots of the vehicle that gave believed samples;
            simulation_begun_anew says why the twin was, and how often, None where there is none.

        Notes
        -----
        An orbit's start and end are those of the circle as it is found with hindsight: it begins
        where the track comes onto it. Predictions begin when half a turn has shown it, and may end
        a quarter of a turn late.
        """
        segments = self._segments.finish()
        orbits = [self._orbit(segment) for segment in segments]
        elsewhere = sum(
            count
            for time, count in zip(self._times, self._counts, strict=True)
            if not any(one.start_time <= time <= one.end_time for one in segments)
        )
        losses = None
        if self._twin is not None:
            losses = {why.value: count for why, count in self._twin.losses.items()}
        return {
            **self.tally.as_dict(),
            "start": {"vehicle_time_s": self._first_time, "stamp_ns": self._first_stamp},
            "autopilot_wind_rejected": {
                "samples": self._winds_rejected, "newest": self._wind_rejected or None,
            },
            "orbits": orbits,
            "predictions_outside_orbits": elsewhere,
            "flights": len(self._flights),
            "simulation_begun_anew": losses,
        }  # fmt: skip

    def _orbit(self, segment: OrbitSegment) -> dict[str, Any]:
        state = None
        first = bisect_left(self._times, segment.start_time)
        last = bisect_right(self._times, segment.end_time) - 1
        wind = dict.fromkeys(("wind_speed_m_s", "wind_std_m_s", "wind_from_deg", "wind_source"))
        motion = dict.fromkeys(("end_mass_motion", "wind_unmodelled_share", *_MOTION))
        motion["end_mass_loop_m"] = None
        if last >= first:
            wind, motion = self._wind(last), self._motion(first, last)
            state = self._predictor.state_at(
                segment.radius,
                segment.speed,
                self._densities[last],
                self._radii[last],
            )
        return {
            "start_s": segment.start_time - self._first_time,
            "end_s": segment.end_time - self._first_time,
            "turns": segment.turns,
            "radius_m": segment.radius,
            "speed_m_s": segment.speed,
            "sense": sense_name(segment.sense),
            "center": self._latitude_longitude(segment),
            "end_mass_radius_m": finite(state.radius) if state else None,
            "end_mass_depth_m": finite(state.depth) if state else None,
            **self._margin(state, first, last),
            **wind,
            **motion,
            **self._agreement(first, last),
            **self._ahead(first, last),
        }

    def _margin(self, state: EndMassState | None, first: int, last: int) -> dict[str, Any]:
        """That of the state in still air, or the newest in wind between two end masses."""
        margin = Margin(MarginOf.NOT_KNOWN)
        if state is not None and last >= first:
            margin = Margin(MarginOf.STILL_AIR, per_second=state.margin_per_s)
            newest = _MARGINS_OF[self._margins_of[last]]
            for number in range(last, first - 1, -1):
                if newest is MarginOf.STILL_AIR:
                    break
                margin = Margin(
                    _MARGINS_OF[self._margins_of[number]], per_second=self._margins[number]
                )
                if margin.of is MarginOf.WIND:
                    break
            else:
                margin = Margin(newest)
        return {
            "margin_of": margin.of.value,
            "margin_per_s": finite(margin.per_second),
            "settling_time_s": finite(margin.settling_time),
            "settled_at_s": self._settled_at(first, last),
        }

    def _settled_at(self, first: int, last: int) -> float | None:
        """From when on the end mass counted as settled on an orbit; None where it never did."""
        for number in range(first, last + 1):
            if self._settled[number]:
                return self._times[number] - self._first_time
        return None

    def _agreement(self, first: int, last: int) -> dict[str, Any]:
        """How far apart simulated and predicted end mass were on an orbit."""
        here = [i for i in range(first, last + 1) if isfinite(self._apart[i])]
        settled = [i for i in here if self._apart_settled[i]]
        moments = settled or here
        apart = [self._apart[i] for i in moments]
        stated = [self._apart_stated[i] for i in moments if isfinite(self._apart_stated[i])]
        return {
            "simulated_settled": bool(settled) if moments else None,
            "simulated_moments": len(apart),
            "simulated_apart_m": median(apart) if apart else None,
            "simulated_apart_greatest_m": max(apart) if apart else None,
            "simulated_apart_std": median(stated) if stated else None,
        }

    def _ahead(self, first: int, last: int) -> dict[str, Any]:
        """What the simulation looked ahead to on an orbit: the newest while that lay ahead."""
        told = [i for i in range(first, last + 1) if self._endings[i] >= 0]
        before = [i for i in told if self._settles_at[i] > self._times[i]]
        if not told:
            return dict.fromkeys(("ahead_ending", "ahead_settles_at_s", *_AHEAD))
        # Once it has settled what is told is that it has.
        newest = told[-1]
        if isfinite(self._settles_at[newest]):
            newest = before[-1] if before else told[0]
        place = self._places_ahead[newest * len(_AHEAD) : (newest + 1) * len(_AHEAD)]
        return {
            "ahead_ending": _ENDINGS[self._endings[newest]].value,
            "ahead_settles_at_s": finite(self._settles_at[newest] - self._first_time),
            **{name: finite(value) for name, value in zip(_AHEAD, place, strict=True)},
        }

    def _motion(self, first: int, last: int) -> dict[str, Any]:
        """What the end masses between two remembered ones are of, and the newest in wind."""
        orbit = slice(first, last + 1)
        kinds = [KINDS[kind] for kind in self._kinds[orbit]]
        found = {
            "end_mass_motion": kinds[-1],
            "wind_unmodelled_share": sum(self._not_modelled[orbit]) / sum(self._counts[orbit]),
        }
        if IN_WIND not in kinds:
            return found | dict.fromkeys((*_MOTION, "end_mass_loop_m"))
        newest = last - kinds[::-1].index(IN_WIND)
        size, points = len(_MOTION), 2 * _LOOP_POINTS
        motion = self._motions[newest * size : (newest + 1) * size]
        loop = _LOOP_STEP * np.array(self._loops[newest * points : (newest + 1) * points])
        return {
            **found,
            "end_mass_motion": IN_WIND,
            **{name: finite(value) for name, value in zip(_MOTION, motion, strict=True)},
            "end_mass_loop_m": _between(loop.reshape(-1, 2)).round(2).tolist(),
        }

    def _wind(self, number: int) -> dict[str, Any]:
        """The wind believed at the newest end mass of an orbit."""
        source = self._sources[number]
        return {
            "wind_speed_m_s": finite(self._winds[number]),
            "wind_std_m_s": finite(self._wind_sigmas[number]),
            "wind_from_deg": finite(self._directions[number]),
            "wind_source": None if source < 0 else _SOURCES[source].value,
        }

    def _latitude_longitude(self, segment: OrbitSegment) -> list[float] | None:
        datum = self._predictor.datum
        if datum is None:
            return None
        latitude, longitude, _ = to_geodetic(datum, *segment.center, segment.up)
        center = [float(latitude), float(longitude)]
        return center if all(isfinite(value) for value in center) else None


def _worth(prediction: Prediction, kind: str) -> float:
    """By which of two predictions some seconds apart the one that knows more is told."""
    end_mass = prediction.end_mass
    return 4.0 * (kind == IN_WIND) + 2.0 * end_mass.margin.known + 1.0 * end_mass.settled


def _motion(prediction: Prediction, kind: str) -> tuple[float, ...]:
    """The numbers of `_MOTION`."""
    if kind != IN_WIND:
        return (nan,) * len(_MOTION)
    end_mass, wind, center = prediction.end_mass, prediction.wind, prediction.orbit.center
    east, north, _ = end_mass.circle_center - center
    off = complex(nan, nan)
    if wind.speed > wind.sigma:
        off = complex(east, north) / complex(*wind.velocity) * wind.speed
    spread = sqrt(np.linalg.eigvalsh(end_mass.covariance[:2, :2])[-1])
    depth = center[2] - end_mass.circle()[:, 2]
    return (
        east, north, off.real, off.imag, spread, end_mass.excursion, depth.min(), depth.max(),
        end_mass.lowest_height_above_home,
    )  # fmt: skip


def _place_ahead(prediction: Prediction) -> tuple[float, ...]:
    """The numbers of `_AHEAD`; nan without a look-ahead."""
    simulated, orbit = prediction.simulated, prediction.orbit
    ahead = None if simulated is None else simulated.settling
    if ahead is None:
        return (nan,) * len(_AHEAD)
    # The centre as it will be, where it drifts or climbs.
    at = ahead.settles_at if isfinite(ahead.settles_at) else ahead.begun
    moved = (at - orbit.time) * np.array([*orbit.drift, orbit.climb_rate])
    east, north, up = ahead.mean - orbit.center - moved
    return east, north, -up, ahead.radius


def _loop(prediction: Prediction, kind: str) -> list[int]:
    """East and north of the circle's centre over a turn, in turn, in steps of `_LOOP_STEP`."""
    if kind != IN_WIND:
        return [0] * (2 * _LOOP_POINTS)
    path = prediction.end_mass.circle()[:, :2] - prediction.orbit.center[:2]
    steps = path[:: len(path) // _LOOP_POINTS].ravel() / _LOOP_STEP
    return np.clip(np.nan_to_num(steps), -_FARTHEST, _FARTHEST).astype(int).tolist()


def _between(loop: np.ndarray) -> np.ndarray:
    """(`_LOOP_TOLD`, 2) points of a loop from (`_LOOP_POINTS`, 2), by its harmonics."""
    harmonics = np.fft.rfft(loop, axis=0)[: _LOOP_POINTS // 2]
    return np.fft.irfft(harmonics, _LOOP_TOLD, axis=0) * (_LOOP_TOLD / _LOOP_POINTS)


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


def source_counts(source: LogSource | LiveSource) -> dict[str, Any]:
    """What a MAVLink source says about itself: its vehicle, and what was lost on the link."""
    link, vehicle = source.link, source.vehicle
    return {
        "vehicle": vehicle and asdict(vehicle),
        "link": {
            "messages": link.messages,
            "lost": sum(link.lost.values()),
            "repeated": sum(link.repeated.values()),
            "bad_runs": link.bad_runs,
            "bad_bytes": link.bad_bytes,
            "other_positions": link.other_positions,
            "time_steps": dict(link.time_steps),
        },
    }


def beacon_counts(source: LogSource | LiveSource, tally: BeaconTally | None) -> dict[str, Any]:
    """What the payload's beacon came to, under "beacon": None where there is none.

    Returns
    -------
    dict
        "vehicle" (None of a topic), "link" (None of a topic), and `BeaconTally.as_dict`.
    """
    if tally is None:
        return {"beacon": None}
    return {"beacon": beacon_link(source) | tally.as_dict()}


def beacon_link(source: LogSource | LiveSource) -> dict[str, Any]:
    """What a source says about the beacon itself: its MAVLink system, and its clock."""
    vehicle, link = source.beacon, source.beacon_link
    if link is None:
        return {"vehicle": None, "link": None}
    counts = {"other_positions": link.other_positions, "time_steps": dict(link.time_steps)}
    return {"vehicle": vehicle and asdict(vehicle), "link": counts}
