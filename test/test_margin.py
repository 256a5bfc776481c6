"""The margin kept from orbit to orbit against the one computed in full."""

import numpy as np
import pytest
from folding_flight import AIR, folding_configuration

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction import margin
from ctcbs_ros.prediction.margin import MarginFollower
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.mode_sensitivity import modes
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import correct_state, steady_states

FLIGHTS = {
    "small drone": (load_configuration("small_drone"), 80.0, 20.0, 0),
    "small drone, fast": (load_configuration("small_drone"), 45.0, 27.0, 0),
    "design example": (load_configuration("design_example"), 250.0, 50.0, 0),
    "folding, large": (folding_configuration(), 100.0, 31.0, 2),
    "folding, small": (folding_configuration(), 100.0, 31.0, 0),
}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_followed_through_a_flight_it_is_the_full_one_within_one_percent(flight, monkeypatch):
    configuration, radius, speed, index = FLIGHTS[flight]
    computed = []

    def counted(state, *args, **kwargs):
        computed.append(kwargs.get("functions"))
        return stability(state, *args, **kwargs)

    monkeypatch.setattr(margin, "stability", counted)
    random = np.random.default_rng(6)
    follower = MarginFollower()
    before = steady_states(flight_point(configuration, radius, speed, AIR).parameters)
    near = before.states[index].end_mass_radius
    for _ in range(40):
        radius *= np.exp(random.normal(0.0, 0.003))
        speed *= np.exp(random.normal(0.0, 0.003))
        state = correct_state(flight_point(configuration, radius, speed, AIR).parameters, near)
        near = state.end_mass_radius
        followed, full = follower.update(state), stability(state)
        assert followed.growth_rate == pytest.approx(full.growth_rate, rel=0.01, abs=1e-5)
        assert followed.frequency == pytest.approx(full.frequency, rel=0.01, abs=1e-5)
        assert followed.nearest_loss == full.nearest_loss
        assert followed.stable == full.stable
        assert followed.band == full.band
    assert sum(functions is None for functions in computed) < 20


def test_another_state_of_the_same_orbit_is_computed_in_full():
    configuration = folding_configuration()
    states = steady_states(flight_point(configuration, 100.0, 31.3, AIR).parameters).states
    follower = MarginFollower()
    for state in (*states, *states[::-1]):
        followed, full = follower.update(state), stability(state)
        assert followed.growth_rate == pytest.approx(full.growth_rate, rel=1e-12)
        assert followed.frequency == pytest.approx(full.frequency, rel=1e-12, abs=1e-12)
        assert followed.functions == full.functions


@pytest.mark.parametrize("flight", FLIGHTS)
def test_on_a_noisy_orbit_few_margins_are_computed_and_all_are_right(flight, monkeypatch):
    configuration, radius, speed, index = FLIGHTS[flight]
    computed = []

    def counted(name, function):
        def call(*args, **kwargs):
            computed.append(name)
            return function(*args, **kwargs)

        monkeypatch.setattr(margin, name, call)

    counted("stability", stability)
    counted("modes", modes)
    random = np.random.default_rng(8)
    follower = MarginFollower()
    p = flight_point(configuration, radius, speed, AIR).parameters
    near = steady_states(p).states[index].end_mass_radius
    for _ in range(100):
        p = flight_point(
            configuration,
            radius * np.exp(random.normal(0.0, 0.001)),
            speed * np.exp(random.normal(0.0, 0.001)),
            AIR * np.exp(random.normal(0.0, 0.001)),
        ).parameters
        state = correct_state(p, near)
        followed, full = follower.update(state), stability(state)
        assert followed.growth_rate == pytest.approx(full.growth_rate, rel=0.005)
        assert followed.frequency == pytest.approx(full.frequency, rel=0.005, abs=1e-9)
    assert len(computed) < 15


def test_while_the_cable_is_paid_out_the_margin_follows():
    configuration = load_configuration("small_drone")
    follower, near = MarginFollower(), None
    for length in np.linspace(150.0, 156.0, 30):
        p = flight_point(configuration, 80.0, 20.0, AIR, cable_length=length).parameters
        state = steady_states(p).states[0] if near is None else correct_state(p, near)
        near = state.end_mass_radius
        followed, full = follower.update(state), stability(state)
        assert followed.growth_rate == pytest.approx(full.growth_rate, rel=0.005)


def test_beside_a_fold_the_margin_is_not_extrapolated():
    # The large branch of the folding flight ends at 97.1 m.
    configuration, follower, near = folding_configuration(), MarginFollower(), None
    for radius in 97.13 + 0.6 * np.linspace(1.0, 0.0, 40) ** 2:
        p = flight_point(configuration, radius, 31.3, AIR).parameters
        state = steady_states(p).states[2] if near is None else correct_state(p, near)
        if state is None or state.slope < 0.0:
            break
        near = state.end_mass_radius
        followed, full = follower.update(state), stability(state)
        assert followed.growth_rate == pytest.approx(full.growth_rate, rel=0.01, abs=1e-5)
    assert radius < 97.2
