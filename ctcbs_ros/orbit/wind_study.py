"""How good the wind of a turn is: simulated turns with known truth, each with its own seed.

A turn is flown in the air (a circle that drifts with the wind) or held over the ground, at 12 to
50 m/s, 12 to 40 s a turn, either sense, in a wind of up to six tenths of the airspeed.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from ctcbs_ros.orbit.coverage import in_region, missed_coverage
from ctcbs_ros.orbit.tracks import correlated_noise
from ctcbs_ros.orbit.wind_of_turn import WindSettings, wind_of_turn

SEED = 6  # turn k is seeded with (SEED, k)
_TURN = 2.0 * pi
_RATE = 5.0  # Hz
_GUST_TURN = 0.1
_NOISE_TIME = 10.0  # s
_LEAST_BAR = (0.93, 0.97)
_WIDE_BAR = (0.90, 0.99)


@dataclass(frozen=True)
class Conditions:
    """How a turn is flown and measured.

    Attributes
    ----------
    turns : float
    noise : float
        White noise of one axis of the velocity [m/s].
    stated : bool
        Whether the source states it.
    wander : float
        Standard deviation of a variation of the airspeed once a turn, over it.
    gusts : float
        Standard deviation of a Gauss-Markov variation of it with a correlation of a tenth of a
        turn.
    correlated : float
        Standard deviation of one axis of a Gauss-Markov error of the velocity [m/s], 10 s.
    airspeed, heading : bool
        Whether they are measured.
    ground_speed_held : bool
        Whether the ground speed is constant instead of the airspeed.
    coverage : (float, float)
        Bar of the share of the turns inside the stated 95 % region.
    """

    turns: float = 1.0
    noise: float = 0.3
    stated: bool = True
    wander: float = 0.02
    gusts: float = 0.0
    correlated: float = 0.0
    airspeed: bool = False
    heading: bool = False
    ground_speed_held: bool = False
    coverage: tuple[float, float] = _WIDE_BAR

    @property
    def settings(self) -> WindSettings:
        """Settings of an estimator that knows of these errors."""
        return WindSettings(
            airspeed_wander=self.wander, correlated_sigma=self.correlated,
            correlation_time=_NOISE_TIME,
        )  # fmt: skip


CASES = {
    "white 0.3 m/s": Conditions(wander=0.0, coverage=_LEAST_BAR),
    "white 1 m/s": Conditions(noise=1.0, wander=0.0, coverage=_LEAST_BAR),
    "white 0.3 m/s, not stated": Conditions(stated=False, wander=0.0),
    "three quarters of a turn": Conditions(turns=0.75, wander=0.0),
    "half a turn": Conditions(turns=0.5, wander=0.0),
    "airspeed varies once a turn, 2 %": Conditions(coverage=_LEAST_BAR),
    "gusts of 3 %": Conditions(wander=0.02, gusts=0.03),
    "Gauss-Markov 0.3 m/s, 10 s": Conditions(wander=0.0, correlated=0.3),
    "airspeed measured": Conditions(airspeed=True),
    "heading sent": Conditions(heading=True),
    "ground speed held, airspeed measured": Conditions(airspeed=True, ground_speed_held=True),
    "ground speed held, heading sent": Conditions(heading=True, ground_speed_held=True),
}


@dataclass(frozen=True)
class WindAccuracy:
    """Errors of the wind at the end of a turn.

    Attributes
    ----------
    runs, unknown : int
        Turns, and those of which no wind came out.
    error : float
        Standard deviation of the wind's error along one axis, over the airspeed.
    stated : float
        Median of the stated standard deviation, over the airspeed.
    covered : float
        Share of the turns with the true wind inside the stated 95 % region.
    airspeed_error : float
        Standard deviation of the airspeed's error, over it.
    """

    runs: int
    unknown: int
    error: float
    stated: float
    covered: float
    airspeed_error: float


def turn_rows(conditions: Conditions, rng) -> tuple[np.ndarray, float, np.ndarray, float]:
    """A turn as `wind_of_turn` takes it, its duration [s], the true wind and airspeed [m/s]."""
    c = conditions
    airspeed, turn = rng.uniform(12.0, 50.0), rng.uniform(12.0, 40.0)
    sense, over_ground = rng.choice([-1, 1]), rng.random() < 0.5
    direction = rng.uniform(0.0, _TURN)
    wind = airspeed * rng.uniform(0.0, 0.6) * np.array([np.cos(direction), np.sin(direction)])
    time = np.arange(0.0, c.turns * turn, 1.0 / _RATE)
    angle = rng.uniform(0.0, _TURN) + sense * _TURN * time / turn
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    if c.ground_speed_held:
        velocity = airspeed * along
    elif over_ground:
        # The wind triangle: ground speed v along the tangent t with |v t - wind| = airspeed.
        across = wind[0] * along[:, 1] - wind[1] * along[:, 0]
        velocity = (along @ wind + np.sqrt(airspeed**2 - across**2))[:, None] * along
    else:
        velocity = wind + airspeed * along
    air = velocity - wind
    length = np.hypot(*air.T)
    unit = air / length[:, None]
    if not c.ground_speed_held:
        once = c.wander * rng.standard_normal(2)
        length = length * (1.0 + unit @ once)
        length *= 1.0 + correlated_noise(time, c.gusts, _GUST_TURN * turn, rng, 1)[:, 0]
    velocity = wind + length[:, None] * unit
    velocity = velocity + correlated_noise(time, c.correlated, _NOISE_TIME, rng, 2)
    velocity += c.noise * rng.standard_normal(velocity.shape)
    rows = np.full((len(time), 6), np.nan)
    rows[:, 0], rows[:, 1:3] = time, velocity
    if c.stated:
        rows[:, 3] = c.noise
    s = c.settings
    if c.airspeed:
        # Indicated: off by the air's density and the sensor's calibration, and by its place.
        indicated = length * rng.uniform(0.85, 1.0)
        indicated *= 1.0 + unit @ (s.sensor_error * rng.standard_normal(2))
        rows[:, 4] = indicated + s.sensor_sigma * rng.standard_normal(len(time))
    if c.heading:
        nose = np.arctan2(unit[:, 1], unit[:, 0]) + rng.normal(0.0, 0.1)
        left = np.column_stack([-unit[:, 1], unit[:, 0]])
        nose += left @ (s.compass_deviation * rng.standard_normal(2))
        rows[:, 5] = nose + s.heading_sigma * rng.standard_normal(len(time))
    return rows, turn, wind, float(np.mean(length))


def wind_accuracy(conditions: Conditions, runs: int, seed: int = SEED) -> WindAccuracy:
    """Fly `runs` random turns; run k is seeded with (seed, k)."""
    errors, stated, inside, of_airspeed = [], [], [], []
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        rows, turn, wind, airspeed = turn_rows(conditions, rng)
        found = wind_of_turn(rows, turn, conditions.settings)
        if found is None:
            continue
        error = found.velocity - wind
        inside.append(in_region(error, found.covariance))
        errors.append(error / airspeed)
        stated.append(sqrt(0.5 * np.trace(found.covariance)) / airspeed)
        of_airspeed.append(found.airspeed / airspeed - 1.0)
    if not errors:
        return WindAccuracy(runs, runs, np.nan, np.nan, np.nan, np.nan)
    return WindAccuracy(
        runs, runs - len(errors), float(np.sqrt(np.mean(np.square(errors)))),
        float(np.median(stated)), float(np.mean(inside)), float(np.std(of_airspeed)),
    )  # fmt: skip


def missed_wind_bars(found: dict[str, WindAccuracy]) -> list[str]:
    """What is worse than it should be, a sentence for each."""
    return [
        sentence
        for name, accuracy in found.items()
        for sentence in missed_coverage(
            f"{name}:", accuracy.covered, accuracy.runs, CASES[name].coverage
        )
    ]
