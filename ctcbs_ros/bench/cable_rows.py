"""The cable in time beside MoorDyn: the same line, segments, start and entry into the circle."""

from dataclasses import replace
from importlib.util import find_spec
from math import pi

import numpy as np

from ctcbs_ros.bench.row import Outcome, outcome_of
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.solver_rows import SETTLED
from ctcbs_ros.bench.timing import duel
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import sampled
from ctcbs_ros.solver.parameters import Parameters

SEGMENTS = 40
_STIFF = 6e4
# Seconds flown, the first minute of them from rest to the full rate, and 0.73 of the longest step
# with which MoorDyn stays finite (2.785 over the highest frequency of its nodes).
_FLOWN, _STEP = 120.0, 0.01
_STIFF_FLOWN, _STIFF_STEP = 80.0, 0.001


def entry(
    parameters: Parameters, segments: int, ramp: float, times: np.ndarray, length=None, **settings
):
    """Fly what `peer_moordyn.tow` flies: from hanging, evenly stretched, to the full rate.

    With the drag at the nodes, as the peer takes it.

    Parameters
    ----------
    parameters : Parameters
        With the peer's damping and density.
    segments : int
    ramp : float
        Angle that the full rate turns in the time it is reached in [rad].
    times : (m,) array
        In 1/Omega.
    length : Signal, optional
        Paid out, if that changes.
    **settings
        For `simulate`.

    Returns
    -------
    (m, 3) ndarray
        Radius, depth and lag of the end mass.
    """
    line = line_of(parameters, drag_at_nodes=True)

    def angle(t):
        return np.where(t < ramp, t * t / (2.0 * ramp), t - 0.5 * ramp)

    def place(t):
        return np.stack([np.cos(angle(t)), np.sin(angle(t)), 0.0 * t], axis=-1)

    stretch = 1.0 + (parameters.end_mass + parameters.length) / parameters.elasticity
    nodes = np.zeros((segments + 1, 3))
    nodes[:, 0] = 1.0
    nodes[:, 2] = np.linspace(-stretch * parameters.length, 0.0, segments + 1)
    tow = sampled(place, 0.0, times[-1], 2.0 * pi / 256.0)
    start = CableState(0.0, nodes, np.zeros_like(nodes))
    driven = drive(line, tow, length=length)
    x, y, z = simulate(line, driven, start, times, **settings).positions[:, 0].T
    lag = (angle(times) - np.arctan2(y, x)) % (2.0 * pi)
    return np.column_stack([np.hypot(x, y), -z, lag])


def soft(session: Session) -> Outcome:
    """Gamma 600."""
    return _entry(session, SETTLED, _FLOWN, _STEP)


def design(session: Session) -> Outcome:
    """The design example."""
    return _entry(session, session.design, _FLOWN, _STEP)


def stiff(session: Session) -> Outcome:
    """Gamma 60,000."""
    return _entry(session, replace(SETTLED, elasticity=_STIFF), _STIFF_FLOWN, _STIFF_STEP)


def _entry(session, parameters, flown, step):
    from ctcbs_ros.atmosphere import GRAVITY
    from ctcbs_ros.bench.peer_moordyn import DENSITY, MASS_PER_LENGTH, RADIUS, RAMP, tow

    rate = parameters.omega * (GRAVITY / RADIUS) ** 0.5
    stiffness = parameters.elasticity * MASS_PER_LENGTH * RADIUS * GRAVITY
    damping = 17.0  # N s, as the peer's
    p = replace(parameters, density=DENSITY, damping=damping / stiffness * rate)
    times = np.arange(1, round(flown / 0.1) + 1) * 0.1 * rate
    ours, theirs = [], []

    def product(_number):
        ours.append(entry(p, SEGMENTS, RAMP * rate, times))

    if find_spec("moordyn") is None:
        timed = duel(product, None, session.rounds(4), calls=1)
        return outcome_of(timed, missing="MoorDyn is not installed (pip install moordyn)")

    def peer(_number):
        theirs.append(tow(session.folder, parameters, SEGMENTS, flown, step, damping).history)

    timed = duel(product, peer, session.rounds(4), calls=1)
    difference = float(np.abs(ours[-1] - theirs[-1][:, 1:])[:, :2].max())
    times_real_time = flown / timed.ours.cpu_median
    return outcome_of(
        timed, difference < 2e-3, difference=difference, times_real_time=times_real_time
    )
