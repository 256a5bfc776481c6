"""The simulated flights of the orbit study: what a receiver may be off by, and what is no orbit.

A run is a straight leg into a circle with random radius (40 to 300 m), speed (15 to 60 m/s, bank
below 60 degrees), sense and course.
"""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.orbit.settings import OrbitSettings
from ctcbs_ros.orbit.tracks import (
    TURN,
    arc,
    correlated_noise,
    figure_of_eight,
    fly,
    racetrack,
    random_circle,
    spiral,
    straight,
)

# Flight k of each study is seeded with its number here and k; of the accuracy with each noise,
# with the noise's number (`seed_of`) between: one draw must not decide several cases.
SEEDS = {
    "accuracy": 1, "entry_and_departure": 2, "taken_for_orbits": 3, "comparison": 4,
    "convergence": 7,
}  # fmt: skip


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
        Whether the source states the standard deviation of its positions and velocities.
    told : bool
        Whether the estimator is told which share of it is correlated, and for how long; otherwise
        it has its defaults.
    rate : float
        Samples a second [Hz].
    jitter : float
        Irregularity of the sample times, as a share of their interval.
    wind : float
        In any direction, past the circle [m/s].
    drift : float
        Of the circle, the same way [m/s]: it moves with the air where no more of that goes past.
    growth : float
        Change of the radius in a turn, over the radius.
    turns : float
        Flown on the circle.
    cost : int
        Only every so many-th flight is flown.
    most_lost : float
        Bar of the share of the flights without an orbit at their end.
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
    told: bool = True
    rate: float = 5.0
    jitter: float = 0.0
    wind: float = 0.0
    drift: float = 0.0
    growth: float = 0.0
    turns: float = 0.75
    cost: int = 1
    most_lost: float = 0.005
    most_radius: float = 0.025
    most_center: float = np.inf
    coverage: tuple[float, float] = (0.93, 0.97)

    @property
    def settings(self) -> OrbitSettings:
        """Settings of the estimator."""
        if not self.told:
            return OrbitSettings()
        whole = np.hypot(self.position, self.correlated)
        return OrbitSettings(
            correlated_share=self.correlated / whole, correlation_time=self.time
        )

    @property
    def sigma(self) -> tuple[float, float]:
        """What the source states."""
        whole = np.hypot(self.position, self.correlated)
        return (whole, self.velocity) if self.stated else (np.nan, np.nan)


_FINE = {"most_radius": 0.01, "most_center": 1.0}
# Where nothing is stated the scale is estimated from some 50 samples: wider bars.
_WIDE = (0.90, 0.98)
# Where the circle changes, its error is the estimator's lag.
_ANY = (0.0, 1.0)
NOISES = {
    "white 1.5 m, 0.3 m/s": Noise(1.5, 0.3, **_FINE),
    "white 5 m, 1 m/s, 20 % lost": Noise(5.0, 1.0, loss=0.2),
    "Gauss-Markov 2 m, 45 s on 0.5 m, 0.3 m/s": Noise(0.5, 0.3, correlated=2.0, coverage=_WIDE),
    "white 1.5 m, 0.3 m/s, not stated": Noise(1.5, 0.3, stated=False, coverage=_WIDE, **_FINE),
    "white 5 m, 1 m/s, 20 % lost, not stated": Noise(
        5.0, 1.0, loss=0.2, stated=False, coverage=_WIDE
    ),
    "Gauss-Markov, nothing stated, defaults": Noise(
        0.5, 0.3, correlated=2.0, stated=False, told=False, coverage=_WIDE
    ),
    "1 Hz, irregular": Noise(1.5, 0.3, rate=1.0, jitter=1.0, coverage=_WIDE),
    "50 Hz": Noise(1.5, 0.3, rate=50.0, cost=10, coverage=_WIDE, **_FINE),
    "wind 5 m/s, circle over the ground": Noise(1.5, 0.3, wind=5.0, coverage=_WIDE, **_FINE),
    "drift 5 m/s with the air, 1.3 turns": Noise(
        1.5, 0.3, drift=5.0, turns=1.3, coverage=_WIDE, **_FINE
    ),
    "radius growing 4 % a turn, 1.5 turns": Noise(
        1.5, 0.3, growth=0.04, turns=1.5, coverage=_ANY
    ),
    "drift 2 m/s in a wind of 7 m/s, 2 turns": Noise(
        1.5, 0.3, wind=5.0, drift=2.0, turns=2.0, cost=5, coverage=_WIDE, **_FINE
    ),
    "drift 0.3 m/s in a wind of 8 m/s, 2 turns": Noise(
        1.5, 0.3, wind=7.7, drift=0.3, turns=2.0, cost=5, coverage=_WIDE, **_FINE
    ),
    "drift 1 m/s in a wind of 8 m/s, 2 turns": Noise(
        1.5, 0.3, wind=7.0, drift=1.0, turns=2.0, cost=5, coverage=_WIDE, **_FINE
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
    "hover": lambda r: [straight(40.0 * r)],
    "parked": lambda r: [straight(40.0 * r)],
    "spiral from 40 to 60 m, 20 % a turn": lambda r: spiral(r, 0.2, 4),
    "spiral from 40 to 60 m, 30 % a turn": lambda r: spiral(r, 0.3, 4),
    "spiral from 40 to 60 m, 45 % a turn": lambda r: spiral(r, 0.45, 3),
}
# Tracks begun on small circles: radius [m] and speed [m/s] from ... to.
SMALL = {
    shape: ((40.0, 60.0), (15.0, 25.0)) for shape in SHAPES if shape.startswith("spiral from")
}
# Noise of the velocity of what does not move [m/s]; its track is only for the time it takes.
STANDING = {"hover": 0.5, "parked": 0.1}


def seed_of(name: str) -> tuple[int, int]:
    """Seed of the flights with one of `NOISES`."""
    return SEEDS["accuracy"], 1 + list(NOISES).index(name)


def flight_of(noise: Noise, run: int, seed: int | tuple[int, int]):
    """A flight from straight into a circle, its radius, rate and centre at its end, its drift."""
    rng = np.random.default_rng([*np.atleast_1d(seed), run])
    a, speed, sense = random_circle(rng)
    circle = [arc(a, noise.turns, sense)]
    end = a
    if noise.growth:
        circle = spiral(a, noise.growth, noise.turns, sense)
        end = a * (1.0 + noise.growth * noise.turns)
    course, towards = rng.uniform(0.0, TURN), rng.uniform(0.0, TURN)
    blown = np.array([np.cos(towards), np.sin(towards)])
    flight = fly(
        [straight(5.0 * speed), *circle], speed, rng, position_noise=noise.position,
        velocity_noise=noise.velocity, loss=noise.loss, rate=noise.rate, jitter=noise.jitter,
        wind=tuple(noise.wind * blown), course=course,
    )
    if noise.correlated:
        flight.position[:] += correlated_noise(
            flight.time, noise.correlated, noise.time, rng, 3
        )
    drift = noise.drift * blown
    shift = np.outer(flight.time, drift)
    flight.position[:, :2] += shift
    flight.true_position[:, :2] += shift
    flight.velocity[:, :2] += drift
    center = flight.centers[-1]
    center = np.full(2, np.nan) if center is None else center + shift[-1]
    # In wind the mean over a part of a turn is not that over a whole one.
    rate = np.nan if noise.wind or noise.growth else speed / a
    return flight, end, rate, center, drift
