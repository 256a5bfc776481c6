"""The nearest ends of a branch against counting states, on thesis Fig. 3.1 (d_n 4.8 and 2.7)."""

from math import exp, log

import numpy as np
import pytest
from points import figure_3_1, parameters

from ctcbs_ros.prediction.fold import follow_fold, known_fold
from ctcbs_ros.prediction.jumps import JumpFinder
from ctcbs_ros.solver.branches import branch_ends
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.steady_state import correct_state, steady_states

FAMILIES = (ANGULAR_RATE, RADIUS_AT_SPEED)


def at(omega, d_n=4.8):
    return parameters(figure_3_1(d_n, omega))


def by_hand(p, family, tau):
    """Parameters at exp(tau) times the angular rate, or the radius, from the definitions alone."""
    point = {"omega": p.omega, "l": p.length, "m": p.end_mass, "d_n": p.cable_drag,
             "f": p.drag_ratio}  # fmt: skip
    k = exp(tau)
    if family is ANGULAR_RATE:
        point["omega"] *= k
    else:
        # V fixed: omega = V / sqrt(a g); d = f d_n has no a in it.
        point["omega"] /= k**0.5
        point["l"] /= k
        point["m"] /= k
        point["d_n"] *= k
        point["f"] /= k
    return parameters(point)


def brute_force(state, family, direction, reach):
    """tau at which a state ceases to exist, and the only state beyond; small Newton steps."""
    radius, tau, step = state.end_mass_radius, 0.0, direction * 0.02
    while abs(step) > 1e-9:
        if abs(tau + step) > reach:
            return None
        p = by_hand(state.parameters, family, tau + step)
        moved = correct_state(p, radius, 0.2)
        if moved is None or (moved.slope > 0.0) != (state.slope > 0.0):
            step *= 0.5
            continue
        radius, tau = moved.end_mass_radius, tau + step
    beyond = steady_states(by_hand(state.parameters, family, tau + direction * 1e-5)).states
    return tau, [s.end_mass_radius for s in beyond]


@pytest.mark.parametrize(("d_n", "index"), [(4.8, 0), (4.8, 2), (2.7, 0), (2.7, 2)])
@pytest.mark.parametrize("omega", [0.97, 1.0, 1.06])
def test_jumps_are_where_the_state_ends_and_land_where_one_is_left(d_n, index, omega):
    state = steady_states(at(omega, d_n)).states[index]
    found = JumpFinder().update(state)
    for family in FAMILIES:
        ends = [brute_force(state, family, way, 1.0) for way in (-1, 1)]
        ends = [end for end in ends if end is not None]
        jump = found[family.name]
        if not ends:
            assert jump is None or abs(log(jump.at)) > 1.0
            continue
        tau, beyond = min(ends, key=lambda end: abs(end[0]))
        assert jump.relative == pytest.approx(exp(tau) - 1.0, abs=2e-7)
        assert jump.at == pytest.approx(exp(tau), abs=2e-7)
        assert len(beyond) == 1
        tow_radius = exp(tau) if family is RADIUS_AT_SPEED else 1.0
        assert jump.landing_radius == pytest.approx(beyond[0] * tow_radius, rel=1e-3)


def test_rate_and_radius_have_the_signs_a_pilot_expects():
    large = JumpFinder().update(steady_states(at(1.0)).states[2])
    small = JumpFinder().update(steady_states(at(1.0)).states[0])
    # Fig. 3.1: up to 1.098 on the large branch, down to 0.932 on the small one.
    assert large["angular_rate"].relative == pytest.approx(0.0982, abs=1e-3)
    assert small["angular_rate"].relative == pytest.approx(-0.0677, abs=1e-3)
    # Tightening the circle ends the large branch, widening it the small one.
    assert large["radius"].relative < 0.0 < small["radius"].relative
    assert large["radius"].landing_radius < 1.0 < small["radius"].landing_radius


def test_corrected_after_small_changes_it_equals_a_fresh_trace():
    rng = np.random.default_rng(2)
    for index in (0, 2):
        finder, p = JumpFinder(), at(1.0)
        state = steady_states(p).states[index]
        finder.update(state)
        for _ in range(25):
            family = FAMILIES[rng.integers(2)]
            p = family.at(p, rng.uniform(-0.006, 0.006))
            state = correct_state(p, state.end_mass_radius)
            kept, fresh = finder.update(state), JumpFinder().update(state)
            for name in ("angular_rate", "radius"):
                assert kept[name].relative == pytest.approx(fresh[name].relative, abs=1e-6)
                assert kept[name].landing_radius == pytest.approx(
                    fresh[name].landing_radius, rel=1e-6
                )


def test_on_another_branch_of_the_same_orbit_it_does_not_keep_the_old_ends():
    lower, _, upper = steady_states(at(1.0)).states
    finder = JumpFinder()
    assert finder.update(upper)["angular_rate"].relative > 0.0
    assert finder.update(lower)["angular_rate"].relative < 0.0


def test_a_branch_without_end_has_no_jump():
    (only,) = steady_states(at(1.0, 10.0)).states
    assert JumpFinder().update(only) == {"angular_rate": None, "radius": None}


def test_where_the_table_knows_of_no_end_nothing_is_sought_and_later_found_again():
    state = steady_states(at(1.0)).states[0]
    finder = JumpFinder()
    before = finder.update(state)
    assert finder.update(state, may_end=False) == {"angular_rate": None, "radius": None}
    assert finder.update(state) == before


def test_ends_that_appear_while_the_flight_changes_are_found_after_a_few_orbits():
    # Fig. 3.1: above d_n 6.2 there are no folds, at 4.8 there are: denser and denser air.
    finder, radius = JumpFinder(), None
    drags = np.linspace(6.6, 4.8, 90)
    for d_n in drags:
        p = at(0.9, d_n)
        state = steady_states(p).states[0] if radius is None else correct_state(p, radius)
        radius = state.end_mass_radius
        found = finder.update(state)
    fresh = JumpFinder().update(state)
    assert fresh["angular_rate"] is not None
    assert found["angular_rate"].at == pytest.approx(fresh["angular_rate"].at, abs=1e-7)
    assert found["radius"].landing_radius == pytest.approx(
        fresh["radius"].landing_radius, rel=1e-6
    )


def test_a_followed_fold_is_where_a_fine_scan_has_it():
    state = steady_states(at(1.0)).states[2]
    end = next(e for e in branch_ends(state) if e.family is ANGULAR_RATE)
    known = known_fold(state.parameters, end.family, end.fold)
    # Angular rate and radius of the flight change by a percent each, one after the other.
    for family in FAMILIES * 3:
        known = follow_fold(known, family.at(known.parameters, 0.01))
    radius = correct_state(known.parameters, state.end_mass_radius, 1.0).end_mass_radius
    flown = next(s for s in steady_states(known.parameters).states if s.slope > 0.0
                 and abs(log(s.end_mass_radius / radius)) < 1e-6)
    tau, _ = brute_force(flown, ANGULAR_RATE, 1, 1.0)
    assert known.fold.tau == pytest.approx(tau, abs=2e-7)
