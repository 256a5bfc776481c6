"""The periodic motion in wind from one nearby, beside the cable in time until it has settled."""

from dataclasses import replace
from math import pi

import numpy as np

from ctcbs_ros.bench.row import Outcome, outcome_of
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.solver_rows import SETTLED
from ctcbs_ros.bench.timing import duel
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.line import line_of
from ctcbs_ros.dynamics.signal import circle, constant
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.solve import followed, periodic_motion
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.solver.steady_state import steady_states

SEGMENTS = 40
# Wind over the tow speed, how far [a] both may be off, and by how much each update differs.
_WIND, _ACCURACY, _CHANGE = 0.1, 1e-3, 0.003
_MOST_TURNS = 60


def soft(session: Session) -> Outcome:
    """Gamma 600, near the resonance of the bounce mode."""
    return _updates(session, SETTLED)


def design(session: Session) -> Outcome:
    """The design example."""
    return _updates(session, session.design)


def _updates(session: Session, parameters) -> Outcome:
    (state,) = steady_states(parameters).states
    start = periodic_motion(state, TowPath(GROUND_SPEED, _WIND), _ACCURACY).motion
    rng = np.random.default_rng(0)
    updates = [
        (
            replace(parameters, omega=parameters.omega * (1.0 + _CHANGE * rng.uniform(-1, 1))),
            TowPath(GROUND_SPEED, _WIND * (1.0 + _CHANGE * rng.uniform(-1, 1))),
        )
        for _ in range(25)
    ]
    ours = {}

    def product(number):
        i = number % len(updates)
        ours[i] = followed(start, *updates[i]).motion

    def peer(number):
        return settled(start, *updates[number % len(updates)])

    timed = duel(product, peer, session.rounds(12), calls=4)
    end, turns = peer(0)
    product(0)
    difference = float(np.abs(ours[0].end_mass(_phases()) - end).max())
    return outcome_of(
        timed, difference < 2e-3 and start.residual <= _ACCURACY, difference=difference,
        residual=ours[0].residual, unknowns=start.values.size, peer_turns=turns,
    )  # fmt: skip


def _phases() -> np.ndarray:
    return 2.0 * pi * np.arange(32) / 32


def settled(before: PeriodicMotion, parameters, path: TowPath) -> tuple[np.ndarray, int]:
    """The end mass round a turn, from a motion before until two turns agree, and how many it took.

    Parameters
    ----------
    before : PeriodicMotion
        In which the line is at first.
    parameters : Parameters
    path : TowPath
        At constant ground speed.
    """
    s, h = np.linspace(0.0, before.parameters.length, SEGMENTS + 1), 1e-4
    velocities = (before.cable(h, s) - before.cable(-h, s)) / (2.0 * h)
    state = CableState(0.0, before.cable(0.0, s), velocities)
    line = line_of(parameters)
    tow = circle(1.0, 1.0, 0.0, 2.0 * pi * _MOST_TURNS)
    driven = drive(line, tow, constant(np.array([path.air_velocity, 0.0, 0.0])))
    last = None
    for turn in range(_MOST_TURNS):
        motion = simulate(line, driven, state, 2.0 * pi * turn + _phases() + 1e-9)
        state, end = motion.end, motion.positions[:, 0]
        if last is not None and np.abs(end - last).max() < 0.2 * _ACCURACY:
            return end, turn + 1
        last = end
    return last, _MOST_TURNS
