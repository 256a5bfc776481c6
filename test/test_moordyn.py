"""The elastic cable against MoorDyn, an independent lumped-mass code, towed round a circle in SI.

MoorDyn is made for moorings: here its sea has the density of air and is deep enough, the line's
added mass and tangential drag are zero, and its top end is moved along the circle. The line starts
hanging at rest; everything that is compared, MoorDyn has found by itself.
"""

from itertools import pairwise
from math import atan2, cos, hypot, log, pi, sin, sqrt

import numpy as np
import pytest
from points import GRAVITY, STRETCHED, design, parameters
from reference_lumped_mass import extrapolate

from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

moordyn = pytest.importorskip("moordyn", reason="MoorDyn is not installed (pip install moordyn)")

RADIUS, MASS_PER_LENGTH, AIR, DIAMETER = 100.0, 0.01, 1.2, 1e-3
TOW_HEIGHT = -500.0  # below MoorDyn's free surface
RAMP = 60.0  # s, from rest to the full rate

INPUT = """A towed line
---------------------- LINE TYPES ----------------------
TypeName Diam Mass/m EA BA EI Cd Ca CdAx CaAx
(name) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)
tow {diameter} {mu} {stiffness} {damping} 0 {drag} 0 0 0
---------------------- POINTS ----------------------
ID Attachment X Y Z Mass Volume CdA Ca
(#) (word/ID) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Free {radius} 0 {bottom} {mass} 0 {end_drag} 0
2 Coupled {radius} 0 {top} 0 0 0 0
---------------------- LINES ----------------------
ID LineType AttachA AttachB UnstrLen NumSegs LineOutputs
(#) (name) (ID) (ID) (m) (-) (-)
1 tow 1 2 {length} {segments} -
---------------------- OPTIONS ----------------------
0 writeLog
{step} dtM
rk4 tScheme
{gravity} g
{air} rho
3000 WtrDpth
1 disableOutput
1 disableOutTime
---------------------- END ----------------------
"""


class Tow:
    """A line of a non-dimensional point, towed in SI units for a number of seconds."""

    def __init__(self, folder, point, segments, duration, step=0.01, damping=17.0):
        a, mu, rho = RADIUS, MASS_PER_LENGTH, AIR
        self.rate = point["omega"] * sqrt(GRAVITY / a)
        stiffness = point["gamma"] * mu * a * GRAVITY
        # what the sea takes off the line's weight, and the dashpots' time constant times Omega
        self.density = 1.0 - rho * pi / 4.0 * DIAMETER**2 / mu
        self.damping = damping / stiffness * self.rate
        length = point["l"] * a
        stretch = 1.0 + (point["m"] + point["l"]) / point["gamma"]
        file = folder / "tow.txt"
        file.write_text(
            INPUT.format(
                diameter=DIAMETER, mu=mu, stiffness=stiffness, damping=damping, radius=a,
                drag=point["d_n"] * mu / (0.5 * rho * DIAMETER * a), length=length,
                bottom=TOW_HEIGHT - stretch * length, top=TOW_HEIGHT, mass=point["m"] * mu * a,
                end_drag=point["f"] * point["d_n"] * mu / (0.5 * rho), segments=segments,
                step=step, gravity=GRAVITY, air=rho,
            )
        )  # fmt: skip
        system = moordyn.Create(str(file))
        try:
            self.history = self._flown(system, duration, step)
        finally:
            moordyn.Close(system)

    def _angle(self, t):
        return self.rate * (t * t / (2.0 * RAMP) if t < RAMP else t - 0.5 * RAMP)

    def _tow_point(self, t):
        angle = self._angle(t)
        return [RADIUS * cos(angle), RADIUS * sin(angle), TOW_HEIGHT]

    def _flown(self, system, duration, step):
        """Angle flown [rad] and non-dimensional radius, depth, lag of the mass, every 0.1 s."""
        moordyn.SetVerbosity(system, moordyn.LEVEL_NONE)
        here = self._tow_point(0.0)
        assert moordyn.Init(system, here, [0.0, 0.0, 0.0]) == 0
        mass = moordyn.GetPoint(system, 1)
        every = round(0.1 / step)
        history = []
        for i in range(round(duration / step)):
            there = self._tow_point((i + 1) * step)
            velocity = [(b - a) / step for a, b in zip(here, there, strict=True)]
            moordyn.Step(system, here, velocity, i * step, step)
            here = there
            if (i + 1) % every == 0:
                x, y, z = moordyn.GetPointPos(mass)
                angle = self._angle((i + 1) * step)
                history.append(
                    (angle, hypot(x, y) / RADIUS, (TOW_HEIGHT - z) / RADIUS,
                     (angle - atan2(y, x)) % (2.0 * pi))
                )  # fmt: skip
        return np.array(history)

    @property
    def end(self):
        """End-mass radius, depth and lag at the end."""
        return self.history[-1, 1:]


@pytest.mark.parametrize("point", [STRETCHED, design(250.0)], ids=["stretched", "design"])
def test_moordyn_settles_in_the_elastic_steady_state(point, tmp_path):
    coarse, fine = (Tow(tmp_path, point, segments, 1300.0) for segments in (20, 40))
    # settled: nothing has moved in the last orbit
    orbit = round(2.0 * pi / fine.rate / 0.1)
    assert np.ptp(fine.history[-orbit:, 1:], axis=0).max() < 1e-6
    (state,) = steady_states(parameters({**point, "rho": fine.density})).states
    expected = [state.end_mass_radius, state.depth, state.phase_lag]
    assert fine.end == pytest.approx(expected, rel=5e-3)
    # MoorDyn is of second order in its segments
    assert extrapolate(coarse.end, fine.end) == pytest.approx(expected, rel=1e-4)
    if point is STRETCHED:
        # docs/thesis.md: MoorDyn settles at 0.1574 and 3.041
        assert fine.end[:2] == pytest.approx([0.1574, 3.041], abs=5e-4)


def test_moordyn_settles_at_the_decay_rate_and_frequency_of_the_margin(tmp_path):
    tow = Tow(tmp_path, STRETCHED, 40, 900.0)
    point = {**STRETCHED, "rho": tow.density}
    (state,) = steady_states(parameters(point, damping=tow.damping)).states
    found = stability(state)
    angle, *figures = tow.history[4000:].T
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
