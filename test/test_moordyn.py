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
