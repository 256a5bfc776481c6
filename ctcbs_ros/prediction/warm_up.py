"""Before a flight: everything that is loaded at its first use is used once.

A compiled kernel is read from its cache when it is first called, ten milliseconds each and most of
a second in all; in flight that would delay the first prediction, and the first jump.
"""

import gc
from math import cos, pi, sin

import numpy as np

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels.galerkin import basis
from ctcbs_ros.prediction.fold import follow_fold, known_fold
from ctcbs_ros.prediction.jumps import JumpFinder
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.branches import Fold
from ctcbs_ros.solver.family import ANGULAR_RATE
from ctcbs_ros.solver.flown import branch_from_straight_flight
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.table.table import Table
from ctcbs_ros.telemetry.sample import Sample

_SAMPLES = 60
_ON_CIRCLE = 1.3 * 2.0 * pi
_SEA_LEVEL_DENSITY = 1.225  # kg/m^3, ICAO Doc 7488


def warm_up(
    configuration: Configuration, table: Table | None = None, with_twin: bool = False
) -> None:
    """Predict once along a circle in the middle of the envelope, and look for its jumps."""
    radius, speed = (
        (low * high) ** 0.5
        for low, high in (configuration.envelope.radius, configuration.envelope.speed)
    )
    predictor = Predictor(configuration, table, with_twin)
    for sample in _circle(radius, speed):
        predictor.update(sample)
    # Only how stable a motion in wind is asks for it; to solve one here would take 0.3 s.
    basis(2, 1.0, np.zeros(1), np.empty((2, 1)), np.empty((2, 1)))
    try:
        parameters = flight_point(configuration, radius, speed, _SEA_LEVEL_DENSITY).parameters
    except InputError:
        return  # lighter than air at sea level, say: the flight itself will tell
    for state in steady_states(parameters).states[:1]:
        branch_from_straight_flight(parameters)
        JumpFinder().update(state)
        # Where no branch ends there is no fold; any point will do for what follows one.
        fold = known_fold(parameters, ANGULAR_RATE, Fold(0.0, state.end_mass_radius))
        if fold is not None:
            follow_fold(fold, ANGULAR_RATE.at(parameters, 0.5))


def spare_collector() -> None:
    """Leave what has been loaded so far to no garbage collection.

    The compiler's objects are many: a collection through all of them stops a program for 50 ms.
    """
    gc.collect()
    gc.freeze()


def _circle(radius: float, speed: float):
    """Samples along a little more than a turn of a circle."""
    for i in range(_SAMPLES):
        angle = _ON_CIRCLE * i / (_SAMPLES - 1)
        time = angle * radius / speed
        yield Sample(
            time=time,
            stamp_ns=int(time * 1e9),
            local_position=(radius * cos(angle), radius * sin(angle), 100.0),
            velocity=(-speed * sin(angle), speed * cos(angle), 0.0),
        )
