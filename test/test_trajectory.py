"""The compiled cable against scipy's integrator, every analytic derivative against differences.

Differences are of `reference_bvp.shoot`, so that derivative and value are both checked by code
that the kernels do not share.
"""

from dataclasses import replace

import numpy as np
import pytest
from points import STRETCHED, design, figure_3_1, parameters
from reference_bvp import filled, shoot
from scipy.integrate import DOP853
from scipy.special import j0, j1, y0, y1

from ctcbs_ros.kernels import dormand_prince, search
from ctcbs_ros.kernels.continuation import level
from ctcbs_ros.kernels.trajectory import N_THETA, OK, integrate, integrate_halved
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, family_between
from ctcbs_ros.solver.sensitivity import sensitivities
from ctcbs_ros.solver.steady_state import steady_states

NAMES = ("x_d", "omega", "m", "w", "d_n", "d", "rho", "g")
POINTS = {
    "inextensible": (figure_3_1(4.8), 0.7),
    "outer": (figure_3_1(4.8), 2.4),
    "elastic": (STRETCHED, 0.2),
    "buoyant": ({**STRETCHED, "w": 45.0, "rho": 0.8}, 1.1),
    "strong drag": (design(250.0), 0.08),
}


def _theta(point, x_d):
    return parameters(point).theta(x_d)


def _run(theta, length, directions=None, nodes=None, tolerance=1e-12):
    """States at the nodes (default: the tow point), (n, 1 + k, 6)."""
    directions = np.empty((0, N_THETA)) if directions is None else directions
    nodes = np.array([length]) if nodes is None else nodes
    out = np.empty((nodes.size, 1 + len(directions), 6))
    mesh = np.empty(search.MAX_STEPS + 1)
    status, steps, _ = integrate(
        theta, directions, nodes, tolerance, search.MAX_STEPS, out, mesh
    )
    assert status == OK
    return out, mesh, steps


def _reference(theta, length):
    """The same from `shoot`, at the tow point, (6,)."""
    x_d, omega, m, w, d_n, d, rho, g = theta
    point = {"omega": omega, "l": length, "m": m, "w": w, "d_n": d_n, "f": d / d_n, "rho": rho}
    return shoot({**point, "gamma": 1.0 / g if g else np.inf}, [x_d], 3e-14)[:, 0]


@pytest.mark.parametrize("name", POINTS)
def test_integration_is_that_of_scipy_at_the_tow_point(name):
    point, x_d = POINTS[name]
    theta = _theta(point, x_d)
    state = _run(theta, point["l"])[0][0, 0]
    expected = _reference(theta, point["l"])
    assert state[:3] == pytest.approx(expected[:3], abs=1e-9)
    assert state[3:] == pytest.approx(expected[3:], rel=1e-9, abs=1e-8)


@pytest.mark.parametrize("name", POINTS)
def test_nodes_on_the_way_and_halved_steps_change_nothing(name):
    point, x_d = POINTS[name]
    theta, length = _theta(point, x_d), point["l"]
    end, mesh, steps = _run(theta, length)
    by_nodes = _run(theta, length, nodes=np.linspace(0.0, length, 31))[0]
    assert by_nodes[-1, 0] == pytest.approx(end[0, 0], rel=1e-9, abs=1e-9)
    assert by_nodes[0, 0, :3] == pytest.approx([x_d, 0.0, 0.0], abs=0.0)
    halved, _ = integrate_halved(theta, mesh, steps)
    assert halved == pytest.approx(end[0, 0], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("component", range(N_THETA))
@pytest.mark.parametrize("name", POINTS)
def test_variational_equations_are_the_derivative(name, component):
    point, x_d = POINTS[name]
    theta, length = _theta(point, x_d), point["l"]
    direction = np.zeros((1, N_THETA))
    direction[0, component] = 1.0
    derivative = _run(theta, length, direction)[0][0, 1]

    step = 1e-4 * max(abs(theta[component]), 1e-3)
    if NAMES[component] == "g":
        step = 1e-6
        theta = theta.copy()
        theta[component] = max(theta[component], 4.0 * step)  # no negative compliance
        derivative = _run(theta, length, direction)[0][0, 1]

    def moved(steps):
        there = theta.copy()
        there[component] += steps * step
        return _reference(there, length)

    # fourth-order central difference
    expected = (8.0 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / (12.0 * step)
    size = np.abs(expected).max()
    assert size > 0.0
    assert derivative == pytest.approx(expected, abs=2e-6 * size)


@pytest.mark.parametrize("family", [ANGULAR_RATE, RADIUS_AT_SPEED], ids=lambda f: f.name)
@pytest.mark.parametrize("name", POINTS)
def test_tow_circle_condition_along_a_family_has_the_right_derivatives(name, family):
    point, x_d = POINTS[name]
    p = parameters(point)
    states, mesh = np.empty((1, 3, 6)), np.empty(search.MAX_STEPS + 1)

    def at(tau, u):
        return level(
            p.theta(), family.exponents(), p.length, family.length, tau, u, 1e-12, states, mesh
        )

    def expected(tau, u):
        there = family.at(p, tau)
        end = _reference(there.theta(np.exp(u)), there.length)
        return end[0] ** 2 + end[1] ** 2 - 1.0

    tau, u, e = 0.13, np.log(x_d), 1e-4
    h, h_u, h_tau, status = at(tau, u)
    assert status == OK
    assert h == pytest.approx(expected(tau, u), abs=1e-8)
    by_u = (expected(tau, u + e) - expected(tau, u - e)) / (2.0 * e)
    by_tau = (expected(tau + e, u) - expected(tau - e, u)) / (2.0 * e)
    size = max(abs(by_u), abs(by_tau))
    assert h_u == pytest.approx(by_u, abs=1e-5 * size)
    assert h_tau == pytest.approx(by_tau, abs=1e-5 * size)


@pytest.mark.parametrize(
    "point", [figure_3_1(4.8), STRETCHED, design(250.0)], ids=["three", "elastic", "design"]
)
def test_sensitivities_are_the_differences_of_steady_states(point):
    p = parameters(point)
    # one family that moves every parameter, length and stiffness apart
    odd = {**point, "omega": 1.1 * point["omega"], "l": 0.9 * point["l"], "m": 1.3 * point["m"],
           "d_n": 1.2 * point["d_n"]}  # fmt: skip
    families = (ANGULAR_RATE, RADIUS_AT_SPEED, family_between(p, parameters(odd))[0])
    e = 1e-5

    def figures(parameters_there, index):
        s = steady_states(parameters_there).states[index]
        return np.array([s.end_mass_radius, s.depth, s.phase_lag])

    for index, state in enumerate(steady_states(p).states):
        found = sensitivities(state, families)
        for row, family in zip(found, families, strict=True):
            difference = figures(family.at(p, e), index) - figures(family.at(p, -e), index)
            assert row == pytest.approx(difference / (2.0 * e), rel=1e-4, abs=1e-4)


def test_radius_at_speed_is_the_family_that_si_units_make():
    # the same cable, mass, air and speed at another radius
    near, far = parameters(design(200.0)), parameters(design(250.0))
    moved = RADIUS_AT_SPEED.at(near, np.log(250.0 / 200.0))
    assert moved.theta() == pytest.approx(far.theta(), rel=1e-12)
    assert moved.length == pytest.approx(far.length, rel=1e-12)
    assert moved.elasticity == pytest.approx(far.elasticity, rel=1e-12)


def test_radius_at_speed_scales_the_elasticity_of_the_vibration_alone_too():
    # gamma = E/(rho_a a g): the same cable vibrates at half the gamma at twice the radius
    near = parameters(design(125.0, elastic=False), vibration_elasticity=1483.2)
    there = RADIUS_AT_SPEED.at(near, np.log(2.0))
    assert there.elasticity == np.inf
    assert there.gamma == pytest.approx(741.6, rel=1e-12)
    assert ANGULAR_RATE.at(near, 0.3).gamma == near.gamma


def test_angular_rate_is_the_family_that_si_units_make():
    slow, fast = parameters(design(200.0, speed=40.0)), parameters(design(200.0, speed=50.0))
    moved = ANGULAR_RATE.at(slow, np.log(50.0 / 40.0))
    assert moved.theta() == pytest.approx(fast.theta(), rel=1e-12)
    assert (moved.length, moved.elasticity) == pytest.approx((fast.length, fast.elasticity))


def test_family_between_two_points_ends_at_the_other():
    start, end = parameters(design(150.0, speed=45.0)), parameters(design(250.0, speed=55.0))
    family, distance = family_between(start, end)
    there = family.at(start, distance)
    assert there.theta() == pytest.approx(end.theta(), rel=1e-12)
    assert (there.length, there.elasticity) == pytest.approx((end.length, end.elasticity))
    stiff = replace(start, elasticity=np.inf, vibration_elasticity=500.0)
    softer = replace(end, elasticity=np.inf, vibration_elasticity=400.0)
    family, distance = family_between(stiff, softer)
    assert family.at(stiff, distance).gamma == pytest.approx(400.0, rel=1e-12)


def test_a_point_of_the_cable_at_rest_in_the_air_has_no_drag_and_a_finite_derivative():
    # x_d 0 puts the whole cable on the axis, where v_n is 0 (erratum to (A.1))
    theta = _theta(figure_3_1(10.0), 0.0)
    direction = np.zeros((1, N_THETA))
    direction[0, 0] = 1.0
    out = _run(theta, 3.0, direction)[0][0]
    assert out[0] == pytest.approx([0.0, 0.0, 3.0, 0.0, 0.0, 53.0], abs=1e-12)
    assert np.isfinite(out).all()
    # drag is quadratic: to first order in x_d a tiny circle is the linear string
    tiny = _reference(_theta(figure_3_1(10.0), 1e-7), 3.0) / 1e-7
    assert out[1, 0] == pytest.approx(tiny[0], rel=1e-4)


def test_a_small_circle_is_the_linear_string_of_bessel_functions():
    # d_n -> 0, small x_d: (T x')' = -omega^2 x with T = m + s, T x' = -omega^2 m x_d at s = 0.
    # With q = 2 omega sqrt(m + s): x = A J0(q) + B Y0(q).
    omega, m, length = 1.7, 5.0, 3.0
    q0, q1 = 2.0 * omega * np.sqrt(m), 2.0 * omega * np.sqrt(m + length)
    # x' = -(A J1 + B Y1) omega / sqrt(m + s)
    system = [[j0(q0), y0(q0)], [-j1(q0) * omega / np.sqrt(m), -y1(q0) * omega / np.sqrt(m)]]
    a, b = np.linalg.solve(system, [1.0, -(omega**2)])
    theta = _theta({"omega": omega, "l": length, "m": m, "d_n": 1e-12, "f": 1.0}, 1e-6)
    end = _run(theta, length)[0][0, 0]
    assert end[0] / 1e-6 == pytest.approx(a * j0(q1) + b * y0(q1), rel=1e-8)


def test_parameters_are_packed_in_the_order_of_the_kernels():
    point = {"omega": 1.1, "l": 3.0, "m": 40.0, "w": 38.0, "d_n": 7.0, "f": 0.5, "rho": 0.9,
             "gamma": 500.0}  # fmt: skip
    omega, length, m, w, d_n, d, rho, g = filled(point)
    p = parameters(point)
    assert p.theta(0.3) == pytest.approx([0.3, omega, m, w, d_n, d, rho, g], rel=1e-15)
    assert p.length == length


def test_the_coefficients_of_the_integrator_are_those_of_scipy():
    assert np.array_equal(dormand_prince.A, DOP853.A[: DOP853.n_stages])
    for name in ("B", "E3", "E5"):
        assert np.array_equal(getattr(dormand_prince, name), getattr(DOP853, name))
