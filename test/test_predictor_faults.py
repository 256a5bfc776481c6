"""Nothing that a predictor is fed makes it raise, or call a position valid that is no number."""

from dataclasses import replace
from math import inf, nan

import pytest
from faults_replay import assert_numbers
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sample_flights import orbiting, samples_of

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.telemetry.sample import Sample

DRONE = load_configuration("small_drone")
GOOD = samples_of(orbiting(turns=1.5, rate=3.0))

anything = st.one_of(
    st.floats(), st.sampled_from([nan, inf, -inf, 0.0, 1e300, -1e300, 5e-324, 90.0, -180.0])
)
vectors = st.none() | st.tuples(anything, anything, anything)
near = st.floats(-200.0, 200.0)
arbitrary = st.builds(
    Sample,
    time=anything | st.floats(0.0, 100.0),
    stamp_ns=st.integers(-(2**63), 2**63),
    flight=st.integers(0, 2),
    latitude=anything | st.floats(46.0, 48.0),
    longitude=anything | st.floats(8.0, 9.0),
    altitude_amsl=anything | near,
    altitude_ellipsoid=anything | near,
    height_above_home=anything | near,
    local_position=vectors | st.tuples(near, near, near),
    velocity=vectors | st.tuples(near, near, near),
    fix_type=st.none() | st.integers(0, 8),
    satellites=st.none() | st.integers(0, 255),
    horizontal_accuracy=anything,
    speed_accuracy=anything,
)
SETTINGS = {"suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}


@settings(max_examples=100, **SETTINGS)
@given(st.lists(arbitrary, min_size=20, max_size=40))
def test_arbitrary_samples(samples):
    predictor = Predictor(DRONE)
    for sample in samples:
        assert_numbers(predictor.update(sample))


FAULTS = (
    "time", "latitude", "longitude", "altitude_amsl", "altitude_ellipsoid", "height_above_home",
    "horizontal_accuracy", "speed_accuracy",
)  # fmt: skip
fault = st.one_of(
    st.fixed_dictionaries({}, optional={name: anything for name in FAULTS}),
    st.fixed_dictionaries({"velocity": vectors}),
    st.fixed_dictionaries({"local_position": vectors, "latitude": st.just(nan)}),
    st.fixed_dictionaries({"flight": st.integers(0, 1)}),
)


@settings(max_examples=25, **SETTINGS)
@given(
    st.dictionaries(st.integers(0, len(GOOD) - 1), fault, max_size=25),
    st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, len(GOOD) - 1)), max_size=4),
)
def test_good_samples_with_faults_among_them(faults, swapped):
    samples = [replace(s, **faults.get(i, {})) for i, s in enumerate(GOOD)]
    for i, j in swapped:
        samples[i], samples[j] = samples[j], samples[i]
    predictor = Predictor(DRONE)
    for sample in samples:
        assert_numbers(predictor.update(sample))


@pytest.mark.slow
@settings(max_examples=200, **SETTINGS)
@given(st.dictionaries(st.integers(0, len(GOOD) - 1), fault, max_size=60))
def test_many_more_faults(faults):
    predictor = Predictor(DRONE)
    for i, sample in enumerate(GOOD):
        assert_numbers(predictor.update(replace(sample, **faults.get(i, {}))))


def test_a_single_fault_of_any_kind_costs_few_predictions():
    plain = sum(p.valid for p in map(Predictor(DRONE).update, GOOD[:140]))
    assert plain > 50
    # A clock that steps forward is another flight: the readers see to that.
    faults = [(name, value) for name in FAULTS for value in (nan, 1e300)]
    faults.remove(("time", 1e300))
    faults += [("horizontal_accuracy", -inf), ("speed_accuracy", -inf), ("speed_accuracy", 0.0)]
    for name, value in faults:
        samples = list(GOOD)
        samples[100] = replace(samples[100], **{name: value})
        predictor = Predictor(DRONE)
        found = sum(predictor.update(s).valid for s in samples[:140])
        assert found >= plain - 3, (name, value)
