"""The margins kept from orbit to orbit against those computed in full."""

import numpy as np
import pytest
from folding_flight import AIR, folding_configuration

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction import margin
from ctcbs_ros.prediction.margin import Margins
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import correct_state, steady_states

STIFF = folding_configuration(youngs_modulus=4e11)
FLIGHTS = {
    "small drone": (load_configuration("small_drone"), 80.0, 20.0),
    "small drone, fast": (load_configuration("small_drone"), 45.0, 27.0),
    "design example": (load_configuration("design_example"), 250.0, 50.0),
    "folding": (folding_configuration(), 100.0, 31.3),
    "folding, stiff": (STIFF, 100.0, 31.3),
}


def states_of(configuration, radius, speed, near=None, **others):
    """All states of a flight, or the continuations of those known."""
    p = flight_point(configuration, radius, speed, AIR, **others).parameters
    if near is None:
        return steady_states(p).states
    return tuple(correct_state(p, state.end_mass_radius) for state in near)


@pytest.fixture
def computed(monkeypatch):
    """The states whose stability has been computed."""
    states = []

    def counted(state, **options):
        states.append(state)
        return stability(state, **options)

    monkeypatch.setattr(margin, "stability", counted)
    return states


@pytest.mark.parametrize("flight", FLIGHTS)
def test_through_a_flight_the_margin_of_the_state_flown_is_within_one_percent(flight):
    configuration, radius, speed = FLIGHTS[flight]
    random = np.random.default_rng(6)
    margins, states = Margins(), states_of(configuration, radius, speed)
    for _ in range(60):
        radius *= np.exp(random.normal(0.0, 0.0005))
        speed *= np.exp(random.normal(0.0, 0.0005))
        states = states_of(configuration, radius, speed, states)
        kept, full = margins.update(states), [stability(state) for state in states]
        assert kept[0].growth_rate == pytest.approx(full[0].growth_rate, rel=0.01)
        for one, other in zip(kept, full, strict=True):
            # The others may wait for their turn.
            assert one.growth_rate == pytest.approx(other.growth_rate, rel=0.01, abs=0.01)
            assert one.verdict == other.verdict


def test_nothing_is_computed_on_an_orbit_that_is_held_and_all_of_one_that_is_new(computed):
    margins, states = Margins(), states_of(*FLIGHTS["folding"])
    first = margins.update(states)
    assert computed == list(states)
    assert margins.update(states_of(*FLIGHTS["folding"])) == first
    assert len(computed) == len(states)
    margins.reset()
    margins.update(states)
    assert len(computed) == 2 * len(states)


def test_an_orbit_computes_one_margin_unless_others_have_moved_far(computed):
    configuration, radius, speed = FLIGHTS["folding, stiff"]
    margins, states = Margins(), states_of(configuration, radius, speed)
    margins.update(states)
    computed.clear()
    near = states_of(configuration, radius, speed * 1.0009, states)
    kept = margins.update(near)
    assert computed == [near[0]]
    assert kept[0] == stability(near[0])
    far = states_of(configuration, radius, speed * 1.01, states)
    assert margins.update(far) == tuple(stability(state) for state in far)


def test_the_number_of_functions_is_sought_anew_only_far_from_where_it_was_found(monkeypatch):
    sought = []

    def counted(state, **options):
        sought.append(not options)
        return stability(state, **options)

    monkeypatch.setattr(margin, "stability", counted)
    configuration, radius, speed = FLIGHTS["design example"]
    margins, states = Margins(), states_of(configuration, radius, speed)
    for factor, expected in ((1.0, True), (1.01, False), (0.99, False), (1.05, True)):
        states = states_of(configuration, radius, speed * factor, states)
        (found,) = margins.update(states)
        assert sought.pop() == expected
        full = stability(states[0])
        assert found.converged
        assert found.functions == full.functions
        assert found.growth_rate == pytest.approx(full.growth_rate, rel=1e-6)


def test_the_state_of_another_branch_is_never_given_the_margin_of_this_one():
    states = states_of(*FLIGHTS["folding"])
    margins = Margins()
    for order in (states, states[::-1], states[1:], states[:1], states):
        assert margins.update(order) == tuple(stability(state) for state in order)


def test_beside_a_fold_the_margin_follows_the_end_mass_not_the_flight_alone():
    # The large branch of the folding flight ends at 97.1 m.
    configuration, margins, states = folding_configuration(), Margins(), None
    for radius in 97.13 + 0.6 * np.linspace(1.0, 0.0, 40) ** 2:
        if states is None:
            states = states_of(configuration, radius, 31.3)[2:]
        states = states_of(configuration, radius, 31.3, states)
        if states[0] is None or states[0].slope < 0.0:
            break
        (kept,), full = margins.update(states), stability(states[0])
        assert kept.growth_rate == pytest.approx(full.growth_rate, rel=0.01, abs=1e-3)
    assert radius < 97.2


def test_while_the_cable_is_paid_out_the_margin_follows():
    configuration, margins, states = load_configuration("small_drone"), Margins(), None
    for length in np.linspace(150.0, 156.0, 60):
        states = states_of(configuration, 80.0, 20.0, states, cable_length=length)
        (kept,) = margins.update(states)
        assert kept.growth_rate == pytest.approx(stability(states[0]).growth_rate, rel=0.005)
