"""What a flight uses for the first time has been used before it begins."""

import subprocess
import sys
from pathlib import Path

import pytest
from folding_flight import folding_configuration
from processes import LIMIT

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.warm_up import _circle, warm_up

# Every compiled kernel that has been loaded, by its name and the kinds of its arguments.
LOADED = """
import sys
from numba.core.registry import CPUDispatcher
def loaded():
    return {
        f"{name}.{key} {arguments}"
        for name, module in list(sys.modules.items()) if name.startswith("ctcbs_ros.kernels")
        for key, value in vars(module).items()
        if isinstance(value, CPUDispatcher)
        for arguments in value.signatures
    }
"""
FLIGHT = """
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.warm_up import warm_up
configuration = load_configuration("small_drone")
with_twin = sys.argv[1] == "True"
warm_up(configuration, with_twin=with_twin)
before = loaded()
from sample_flights import orbiting, samples_of
wind = (3.0, -2.0)
for flight, known in (
    (orbiting(turns=4.0, rate=3.0, radius_change=(95.0, 2.0)), None),
    (orbiting(turns=4.0, rate=3.0, wind=wind), wind),
):
    predictor = Predictor(configuration, with_twin=with_twin)
    predicted = [predictor.update(sample).end_mass for sample in samples_of(flight, wind=known)]
print(sorted(loaded() - before), any(p and p.in_wind and p.settling_time > 0 for p in predicted))
"""


@pytest.mark.parametrize("with_twin", [False, True])
def test_no_kernel_is_loaded_in_flight(with_twin):
    done = subprocess.run(
        [sys.executable, "-c", LOADED + FLIGHT, str(with_twin)],
        cwd=Path(__file__).parent, timeout=LIMIT, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[] True"


def test_the_circle_gives_predictions():
    predictor = Predictor(load_configuration("small_drone"))
    assert [predictor.update(sample) for sample in _circle(80.0, 20.0)][-1].valid


def test_any_configuration_can_be_warmed_up():
    warm_up(folding_configuration())
    warm_up(folding_configuration(d_n=2.7, speed=(100.0, 140.0)))
