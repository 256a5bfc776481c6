"""The branch flown, on thesis Fig. 3.1 (f 1, l 3, m 50).

At d_n 4.8 three states exist between the folds at omega 0.9323 and 1.0982, found here by counting
states; thesis: jumps 2.3 -> 0.5 with rising omega and 1.3 -> 2.5 with falling omega.
"""

from dataclasses import replace

import numpy as np
import pytest
from points import FIVE, figure_3_1, parameters

from ctcbs_ros.prediction.branch import BranchTracker, follow
from ctcbs_ros.solver.family import RADIUS_AT_SPEED, family_between
from ctcbs_ros.solver.flown import branch_from_straight_flight, match
from ctcbs_ros.solver.steady_state import steady_states

D_N = 4.8


def at(omega, d_n=D_N):
    return parameters(figure_3_1(d_n, omega))


def radii(p):
    return [s.end_mass_radius for s in steady_states(p).states]


def fold_by_counting(low, high, d_n=D_N):
    """omega at which the number of states changes, by bisection."""
    counts = len(radii(at(low, d_n)))
    assert counts != len(radii(at(high, d_n)))
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        if len(radii(at(middle, d_n))) == counts:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


LOWER, UPPER = fold_by_counting(0.90, 0.95), fold_by_counting(1.05, 1.15)


def flown(omegas, tracker=None):
    tracker = tracker or BranchTracker()
    return [tracker.update(at(omega), None) for omega in omegas]


def jumps(history):
    return [(i, t.jumps) for i, t in enumerate(history) if t.jumps]


def test_the_folds_are_where_the_thesis_has_them():
    assert pytest.approx(0.932, abs=1e-3) == LOWER
    assert pytest.approx(1.098, abs=1e-3) == UPPER


def test_rising_slowly_it_jumps_once_at_the_upper_fold_and_says_so():
    omegas = np.linspace(0.8, 1.3, 101)
    history = flown(omegas)
    (i, count), *more = jumps(history)
    assert (count, more) == (1, [])
    assert omegas[i - 1] < UPPER < omegas[i]
    assert history[i - 1].state.end_mass_radius == pytest.approx(2.3, abs=0.1)
    assert history[i].state.end_mass_radius == pytest.approx(0.5, abs=0.03)
    steps = np.diff(np.log([t.state.end_mass_radius for t in history]))
    assert np.abs(np.delete(steps, i - 1)).max() < 0.05
    assert all(t.branch == "main" for t in history)


def test_falling_slowly_it_jumps_once_at_the_lower_fold():
    omegas = np.linspace(1.3, 0.8, 101)
    history = flown(omegas)
    (i, count), *more = jumps(history)
    assert (count, more) == (1, [])
    assert omegas[i - 1] > LOWER > omegas[i]
    assert history[i - 1].state.end_mass_radius == pytest.approx(1.2, abs=0.2)
    assert history[i].state.end_mass_radius == pytest.approx(2.5, abs=0.05)


def test_with_the_table_s_guesses_the_history_is_the_same():
    omegas = [*np.linspace(0.8, 1.2, 81), *np.linspace(1.2, 0.8, 81)]
    tracker = BranchTracker()
    guessed = [tracker.update(at(o), [r * 1.004 for r in radii(at(o))]) for o in omegas]
    solved = flown(omegas)
    assert jumps(guessed) == jumps(solved)
    for one, other in zip(guessed, solved, strict=True):
        assert one.state.end_mass_radius == pytest.approx(other.state.end_mass_radius, rel=1e-7)
        assert one.branch == other.branch
    assert {t.method for t in guessed} == {"table and Newton", "continuation"}


def test_guesses_that_lead_to_fewer_states_are_not_trusted():
    good = radii(at(1.0))
    for guesses in ([good[0], good[0] * 1.01, good[2]], [good[0], 1e-6, good[2]], []):
        tracked = BranchTracker().update(at(1.0), guesses)
        assert tracked.method == "full solve"
        assert len(tracked.others) == 2


@pytest.mark.parametrize("start", [0.8, 1.3])
def test_inside_the_folds_it_never_jumps(start):
    rng = np.random.default_rng(5)
    history = flown([start, *rng.uniform(LOWER + 1e-3, UPPER - 1e-3, 60)])
    assert jumps(history) == []
    side = [t.state.end_mass_radius > 2.0 for t in history]
    assert side == [start < 1.0] * 61
    assert all(len(t.others) == 2 for t in history[1:])


@pytest.mark.parametrize("start", [0.8, 1.3])
def test_close_before_a_fold_it_is_still_on_its_branch_and_just_beyond_it_has_jumped(start):
    rising = start < 1.0
    fold = UPPER if rising else LOWER
    for nearness in (1e-2, 1e-3, 1e-4, 1e-5, 2e-6):
        way = nearness if rising else -nearness
        history = flown([start, 1.0, fold * (1.0 - way), fold * (1.0 + way)])
        assert jumps(history) == [(3, 1)]
        assert history[2].state.slope > 0.0
        near, gone = history[2].state.end_mass_radius, history[3].state.end_mass_radius
        assert abs(near - (2.25 if rising else 1.216)) < 0.1 + 20.0 * nearness
        assert gone == pytest.approx(0.485 if rising else 2.51, abs=0.03)


@pytest.mark.parametrize(("start", "end"), [(0.8, 1.3), (1.3, 0.8), (0.8, 1.05), (1.3, 0.95)])
def test_a_gap_ends_in_the_same_state_as_small_steps(start, end):
    small = flown(np.linspace(start, end, 60))
    big = flown([start, end])
    assert big[-1].state.end_mass_radius == pytest.approx(small[-1].state.end_mass_radius)
    assert sum(t.jumps for t in big) == sum(t.jumps for t in small)
    assert big[-1].branch == small[-1].branch


def test_standing_still_on_the_other_branch_stays_on_it():
    history = flown([1.3, 1.0, 1.0, 1.0 + 1e-9, 1.0 + 1e-7, 1.0 + 1e-5, 1.0])
    assert jumps(history) == []
    for tracked in history[1:]:
        assert tracked.state.end_mass_radius == pytest.approx(0.695, abs=1e-3)


def test_the_curve_from_straight_flight_met_further_on_is_named_by_its_folds():
    up, down = flown([0.8, 1.0])[-1], flown([1.3, 1.0])[-1]
    assert up.branch == "main"
    assert down.branch == "main, beyond 2 folds"
    assert flown([1.3, 1.0, 0.8])[-1].branch == "main"


def tightened(p, steps=120, start=4.0):
    """State reached by small Newton steps from a wide circle at constant speed and length."""
    tracker = BranchTracker()
    for tau in np.linspace(start, 0.0, steps):
        tracked = tracker.update(RADIUS_AT_SPEED.at(p, tau), None)
        assert tracked.state is not None
    return tracked.state.end_mass_radius


@pytest.mark.parametrize("omega", [0.96, 1.0, 1.05, 1.09])
def test_first_acquisition_is_the_branch_that_tightening_from_straight_flight_leads_to(omega):
    p = at(omega)
    tracked = BranchTracker().update(p, None)
    assert len(tracked.others) == 2
    assert tracked.branch == "main"
    assert tracked.state.end_mass_radius == pytest.approx(tightened(p), rel=1e-6)
    assert tracked.jumps == 0


def test_five_states_are_all_told_and_the_first_is_that_of_straight_flight():
    p = parameters(FIVE)
    tracked = BranchTracker().update(p, None)
    everything = sorted(s.end_mass_radius for s in (tracked.state, *tracked.others))
    assert everything == pytest.approx(radii(p))
    assert len(everything) == 5
    flown_branch = branch_from_straight_flight(p)
    if match([tracked.state], flown_branch.end_mass_radius) is None:
        assert np.isnan(flown_branch.end_mass_radius)
        assert tracked.state.slope > 0.0


def test_an_isolated_branch_is_named_so():
    # At d_n 2.7 the branch is isolated in omega at this l (thesis, Fig. 3.1), yet tightening
    # leads to it; at d_n 0.5 no tightening to a quarter of the radius does.
    tracker = BranchTracker()
    tracker.update(at(1.3), None)
    names = []
    for d_n in (4.8, 4.3, 4.1, 3.5, 2.7, 2.0, 1.0, 0.5):
        tracked = tracker.update(at(1.1, d_n), None)
        assert tracked.jumps == 0
        assert tracked.state.end_mass_radius == pytest.approx(0.484, abs=0.01)
        names.append(tracked.branch)
    assert names[:5] == ["main"] + ["main, beyond 2 folds"] * 4
    assert names[-1] == "isolated"
    first = BranchTracker().update(at(1.1, 0.5), None)
    assert first.branch == "main"
    assert first.state.end_mass_radius > 3.0


@pytest.mark.parametrize("d_n", [4.8, 3.5, 2.7])
def test_tightening_past_the_fold_and_widening_again_leads_to_the_branch_beyond_it(d_n):
    tracker = BranchTracker()
    p = at(1.0, d_n)
    taus = [*np.linspace(1.0, -0.5, 40), *np.linspace(-0.5, 0.0, 14)]
    history = [tracker.update(RADIUS_AT_SPEED.at(p, tau), None) for tau in taus]
    assert sum(t.jumps for t in history) == 1
    assert history[-1].branch == "main, beyond 2 folds"
    assert history[-1].state.end_mass_radius == pytest.approx(radii(p)[0])


def test_history_goes_on_when_cable_length_and_end_mass_change_in_flight():
    tracker = BranchTracker()
    tracker.update(at(1.3), None)
    tracked = tracker.update(at(1.0), None)
    small = tracked.state.end_mass_radius
    for factor in np.linspace(1.0, 1.05, 11):
        mass = 50.0 * factor
        p = replace(at(1.0), length=3.0 * factor, end_mass=mass, end_weight=mass)
        tracked = tracker.update(p, None)
        assert tracked.jumps == 0
        assert abs(np.log(tracked.state.end_mass_radius / small)) < 0.1
        small = tracked.state.end_mass_radius
    # And at once by as much as ends the branch: it must land on the state that is left.
    p = replace(at(1.0), length=1.5)
    tracked = tracker.update(p, None)
    assert match(steady_states(p).states, tracked.state.end_mass_radius) is not None


def test_after_a_reset_it_is_a_first_acquisition_again():
    tracker = BranchTracker()
    flown([1.3, 1.0], tracker)
    tracker.reset()
    tracked = tracker.update(at(1.0), None)
    assert tracked.branch == "main"
    assert tracked.state.end_mass_radius == pytest.approx(2.457, abs=1e-3)


def test_a_state_followed_there_and_back_is_the_same():
    rng = np.random.default_rng(11)
    start = steady_states(at(1.3)).states[0]
    for _ in range(20):
        p = start.parameters
        factors = np.exp(rng.uniform(-0.1, 0.1, 5))
        target = replace(
            p, omega=p.omega * factors[0], length=p.length * factors[1],
            end_mass=p.end_mass * factors[2], end_weight=p.end_weight * factors[2],
            cable_drag=p.cable_drag * factors[3], drag_ratio=p.drag_ratio * factors[4],
        )  # fmt: skip
        there, jumped = follow(start, target)
        if jumped:
            continue
        back, jumped = follow(there, p)
        assert jumped == 0
        assert back.end_mass_radius == pytest.approx(start.end_mass_radius, rel=1e-8)


def test_a_family_between_two_points_leads_from_the_one_to_the_other():
    start, end = at(1.0), replace(at(1.2), length=2.0, elasticity=600.0, cable_drag=9.0)
    start = replace(start, elasticity=500.0)
    family, distance = family_between(start, end)
    there = family.at(start, distance)
    for name in ("omega", "length", "end_mass", "end_weight", "cable_drag", "drag_ratio",
                 "elasticity"):  # fmt: skip
        assert getattr(there, name) == pytest.approx(getattr(end, name))
