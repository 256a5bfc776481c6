"""How good the orbit estimator is: simulated flights with known truth, each with its own seed.

A run is a straight leg into a circle with random radius (40 to 300 m), speed (15 to 60 m/s, bank
below 60 degrees), sense and course. Figures are of the orbit after three quarters of a turn.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from ctcbs_ros.orbit.estimator import OrbitEstimator, OrbitSettings
from ctcbs_ros.orbit.tracks import (
    TURN,
    arc,
    correlated_noise,
    estimate,
    figure_of_eight,
    fly,
    racetrack,
    random_circle,
    spiral,
    straight,
)

# Flight k of each study is seeded with its number here and k.
SEEDS = {"accuracy": 1, "entry_and_departure": 2, "taken_for_orbits": 3}
# Of centre and radius, in `Orbit.covariance`.
_CIRCLE = np.array([0, 1, 3])


@dataclass(frozen=True)
class Noise:
    """A receiver's errors, and what the estimator is told of them.

    Attributes
    ----------
    position, velocity : float
        Standard deviation of the white noise of one axis [m], [m/s].
    loss : float
        Share of the samples lost.
    correlated : float
        Standard deviation of a Gauss-Markov error of the position [m].
    time : float
        Its correlation time [s].
    stated : bool
        Whether the source states the white noise.
    most_radius : float
        Bar of the standard deviation of the radius error, over the radius.
    most_center : float
        Bar of that of the centre along one axis [m].
    coverage : (float, float)
        Bar of the share of the runs in the stated 95 % regions.
    """

    position: float
    velocity: float
    loss: float = 0.0
    correlated: float = 0.0
    time: float = 45.0
    stated: bool = True
    most_radius: float = 0.025
    most_center: float = np.inf
    coverage: tuple[float, float] = (0.93, 0.97)

    @property
    def settings(self) -> OrbitSettings:
        """Settings of an estimator that knows of the correlated error."""
        return OrbitSettings(correlated_sigma=self.correlated, noise_time=self.time)

    @property
    def sigma(self) -> tuple[float, float]:
        """What the source states."""
        return (self.position, self.velocity) if self.stated else (np.nan, np.nan)


_FINE = {"most_radius": 0.01, "most_center": 1.0}
# Where nothing is stated the scale is estimated from some 50 samples: wider bars.
_WIDE = (0.90, 0.98)
NOISES = {
    "white 1.5 m, 0.3 m/s": Noise(1.5, 0.3, **_FINE),
    "white 5 m, 1 m/s, 20 % lost": Noise(5.0, 1.0, loss=0.2),
    "Gauss-Markov 2 m, 45 s on 0.5 m, 0.3 m/s": Noise(0.5, 0.3, correlated=2.0, coverage=_WIDE),
    "white 1.5 m, 0.3 m/s, not stated": Noise(1.5, 0.3, stated=False, coverage=_WIDE, **_FINE),
    "white 5 m, 1 m/s, 20 % lost, not stated": Noise(
        5.0, 1.0, loss=0.2, stated=False, coverage=_WIDE
    ),
}

SHAPES = {
    "straight leg": lambda r: [straight(40.0 * r)],
    "half a turn": lambda r: [straight(5.0 * r), arc(r, 0.5), straight(5.0 * r)],
    "racetrack, legs 4 radii": lambda r: racetrack(r, 4.0 * r, 3),
    "racetrack, legs 1.5 radii": lambda r: racetrack(r, 1.5 * r, 3),
    "figure of eight": lambda r: figure_of_eight(r, 3),
    "spiral, 20 % a turn": lambda r: spiral(r, 0.2, 4),
    "spiral, 30 % a turn": lambda r: spiral(r, 0.3, 4),
    "spiral, -20 % a turn": lambda r: spiral(r, -0.2, 3),
}


@dataclass(frozen=True)
class Accuracy:
    """Errors after three quarters of a turn.

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
    covered : dict
        Share of the runs whose true values lie in the stated 95 % region: of the circle (centre
        and radius together), the rate and the phase.
    """

    runs: int
    lost: int
    radius: float
    radius_bias: float
    center: float
    covered: dict = field(default_factory=dict)


def accuracy(noise: Noise, runs: int, seed: int = SEEDS["accuracy"]) -> Accuracy:
    """Fly `runs` random circles; run k is seeded with (seed, k)."""
    radius, center, inside = [], [], []
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        a, speed, sense = random_circle(rng)
        flight = fly(
            [straight(5.0 * speed), arc(a, 0.75, sense)], speed, rng,
            position_noise=noise.position, velocity_noise=noise.velocity, loss=noise.loss,
            course=rng.uniform(0.0, TURN),
        )
        if noise.correlated:
            flight.position[:] += correlated_noise(
                flight.time, noise.correlated, noise.time, rng
            )
        orbit = estimate(OrbitEstimator(noise.settings), flight, sigma=noise.sigma)[-1]
        if orbit is None:
            continue
        error = np.array([*(orbit.center[:2] - flight.centers[1]), orbit.radius - a])
        out = flight.true_position[-1, :2] - flight.centers[1]
        phase = (orbit.phase - np.arctan2(out[1], out[0]) + np.pi) % TURN - np.pi
        rate = orbit.angular_rate - speed / a
        covariance = orbit.covariance
        distance = error @ np.linalg.solve(covariance[np.ix_(_CIRCLE, _CIRCLE)], error)
        radius.append(error[2] / a)
        center.append(error[:2])
        inside.append([
            distance < chi2.ppf(0.95, 3),
            rate**2 < chi2.ppf(0.95, 1) * covariance[4, 4],
            phase**2 < chi2.ppf(0.95, 1) * covariance[5, 5],
        ])
    if not radius:
        return Accuracy(runs, runs, np.nan, np.nan, np.nan)
    shares = np.mean(inside, axis=0)
    return Accuracy(
        runs, runs - len(radius), float(np.std(radius)), float(np.mean(radius)),
        float(np.std(center, axis=0).max()),
        {name: float(s) for name, s in zip(("circle", "rate", "phase"), shares, strict=True)},
    )


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
    """Share of the samples of a track that is no orbit at which one is given."""
    valid, samples = 0, 0
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        a, speed, _ = random_circle(rng)
        flight = fly(SHAPES[shape](a), speed, rng, course=rng.uniform(0.0, TURN))
        orbits = estimate(OrbitEstimator(), flight, sigma=(1.5, 0.3))
        valid += sum(orbit is not None for orbit in orbits)
        samples += len(orbits)
    return valid / samples


# Half a turn and the samples until it is seen that no more follows; the first lobe of an eight is
# three quarters of a turn, and no other is taken for an orbit.
# Over half a turn noise hides a spiral on a small circle.
_MOST_TAKEN = {"figure of eight": 0.07, "half a turn": 0.07, "spiral, 20 % a turn": 0.1}
_MOST_TAKEN_ELSE = 0.05
_MOST_LOST = 0.005


def missed_bars(accuracies: dict, turns: Turns, shapes: dict) -> list[str]:
    """What of the figures is worse than it should be, a sentence for each."""
    missed = []
    for name, found in accuracies.items():
        bar = NOISES[name]
        if found.lost > max(_MOST_LOST * found.runs, 1):
            missed.append(f"{name}: no orbit in {found.lost} of {found.runs} runs")
        if not found.radius <= bar.most_radius:
            missed.append(f"{name}: radius error {found.radius:.2%}")
        if not found.center <= bar.most_center:
            missed.append(f"{name}: centre error {found.center:.2f} m")
        # Fewer runs than 1000 scatter more: three standard deviations of what that adds.
        extra = 3.0 * np.sqrt(0.05 * 0.95 * max(1.0 / found.runs - 1e-3, 0.0))
        for what, share in found.covered.items():
            if not bar.coverage[0] - extra <= share <= bar.coverage[1] + extra:
                missed.append(f"{name}: {what} inside the 95 % region in {share:.1%}")
    if not turns.first[1] <= 0.5:
        missed.append(f"first orbit after {turns.first[1]:.2f} turns")
    if not turns.left[2] <= 0.25:
        missed.append(f"an orbit {turns.left[2]:.2f} turns after departure")
    if turns.early:
        missed.append(f"an orbit on the straight leg before in {turns.early:.1%} of the runs")
    for name, share in shapes.items():
        if share > _MOST_TAKEN.get(name, _MOST_TAKEN_ELSE):
            missed.append(f"{name}: taken for an orbit at {share:.1%} of the samples")
    return missed
