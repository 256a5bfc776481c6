"""The tow point's path and the wind from files: a flight log of any kind, or a CSV file."""

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctcbs_ros.errors import InputError

# A CSV file's track is as fine as its maker wanted; steps so many times the median are gaps.
_GAP = 20.0
# A step this many times as fast as the usual near it, and faster by a tow speed, is a jump.
_JUMP, _NEAR = 3.0, 11
_LOG_SMOOTH = 2.0  # s; receivers wander by more than cables bear in less


@dataclass(frozen=True)
class TowPath:
    """A path without gap or jump, in the file's units.

    Attributes
    ----------
    times : (n,) ndarray
    positions : (n, 3) ndarray
    smooth : float
        Period below which its oscillations are noise, unless the user says.
    origin : tuple of 3 floats, optional
        Latitude, longitude [deg] and altitude [m] of the origin, of a log that knows them.
    wind_times, wind : (m,) and (m, 3) ndarrays
        By a log's autopilot; empty of a CSV file.
    """

    times: np.ndarray
    positions: np.ndarray
    smooth: float
    origin: tuple[float, float, float] | None
    wind_times: np.ndarray
    wind: np.ndarray

    @property
    def speed(self) -> float:
        """Median speed."""
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        return float(np.median(steps / np.diff(self.times)))


def read_tow_path(file: str, begin: float | None, finish: float | None) -> TowPath:
    """Read a path, or the part of it between two times.

    Parameters
    ----------
    file : str
        Told by its content: CSV with columns t, x, y, z, or any log that `ctcbs replay` reads.
    begin, finish : float, optional
        Without them all of a CSV file, and of a log the longest way without gap or jump.

    Raises
    ------
    InputError
        If it cannot be read, is too short, or has a gap or a jump between the times.
    """
    names = _csv_columns(file)
    if names is None:
        return _from_log(file, begin, finish)
    _refuse_columns(file, "--track", names, ("t", "x", "y", "z"))
    rows = read_csv(file, "--track", ("t", "x", "y", "z"))
    rows = rows[_between(rows[:, 0], begin, finish)]
    if len(rows) < 4:
        raise InputError(f"--track {file}: {len(rows)} rows are not enough, 4 are needed")
    _refuse_breaks(file, rows[:, 0], rows[:, 1:])
    nothing = np.empty(0), np.empty((0, 3))
    return TowPath(rows[:, 0], rows[:, 1:], 0.0, None, *nothing)


def read_csv(file: str, flag: str, names: tuple[str, ...]) -> np.ndarray:
    """Columns of a CSV file as numbers, (n, k); z may be left out and is then 0."""
    try:
        with open(file, newline="", encoding="utf-8") as handle:
            rows = list(csv.DictReader(handle))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{flag} {file}: cannot be read: {error}") from None
    try:
        return np.array(
            [[float(row.get(n, 0.0) if n == "z" else row[n]) for n in names] for row in rows]
        ).reshape(-1, len(names))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{flag} {file}: numbers in columns {', '.join(names)} are needed ({error})"
        ) from None


def _csv_columns(file):
    """Names in the first line, or None where that is no CSV file with a column t."""
    try:
        with open(file, "rb") as handle:
            head = handle.readline(1000)
    except OSError as error:
        raise InputError(
            f"--track {file}: cannot be read: {error.strerror or error}"
        ) from None
    names = [name.strip(b" \r\n\"").decode("latin-1") for name in head.split(b",")]
    return names if "t" in names else None


def _refuse_columns(file, flag, names, wanted):
    missing = [name for name in wanted if name not in names]
    if missing:
        raise InputError(f"{flag} {file}: no column {', '.join(missing)}")


def _between(times, begin, finish):
    return (times >= (-np.inf if begin is None else begin)) & (
        times <= (np.inf if finish is None else finish)
    )


def _refuse_breaks(file, times, positions):
    gaps = np.diff(times)
    if np.any(gaps <= 0.0):
        i = int(np.argmax(gaps <= 0.0))
        raise InputError(f"--track {file}: times must rise; {times[i + 1]:g} follows {times[i]:g}")
    if not np.all(np.isfinite(positions)):
        raise InputError(f"--track {file}: positions must be finite")
    if np.any(gaps > _GAP * np.median(gaps)):
        i = int(np.argmax(gaps))
        raise InputError(f"--track {file}: a gap of {gaps[i]:g} after t = {times[i]:g}")
    speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) / gaps
    padded = np.pad(speeds, _NEAR // 2, mode="edge")
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEAR), axis=1)
    jumps = speeds > _JUMP * usual + np.median(speeds)
    if np.any(jumps):
        i = int(np.argmax(jumps))
        raise InputError(
            f"--track {file}: a jump after t = {times[i]:g}, at {speeds[i]:.4g} where "
            f"{usual[i]:.4g} is the speed about it"
        )


def _from_log(file, begin, finish):
    from ctcbs_ros.telemetry.source import open_log
    from ctcbs_ros.telemetry.tow_track import read_tow_track

    try:
        track = read_tow_track(open_log(file))
    except InputError as error:
        raise InputError(f"--track {file}: no CSV file with a column t; {error}") from None
    if not track.stretches:
        raise InputError(f"--track {file}: no position in it can be believed")
    if begin is None and finish is None:
        chosen = max(track.stretches, key=_way)
        times, positions = chosen.times, chosen.positions
        if len(track.stretches) > 1:
            print(
                f"ctcbs: {file}: {len(track.stretches)} stretches without gap or jump; flown is "
                f"the longest, --from {times[0]:.1f} --to {times[-1]:.1f}", file=sys.stderr,
            )
    else:
        times, positions = _asked_for(file, track.stretches, begin, finish)
    if len(times) < 5:
        raise InputError(f"--track {file}: {len(times)} positions are not enough, 5 are needed")
    datum = track.datum
    origin = None if datum is None else (datum.latitude, datum.longitude, datum.altitude)
    return TowPath(times, positions, _LOG_SMOOTH, origin, track.wind_times, track.wind)


def _way(stretch):
    return np.linalg.norm(np.diff(stretch.positions, axis=0), axis=1).sum()


def _asked_for(file, stretches, begin, finish):
    last = stretches[-1].times[-1]
    if begin is not None and begin >= last:
        raise InputError(f"--from {begin:g}: {Path(file).name} ends at {last:.1f} s")
    within = [(s, _between(s.times, begin, finish)) for s in stretches]
    within = [(s, inside) for s, inside in within if inside.any()]
    if not within:
        raise InputError(f"--track {file}: no position between --from and --to")
    if len(within) > 1:
        ended = within[0][0]
        raise InputError(
            f"--track {file}: {ended.ended_by} after t = {ended.times[-1]:.1f} s; the longest way "
            "without is taken where neither --from nor --to is given"
        )
    stretch, inside = within[0]
    return stretch.times[inside], stretch.positions[inside]
