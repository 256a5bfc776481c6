"""Fold curves against brute force: states counted on both sides, and on a grid of omega."""

from dataclasses import replace

import numpy as np
import pytest

from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.fold_curve import fold_curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import steady_states

# Fig. 3.1 of the thesis, and a light mass on a long cable, whose folds form three curves.
FIG_31 = Parameters(omega=1.0, length=3.0, end_mass=50.0, cable_drag=1.0, drag_ratio=1.0)
LIGHT = Parameters(omega=1.0, length=6.0, end_mass=3.5, cable_drag=1.0, drag_ratio=0.1)


@pytest.fixture(scope="module")
def light_curves():
    return fold_curves(LIGHT)


def count(parameters, omega, drag):
    return len(steady_states(replace(parameters, omega=omega, cable_drag=drag)).states)


def crossings(curves, drag):
    """omega at which fold curves cross a drag, by their polylines."""
    found = []
    for curve in curves:
        x = np.log(curve.cable_drag / drag)
        for i in np.flatnonzero(x[:-1] * x[1:] < 0.0):
            share = x[i] / (x[i] - x[i + 1])
            found.append(curve.omega[i] + share * (curve.omega[i + 1] - curve.omega[i]))
    return np.sort(found)


@pytest.mark.parametrize("elasticity", [float("inf"), 600.0])
def test_number_of_states_differs_by_two_across_a_fold_curve(elasticity):
    parameters = replace(FIG_31, elasticity=elasticity)
    (curve,) = fold_curves(parameters, drag_range=(0.3, 100.0))
    for i in range(2, len(curve.omega) - 2, max(len(curve.omega) // 12, 1)):
        omega, drag = curve.omega[i], curve.cable_drag[i]
        along = np.log([curve.omega[i + 1], curve.cable_drag[i + 1]])
        along -= np.log([curve.omega[i - 1], curve.cable_drag[i - 1]])
        across = 3e-4 * np.array([-along[1], along[0]]) / np.hypot(*along)
        if abs(drag / curve.cable_drag.max() - 1.0) < 0.02:
            continue  # in the tip of the cusp both sides are within reach of both folds
        sides = [count(parameters, *np.exp(e * across) * (omega, drag)) for e in (-1.0, 1.0)]
        assert abs(sides[0] - sides[1]) == 2


def test_cusp_of_fig_3_2_is_on_the_curve():
    # Thesis, Figs. 3.1 and 3.2: no folds above d_n 6.2, near omega 0.9.
    (curve,) = fold_curves(FIG_31)
    (cusp,) = curve.cusps
    assert cusp.cable_drag == pytest.approx(6.2, abs=0.1)
    assert cusp.omega == pytest.approx(0.9, abs=0.05)
    assert curve.cable_drag.max() <= cusp.cable_drag * (1.0 + 1e-9)


@pytest.mark.parametrize("drag", [0.03, 0.4, 2.5, 20.0])
def test_curves_cross_a_drag_wherever_the_number_of_states_changes(light_curves, drag):
    omegas = np.linspace(0.3, 2.995, 400)
    counts = np.array([count(LIGHT, omega, drag) for omega in omegas])
    changes = np.flatnonzero(np.diff(counts))
    found = crossings(light_curves, drag)
    for i in changes:
        inside = np.sum((found > omegas[i] - 1e-3) & (found < omegas[i + 1] + 1e-3))
        assert 2 * inside >= abs(counts[i + 1] - counts[i]) > 0
    assert len(found) == np.abs(np.diff(counts)).sum() // 2


def test_closed_fold_curve_has_two_cusps(light_curves):
    (curve,) = [curve for curve in light_curves if curve.closed]
    assert len(curve.cusps) == 2
    upper, lower = sorted(curve.cusps, key=lambda c: -c.cable_drag)
    for cusp, beyond in ((upper, 1.01), (lower, 0.99)):
        near = cusp.omega * np.linspace(0.99, 1.01, 41)
        assert {count(LIGHT, w, cusp.cable_drag * beyond) for w in near} == {1}
    inside = upper.omega * np.linspace(0.99, 1.02, 301)
    assert max(count(LIGHT, w, upper.cable_drag * 0.97) for w in inside) == 3


def test_empty_range_is_refused():
    with pytest.raises(InputError, match="cable drag: 3 to 2"):
        fold_curves(FIG_31, drag_range=(3.0, 2.0))
