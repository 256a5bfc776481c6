"""The motion in the wind where no periodic solution is found: the cable flown until it repeats.

As good a motion to follow as the periodic one (`ctcbs_ros.prediction.wind_motion`), and marked as
what it is. What it is not: a motion that keeps changing from turn to turn.
"""

from collections.abc import Generator
from dataclasses import replace
from math import hypot, log

import numpy as np

from ctcbs_ros.dynamics.equilibrium import equilibrium
from ctcbs_ros.errors import InputError
from ctcbs_ros.periodic.fourier import fourier
from ctcbs_ros.prediction.prediction import MotionSource
from ctcbs_ros.prediction.wind_motion import Flight, LinearMotion, Scaled, beside
from ctcbs_ros.prediction.wind_reasons import not_repeating
from ctcbs_ros.solver.steady_state import SteadyState
from ctcbs_ros.twin.decay import decay
from ctcbs_ros.twin.simulated_cable import elastic
from ctcbs_ros.twin.turns import Flown, Flying, of_length, refined_turns_search, turns_search

_FLYING = Flying(segments=24)
# Steps of the derivatives: in ln of radius and rate, and in wind over the tow speed. What is left
# of the approach is in them, and so in what is used farthest off, 0.08, four times.
_STEP, _LEFT_TOO = 0.02, 4.0


def motion_in_time_search(
    flight: Flight, scaled: Scaled, state: SteadyState, before: LinearMotion | None
) -> Generator[float, None, LinearMotion | str]:
    """The motion with its derivatives, or why there is none; yields work (`newton_steps`).

    Parameters
    ----------
    flight : Flight
    scaled : callable
        Parameters at a tow radius [m] and a speed [m/s].
    state : SteadyState
        In still air, on the branch flown.
    before : LinearMotion or None
        Such a motion nearby, to begin with.
    """
    speed = flight.radius * flight.rate
    try:
        parameters = elastic(scaled(flight.radius, speed))
        still = before is None or before.state is None
        if still:
            begun = equilibrium(replace(state, parameters=parameters), _FLYING.half.segments)
        else:
            begun = of_length(before.state, parameters.length / before.motion.parameters.length)
        coarse, fine = yield from refined_turns_search(
            parameters, flight.path, begun, still, _FLYING
        )
        if fine.motion is None:
            return not_repeating(fine, flight.wind, speed)
        found = yield from _derivatives(coarse, flight, scaled)
    except (ArithmeticError, InputError) as error:
        return str(error)
    if found is None:
        return not_repeating(fine, flight.wind, speed)
    slopes, others = found
    motion = fine.motion
    motion = replace(motion, residual=hypot(motion.residual, _LEFT_TOO * fine.left))
    waves = np.stack([fourier(motion.values), *slopes], axis=1)
    seen = decay([flown.changes for flown in (coarse, fine, *(flown for flown, _ in others))])
    return LinearMotion(
        flight, motion, waves, source=MotionSource.IN_TIME, state=fine.state,
        beside=tuple((flown.motion, unit) for flown, unit in others), known_as=coarse.motion,
        decay=seen,
    )  # fmt: skip


def _derivatives(base: Flown, flight: Flight, scaled: Scaled):
    """Of the waves by ln radius, ln rate and wind [m/s]; the flights they are from, with steps.

    By differences; None without motions.
    """
    waves, found, others = fourier(base.motion.values), [], []
    speed = flight.radius * flight.rate
    for steps in np.eye(3):
        # By less of each where more leads nowhere.
        for step in (_STEP, -_STEP):
            there = beside(flight, step * steps)
            if there.wind < 0.0:
                continue
            parameters = elastic(scaled(there.radius, there.radius * there.rate))
            begun = of_length(base.state, parameters.length / base.motion.parameters.length)
            flown = yield from turns_search(parameters, there.path, begun, False, _FLYING.half)
            if flown.motion is not None:
                unit = step * speed if steps[2] else log(1.0 + step)
                found.append((fourier(flown.motion.values) - waves) / unit)
                others.append((flown, unit))
                break
        else:
            return None
    return found, others
