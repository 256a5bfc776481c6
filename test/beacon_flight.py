"""Simulated flights whose payload carries a beacon, and what comparing them comes to."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import faults_log
import numpy as np

from ctcbs_ros.beacon.comparer import BeaconComparer
from ctcbs_ros.beacon.comparison import Comparison, Standing
from ctcbs_ros.beacon.tally import BeaconTally
from ctcbs_ros.configuration import Configuration, load_configuration
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.simulate import SimulatedBeacon, simulate_flight, simulate_payload, write_tlog
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.source import open_log

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"
SYSTEM = 42
OFFSET = (3.0, -2.0, 1.0)  # m by which the beacon is wrong
# The air is still, and known to be.
STILL = ("wind.speed=0.0", "wind.from_direction=0.0", "wind.accuracy=0.2")
TURN = 2 * np.pi * 60.0 / 20.0  # s


@dataclass(frozen=True)
class Flight:
    """A log of it, and what predictor and twin say, which no fault of the beacon changes."""

    log: faults_log.Log
    configuration: Configuration
    predictions: list[Prediction]
    frame: LocalFrame
    folder: Path

    def of_beacon(self, start=0.0, end=np.inf) -> np.ndarray:
        """Which frames are the beacon's, received within some seconds after the first."""
        of_beacon = np.array([one.sender[0] == SYSTEM for one in self.log])
        return of_beacon & faults_log.seconds(self.log, start, end)

    @cached_property
    def clean(self) -> tuple[list[Comparison], BeaconTally]:
        """What they come to without faults."""
        return self.compared()

    def compared(self, log=None, wanted=None) -> tuple[list[Comparison], BeaconTally]:
        """What the beacon's reports come to, of this log or of one with faults."""
        path = self.folder / "faulty.tlog"
        data = log if isinstance(log, bytes) else faults_log.as_bytes(log or self.log)
        path.write_bytes(data)
        comparer = BeaconComparer(
            self.configuration.beacon, self.frame, self.configuration.cable.length
        )
        predictions = iter(self.predictions)
        found = []
        for item in open_log(path, beacon=wanted or BeaconWanted(SYSTEM)):
            if isinstance(item, BeaconSample):
                found += comparer.add(item)
            else:
                found += comparer.hear(next(predictions))
        assert next(predictions, None) is None
        found += comparer.finish()
        tally = BeaconTally()
        for comparison in found:
            tally.add(comparison)
        return found, tally


def fly(
    folder: Path, table, sense=1, turns=5.0, noise=0.0, with_twin=False, wind=(0.0, 0.0)
) -> Flight:
    """Simulate and predict one; a wind other than none is told by the autopilot."""
    configuration = load_configuration(DRONE, STILL)
    flight = simulate_flight(60.0, 20.0, turns, sense=sense, height=250.0, wind=wind)
    payload = simulate_payload(configuration, flight, late=0.07)
    path = folder / "flight.tlog"
    write_tlog(
        path, flight, latitude=47.4, longitude=8.5,
        beacon=SimulatedBeacon(payload, SYSTEM, OFFSET, noise),
    )  # fmt: skip
    predictor = Predictor(configuration, table, with_twin)
    samples = list(open_log(path, system=1))
    predictions = [predictor.update(sample) for sample in samples]
    log = faults_log.read(path)
    return Flight(log, configuration, predictions, predictor.frame, folder)


def errors(found: list[Comparison], after=0.0) -> np.ndarray:
    """Measured less predicted less what the beacon is wrong by, (n, 3), of those settled [m].

    From a time on, after the first that was settled [s].
    """
    settled = [one for one in found if one.outcome is Standing.SETTLED]
    first = settled[0].time
    return np.array([one.predicted.enu for one in settled if one.time >= first + after]) - OFFSET
