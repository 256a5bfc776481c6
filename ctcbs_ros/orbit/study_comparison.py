"""This orbit estimator beside other methods (`alternatives.py`), on the same simulated flights."""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.orbit.alternatives import METHODS
from ctcbs_ros.orbit.estimator import OrbitEstimator
from ctcbs_ros.orbit.study_cases import SEEDS, Noise, flight_of
from ctcbs_ros.orbit.tracks import estimate

_GLITCHES = "three glitches of 100 m"
# Wind over each circle [m/s].
CASES = {"noise alone": 0.0, _GLITCHES: 0.0, "wind 8 m/s": 8.0}


@dataclass(frozen=True)
class Comparison:
    """Another method, or this one, on the same flights: errors as in `study.Accuracy`.

    Attributes
    ----------
    radius, center : float
        Root mean square of the radius error over the radius, and of the centre's east
        [m].
    worst : float
        Largest radius error, over the radius.
    lost : int
        Flights without a circle.
    """

    radius: float
    center: float
    worst: float
    lost: int


def comparison(case: str, runs: int, seed: int = SEEDS["comparison"]) -> dict:
    """This estimator beside `alternatives.METHODS`, by name; white 1.5 m, 0.3 m/s.

    Parameters
    ----------
    case : str
        Of `CASES`: white noise alone, three positions of each circle off by 100 m, or wind.
    runs : int
    """
    noise = Noise(1.5, 0.3, wind=CASES[case])
    rows = {name: [] for name in ("this estimator", *METHODS)}
    for run in range(runs):
        flight, a, _, center, _ = flight_of(noise, run, seed)
        on = np.flatnonzero(flight.piece == 1)
        if case == _GLITCHES:
            rng = np.random.default_rng([seed, run, 1])
            # Not the newest few: whether those are glitches or a departure nobody can tell yet.
            hit = rng.choice(on[:-4], 3, replace=False)
            flight.position[hit, :2] += 100.0 * rng.choice([-1.0, 1.0], (3, 2)) / np.sqrt(2.0)
        orbit = estimate(OrbitEstimator(noise.settings), flight, sigma=noise.sigma)[-1]
        found = {"this estimator": None if orbit is None else [*orbit.center[:2], orbit.radius]}
        samples = flight.time[on], flight.position[on, :2], flight.velocity[on, :2]
        found |= {name: method(*samples, 1.5, 0.3) for name, method in METHODS.items()}
        for name, circle in found.items():
            if circle is not None:
                rows[name].append([circle[2] / a - 1.0, *(circle[:2] - center)])
    result = {}
    for name, values in rows.items():
        errors_of = np.array(values)
        result[name] = Comparison(
            *(float(np.sqrt(np.mean(errors_of[:, c] ** 2))) for c in (0, 1)),
            float(np.abs(errors_of[:, 0]).max()), runs - len(values),
        )
    return result
