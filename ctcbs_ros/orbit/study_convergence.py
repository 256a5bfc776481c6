"""How good the orbit is while an autopilot converges onto its circle, changes or leaves it.

True is the circle that is settled upon in the end, or one that is flown on the way: with a radius
of curvature constant to 5 % for half a turn, and left no more than a quarter of a turn ago. So is,
that long, the circle before the change. Where a straight course is steered to, no other is.
"""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.orbit.circle_fit import algebraic_circle
from ctcbs_ros.orbit.coverage import in_region
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.guided_tracks import Autopilot, Loiter, Straight, guided
from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.study_cases import SEEDS
from ctcbs_ros.orbit.tracks import TURN, correlated_noise, random_circle

CASES = (
    "steered to its centre", "passing it at a tangent", "begun inside", "to another radius",
    "to another centre", "to a straight course",
)  # fmt: skip
# Bars: shares of the orbits with the radius in its 95 % interval, and the circle in its region.
LEAST_INTERVAL, LEAST_COVERED = 0.90, 0.90
_STALE = 0.25  # turns
_CONSTANT = 0.1  # spread of the radius of curvature of a circle that is flown, over it
_PHASE = 1.8  # turns after the change that are judged
_STRAIGHT, _AFTER, _BEFORE = 1.0, 2.6, 1.7  # turns flown
_EVERY = 10  # steps of the simulation a sample: 5 Hz
# Flight k has the k-th of these errors: white position and velocity, correlated position; told.
_ERRORS = (
    (1.5, 0.3, 0.0, OrbitSettings(correlated_share=0.0)),
    (0.07, 0.04, 0.29, OrbitSettings()),  # a simulator's
    (0.5, 0.3, 2.0, OrbitSettings()),  # a receiver's
)


@dataclass(frozen=True)
class Convergence:
    """Orbits given within 1.8 turns of the change; shares of them.

    Attributes
    ----------
    runs : int
    stated : float
        Share of the samples with an orbit.
    interval : float
        Radius inside its stated 95 % interval.
    covered : float
        Centre and radius inside their stated 95 % region.
    early : float
        The same from 0.3 to 0.6 turns after the change; nan where there is no orbit then.
    early_stated : float
        Share of the samples of that time with an orbit.
    settled : float
        As `covered`, if the circle settled upon alone is true.
    """

    runs: int
    stated: float
    interval: float
    covered: float
    early: float
    early_stated: float
    settled: float


def _legs(case: str, radius: float, speed: float, sense: int, rng) -> tuple:
    """Legs, turn of the last circle [s], start and course of a flight."""
    turn = TURN * radius / speed
    lead = max(6.0, 0.4 * turn)
    last = Loiter(lead + _AFTER * turn, (0.0, 0.0), radius, sense)
    if case == "steered to its centre":
        start = -rng.uniform(1.2, 3.0) * radius, rng.uniform(-0.3, 0.3) * radius
    elif case == "passing it at a tangent":
        start = -rng.uniform(-0.3, 1.0) * radius, -sense * rng.uniform(0.7, 1.2) * radius
    elif case == "begun inside":
        at, azimuth = rng.uniform(0.0, 0.7) * radius, rng.uniform(0.0, TURN)
        start = at * np.cos(azimuth), at * np.sin(azimuth)
    else:
        first = Loiter(6.0 + _BEFORE * turn, (0.0, 0.0), radius, sense)
        if case == "to a straight course":
            last = Straight(first.until + _STRAIGHT * turn, rng.uniform(-0.5, 0.5) * TURN)
        else:
            share, center = rng.choice([rng.uniform(0.65, 0.9), rng.uniform(1.1, 1.5)]), (0.0, 0.0)
            if case == "to another centre":
                share, away = rng.uniform(0.8, 1.25), rng.uniform(0.2, 1.2) * radius
                azimuth = rng.uniform(0.0, TURN)
                center = away * np.cos(azimuth), away * np.sin(azimuth)
            if speed**2 > 17.0 * share * radius:  # banked by more than 60 degrees
                share = 1.2
            turn *= share
            last = Loiter(first.until + _AFTER * turn, center, share * radius, sense)
        return [first, last], turn, (radius, 0.0), sense * TURN / 4.0
    return [Straight(lead, 0.0), last], turn, (start[0] - lead * speed, start[1]), 0.0


def converging_orbits(case: str, runs: range, seed: int = SEEDS["convergence"]) -> list:
    """For each sample of each flight after the change, how good the orbit is.

    Flight k of case j is seeded with (seed, j, k).

    Returns
    -------
    list of (float, bool, bool, bool, bool)
        Turns since the change; whether there is an orbit; whether its radius is in its interval
        and its circle in its region, and the latter of the circle settled upon alone.
    """
    rows = []
    for run in runs:
        rng = np.random.default_rng([seed, CASES.index(case), run])
        radius, speed, sense = random_circle(rng)
        legs, turn, start, course = _legs(case, radius, speed, sense, rng)
        autopilot = Autopilot(
            speed, rng.uniform(12.0, 25.0), rng.uniform(0.6, 0.9), rng.uniform(0.4, 1.0)
        )
        time, position, velocity = (x[::_EVERY] for x in guided(autopilot, legs, start, course))
        white, noise, correlated, settings = _ERRORS[run % len(_ERRORS)]
        settled = [_settled(leg, time, position, turn) for leg in legs]
        flown = flown_circles(position, velocity)
        seen = position + correlated_noise(time, correlated, 45.0, rng, 2)
        seen = seen + white * rng.standard_normal(position.shape)
        noisy = velocity + noise * rng.standard_normal(position.shape)
        estimator, sigma = OrbitEstimator(settings), float(np.hypot(white, correlated))
        for i in np.flatnonzero(time < legs[0].until + _PHASE * turn):
            orbit = estimator.add(
                time[i], np.append(seen[i], 100.0), np.append(noisy[i], 0.0), sigma, noise
            ).orbit
            since = (time[i] - legs[0].until) / turn
            if since < 0.0:
                continue
            if orbit is None:
                rows.append((since, False, False, False, False))
                continue
            true = settled if since <= _STALE else settled[1:]
            true = [circle for circle in true if circle is not None]
            rows.append((since, True, *_judged(orbit, true + flown[i]), _judged(orbit, true)[1]))
    return rows


def flown_circles(position: np.ndarray, velocity: np.ndarray) -> list[list[np.ndarray]]:
    """Circles that a track has been on for half a turn, at most a quarter of a turn ago.

    position, velocity : (n, 2) ndarray, without errors
        At equal intervals.

    Returns
    -------
    list of list of (3,) ndarray
        For each position, centres and radii.
    """
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    bend = np.gradient(course)
    length = np.hypot(*np.gradient(position, axis=0).T)
    curved = np.divide(length, bend, out=np.full(len(bend), np.inf), where=bend != 0.0)
    completed, found = [], []
    for i in range(len(position)):
        turned = np.abs(course[: i + 1] - course[i])
        before = np.flatnonzero(turned >= 0.5 * TURN)
        circle = None
        if before.size:
            half = slice(before[-1], i + 1)
            radii = curved[half]
            if np.isfinite(radii).all() and np.ptp(radii) < _CONSTANT * abs(np.mean(radii)):
                circle = algebraic_circle(position[half])
        completed.append(circle)
        left = np.flatnonzero(turned >= _STALE * TURN)
        recent = completed[left[-1] + 1 if left.size else 0 :]
        found.append([c for c in recent[::-3] if c is not None])
    return found


def _settled(leg, time, position, turn: float) -> np.ndarray | None:
    """Centre and radius over the last turn of a leg."""
    if isinstance(leg, Straight):
        return None
    on = (time > leg.until - turn) & (time < leg.until)
    return np.array([*leg.center, np.hypot(*(position[on] - leg.center).T).mean()])


def _judged(orbit, circles: list) -> tuple[bool, bool]:
    """Of the circle it is nearest to: radius in its interval, circle in its region."""
    which = [0, 1, 3, 7, 8] if np.any(orbit.drift) else [0, 1, 3]
    covariance = orbit.covariance[np.ix_(which, which)]
    state = np.array([*orbit.center[:2], orbit.radius, *orbit.drift])[: len(which)]
    errors = [state - np.append(circle, np.zeros(len(which) - 3)) for circle in circles]
    if not errors:
        return False, False
    best = min(errors, key=lambda error: error @ np.linalg.solve(covariance, error))
    return in_region(best[2:3], covariance[2:3, 2:3]), in_region(best, covariance)


def convergence(rows: list, runs: int) -> Convergence:
    """What `converging_orbits` come to."""
    since, given, interval, region, settled = np.array(rows, float).T
    given, then = given > 0.0, (since >= 0.3) & (since < 0.6)
    early = region[given & then]
    if not given.any():
        return Convergence(runs, *[0.0, np.nan, np.nan, np.nan, 0.0, np.nan])
    return Convergence(
        runs, float(np.mean(given)), float(np.mean(interval[given])),
        float(np.mean(region[given])), float(np.mean(early)) if early.size else np.nan,
        float(np.mean(given[then])), float(np.mean(settled[given])),
    )  # fmt: skip


def fly_convergence(case: str, runs: int, seed: int = SEEDS["convergence"]) -> Convergence:
    """Fly `runs` flights of a case."""
    return convergence(converging_orbits(case, range(runs), seed), runs)
