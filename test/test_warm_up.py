"""What a flight uses for the first time has been used before it begins."""

import subprocess
import sys
from pathlib import Path

from folding_flight import folding_configuration
from processes import LIMIT

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.warm_up import _circle, warm_up

# Every compiled kernel that has been loaded, by its name.
LOADED = """
import sys
from numba.core.registry import CPUDispatcher
def loaded():
    return {
        f"{name}.{key}"
        for name, module in list(sys.modules.items()) if name.startswith("ctcbs_ros.kernels")
        for key, value in vars(module).items()
        if isinstance(value, CPUDispatcher) and value.signatures
    }
"""
FLIGHT = """
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.warm_up import warm_up
configuration = load_configuration("small_drone")
warm_up(configuration)
before = loaded()
from sample_flights import orbiting, samples_of
predictor = Predictor(configuration)
for sample in samples_of(orbiting(turns=4.0, rate=3.0, radius_change=(95.0, 2.0))):
    prediction = predictor.update(sample)
print(sorted(loaded() - before))
"""


def test_no_kernel_is_loaded_in_flight():
    done = subprocess.run(
        [sys.executable, "-c", LOADED + FLIGHT], cwd=Path(__file__).parent, timeout=LIMIT,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


def test_the_circle_gives_predictions():
    predictor = Predictor(load_configuration("small_drone"))
    assert [predictor.update(sample) for sample in _circle(80.0, 20.0)][-1].valid


def test_any_configuration_can_be_warmed_up():
    warm_up(folding_configuration())
    warm_up(folding_configuration(d_n=2.7, speed=(100.0, 140.0)))
