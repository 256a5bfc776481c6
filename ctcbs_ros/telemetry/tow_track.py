"""The track of a flight log in the local frame, in stretches without a gap or a jump.

Samples go the way that predictions go: screened, placed about one datum, and held against where
those before led. Nothing is filled in: what is broken ends a stretch, with the reason.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ctcbs_ros.geodesy import Datum
from ctcbs_ros.telemetry.continuity import Continuity, Track
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.screen import Screen

# Through it a cubic is off by 1 % of the radius of a turn of 20 s [s].
LONGEST_GAP = 3.0


@dataclass(frozen=True)
class Stretch:
    """Positions that lead from each to the next.

    Attributes
    ----------
    times : (n,) ndarray
        Rising, since the first believed sample [s].
    positions : (n, 3) ndarray
        East, north, up in the local frame [m].
    ended_by : str
        What broke the track after it; empty for the last.
    """

    times: np.ndarray
    positions: np.ndarray
    ended_by: str


@dataclass(frozen=True)
class TowTrack:
    """All that a log tells of the tow point's path and of the wind.

    Attributes
    ----------
    stretches : tuple of Stretch
        In order of time.
    datum : Datum or None
        Origin of the local frame; None of a log without geodetic positions.
    wind_times : (m,) ndarray
        Rising, on the same clock [s].
    wind : (m, 3) ndarray
        By the autopilot: where the air moves to, east, north, up [m/s].
    """

    stretches: tuple[Stretch, ...]
    datum: Datum | None
    wind_times: np.ndarray
    wind: np.ndarray


@dataclass
class _Open:
    """A stretch that is being read."""

    times: list[float] = field(default_factory=list)
    positions: list[np.ndarray] = field(default_factory=list)

    def closed(self, why: str) -> Stretch:
        return Stretch(np.array(self.times), np.array(self.positions).reshape(-1, 3), why)


def read_tow_track(samples: Iterable[Sample], longest_gap: float = LONGEST_GAP) -> TowTrack:
    """Read the track that a source of samples tells.

    Parameters
    ----------
    samples : iterable of Sample
        As of `ctcbs_ros.telemetry.source.open_log`. After a reboot or a step of the clock the
        times go on from those before.
    longest_gap : float
        Time between two samples that ends a stretch [s].
    """
    screen, frame, continuity = Screen(), LocalFrame(), Continuity()
    stretches, now, flight, first, last = [], _Open(), None, None, -np.inf
    wind_times, winds = [], []
    for sample in samples:
        if screen.check(sample) is not None:
            continue
        if flight is not None and (sample.flight != flight or sample.time < last):
            frame.new_flight()
            continuity.reset()
            stretches.append(now.closed("another flight begins"))
            now, first = _Open(), sample.time - (last - first)
        flight = sample.flight
        local = frame.localize(sample)
        if local is None:
            continue
        track = continuity.check(sample, local.position)
        if track is Track.STRAYS:
            continue
        first = sample.time if first is None else first
        if track is Track.BREAKS:
            stretches.append(now.closed("a jump"))
            now = _Open()
        elif now.times and sample.time - last > longest_gap:
            stretches.append(now.closed(f"a gap of {sample.time - last:.1f} s"))
            now = _Open()
        last = sample.time
        if now.times and last - first <= now.times[-1]:
            continue
        now.times.append(last - first)
        now.positions.append(local.position)
        if sample.wind is not None and (not wind_times or last - first > wind_times[-1]):
            wind_times.append(last - first)
            winds.append(sample.wind)
    stretches.append(now.closed(""))
    return TowTrack(
        tuple(s for s in stretches if len(s.times)),
        frame.datum,
        np.array(wind_times),
        np.array(winds, float).reshape(-1, 3),
    )
