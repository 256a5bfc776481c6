"""How well the twin's stated errors hold: simulated flights, and a finer cable for the truth.

The receiver's error is a constant of a flight and white noise beside it, the wind told is off by a
constant: what stays through a flight is what no filter takes out, and each flight is one draw of
it alone. A dozen flights tell little, so these errors are spread evenly (a shifted Halton
sequence). The truth is another cable, of more segments, with no damping but its own, in one run in
the ground's axes along the true path, with a hundredth of the twin's tolerance.
"""

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
from scipy.special import ndtri
from scipy.stats.qmc import Halton

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.equilibrium import trailing
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.orbit.coverage import in_region, missed_coverage
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.simulated_flight import SimulatedFlight, simulate_flight
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.twin.simulated import TwinState
from ctcbs_ros.twin.simulated_cable import elastic

SEED = 9
# Of a position, its part that stays and its white part [m]; of a velocity [m/s]; of the wind told
# [m/s]; all along one axis.
STAYS, WHITE, VELOCITY, WIND = 1.45, 0.4, 0.3, 0.4
_STATED = sqrt(STAYS**2 + WHITE**2)
# Samples a second, and of the true path.
_RATE, _PATH_RATE = 2.5, 5.0
_TURNS = 4.0
SEGMENTS, _TOLERANCE = 40, 1e-4
# Winds [m/s], and whether the log begins in straight flight or on the circle.
CASES = {
    f"{wind}, from {'straight flight' if straight else 'the circle'}": (bounds, straight)
    for wind, bounds in (
        ("still air", (0.0, 0.0)), ("wind 1 to 4 m/s", (1.0, 4.0)),
        ("wind 4 to 8 m/s", (4.0, 8.0)),
    )
    for straight in (True, False)
}  # fmt: skip
# Share inside the 95 % region once it is valid, and until then, when it may be too careful.
_BAR, _BAR_BEFORE, _BAR_SQUARE = (0.93, 0.99), (0.93, 1.0), 0.6


@dataclass(frozen=True)
class Course:
    """A flight's twin beside the truth, sample by sample where it has a position.

    Attributes
    ----------
    valid : (n,) ndarray of bool
    off : (n, 3) ndarray
        Twin less truth [m].
    covariance : (n, 3, 3) ndarray
        Stated [m^2].
    waited : float
        From the first position until it is valid [s]; nan where it never is.
    """

    valid: np.ndarray
    off: np.ndarray
    covariance: np.ndarray
    waited: float


@dataclass(frozen=True)
class Coverage:
    """Flights of a case.

    Attributes
    ----------
    runs, valid : int
        Flights, and those whose twin is valid at some time.
    waited : float
        Median time from the first position until then [s].
    error, stated : float
        Medians over the samples once it is valid: distance from the truth, and the square root of
        the stated variances' sum [m].
    covered, covered_before : float
        Share of the samples with the truth inside the stated 95 % region, since it is valid and
        until then; every flight counts as much.
    square : float
        Mean squared distance in stated standard deviations since it is valid; 3 if they are right.
    """

    runs: int
    valid: int
    waited: float
    error: float
    stated: float
    covered: float
    covered_before: float
    square: float


def course(case: str, run: int, seed: int = SEED) -> Course:
    """Fly a flight of a case: small drone, 50 to 90 m, 16 to 24 m/s, either sense.

    Flight k is seeded with (seed, k, case).
    """
    (low, high), straight = CASES[case]
    rng = np.random.default_rng([seed, run, list(CASES).index(case)])
    radius, speed, strength = rng.uniform(50, 90), rng.uniform(16, 24), rng.uniform(low, high)
    towards, sense = rng.uniform(0.0, 2.0 * pi), int(rng.choice([1, -1]))
    air = (strength * cos(towards), strength * sin(towards))
    flight = simulate_flight(radius, speed, _TURNS, sense=sense, wind=air, rate=_PATH_RATE)
    truth = true_places(flight, air)
    on_circle = np.flatnonzero(np.isfinite(flight.radius))
    first = 0 if straight else on_circle[0]
    kept = np.arange(first, on_circle[-1], round(_PATH_RATE / _RATE))
    predictor = Predictor(load_configuration("small_drone"), with_twin=True)
    valid, off, covariance, times = [], [], [], []
    lasting = _lasting(case, run, seed)
    for sample, there in zip(_told(flight, air, kept, lasting, rng), truth[kept], strict=True):
        found = predictor.update(sample).simulated
        if found is None or found.state is TwinState.WAITING:
            continue
        times.append(sample.time)
        valid.append(found.valid)
        off.append(found.position - there)
        covariance.append(found.covariance[:3, :3])
    waited = times[valid.index(True)] - times[0] if any(valid) else np.nan
    return Course(
        np.array(valid, bool), np.reshape(off, (-1, 3)), np.reshape(covariance, (-1, 3, 3)),
        waited,
    )  # fmt: skip


def true_places(flight: SimulatedFlight, air) -> np.ndarray:
    """The end mass by a finer cable in one run along the true path, from trailing behind: (n, 3).

    It has none of what is the twin's own: axes, tolerance, damping, path.
    """
    # Any radius does: the line in SI has none.
    point = flight_point(load_configuration("small_drone"), 60.0, flight.airspeed, 1.225)
    line = line_of(elastic(point.parameters)).scaled(
        point.radius, 1.0 / point.angular_rate, point.mass_per_length * point.radius
    )
    wind = (*air, 0.0)
    begun = trailing(line, SEGMENTS, flight.position[0], flight.velocity[0], wind)
    begun = CableState(float(flight.time[0]), begun.positions, begun.velocities)
    driven = drive(line, spline(flight.time, flight.position), constant(wind))
    return simulate(line, driven, begun, flight.time, _TOLERANCE).positions[:, 0]


def _lasting(case: str, run: int, seed: int) -> np.ndarray:
    """Errors that stay through a flight, of the place [m] and of the wind told [m/s], (5,)."""
    shift = np.random.default_rng([seed, list(CASES).index(case)]).random(5)
    even = Halton(5, scramble=False).random(run + 1)[-1]
    drawn = ndtri(np.clip((even + shift) % 1.0, 1e-9, 1.0 - 1e-9))
    return drawn * [STAYS, STAYS, STAYS, WIND, WIND]


def _told(flight: SimulatedFlight, air, kept, lasting, rng):
    """Samples of a flight, with errors."""
    stays, off = lasting[:3], lasting[3:]
    wind = (air[0] + off[0], air[1] + off[1], 0.0)
    for i in kept:
        place = flight.position[i] + stays + WHITE * rng.standard_normal(3)
        velocity = flight.velocity[i] + VELOCITY * rng.standard_normal(3)
        time = float(flight.time[i])
        yield Sample(
            time, round(1e9 * time), 0, local_position=tuple(place.tolist()),
            velocity=tuple(velocity.tolist()), wind=wind, wind_accuracy=WIND,
            horizontal_accuracy=_STATED, speed_accuracy=VELOCITY, airspeed=flight.airspeed,
        )  # fmt: skip


def summed_up(courses: list[Course]) -> Coverage:
    """What flights come to together."""
    inside = [
        np.array([in_region(e, c) for e, c in zip(k.off, k.covariance, strict=True)], bool)
        for k in courses
    ]
    ready = [k for k in courses if k.valid.any()]
    off = np.concatenate([k.off[k.valid] for k in courses])
    stated = np.concatenate([k.covariance[k.valid] for k in courses])
    square = [
        np.mean([e @ np.linalg.solve(c, e) for e, c in
                 zip(k.off[k.valid], k.covariance[k.valid], strict=True)])
        for k in ready
    ]  # fmt: skip
    since = [found[k.valid].mean() for found, k in zip(inside, courses, strict=True)
             if k.valid.any()]  # fmt: skip
    before = [found[~k.valid].mean() for found, k in zip(inside, courses, strict=True)
              if not k.valid.all()]  # fmt: skip
    return Coverage(
        len(courses), len(ready), _median([k.waited for k in ready]),
        _median(np.linalg.norm(off, axis=1)),
        _median(np.sqrt(np.trace(stated, axis1=1, axis2=2))),
        _mean(since), _mean(before), _mean(square),
    )  # fmt: skip


def _mean(values) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _median(values) -> float:
    return float(np.median(values)) if len(values) else np.nan


def missed_bars(found: dict[str, Coverage]) -> list[str]:
    """What is worse than it should be, a sentence for each."""
    missed = []
    for case, c in found.items():
        if 2 * c.valid < c.runs:
            missed.append(f"{case}: the twin is valid in {c.valid} of {c.runs} flights")
        for share, when, bar in (
            (c.covered, "the truth", _BAR), (c.covered_before, "before, the truth", _BAR_BEFORE)
        ):  # fmt: skip
            if np.isfinite(share):
                missed += missed_coverage(f"{case}: {when}", share, c.valid, bar)
        # A mean of chi^2 of three components has this standard deviation.
        if c.valid and abs(c.square - 3.0) > _BAR_SQUARE + 3.0 * sqrt(6.0 / c.valid):
            missed.append(f"{case}: squared distances of {c.square:.1f} on average where 3 is due")
    return missed
