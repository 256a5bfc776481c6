"""Numbers that the thesis states (figures' captions and text), as docs/thesis.md corrects them."""

from itertools import pairwise
from math import exp, log

import numpy as np
import pytest
from points import design, figure_3_1, figure_4_1, parameters

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.family import ANGULAR_RATE
from ctcbs_ros.solver.flown import landing
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states


def _branch(d_n, omega=0.5, high=3.0, figure=figure_3_1):
    state = steady_states(parameters(figure(d_n, omega=omega))).states[0]
    path = trace(
        state.parameters, state.end_mass_radius, ANGULAR_RATE, 1,
        (log(0.02 / omega), log(high / omega)),
    )  # fmt: skip
    return path, state


# Fig. 3.1: f 1, l 3, m 50.


def test_figure_3_1_jumps_of_d_n_4_8():
    # multivalued for 0.9 < omega < 1.1; 2.3 -> 0.5 rising, 1.3 -> 2.5 falling
    path, state = _branch(4.8)
    rising, falling = path.folds
    assert 0.5 * exp(rising.tau) == pytest.approx(1.1, abs=0.03)
    assert 0.5 * exp(falling.tau) == pytest.approx(0.93, abs=0.03)
    assert rising.end_mass_radius == pytest.approx(2.3, abs=0.1)
    assert falling.end_mass_radius == pytest.approx(1.3, abs=0.1)
    lands = landing(state.parameters, rising, ANGULAR_RATE, 1)
    assert lands.end_mass_radius == pytest.approx(0.5, abs=0.05)
    lands = landing(state.parameters, falling, ANGULAR_RATE, -1)
    assert lands.end_mass_radius == pytest.approx(2.5, abs=0.05)


def test_figure_3_1_jumps_end_in_a_cusp_below_d_n_6_2():
    assert len(_branch(6.0)[0].folds) == 2
    for d_n in (6.2, 7.0, 10.0):
        assert _branch(d_n)[0].folds == ()
        numbers = {len(steady_states(parameters(figure_3_1(d_n, omega))).states)
                   for omega in np.arange(0.1, 3.0, 0.1)}  # fmt: skip
        assert numbers == {1}


def test_figure_3_1_folds_of_d_n_close_in_on_each_other():
    # Fig. 3.2: F1 and F2 move closer and coalesce in a cusp
    widths = []
    for d_n in (4.5, 5.0, 5.5, 6.0):
        high, low = (fold.tau for fold in _branch(d_n)[0].folds)
        widths.append(high - low)
    assert all(b < 0.7 * a for a, b in pairwise(widths))


def test_figure_3_1_d_n_2_7_has_several_states_above_0_9():
    for omega, number in ((0.5, 1), (0.8, 1), (1.0, 3), (1.5, 3), (2.5, 3)):
        assert len(steady_states(parameters(figure_3_1(2.7, omega))).states) == number


# Fig. 4.1: m 3.5, l 3, f 0.1, inextensible base, gamma 600.


def _unstable_windows(d_n, step=0.05, high=4.2):
    """Intervals of omega with an unstable state, their edges interpolated."""
    omegas = np.arange(1.2, high, step)
    growth = []
    for omega in omegas:
        (state,) = steady_states(parameters(figure_4_1(d_n, omega))).states
        growth.append(stability(state).growth_rate)
    growth = np.array(growth)
    edges = np.flatnonzero(growth[:-1] * growth[1:] < 0.0)
    return [
        (omegas[i] + step * growth[i] / (growth[i] - growth[i + 1]), growth[i + 1] > 0.0)
        for i in edges
    ]


def test_figure_4_1_has_two_flutter_windows_at_d_n_1_33():
    (a, opens_a), (b, opens_b), (c, opens_c) = _unstable_windows(1.33)
    assert (opens_a, opens_b, opens_c) == (True, False, True)
    assert (a, b) == (pytest.approx(1.8, abs=0.25), pytest.approx(2.2, abs=0.25))
    assert c == pytest.approx(2.8, abs=0.25)


def test_figure_4_1_is_unstable_from_about_3_4_at_d_n_2():
    ((edge, opens),) = _unstable_windows(2.0)
    assert opens
    assert edge == pytest.approx(3.4, abs=0.1)


def test_figure_4_1_is_stable_at_d_n_3():
    assert _unstable_windows(3.0, step=0.1) == []


@pytest.mark.parametrize("d_n", [1.33, 2.0, 3.0])
def test_figure_4_1_has_its_first_minimum_of_the_radius_near_2_1(d_n):
    omegas = np.arange(1.5, 3.0, 0.05)
    radii = [
        steady_states(parameters(figure_4_1(d_n, omega))).states[0].end_mass_radius
        for omega in omegas
    ]
    assert omegas[np.argmin(radii)] == pytest.approx(2.1, abs=0.2)


# Chapter 5, V 50 m/s.

FIRST, SECOND = 0.00196, 0.045  # frontal area of the two end masses [m^2], docs/thesis.md


@pytest.mark.parametrize(
    ("radius", "area", "l", "d_n", "f", "x_d"),
    [
        (250.0, FIRST, 4.0, 213.4, 0.0436, 0.1484),
        (250.0, SECOND, 4.0, 213.4, 1.0, 0.0832),
        (100.0, FIRST, 10.0, 85.36, 0.109, 8.51e-3),
        (100.0, SECOND, 10.0, 85.36, 2.5, 8.48e-3),
    ],
)
def test_chapter_5_end_mass_radius_without_stretch(radius, area, l, d_n, f, x_d):  # noqa: E741
    point = design(radius, area=area, elastic=False)
    assert point["l"] == l
    assert point["d_n"] == pytest.approx(d_n, abs=0.05)
    assert point["f"] == pytest.approx(f, rel=5e-3)
    (state,) = steady_states(parameters(point)).states
    assert state.end_mass_radius == pytest.approx(x_d, rel=1e-3)


def test_chapter_5_end_mass_radius_with_stretch():
    (state,) = steady_states(parameters(design(250.0))).states
    assert state.end_mass_radius == pytest.approx(0.0800, abs=5e-5)


def test_chapter_5_is_stable_for_every_radius_and_deployed_length():
    # Figs. 5.2 and 5.3
    for elastic in (False, True):
        for radius in (100.0, 150.0, 200.0, 250.0):
            for length in (50.0, 250.0, 500.0, 1000.0):
                p = parameters(design(radius, length=length, elastic=elastic))
                (state,) = steady_states(p).states
                assert stability(state).stable


def test_appendix_d_more_drag_on_the_end_mass_makes_the_circle_smaller():
    # Fig. D.1, at the lower angular velocities
    radii = [
        steady_states(parameters({**figure_3_1(10.0), "f": f})).states[0].end_mass_radius
        for f in (0.5, 1.0, 2.0)
    ]
    assert radii == sorted(radii, reverse=True)


# SI units.


def test_chapter_5_in_si_units_gives_its_non_dimensional_parameters():
    # thesis: omega 1.0 - 1.6, m 20 - 50, d_n 213.41 - 85.36 over a 250 - 100 m; d 213.4 second
    configuration = load_configuration("design_example")
    for radius, omega, m, d_n in ((250.0, 1.0, 20.0, 213.41), (100.0, 1.6, 50.0, 85.36)):
        p = flight_point(configuration, radius, 50.0, 1.18).parameters
        assert p.omega == pytest.approx(omega, abs=0.011)
        assert p.end_mass == pytest.approx(m, rel=0.006)
        assert p.cable_drag == pytest.approx(d_n, abs=0.01)
        assert p.end_mass_drag == pytest.approx(213.4, abs=0.05)
        point = design(radius)
        assert p.omega == pytest.approx(point["omega"], rel=1e-14)
        assert p.length == pytest.approx(point["l"], rel=1e-14)
        assert p.end_mass == pytest.approx(point["m"], rel=1e-14)
        assert p.end_weight == pytest.approx(point["m"], rel=1e-14)
        assert p.drag_ratio == pytest.approx(point["f"], rel=1e-14)
        assert p.elasticity == pytest.approx(point["gamma"], rel=1e-14)
        assert p.density == 1.0


def test_the_first_design_has_d_9_3(tmp_path):
    text = (load_configuration("design_example").source, "frontal_area: 0.045")
    file = tmp_path / "first.yaml"
    with open(text[0], encoding="utf-8") as original:
        file.write_text(original.read().replace(text[1], "frontal_area: 0.00196"))
    p = flight_point(load_configuration(file), 250.0, 50.0, 1.18).parameters
    assert p.end_mass_drag == pytest.approx(9.3, abs=0.05)
