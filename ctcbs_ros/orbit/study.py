"""How good the orbit estimator is, on the simulated flights of `study_cases.py` with known truth.

Figures are of the orbit after three quarters of a turn, unless a case says otherwise.
"""

from dataclasses import dataclass, field

import numpy as np

from ctcbs_ros.orbit.coverage import in_region
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.study_cases import (
    SEEDS,
    SHAPES,
    SMALL,
    STANDING,
    Noise,
    flight_of,
)
from ctcbs_ros.orbit.tracks import (
    TURN,
    arc,
    correlated_noise,
    estimate,
    fly,
    random_circle,
    straight,
)


@dataclass(frozen=True)
class Accuracy:
    """Errors at the end of the circle.

    Attributes
    ----------
    runs, lost : int
        Flights, and those without an orbit at their end.
    radius : float
        Standard deviation of the radius error over the radius.
    radius_bias : float
        Mean of the radius error over the radius.
    center : float
        Standard deviation of the centre's error along one axis [m].
    drift : float
        Standard deviation of the drift's error along one axis [m/s].
    covered : dict
        Share of the runs whose true values lie in the stated 95 % region: of the circle (centre,
        radius and, where it is given, drift together), the rate and the phase.
    """

    runs: int
    lost: int
    radius: float
    radius_bias: float
    center: float
    drift: float = np.nan
    covered: dict = field(default_factory=dict)


def errors(
    noise: Noise, runs: range, seed: int | tuple[int, int] = SEEDS["accuracy"]
) -> list:
    """Fly random circles, run k seeded with (seed, k).

    Returns
    -------
    list
        For each run None where no orbit is found, else the errors of radius over the radius, of
        centre (2,) and drift (2,), and whether circle, rate and phase are in their 95 % regions.
    """
    found = []
    for run in runs:
        flight, a, rate, center, drift = flight_of(noise, run, seed)
        orbit = estimate(OrbitEstimator(noise.settings), flight, sigma=noise.sigma)[-1]
        if orbit is None:
            found.append(None)
            continue
        error = np.array([*(orbit.center[:2] - center), orbit.radius - a, *(orbit.drift - drift)])
        which = np.array([0, 1, 3, 7, 8] if np.any(orbit.drift) else [0, 1, 3])
        covariance = orbit.covariance
        out = flight.true_position[-1, :2] - center
        phase = (orbit.phase - np.arctan2(out[1], out[0]) + np.pi) % TURN - np.pi
        off = orbit.angular_rate - rate
        inside = [
            in_region(error[: len(which)], covariance[np.ix_(which, which)]),
            np.nan if np.isnan(rate) else in_region(np.array([off]), covariance[4:5, 4:5]),
            in_region(np.array([phase]), covariance[5:6, 5:6]),
        ]
        found.append((error[2] / a, error[:2], error[3:], inside))
    return found


def summary(noise: Noise, found: list) -> Accuracy:
    """What `errors` come to."""
    kept = [f for f in found if f is not None]
    if not kept:
        return Accuracy(len(found), len(found), np.nan, np.nan, np.nan)
    radius, center, drift, inside = (np.array(column, float) for column in zip(*kept, strict=True))
    shares = inside.mean(axis=0)
    if noise.growth:
        shares[:] = np.nan
    return Accuracy(
        len(found), len(found) - len(kept), float(np.std(radius)), float(np.mean(radius)),
        float(np.std(center, axis=0).max()), float(np.std(drift, axis=0).max()),
        {name: float(share) for name, share in zip(("circle", "rate", "phase"), shares,
                                                   strict=True) if np.isfinite(share)},
    )  # fmt: skip


def accuracy(noise: Noise, runs: int) -> Accuracy:
    """Fly `runs` random circles."""
    return summary(noise, errors(noise, range(runs)))


@dataclass(frozen=True)
class Turns:
    """Entry into circles and departure from them, in turns; shares of the runs.

    Attributes
    ----------
    runs : int
    first : (3,) list
        Turn flown at the first orbit: median, 95th percentile and most.
    left : (3,) list
        The same of the turn's duration after which the last orbit is given up.
    early : float
        Share of the runs with an orbit on the straight leg before.
    lost : float
        Share of the samples on the circle without an orbit, after the first.
    """

    runs: int
    first: list
    left: list
    early: float
    lost: float


def entry_and_departure(
    runs: int, noise: Noise | None = None, seed: int = SEEDS["entry_and_departure"]
) -> Turns:
    """Straight, 1.6 turns, straight; run k is seeded with (seed, k)."""
    noise = noise or Noise(1.5, 0.3)
    first, left, early, lost = [], [], 0, []
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        a, speed, sense = random_circle(rng)
        lead = max(8.0 * speed, 0.5 * TURN * a)
        flight = fly(
            [straight(lead), arc(a, 1.6, sense), straight(lead)], speed, rng,
            position_noise=noise.position, velocity_noise=noise.velocity, loss=noise.loss,
            course=rng.uniform(0.0, TURN),
        )
        orbits = estimate(OrbitEstimator(noise.settings), flight, sigma=noise.sigma)
        valid = np.array([orbit is not None for orbit in orbits])
        early += bool(valid[flight.piece == 0].any())
        on = np.flatnonzero(valid & (flight.piece == 1))
        if not on.size:
            first.append(np.inf)
            continue
        first.append(flight.angle[on[0]] / TURN)
        lost.append(1.0 - valid[on[0] :][flight.piece[on[0] :] == 1].mean())
        departed = flight.time[flight.piece == 2][0]
        last = flight.time[np.flatnonzero(valid)[-1]]
        left.append(max(0.0, last - departed) * speed / a / TURN)

    def spread(values):
        return [float(v) for v in np.percentile(values, [50, 95, 100])] if values else []

    return Turns(
        runs, spread(first), spread(left), early / runs, float(np.mean(lost)) if lost else 1.0
    )


def taken_for_orbits(shape: str, runs: int, seed: int = SEEDS["taken_for_orbits"]) -> float:
    """Share of the samples of a track that is no orbit at which one is given; default settings."""
    valid, samples = 0, 0
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        a, speed, _ = random_circle(rng)
        if shape in SMALL:
            a, speed = (rng.uniform(*bounds) for bounds in SMALL[shape])
        flight = fly(SHAPES[shape](a), speed, rng, course=rng.uniform(0.0, TURN))
        if shape in STANDING:
            flight.position[:, :2] = flight.true_position[0, :2]
            flight.position[:] += correlated_noise(flight.time, 2.0, 45.0, rng, 3)
            flight.position[:, :2] += 1.5 * rng.standard_normal((len(flight.time), 2))
            flight.velocity[:] = STANDING[shape] * rng.standard_normal((len(flight.time), 3))
        orbits = estimate(OrbitEstimator(), flight, sigma=(1.5, 0.3))
        valid += sum(orbit is not None for orbit in orbits)
        samples += len(orbits)
    return valid / samples


# Half a turn and the samples until it is seen that no more follows; the first lobe of an eight is
# three quarters of a turn, and no other is taken for an orbit.
_MOST_TAKEN = {"figure of eight": 0.07, "half a turn": 0.07}
_MOST_TAKEN_ELSE = 0.05


def most_taken(shape: str) -> float:
    """Bar of the share of the samples at which a track that is no orbit is taken for one."""
    return _MOST_TAKEN.get(shape, _MOST_TAKEN_ELSE)
