"""What a flight came to: counts of samples, skips and warnings, and the orbits that were flown."""

from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.geodesy import to_geodetic
from ctcbs_ros.orbit.segments import OrbitSegment, OrbitSegments
from ctcbs_ros.prediction.prediction import EndMassState, Margin, MarginOf, Prediction
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import finite, sense_name
from ctcbs_ros.prediction.tally import Tally
from ctcbs_ros.prediction.wind_choice import REJECTED
from ctcbs_ros.replay.moments import (
    AHEAD,
    ENDINGS,
    LOOP_POINTS,
    MARGINS_OF,
    MOTION,
    SOURCES,
    Moments,
)  # fmt: skip
from ctcbs_ros.replay.motion_kind import IN_WIND, KINDS
from ctcbs_ros.telemetry.link import LinkStatistics
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.source import LogSource
from ctcbs_ros.twin.simulated import Simulated

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
        self._moments = Moments()
        self._twin: Simulated | None = None

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self.tally.add(prediction)
        if prediction.skip is not None:
            return
        if self._first_time is None:
            self._first_time, self._first_stamp = prediction.time, prediction.stamp_ns
        self._flights.add(prediction.flight)
        self._moments.forget_after(prediction.time)
        self._segments.add(prediction.time, prediction.orbit, prediction.tow_point)
        if prediction.wind is not None and REJECTED in prediction.wind.note:
            self._winds_rejected += 1
            self._wind_rejected = prediction.wind.note.partition(REJECTED)[2]
        self._twin = prediction.simulated or self._twin
        if prediction.valid:
            self._moments.add(prediction)

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
            settled_at_s is when the end mass first counted as settled there, to 10 s (of a flight
            of more than a day to 20 s, and so on), or None.
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
            far around it on the average [m]; and when it was told, for the circle as it was then.
            predictions_outside_orbits counts those of arcs that came to no orbit, to within 10 s;
            outside_orbits_s says from when to when they are.
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
        elsewhere = self._outside(segments)
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
            "predictions_outside_orbits": int(elsewhere["count"].sum()),
            "outside_orbits_s": [self._seconds(time) for time in elsewhere["time"][[0, -1]]]
            if len(elsewhere) else None,
            "flights": len(self._flights),
            "simulation_begun_anew": losses,
        }  # fmt: skip

    def _outside(self, segments: list[OrbitSegment]) -> np.ndarray:
        """The moments of arcs that came to no orbit."""
        moments = self._moments.all
        outside = np.ones(len(moments), bool)
        for one in segments:
            outside &= (moments["time"] < one.start_time) | (moments["time"] > one.end_time)
        return moments[outside]

    def _orbit(self, segment: OrbitSegment) -> dict[str, Any]:
        here = self._moments.between(segment.start_time, segment.end_time)
        settled = here["time"][here["settled"]]
        state = None
        wind = dict.fromkeys(("wind_speed_m_s", "wind_std_m_s", "wind_from_deg", "wind_source"))
        motion = dict.fromkeys(("end_mass_motion", "wind_unmodelled_share", *MOTION))
        motion |= dict.fromkeys(("end_mass_horizontal_std_m", "end_mass_loop_m"))
        if len(here):
            newest = here[-1]
            wind, motion = _wind(newest), _motion(here)
            state = self._predictor.state_at(
                segment.radius, segment.speed, float(newest["density"]), float(newest["radius"])
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
            **_margin(state, here),
            "settled_at_s": self._seconds(settled[0]) if len(settled) else None,
            **wind,
            **motion,
            **_agreement(here),
            **self._ahead(here),
        }

    def _seconds(self, time: float) -> float | None:
        """A time since the flight began [s]; None of nan."""
        return finite(float(time) - self._first_time)

    def _ahead(self, here: np.ndarray) -> dict[str, Any]:
        """What the simulation looked ahead to on an orbit: the newest while that lay ahead."""
        told = here[here["ending"] >= 0]
        if not len(told):
            names = "ahead_ending", "ahead_told_at_s", "ahead_settles_at_s", *AHEAD
            return dict.fromkeys(names)
        newest = told[-1]
        if isfinite(newest["settles_at"]):  # once it has settled what is told is that it has
            before = told[told["settles_at"] > told["time"]]
            newest = before[-1] if len(before) else told[0]
        return {
            "ahead_ending": ENDINGS[newest["ending"]].value,
            "ahead_told_at_s": self._seconds(newest["time"]),
            "ahead_settles_at_s": self._seconds(newest["settles_at"]),
            **_named(AHEAD, newest["ahead"]),
        }

    def _latitude_longitude(self, segment: OrbitSegment) -> list[float] | None:
        datum = self._predictor.datum
        if datum is None:
            return None
        latitude, longitude, _ = to_geodetic(datum, *segment.center, segment.up)
        center = [float(latitude), float(longitude)]
        return center if all(isfinite(value) for value in center) else None


def _margin(state: EndMassState | None, here: np.ndarray) -> dict[str, Any]:
    """That of the state in still air, or the newest in wind of some moments."""
    margin = Margin(MarginOf.NOT_KNOWN)
    if state is not None and len(here):
        margin = _in_wind(here)
        if margin.of is MarginOf.STILL_AIR:
            margin = Margin(MarginOf.STILL_AIR, per_second=state.margin_per_s)
    return {
        "margin_of": margin.of.value,
        "margin_per_s": finite(margin.per_second),
        "settling_time_s": finite(margin.settling_time),
    }


def _in_wind(here: np.ndarray) -> Margin:
    """The newest margin in wind, but for what it is of where that is still air or none is."""
    newest = MARGINS_OF[here["margin_of"][-1]]
    in_wind = here[here["margin_of"] == MARGINS_OF.index(MarginOf.WIND)]
    if newest is MarginOf.STILL_AIR or not len(in_wind):
        return Margin(newest)
    return Margin(MarginOf.WIND, per_second=float(in_wind["margin"][-1]))


def _agreement(here: np.ndarray) -> dict[str, Any]:
    """How far apart simulated and predicted end mass were."""
    known = here[np.isfinite(here["apart"])]
    settled = known[known["apart_settled"]]
    moments = settled if len(settled) else known
    stated = moments["apart_stated"][np.isfinite(moments["apart_stated"])]
    apart = moments["apart"]
    return {
        "simulated_settled": bool(len(settled)) if len(moments) else None,
        "simulated_moments": len(moments),
        "simulated_apart_m": float(np.median(apart)) if len(apart) else None,
        "simulated_apart_greatest_m": float(apart.max()) if len(apart) else None,
        "simulated_apart_std": float(np.median(stated)) if len(stated) else None,
    }


def _motion(here: np.ndarray) -> dict[str, Any]:
    """What the end masses of some moments are of, and the newest in wind."""
    kinds = [KINDS[kind] for kind in here["kind"]]
    found = {
        "end_mass_motion": kinds[-1],
        "wind_unmodelled_share": float(here["not_modelled"].sum() / here["count"].sum()),
    }
    if IN_WIND not in kinds:
        spread = {"end_mass_horizontal_std_m": finite(float(here[-1]["spread"]))}
        return found | spread | dict.fromkeys((*MOTION, "end_mass_loop_m"))
    newest = here[len(kinds) - 1 - kinds[::-1].index(IN_WIND)]
    return {
        **found,
        "end_mass_motion": IN_WIND,
        "end_mass_horizontal_std_m": finite(float(newest["spread"])),
        **_named(MOTION, newest["motion"]),
        "end_mass_loop_m": _between(newest["loop"]).round(2).tolist(),
    }


def _wind(newest: np.void) -> dict[str, Any]:
    """The wind believed at a moment."""
    source = newest["wind_source"]
    return {
        "wind_speed_m_s": finite(float(newest["wind_speed"])),
        "wind_std_m_s": finite(float(newest["wind_sigma"])),
        "wind_from_deg": finite(float(newest["wind_from"])),
        "wind_source": None if source < 0 else SOURCES[source].value,
    }


def _named(names: tuple[str, ...], values: np.ndarray) -> dict[str, float | None]:
    return {name: finite(float(value)) for name, value in zip(names, values, strict=True)}


def _between(loop: np.ndarray) -> np.ndarray:
    """(`_LOOP_TOLD`, 2) points of a loop from (`LOOP_POINTS`, 2), by its harmonics."""
    harmonics = np.fft.rfft(loop, axis=0)[: LOOP_POINTS // 2]
    return np.fft.irfft(harmonics, _LOOP_TOLD, axis=0) * (_LOOP_TOLD / LOOP_POINTS)


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
            "other_systems": _by_system(link),
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
    counts = {
        "other_positions": link.other_positions,
        "other_systems": _by_system(link),
        "time_steps": dict(link.time_steps),
    }
    return {"vehicle": vehicle and asdict(vehicle), "link": counts}


def _by_system(link: LinkStatistics) -> dict[str, int]:
    """Position messages not used, by the number of the MAVLink system that sent them."""
    return {str(system): count for system, count in sorted(link.positions_of_others.items())}
