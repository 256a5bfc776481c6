"""Derivatives of the modes against eigenvalues computed beside."""

import numpy as np
import pytest
from folding_flight import AIR, folding_configuration

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.margin import AIR_DENSITY
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.mode_sensitivity import modes
from ctcbs_ros.solver.stability import eigenvalues
from ctcbs_ros.solver.steady_state import correct_state, steady_states

FAMILIES = (RADIUS_AT_SPEED, ANGULAR_RATE, AIR_DENSITY)
FLIGHTS = {
    "small drone": (load_configuration("small_drone"), 60.0, 20.0, 0),
    "design example": (load_configuration("design_example"), 250.0, 50.0, 0),
    "folding, middle": (folding_configuration(), 100.0, 31.3, 1),
}


def state_of(flight):
    configuration, radius, speed, index = FLIGHTS[flight]
    point = flight_point(configuration, radius, speed, AIR)
    return steady_states(point.parameters).states[index]


@pytest.mark.parametrize("flight", FLIGHTS)
def test_derivatives_foretell_the_eigenvalues_of_a_neighbouring_flight(flight):
    state = state_of(flight)
    known = modes(state, 8, FAMILIES)
    assert known.derivatives.shape == (known.eigenvalues.size, 3)
    for family, by_tau in zip(FAMILIES, known.derivatives.T, strict=True):
        tau = 2e-3
        ends = [
            correct_state(family.at(state.parameters, way * tau), state.end_mass_radius)
            for way in (1, -1)
        ]
        above, below = (eigenvalues(end, 8) for end in ends)
        # Modes so close to another that the change could mix them are left out.
        apart = known.gaps > 20.0 * np.abs(by_tau) * tau
        assert apart.sum() >= 2
        for value, rate in zip(known.eigenvalues[apart], by_tau[apart], strict=True):
            higher = above[np.argmin(np.abs(above - value - rate * tau))]
            lower = below[np.argmin(np.abs(below - value + rate * tau))]
            assert abs((higher - lower) / (2.0 * tau) - rate) < 0.01 * abs(rate) + 0.005


@pytest.mark.parametrize("flight", FLIGHTS)
def test_the_modes_are_all_those_in_the_band(flight):
    state = state_of(flight)
    known, everything = modes(state, 8, FAMILIES), eigenvalues(state, 8)
    band = state.parameters.band
    slow = everything[(everything.imag >= 0.0) & (everything.imag <= band)]
    found = known.eigenvalues[known.eigenvalues.imag <= band]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(slow), abs=1e-6)
    for value, gap in zip(known.eigenvalues, known.gaps, strict=True):
        assert np.sort(np.abs(everything - value))[1] == pytest.approx(gap, abs=1e-6)


def test_beside_a_fold_there_are_no_derivatives():
    configuration, _, speed, _ = FLIGHTS["folding, middle"]
    # Thesis Fig. 3.1, d_n 4.8: the large branch ends at omega 1.098; 97.1 m at this speed.
    low, high = 96.0, 100.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        point = flight_point(configuration, middle, speed, AIR)
        if len(steady_states(point.parameters).states) == 3:
            high = middle
        else:
            low = middle
    point = flight_point(configuration, high * (1.0 + 1e-6), speed, AIR)
    assert modes(steady_states(point.parameters).states[2], 8, FAMILIES) is None
