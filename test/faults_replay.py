"""A log with faults replayed through the core, held against the same flight without them."""

from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any

import faults_log
import numpy as np
from scipy.stats import chi2

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.geodesy import Datum, to_enu
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.replay.core import replay_through_core
from ctcbs_ros.telemetry.screen import SkipCode
from ctcbs_ros.telemetry.source import open_log

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
BOOT_MS = 60_000  # the vehicle's clock at the first sample of `flight`
REGION = chi2.ppf(0.95, 3)  # 95 % of a position in space lie within this Mahalanobis distance^2


@dataclass(frozen=True)
class Replay:
    """What a log came to: a prediction for each sample, and the summary."""

    predictions: list[Prediction]
    summary: dict[str, Any]

    @property
    def valid(self) -> int:
        """Valid predictions."""
        return self.summary["predictions"]

    @property
    def skipped(self) -> dict[str, int]:
        """Samples skipped, by code."""
        return self.summary["skipped"]

    @property
    def link(self) -> dict[str, Any]:
        """Counts of the link."""
        return self.summary["link"]

    def by_time(self) -> dict[int, Prediction]:
        """The valid predictions by the vehicle's clock [ms]."""
        return {round(p.time * 1000): p for p in self.predictions if p.valid}


class _Watched(Predictor):
    """A predictor that keeps what it predicted."""

    def __init__(self, configuration):
        super().__init__(configuration)
        self.predictions = []

    def update(self, sample):
        self.predictions.append(super().update(sample))
        return self.predictions[-1]


def replay(log: faults_log.Log | bytes, folder: Path, **vehicle) -> Replay:
    """Replay a log through the core, and check that its counts add up."""
    path = folder / "faults.tlog"
    path.write_bytes(log if isinstance(log, bytes) else faults_log.as_bytes(log))
    predictor = _Watched(load_configuration(DRONE))
    summary = replay_through_core(open_log(path, **vehicle), predictor, 0.0, lambda *_: None)
    found = Replay(predictor.predictions, summary)
    used = sum(p.skip is None for p in found.predictions)
    assert summary["samples"] == len(found.predictions) == used + sum(found.skipped.values())
    assert set(found.skipped) <= {code.value for code in SkipCode}
    return found


def outside(found: Replay, clean: Replay) -> np.ndarray:
    """Distance of each valid prediction to the clean one of its time, over its 95 % region.

    Above 1 it is outside; inf where the clean flight has no prediction within a quarter of a turn,
    the time in which an orbit that was left must be known to be over.
    """
    truth = clean.by_time()
    times = np.array(list(truth))
    found_outside = []
    for time, prediction in found.by_time().items():
        if time in truth:
            found_outside.append(distance(prediction, truth[time]))
        elif np.abs(times - time).min() > 250 * turn(prediction):
            found_outside.append(np.inf)
    return np.array(found_outside)


def turn(prediction: Prediction) -> float:
    """Time of a turn [s]."""
    return 2 * np.pi / prediction.orbit.angular_rate


def distance(prediction: Prediction, clean: Prediction) -> float:
    """Between two end masses, in units of the first one's 95 % region.

    By their geodetic positions: each replay has a frame of its own, about its first sample.
    """
    here, there = prediction.end_mass.geodetic, clean.end_mass.geodetic
    assert here.ellipsoidal == there.ellipsoidal
    home = Datum(there.latitude, there.longitude, there.altitude, there.ellipsoidal)
    error = np.array(to_enu(home, here.latitude, here.longitude, here.altitude), float)
    covariance = prediction.end_mass.covariance[:3, :3]
    return float(np.sqrt(error @ np.linalg.solve(covariance, error) / REGION))


def assert_numbers(prediction):
    """A valid prediction is a number in all that is not documented to be unknown."""
    if not prediction.valid:
        return
    mass = prediction.end_mass
    assert prediction.skip is None
    for value in (mass.position, mass.covariance, mass.circle_center, mass.cable):
        assert np.all(np.isfinite(value))
    assert np.linalg.eigvalsh(mass.covariance).min() > -1e-6
    assert isfinite(mass.yaw)
    # In a wind how stable the motion is may not be known; then it never counts as settled.
    assert mass.settling_time > 0.0 or not (mass.margin.known or mass.settled)
    for field in fields(mass.state):
        assert isfinite(getattr(mass.state, field.name))
    geodetic = mass.geodetic
    known = [isfinite(x) for x in (geodetic.latitude, geodetic.longitude, geodetic.altitude)]
    assert all(known) or not any(known)
    assert mass.state.residual < 1e-9


def flight(folder: Path) -> faults_log.Log:
    """A simulated flight of the small drone: 1.75 turns at 60 m and 20 m/s, from 15 s to 48 s."""
    path = folder / "clean.tlog"
    arguments = (
        f"simulate --config {DRONE} --radius 60 --speed 20 --turns 1.75 --sense cw "
        f"--center=47.4,8.5 --position-noise 1 --velocity-noise 0.2 --seed 3 -o {path}"
    )
    assert main(arguments.split()) == 0
    return faults_log.read(path)
