"""The cable in time: what it conserves, where it settles, how it leaves what is not stable."""

from itertools import pairwise

import numpy as np
import pytest
from points import STRETCHED, design, figure_3_1, figure_4_1, parameters, random_points
from reference_integrators import generalised_alpha, longest_step, runge_kutta
from reference_lumped_mass import LumpedMass, extrapolate, radius_depth_lag

from ctcbs_ros.dynamics.cable import (
    CableState,
    drive,
    hanging,
    simulate,
    with_disturbance,
)
from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.dynamics.loads import loads
from ctcbs_ros.dynamics.signal import circle, constant, held, linear, sampled, spline, steps
from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

STILL = constant(np.zeros(3))


def turned(positions, times):
    """Positions (m, 3) at times (m,) in the frame that turns at the rate 1."""
    c, s = np.cos(times), np.sin(times)
    x, y, z = positions.T
    return np.column_stack([c * x + s * y, c * y - s * x, z])


def pendulum(n, stiffness, angle=0.5, length=3.0):
    """A heavy cable without drag, held aside by an angle, and stretched about as it hangs."""
    line = Line(1.0, stiffness, 1.0, 0.0, length, 2.0, 2.0, 0.0)
    down = np.linspace(length, 0.0, n + 1) * (1.0 + 3.5 / stiffness)
    x = np.column_stack([down * np.sin(angle), 0.0 * down, -down * np.cos(angle)])
    return line, CableState(0.0, x, np.zeros_like(x))


def test_the_motion_is_the_references_by_another_integrator():
    # a peer in the turning frame, integrated by scipy's DOP853 to 1e-8
    point = {**STRETCHED, "m": 3.5}
    (state,) = steady_states(parameters(point)).states
    n = 8
    rest = equilibrium(state, n)
    push = np.linspace(0.05, 0.0, n + 1)[:, None] * [1.0, 0.5, 0.3]
    start = with_disturbance(rest, velocities=push)
    times = np.linspace(0.0, 4.0, 9)
    peer = LumpedMass(point, n)
    expected = peer.simulate(rest.positions[:-1].ravel(), push[:-1].ravel(), times)
    line = line_of(state.parameters)
    driven = drive(line, circle(1.0, 1.0, 0.0, 5.0))
    found = []
    for tolerance in (1e-5, 1e-7):
        motion = simulate(line, driven, start, times, tolerance)
        mass = turned(motion.positions[:, 0], times)
        found.append(np.abs(mass - expected[:, :3]).max())
    assert found[0] < 2e-6
    assert found[1] < 2e-8


def test_a_pick_up_on_the_circle_is_that_of_the_references_by_another_integrator():
    # MoorDyn's end mass cannot change: the same peer, stopped and gone on with another mass
    light = {**STRETCHED, "m": 3.5}
    heavy = {**light, "m": 5.0, "f": 1.4}
    (state,) = steady_states(parameters(light)).states
    n, before, after = 8, np.array([0.0, 1.0, 2.0]), np.array([2.0, 2.5, 3.0, 4.0])
    rest = equilibrium(state, n)
    push = np.linspace(0.05, 0.0, n + 1)[:, None] * [1.0, 0.5, 0.3]
    there = LumpedMass(light, n).simulate(rest.positions[:-1].ravel(), push[:-1].ravel(), before)
    picked = LumpedMass(heavy, n).simulate(*np.split(there[-1], 2), after)
    # it matters: without, the mass is elsewhere
    left = LumpedMass(light, n).simulate(*np.split(there[-1], 2), after)
    assert np.linalg.norm(picked[-1, :3] - left[-1, :3]) > 0.05
    line = line_of(state.parameters)
    ends = [line.end, line_of(parameters(heavy)).end]
    driven = drive(line, circle(1.0, 1.0, 0.0, 5.0), end=steps([2.0], ends))
    start = with_disturbance(rest, velocities=push)
    times = np.concatenate([before, after[1:]])
    motion = simulate(line, driven, start, times, 1e-7)
    expected = np.concatenate([there, picked[1:]])[:, :3]
    assert turned(motion.positions[:, 0], times) == pytest.approx(expected, abs=1e-6)


def test_explicit_and_implicit_peers_find_the_same_motion_in_a_rising_wind():
    (state,) = steady_states(parameters(STRETCHED)).states
    line, start, span = line_of(state.parameters), equilibrium(state, 20), 6.0
    driven = drive(
        line, circle(1.0, 1.0, 0.0, span), linear([1.0, 5.0], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    )
    found = simulate(line, driven, start, [span], 1e-6).positions[0]
    moved = np.abs(found - simulate(line, drive(line, driven.tow_point), start, [span]).positions)
    assert moved.max() > 0.03
    others = (driven.compiled, line.packed(), 0.0)
    count = int(span / longest_step(line, 20) / 0.4)
    x, v = start.positions.copy(), start.velocities.copy()
    runge_kutta(*others, span / count, count, x, v)
    assert found == pytest.approx(x, abs=1e-5)
    off = []
    for count in (200, 400):
        x, v = start.positions.copy(), start.velocities.copy()
        generalised_alpha(*others, span / count, count, x, v, 0.8, 1e-9)
        off.append(np.abs(found - x).max())
    assert off[1] < 3e-5
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("stiffness", [600.0, 60000.0])
def test_energy_stays_without_drag(stiffness):
    line, start = pendulum(20, stiffness)
    driven = drive(line, STILL)
    lost = []
    for tolerance in (1e-4, 1e-5):
        motion = simulate(line, driven, start, np.linspace(0.0, 20.0, 201), tolerance)
        found = loads(line, driven, motion)
        lost.append(np.ptp(found.energy[[0, -1]]) / np.ptp(found.kinetic))
    # what is lost is the integrator's: ten times less error, less of it
    assert lost[0] < 1e-3
    assert lost[1] < 0.1 * lost[0]


@pytest.mark.parametrize("drag_at_nodes", [False, True], ids=["segments", "nodes"])
def test_the_tow_point_the_air_and_the_dashpots_account_for_all_energy(drag_at_nodes):
    line = Line(1.0, 600.0, 1.0, 0.5, 3.0, 2.0, 2.0, 0.3, 0.01, drag_at_nodes)
    # starts from rest, smoothly
    tow = sampled(
        lambda t: (1.0 - np.exp(-(t**3)))[:, None]
        * np.stack([np.sin(t), 0.3 * np.sin(2.0 * t), 0.0 * t], axis=-1),
        0.0, 12.0, 0.01,
    )  # fmt: skip
    driven = drive(line, tow, wind=linear([1.0, 8.0], [[0.0, 0.0, 0.0], [0.5, 0.2, 0.0]]))
    times = np.linspace(0.0, 11.0, 4401)
    found = loads(line, driven, simulate(line, driven, hanging(line, 20), times, 1e-6))
    power = found.tow_power + found.air_power + found.dashpot_power
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(times))])
    assert np.abs(found.energy - found.energy[0] - work).max() < 5e-4 * np.ptp(found.energy)
    assert found.dashpot_power.max() <= 0.0


@pytest.mark.parametrize("drag_at_nodes", [False, True], ids=["segments", "nodes"])
def test_the_discretised_steady_state_is_of_second_order_in_segments(drag_at_nodes):
    for point in (STRETCHED, {**STRETCHED, "gamma": 6e4}, design(250.0)):
        (state,) = steady_states(parameters(point)).states
        exact = np.array([state.end_mass_radius, state.depth, state.phase_lag])
        found = [
            np.array(radius_depth_lag(equilibrium(state, n, drag_at_nodes).positions.ravel()))
            for n in (20, 40, 80)
        ]
        errors = [np.abs(f - exact).max() for f in found]
        for coarse, fine in pairwise(errors):
            assert coarse / fine == pytest.approx(4.0, rel=0.1)
        assert extrapolate(found[1], found[2]) == pytest.approx(exact, abs=5e-6)


@pytest.mark.parametrize("gamma", [600.0, 1e6])
def test_every_steady_state_is_found_among_the_discretised_ones(gamma):
    found = 0
    for point in random_points(12, 3, False):
        for state in steady_states(parameters({**point, "gamma": gamma})).states:
            rest = equilibrium(state, 40)
            radius, depth, _ = radius_depth_lag(rest.positions.ravel())
            assert (radius, depth) == pytest.approx((state.end_mass_radius, state.depth), abs=0.03)
            found += 1
    assert found >= 12


@pytest.mark.parametrize(
    "point", [STRETCHED, {**STRETCHED, "gamma": 6e4}, design(250.0)],
    ids=["stretched", "stiff", "design"],
)  # fmt: skip
def test_from_a_steady_state_disturbed_the_cable_returns_to_it(point):
    (state,) = steady_states(parameters(point)).states
    margin = -stability(state).growth_rate
    span = np.log(1e4) / margin
    line = line_of(state.parameters)
    driven = drive(line, circle(1.0, 1.0, 0.0, span))
    found = []
    for n in (20, 40):
        push = np.linspace(0.1, 0.0, n + 1)[:, None] * [1.0, 0.5, 0.0]
        start = with_disturbance(equilibrium(state, n), velocities=push)
        end = simulate(line, driven, start, [span], 3e-4).positions[0]
        found.append(np.array(radius_depth_lag(turned(end[:1], np.array([span])).ravel())))
    exact = [state.end_mass_radius, state.depth, state.phase_lag]
    # 0.1 % of the tow radius, once extrapolated in the segments
    assert extrapolate(*found)[:2] == pytest.approx(exact[:2], abs=2e-4)
    assert found[1][:2] == pytest.approx(exact[:2], abs=1e-3)


def least_damped(state, n, span, settle, modes, disturbance=1e-5):
    """Growth rate and frequency of the least damped of a few modes in the band, after a while.

    By a matrix pencil through the end mass's departure from the discretised steady state, after a
    filter that lets only slow modes pass and changes no rate.
    """
    rest = equilibrium(state, n)
    line = line_of(state.parameters)
    push = np.linspace(disturbance, 0.0, n + 1)[:, None] * [1.0, 0.7, 0.0]
    times = np.linspace(settle, span, round((span - settle) / 0.1))
    motion = simulate(
        line, drive(line, circle(1.0, 1.0, 0.0, span)),
        with_disturbance(rest, velocities=push), times,
    )  # fmt: skip
    away = turned(motion.positions[:, 0], times) - rest.positions[0]
    assert np.abs(away).max() < 1e-2
    smooth = np.hanning(43)[1:-1]
    away = np.apply_along_axis(np.convolve, 0, away, smooth / smooth.sum(), "valid")[::4]
    window = len(away) // 2
    pieces = np.lib.stride_tricks.sliding_window_view(away, window + 1, axis=0).reshape(
        -1, window + 1
    )
    right = np.linalg.svd(pieces, full_matrices=False)[2][:modes]
    shifted = np.linalg.pinv(right[:, :-1].T) @ right[:, 1:].T
    values = np.log(np.linalg.eigvals(shifted).astype(complex)) / (times[4] - times[0])
    worst = values[np.argmax(values.real)]
    return np.array([worst.real, abs(worst.imag)])


@pytest.mark.parametrize(
    ("point", "which", "span", "settle", "modes", "segments"),
    # more modes than these only find twice the frequency, and what is left of the axial waves
    [
        # between the folds, elastic and nearly inextensible: divergence
        ({**figure_3_1(4.8, 1.05), "gamma": 6e4}, 1, 70.0, 40.0, 2, (20, 40)),
        ({**figure_3_1(4.8, 1.09), "gamma": 1e6}, 1, 80.0, 50.0, 2, (20, 40)),
        # flutter in the narrow window of Fig. 4.1, and a stable state
        ({**figure_4_1(1.33, 2.0), "gamma": 600.0}, 0, 150.0, 70.0, 4, (40, 80)),
        ({**figure_4_1(1.33, 2.0), "gamma": 6e4}, 0, 130.0, 60.0, 4, (40, 80)),
        ({**figure_4_1(1.33, 3.4), "gamma": 600.0}, 0, 90.0, 40.0, 4, (40, 80)),
        ({**figure_4_1(1.33, 1.9), "gamma": 600.0}, 0, 150.0, 70.0, 4, (40, 80)),
        ({**figure_4_1(2.0, 3.6), "gamma": 600.0}, 0, 150.0, 70.0, 4, (40, 80)),
        (STRETCHED, 0, 120.0, 40.0, 4, (20, 40)),
    ],
    ids=["divergence", "divergence-rigid", "flutter", "flutter-rigid", "flutter-wide", "edge",
         "flutter-2", "stable"],
)
def test_a_small_disturbance_goes_as_the_eigenvalue_says(
    point, which, span, settle, modes, segments
):
    state = steady_states(parameters(point)).states[which]
    expected = stability(state, functions=(40,))
    found = extrapolate(*(least_damped(state, n, span, settle, modes) for n in segments))
    assert found[0] == pytest.approx(expected.growth_rate, rel=0.02)
    assert found[1] == pytest.approx(expected.frequency, rel=0.02, abs=1e-6)


def test_a_disturbance_dies_in_the_stable_case_of_figure_4_1_as_the_eigenvalue_says():
    # thesis Fig. 4.1: d_n 3 is stable
    state = steady_states(parameters({**figure_4_1(3.0, 2.0), "gamma": 600.0})).states[0]
    expected = stability(state, functions=(40,))
    found = extrapolate(*(least_damped(state, n, 100.0, 40.0, 4, 1e-3) for n in (40, 80)))
    assert expected.growth_rate < -0.03
    assert found == pytest.approx([expected.growth_rate, expected.frequency], rel=0.02)


def between_folds(omega):
    """States of thesis Fig. 3.1 at d_n 4.8, nearly inextensible."""
    return steady_states(parameters({**figure_3_1(4.8, omega), "gamma": 6e4})).states


def fold_between(three, one):
    """Omega at which two of three states are lost on the way to where there is one."""
    while abs(one - three) > 1e-7:
        middle = 0.5 * (three + one)
        three, one = (middle, one) if len(between_folds(middle)) == 3 else (three, middle)
    return three


def ramp(first, which, rate, change, passed):
    """Radii over a ramp of omega from one steady state, and omega where the mass passes one."""
    start = between_folds(first)[which]
    line = line_of(start.parameters)
    span = change / abs(rate)

    def place(t):
        angle = t + 0.5 * rate / first * t * t
        return np.stack([np.cos(angle), np.sin(angle), 0.0 * t], axis=-1)

    tow = sampled(place, 0.0, span, 2.0 * np.pi / 200.0)
    times = np.linspace(0.0, span, 800)
    motion = simulate(line, drive(line, tow), equilibrium(start, 20), times, 1e-3)
    radius = np.hypot(*motion.positions[:, 0, :2].T)
    crossing = np.argmax((radius - passed) * (radius[0] - passed) < 0.0)
    return radius, first + rate * times[crossing]


def test_a_slow_ramp_jumps_past_the_fold_by_the_known_delay():
    # thesis Fig. 3.1, d_n 4.8: 2.3 -> 0.5 rising
    fold, rate = fold_between(1.05, 1.12), 2.5e-4
    # near a fold lambda^2 = 4 k (omega_fold - omega); a ramp passes it by 2.338 (rate^2/k)^(1/3)
    # (Airy's first zero; Haberman, SIAM J. Appl. Math. 37, 1979)
    near = 0.002
    k = stability(between_folds(fold - near)[2]).growth_rate ** 2 / (4.0 * near)
    radius, jumped = ramp(fold - 0.03, 2, rate, 0.1, 1.2)
    assert radius[0] > 2.3
    assert radius[-1] < 0.5
    assert jumped - fold == pytest.approx(2.338 * (rate**2 / k) ** (1.0 / 3.0), rel=0.1)


def test_a_falling_ramp_jumps_outward_with_a_delay_of_its_rate_to_two_thirds():
    # thesis Fig. 3.1, d_n 4.8: 1.3 -> 2.5 falling
    fold = fold_between(1.0, 0.85)
    slow, slowly = ramp(fold + 0.04, 0, -2.5e-4, 0.13, 2.0)
    _, quickly = ramp(fold + 0.04, 0, -1e-3, 0.3, 2.0)
    assert slow[0] < 1.0
    assert slow[-1] == pytest.approx(2.5, abs=0.15)
    assert fold - slowly > 0.005
    assert (fold - quickly) / (fold - slowly) == pytest.approx(4.0 ** (2.0 / 3.0), rel=0.1)


def test_a_held_signal_stays_what_it_is_at_its_ends():
    whole = spline(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 9) ** 2)
    kept = held(whole)
    assert kept.at([-1e4, -0.1, 0.0, 0.3, 1.0, 5.0, 1e4])[:, 0] == pytest.approx(
        [0.0, 0.0, 0.0, 0.09, 1.0, 1.0, 1.0], abs=1e-12
    )
    assert kept.stops == pytest.approx([0.0, 1.0])


def test_paying_out_keeps_angular_momentum():
    # about a fixed tow point nothing acts round the vertical but what comes out, at radius 0
    span = 12.0
    lengths = sampled(
        lambda t: (1.0 + 2.0 * (t / span - np.sin(2.0 * np.pi * t / span) / (2.0 * np.pi)))[
            :, None
        ],
        0.0, span, 0.02,
    )  # fmt: skip
    off = []
    for n in (10, 20):
        line, start = pendulum(n, 2000.0, 0.4, 1.0)
        start.velocities[:, 1] = start.positions[:, 0]
        times = np.linspace(0.0, span, 61)
        motion = simulate(line, drive(line, STILL, length=lengths), start, times, 1e-5)
        momentum = []
        for x, v, length, rate in zip(
            motion.positions, motion.velocities, lengths.at(times)[:, 0],
            np.gradient(lengths.at(times)[:, 0], times), strict=True,
        ):  # fmt: skip
            along = np.gradient(x, axis=0)[:-1] * np.arange(n)[:, None]
            real = v[:-1] - rate / length * along  # of the cable, not of the nodes
            mass = np.full(n, length / n)
            mass[0] = 2.0 + 0.5 * length / n
            momentum.append(mass @ (x[:-1, 0] * real[:, 1] - x[:-1, 1] * real[:, 0]))
        off.append(abs(momentum[-1] / momentum[0] - 1.0))
    assert off[0] < 5e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.2)


def test_a_winch_that_speeds_up_lifts_cable_and_mass():
    # constant acceleration L'': tension is that at rest times 1 - L''/g at every place
    n, slow = 10, -0.2
    line = Line(1.0, 5e4, 1.0, 0.0, 2.0, 3.0, 3.0, 0.0, 0.01)
    times = np.linspace(0.0, 2.0, 401)
    lengths = spline(times, 2.0 + 0.5 * slow * times**2)
    driven = drive(line, STILL, length=lengths)
    motion = simulate(line, driven, hanging(line, n), times, 1e-6)
    found = loads(line, driven, motion).tensions[200:390].mean(axis=0)
    left = lengths.at(times[200:390]).mean()
    expected = (3.0 + left / n * (np.arange(n) + 0.5)) * (1.0 - slow)
    assert found == pytest.approx(expected, rel=2e-3)


def test_a_released_mass_bounces_about_its_new_rest_at_the_springs_frequency():
    line = Line(1e-3, 100.0, 1e-3, 0.0, 1.0, 2.0, 2.0, 0.0)
    driven = drive(line, STILL, end=steps([1.0], [[2.0, 2.0, 0.0], [1.0, 1.0, 0.0]]))
    times = np.linspace(0.0, 6.0, 1201)
    depth = -simulate(line, driven, hanging(line, 5), times, 1e-5).positions[:, 0, 2]
    assert depth[times <= 1.0] == pytest.approx(1.02, abs=1e-5)
    # spring 100, mass 1 and a third of the cable's; release at the bottom
    expected = 1.01 + 0.01 * np.cos(np.sqrt(100.0 / (1.0 + 1e-3 / 3.0)) * (times - 1.0))
    assert depth[times > 1.0] == pytest.approx(expected[times > 1.0], abs=1e-4)


def test_wind_is_the_same_as_being_towed_against_it():
    line = Line(1.0, 600.0, 1.0, 0.5, 3.0, 2.0, 2.0, 0.3)
    times = np.linspace(0.0, 10.0, 21)
    wind = np.array([0.7, -0.3, 0.1])
    blown = simulate(line, drive(line, STILL, wind=constant(wind)), hanging(line, 10), times)
    tow = linear([0.0, 20.0], [[0.0, 0.0, 0.0], -20.0 * wind])
    towed = simulate(line, drive(line, tow), hanging(line, 10, velocity=-wind), times)
    carried = towed.positions + wind * times[:, None, None]
    assert blown.positions == pytest.approx(carried, abs=1e-4)


def test_where_the_tow_point_drops_faster_the_mass_falls_freely():
    line = Line(1.0, 1e4, 1.0, 0.0, 1.0, 2.0, 2.0, 0.0)
    times = np.linspace(0.0, 0.6, 7)
    tow = spline(np.linspace(0.0, 1.0, 9), np.outer(np.linspace(0.0, 1.0, 9) ** 2, [0, 0, -1.5]))
    driven = drive(line, tow)
    motion = simulate(line, driven, hanging(line, 10), times)
    assert np.all(loads(line, driven, motion).tensions[1:] == 0.0)
    # once the stretch is gone
    assert np.diff(motion.velocities[1:, 0, 2]) == pytest.approx(-np.diff(times[1:]), abs=1e-6)


def test_bad_input_is_refused_and_nothing_infinite_carried_on():
    line = Line(1.0, 600.0, 1.0, 0.5, 3.0, 2.0, 2.0, 0.3)
    start = hanging(line, 5)
    with pytest.raises(InputError, match="stiffness"):
        Line(1.0, float("nan"), 1.0, 0.5, 3.0, 2.0, 2.0, 0.3)
    with pytest.raises(InputError, match="wind: it must be finite"):
        constant([float("nan"), 0.0, 0.0], "wind")
    with pytest.raises(InputError, match="wind: 3 components"):
        drive(line, STILL, wind=constant([1.0]))
    with pytest.raises(InputError, match="tow point: times must rise"):
        spline([0.0, 1.0, 1.0], np.zeros((3, 3)), "tow point")
    hauled = drive(line, STILL, length=linear([0.0, 5.0], [3.0, -1.0]))
    with pytest.raises(InputError, match="length"):
        simulate(line, hauled, start, [9.0])
    lost = drive(line, STILL, end=steps([1.0], [[2.0, 2.0, 0.3], [0.0, 0.0, 0.0]]))
    with pytest.raises(InputError, match="end mass"):
        simulate(line, lost, start, [9.0])
    with pytest.raises(InputError, match="times"):
        simulate(line, drive(line, STILL), start, [1.0, 1.0])
    broken = CableState(0.0, np.full((6, 3), np.nan), np.zeros((6, 3)))
    with pytest.raises(InputError, match="finite"):
        simulate(line, drive(line, STILL), broken, [1.0])
