"""The elastic cable against MoorDyn, an independent lumped-mass code, towed round a circle in SI.

How is told in `ctcbs_ros.bench.peer_moordyn`; everything that is compared, MoorDyn has found by
itself.
"""

from itertools import pairwise
from math import log, pi

import numpy as np
import pytest
from points import STRETCHED, design, parameters
from reference_lumped_mass import extrapolate

from ctcbs_ros.bench.cable_rows import entry
from ctcbs_ros.bench.peer_moordyn import DENSITY, RAMP, tow
from ctcbs_ros.dynamics.cable import drive, simulate
from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import circle, constant
from ctcbs_ros.periodic.solve import periodic_motion
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

pytest.importorskip("moordyn", reason="MoorDyn is not installed (pip install moordyn)")

@pytest.mark.parametrize("point", [STRETCHED, design(250.0)], ids=["stretched", "design"])
def test_moordyn_settles_in_the_elastic_steady_state(point, tmp_path):
    coarse, fine = (tow(tmp_path, parameters(point), n, 1300.0) for n in (20, 40))
    # settled: nothing has moved in the last orbit
    orbit = round(2.0 * pi / fine.rate / 0.1)
    assert np.ptp(fine.history[-orbit:, 1:], axis=0).max() < 1e-6
    (state,) = steady_states(parameters({**point, "rho": DENSITY})).states
    expected = [state.end_mass_radius, state.depth, state.phase_lag]
    assert fine.end == pytest.approx(expected, rel=5e-3)
    # MoorDyn is of second order in its segments
    assert extrapolate(coarse.end, fine.end) == pytest.approx(expected, rel=1e-4)
    if point is STRETCHED:
        # docs/thesis.md: MoorDyn settles at 0.1574 and 3.041
        assert fine.end[:2] == pytest.approx([0.1574, 3.041], abs=5e-4)


def test_moordyn_settles_at_the_decay_rate_and_frequency_of_the_margin(tmp_path):
    towed = tow(tmp_path, parameters(STRETCHED), 40, 900.0)
    point = {**STRETCHED, "rho": DENSITY}
    (state,) = steady_states(parameters(point, damping=towed.damping)).states
    found = stability(state)
    angle, *figures = towed.history[4000:].T
    # one mode is left after 400 s: depth = end + A e^(-margin angle) cos(frequency angle + phase)
    depth = figures[1] - state.depth
    depth -= np.mean(depth[-1000:])
    crossings = np.flatnonzero(depth[:-1] * depth[1:] < 0.0)
    between = np.diff(angle[crossings][:16])
    assert pi / between.mean() == pytest.approx(found.frequency, rel=0.01)
    peaks = [np.abs(depth[i:j]).max() for i, j in pairwise(crossings[:16])]
    decay = np.polyfit(angle[crossings[:15]], np.log(peaks), 1)[0]
    assert decay == pytest.approx(found.growth_rate, rel=0.03)
    assert abs(log(peaks[0] / peaks[-1])) > 0.7


@pytest.mark.parametrize(
    ("point", "duration", "step"),
    [(STRETCHED, 500.0, 0.01), (design(250.0), 500.0, 0.01),
     ({**STRETCHED, "gamma": 6e4}, 150.0, 0.001)],
    ids=["stretched", "design", "stiff"],
)  # fmt: skip
def test_an_entry_into_the_circle_is_moordyns_all_the_way(point, duration, step, tmp_path):
    towed = tow(tmp_path, parameters(point), 40, duration, step)
    p = parameters({**point, "rho": DENSITY}, damping=towed.damping)
    times = np.arange(1, len(towed.history) + 1) * 0.1 * towed.rate
    found, expected = entry(p, 40, RAMP * towed.rate, times), towed.history[:, 1:]
    assert found[:, :2] == pytest.approx(expected[:, :2], rel=1e-3)
    assert np.abs(np.exp(1j * found[:, 2]) - np.exp(1j * expected[:, 2])).max() < 1e-3
    assert found[-1] == pytest.approx(expected[-1], rel=1e-5)


@pytest.mark.parametrize(
    ("point", "wind", "duration", "downwind"),
    # physics: 2.5 and 5 m/s move the design example's mass by 0.6 and 1.3 of the tow radius, and
    # near the bounce's resonance a stretching cable's goes slightly upwind
    [(design(250.0), 0.05, 500.0, 0.6), (design(250.0), 0.1, 500.0, 1.3),
     (STRETCHED, 0.1, 900.0, -0.05)],
    ids=["design", "design-more", "upwind"],
)  # fmt: skip
def test_in_wind_the_mass_goes_round_as_moordyns_does(point, wind, duration, downwind, tmp_path):
    towed = tow(tmp_path, parameters(point), 40, duration, wind=wind)
    p = parameters({**point, "rho": DENSITY}, damping=towed.damping)
    (state,) = steady_states(p).states
    angles = towed.history[:, 0]
    # the last orbit of each, at the same angles of the tow point
    last = angles > angles[-1] - 2.0 * pi
    times = angles[last] - angles[last][0] + angles[last][0] % (2.0 * pi) + 60.0 * 2.0 * pi
    line = line_of(p, drag_at_nodes=True)
    driven = drive(line, circle(1.0, 1.0, 0.0, times[-1]), constant([wind, 0.0, 0.0]))
    found = simulate(line, driven, equilibrium(state, 40, drag_at_nodes=True), times)
    assert found.positions[:, 0] == pytest.approx(towed.positions[last], abs=2e-5)
    assert found.positions[:, 0, 0].mean() == pytest.approx(downwind, rel=0.2)
    # and the periodic motion, without segments, is as near as 40 of them allow
    motion = periodic_motion(state, TowPath(GROUND_SPEED, wind), 1e-4).motion
    assert motion.end_mass(angles[last]) == pytest.approx(towed.positions[last], abs=4e-3)
