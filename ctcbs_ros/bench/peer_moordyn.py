"""Peer: MoorDyn, a lumped-mass code for moorings, on a cable towed round a circle in SI.

Its sea has the density of air and is deep enough, the line's added mass and tangential drag are
zero, and its top end is moved along the circle. The line starts hanging at rest; where it settles,
MoorDyn has found by itself. In wind the circle is that of the frame in which the air rests: it
moves against the wind.
"""

import ctypes
import os
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from pathlib import Path

import numpy as np

from ctcbs_ros.atmosphere import GRAVITY
from ctcbs_ros.solver.parameters import Parameters

RADIUS, MASS_PER_LENGTH, AIR, DIAMETER = 100.0, 0.01, 1.2, 1e-3
TOW_HEIGHT = -500.0  # below MoorDyn's free surface
RAMP = 60.0  # s, from rest to the full rate
# What the sea takes off the line's weight.
DENSITY = 1.0 - AIR * pi / 4.0 * DIAMETER**2 / MASS_PER_LENGTH

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


@dataclass(frozen=True)
class Towed:
    """A flight.

    Attributes
    ----------
    rate : float
        Angular rate of the tow point [rad/s].
    damping : float
        The line's dashpots, as `Parameters.damping`.
    history : (n, 4) ndarray
        Angle flown [rad], non-dimensional radius and depth and lag of the mass, every 0.1 s.
    positions : (n, 3) ndarray
        Of the mass against the circle's centre, over the tow radius, at the same times.
    """

    rate: float
    damping: float
    history: np.ndarray
    positions: np.ndarray

    @property
    def end(self) -> np.ndarray:
        """End-mass radius, depth and lag at the end."""
        return self.history[-1, 1:]


def tow(folder: Path, parameters: Parameters, segments: int, duration: float,
        step: float = 0.01, damping: float = 17.0, wind: float = 0.0,
        reel=None) -> Towed:  # fmt: skip
    """Tow a line of an elastic parameter point for a number of seconds.

    Parameters
    ----------
    folder : Path
        For MoorDyn's input.
    parameters : Parameters
        Its `density` is replaced by `DENSITY`.
    segments : int
    duration, step : float
        [s]
    damping : float
        Of the line's axial dashpots, BA [N s].
    wind : float
        Over the tow speed, towards +x; it rises as the rate does.
    reel : callable, optional
        Of the time [s], giving the length paid out as a part of the first one, and its rate [1/s].
    """
    import moordyn

    p, a, mu = parameters, RADIUS, MASS_PER_LENGTH
    rate = p.omega * sqrt(GRAVITY / a)
    stiffness = p.elasticity * mu * a * GRAVITY
    stretch = 1.0 + (p.end_mass + p.length) / p.elasticity
    file = folder / "tow.txt"
    file.write_text(
        INPUT.format(
            diameter=DIAMETER, mu=mu, stiffness=stiffness, damping=damping, radius=a,
            drag=p.cable_drag * mu / (0.5 * AIR * DIAMETER * a), length=p.length * a,
            bottom=TOW_HEIGHT - stretch * p.length * a, top=TOW_HEIGHT, mass=p.end_mass * mu * a,
            end_drag=p.end_mass_drag * mu / (0.5 * AIR), segments=segments, step=step,
            gravity=GRAVITY, air=AIR,
        )
    )  # fmt: skip
    with _quiet():
        system = moordyn.Create(str(file))
    try:
        reeled = None if reel is None else lambda t: (p.length * a * part for part in reel(t))
        angles, positions = _flown(moordyn, system, rate, duration, step, wind, reeled)
    finally:
        with _quiet():
            moordyn.Close(system)
    x, y, z = positions.T
    lag = (angles - np.arctan2(y, x)) % (2.0 * pi)
    history = np.column_stack([angles, np.hypot(x, y), -z, lag])
    return Towed(rate, damping / stiffness * rate, history, positions)


def _angle(rate, t):
    return rate * (t * t / (2.0 * RAMP) if t < RAMP else t - 0.5 * RAMP)


def _tow_point(rate, t, wind):
    angle = _angle(rate, t)
    return [RADIUS * (cos(angle) - wind * angle), RADIUS * sin(angle), TOW_HEIGHT]


def _flown(moordyn, system, rate, duration, step, wind, reeled):
    """Angles flown (n,), and positions of the mass against the circle's centre (n, 3)."""
    moordyn.SetVerbosity(system, moordyn.LEVEL_NONE)
    here = _tow_point(rate, 0.0, wind)
    with _quiet():
        if moordyn.Init(system, here, [0.0, 0.0, 0.0]) != 0:
            raise ArithmeticError("MoorDyn found no initial state")
    mass, line = moordyn.GetPoint(system, 1), moordyn.GetLine(system, 1)
    every = round(0.1 / step)
    angles, positions = [], []
    for i in range(round(duration / step)):
        there = _tow_point(rate, (i + 1) * step, wind)
        velocity = [(b - a) / step for a, b in zip(here, there, strict=True)]
        if reeled is not None:
            length, length_rate = reeled(i * step)
            moordyn.SetLineUnstretchedLength(line, length)
            moordyn.SetLineUnstretchedLengthVel(line, length_rate)
            # Each gives back a None that it does not own (MoorDyn 2.7): the interpreter's only
            # one would be gone after some thousands. Owned once too often it does no harm.
            for _ in range(2):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(None))
        moordyn.Step(system, here, velocity, i * step, step)
        here = there
        if (i + 1) % every == 0:
            x, y, z = moordyn.GetPointPos(mass)
            angles.append(_angle(rate, (i + 1) * step))
            centre = -wind * angles[-1]
            positions.append((x / RADIUS - centre, y / RADIUS, (z - TOW_HEIGHT) / RADIUS))
    return np.array(angles), np.array(positions)


@contextmanager
def _quiet():
    """MoorDyn's banner goes to the process's standard output, where results belong."""
    saved = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(saved, 1)
        os.close(saved)
        os.close(nowhere)
