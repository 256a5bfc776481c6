"""Hopf curves against growth rates computed point by point."""

from dataclasses import replace

import numpy as np
import pytest

from ctcbs_ros.solver.hopf_curve import hopf_curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

# Fig. 4.1 of the thesis.
FIG_41 = Parameters(omega=1.0, length=3.0, end_mass=3.5, cable_drag=1.0, drag_ratio=0.1)


@pytest.fixture(scope="module")
def curve():
    (curve,) = hopf_curves(FIG_41, (0.3, 4.0), (0.95, 5.0))
    return curve


def crossings(curve, drag):
    x = np.log(curve.cable_drag / drag)
    i = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    share = x[i] / (x[i] - x[i + 1])
    return np.sort(curve.omega[i] + share * (curve.omega[i + 1] - curve.omega[i]))


def test_curve_crosses_fig_4_1_at_the_edges_of_its_flutter_windows(curve):
    # Thesis, Fig. 4.1: d_n 1.33 unstable for about 1.8 to 2.2 and from 2.8, d_n 2 from 3.2
    # (3.4 when converged), d_n 3 nowhere.
    np.testing.assert_allclose(crossings(curve, 1.33), [1.8, 2.2, 2.8], atol=0.2)
    np.testing.assert_allclose(crossings(curve, 2.0), [3.4], atol=0.1)
    assert crossings(curve, 3.0).size == 0
    assert curve.leading.all()


def test_growth_rate_vanishes_on_the_curve_and_changes_sign_across_it(curve):
    def growth(omega, drag):
        (state,) = steady_states(replace(FIG_41, omega=omega, cable_drag=drag)).states
        return stability(state, functions=(40,)).growth_rate

    place = np.log([curve.omega, curve.cable_drag])
    for i in range(3, len(curve.omega) - 1, len(curve.omega) // 6):
        along = place[:, i + 1] - place[:, i - 1]
        across = 0.01 * np.array([-along[1], along[0]]) / np.hypot(*along)
        here, there = np.exp(place[:, i] - across), np.exp(place[:, i] + across)
        assert abs(growth(curve.omega[i], curve.cable_drag[i])) < 1e-4
        assert growth(*here) * growth(*there) < 0.0
