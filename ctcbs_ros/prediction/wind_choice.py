"""Whose wind is believed: the autopilot's, the one that the flight shows, or the user's.

The rule, in this order:

1. the autopilot's, while it is fresh, unless the flight shows another one;
2. the flight's own, while its standard deviation is below a limit;
3. the one set by parameters;
4. the flight's own while it is known at all;
5. none.

An autopilot's wind without a stated error is known no better than it has changed lately: an
estimate that begins at nought, or at the wind of another height, takes some turns to converge.
"""

from collections import deque
from dataclasses import replace
from math import cos, hypot, isfinite, radians, sin

import numpy as np

from ctcbs_ros.configuration import SetWind
from ctcbs_ros.orbit.wind import Wind, WindSource, contradict, worst_sigma
from ctcbs_ros.orbit.wind_of_turn import FlightWind

# Age of an autopilot's wind up to which it is fresh [s].
FRESH = 10.0
# Standard deviation of one axis of an autopilot's wind where it states none (WIND) [m/s].
AUTOPILOT_SIGMA = 1.5
# Time over which its changes count as its error as well, and the least between two kept [s].
_RECENT, _APART = 60.0, 2.0
# Standard deviation up to which the flight's own wind is preferred to the user's, and up to which
# it is known at all: an autopilot that it contradicts is not believed again as soon as it ages.
MOST_SIGMA, KEPT_SIGMA = 1.5, 2.5  # [m/s]
# Growth of its variance with its age, 1 m/s in 100 s [(m/s)^2/s].
_AGEING = 0.01
# In the note of a flight's wind, before that of an autopilot which it contradicts.
REJECTED = "the autopilot says "


class WindChoice:
    """Keeps what the autopilot, the flight and the user say of the wind.

    Parameters
    ----------
    by_user : Wind, optional
    """

    def __init__(self, by_user: Wind | None = None):
        self._by_user = by_user
        self.reset()

    def reset(self) -> None:
        """Forget what was said and shown: another flight."""
        self._by_autopilot: Wind | None = None
        self._told_at = -np.inf
        # What it said lately without an error: time, east, north; and by how much it has changed.
        self._said: deque[tuple[float, float, float]] = deque(maxlen=int(_RECENT / _APART) + 1)
        self._changed = 0.0
        self._by_flight: FlightWind | None = None

    def told(self, time: float, velocity, sigma: float) -> None:
        """Take in the autopilot's wind.

        Parameters
        ----------
        time : float
            [s]
        velocity : sequence of float
            Of the air, towards east, north [m/s]. Nought is what autopilots send that know none.
        sigma : float
            Standard deviation of one axis [m/s]; nan where it is not stated.
        """
        east, north = velocity[:2]
        if not isfinite(east + north) or (east == 0.0 and north == 0.0):
            return
        stated = 0.0 < sigma < np.inf
        self._changed = 0.0 if stated else self._change(time, east, north)
        sigma = sigma if stated else AUTOPILOT_SIGMA
        self._by_autopilot = Wind(
            np.array([east, north]), sigma**2 * np.eye(2), WindSource.AUTOPILOT
        )
        self._told_at = time

    def _change(self, time: float, east: float, north: float) -> float:
        """Largest difference to what the autopilot said lately [m/s]."""
        said = self._said
        if said and time < said[-1][0]:
            said.clear()
        while said and time - said[0][0] > _RECENT:
            said.popleft()
        if not said or time - said[-1][0] >= _APART:
            said.append((time, east, north))
        return max(hypot(east - e, north - n) for _, e, n in said)

    def shown(self, wind: FlightWind | None) -> None:
        """Take in what the present turn shows; None where it shows nothing."""
        if wind is not None and worst_sigma(wind.covariance) <= MOST_SIGMA:
            self._by_flight = wind

    def at(self, time: float) -> Wind | None:
        """The wind believed at a time [s]; None where nobody knows."""
        flight = self._of_flight(time)
        autopilot = self._by_autopilot if time - self._told_at <= FRESH else None
        # Whether it is contradicted is asked of what it says, not of what it may become.
        believed = None if autopilot is None else _widened(autopilot, self._changed)
        if autopilot is not None and flight is not None:
            if not contradict(autopilot, flight):
                return _noted(believed, f"the flight shows {described(flight)}")
            note = f"{flight.note}; {REJECTED}{described(autopilot)}"
            opposite = _turned(autopilot)
            if not contradict(opposite, flight):
                note += ", the opposite: where it blows to"
            return _noted(self._but_of_autopilot(flight), note)
        return believed or self._but_of_autopilot(flight)

    def _but_of_autopilot(self, flight: Wind | None) -> Wind | None:
        if flight is not None and worst_sigma(flight.covariance) <= MOST_SIGMA:
            return flight
        return self._by_user or flight

    def _of_flight(self, time: float) -> Wind | None:
        shown = self._by_flight
        if shown is None:
            return None
        age = max(0.0, time - shown.time)
        covariance = shown.covariance + _AGEING * age * np.eye(2)
        if worst_sigma(covariance) > KEPT_SIGMA:
            return None
        note = ", ".join(filter(None, (shown.relation, shown.note)))
        return Wind(shown.velocity, covariance, WindSource.FLIGHT, note)


def user_wind(wind: SetWind) -> Wind | None:
    """The wind set by parameters; None where it is not."""
    if not isfinite(wind.speed):
        return None
    blows_from = radians(wind.from_direction)
    velocity = -wind.speed * np.array([sin(blows_from), cos(blows_from)])
    return Wind(velocity, wind.accuracy**2 * np.eye(2), WindSource.PARAMETER)


def described(wind: Wind) -> str:
    """Strength of a wind in words, and its direction where it is stronger than its error."""
    origin = f" from {round(wind.from_direction) % 360} deg" if wind.speed > wind.sigma else ""
    return f"{wind.speed:.1f} m/s{origin}"


def _noted(wind: Wind, note: str) -> Wind:
    return Wind(wind.velocity, wind.covariance, wind.source, note)


def _widened(wind: Wind, changed: float) -> Wind:
    return replace(wind, covariance=wind.covariance + changed**2 * np.eye(2))


def _turned(wind: Wind) -> Wind:
    return Wind(-wind.velocity, wind.covariance, wind.source)
