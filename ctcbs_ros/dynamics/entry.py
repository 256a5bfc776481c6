"""A planned entry, simulated until it is settled: which state is reached, when, and what it costs.

Everything is told by the end mass's motion from one orbit to the next. It is settled where two
orbits are the same, up to what the rate of their approach leaves; and it keeps oscillating where
its extremes over many orbits are the same, and the orbits are not.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ctcbs_ros.dynamics.cable import TOLERANCE, CableState, Drive, drive, simulate
from ctcbs_ros.dynamics.line import Line, line_of
from ctcbs_ros.dynamics.loads import loads
from ctcbs_ros.dynamics.manoeuvre import Manoeuvre
from ctcbs_ros.dynamics.settled import SPAN, approached, oscillates, settled_after
from ctcbs_ros.dynamics.signal import constant, held, sampled
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import SteadyState, steady_states

PERIOD = 2.0 * pi
AN_ORBIT = 64  # states given
# Flown at a time, and before the manoeuvre where wind must be felt first; in orbits.
_CHUNK, _LEAD = 5, 15
# Of the tow radius: what is left of the approach to count as settled, how near a steady state is
# that state, and what is meant by settled to 5 %.
_LEFT, _NEAR, _WITHIN = 5e-3, 0.03, 0.05

STEADY, PERIODIC, OSCILLATING, UNDECIDED = "steady", "periodic", "oscillating", "undecided"


@dataclass(frozen=True)
class Known:
    """A steady state in still air that the circle has.

    Attributes
    ----------
    end_mass_radius, depth, phase_lag, growth_rate : float
    stable, reached : bool
    """

    end_mass_radius: float
    depth: float
    phase_lag: float
    growth_rate: float
    stable: bool
    reached: bool


@dataclass(frozen=True)
class Entry:
    """What an entry comes to, in the units of the circle: its radius, 1/Omega, mu a.

    Attributes
    ----------
    outcome : str
        "steady" (a steady state of still air), "periodic" (the same from orbit to orbit, as in
        wind), "oscillating" (for good, between the radii and depths told), or "undecided": neither
        so far.
    settling_time : float
        From the manoeuvre's beginning until the end mass stays within 5 % of the tow radius of
        where it ends; nan where it does not settle.
    manoeuvre_time, simulated_time : float
    least_radius, greatest_radius, least_depth, greatest_depth : float
        Of the end mass from the circle's axis and below the tow plane: over the last orbit where
        it is settled, else over the last thirty.
    mean_position : (3,) ndarray
        Over the same.
    greatest_tension : float
        Of all segments at all times from the manoeuvre's beginning.
    greatest_excursion : float
        Greatest distance of the end mass from the circle's axis once the circle is flown.
    lowest : float
        Least height of the end mass against the tow plane, from the manoeuvre's beginning.
    slack : float
        Share of that time at which some segment is slack.
    states : tuple of Known
    """

    outcome: str
    settling_time: float
    manoeuvre_time: float
    simulated_time: float
    least_radius: float
    greatest_radius: float
    least_depth: float
    greatest_depth: float
    mean_position: np.ndarray
    greatest_tension: float
    greatest_excursion: float
    lowest: float
    slack: float
    states: tuple[Known, ...]


def enter(
    parameters: Parameters, manoeuvre: Manoeuvre, wind=(0.0, 0.0, 0.0), orbits: float = 100.0,
    segments: int = 40, tolerance: float = TOLERANCE, tell=lambda part: None,
) -> Entry:  # fmt: skip
    """Simulate an entry until it is settled, or oscillates for good, or for a number of orbits.

    Parameters
    ----------
    parameters : Parameters
        Of the circle.
    manoeuvre : Manoeuvre
    wind : (3,) array_like
        Velocity of the air over the tow speed.
    orbits : float
        Longest time flown after the manoeuvre.
    segments : int
    tolerance : float
        As in `simulate`.
    tell : callable
        Called with the part of the longest time that has been flown.
    """
    line = line_of(parameters)
    wind = np.asarray(wind, float)
    lead = _LEAD * PERIOD if manoeuvre.settles_first and np.any(wind) else 0.0
    last = manoeuvre.duration + (orbits + _CHUNK) * PERIOD
    tow = sampled(manoeuvre.place, -lead, last, PERIOD / 256.0, "tow point")
    length = None
    if manoeuvre.length is not None:
        reeled = manoeuvre.duration
        length = held(sampled(manoeuvre.length, 0.0, reeled, reeled / 64.0, "length"))
    driven = drive(line, tow, constant(wind), length)
    state = _placed(manoeuvre.begin(segments, wind), driven, -lead)
    if lead:
        state = simulate(line, driven, state, [0.0], tolerance).end
    return _judged(parameters, line, driven, state, manoeuvre, orbits, tolerance, tell)


def _placed(state: CableState, driven: Drive, time: float) -> CableState:
    """A state turned about the axis to where the tow point is at a time."""
    here, there = state.positions[-1], driven.tow_point.at(time)
    angle = np.arctan2(there[1], there[0]) - np.arctan2(here[1], here[0])
    c, s = np.cos(angle), np.sin(angle)
    back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return CableState(time, state.positions @ back, state.velocities @ back)


def _judged(parameters, line: Line, driven, state, manoeuvre, orbits, tolerance, tell) -> Entry:
    still = not np.any(driven.wind.coefficients)
    known = _known(parameters) if still else ()
    # Times are counted from the end of the manoeuvre, in whole parts of an orbit.
    step = PERIOD / AN_ORBIT
    before = int(np.ceil((manoeuvre.duration - state.time) / step - 1e-9))
    origin = manoeuvre.duration - before * step
    ends, tops, tensions, slack = [], [], [], []
    done, outcome, reached = 0, UNDECIDED, None
    most = before + round(orbits * AN_ORBIT)
    while outcome == UNDECIDED and done < most:
        count = before + _CHUNK * AN_ORBIT if done == 0 else _CHUNK * AN_ORBIT
        times = origin + step * np.arange(done, done + count)
        motion = simulate(line, driven, state, times[times >= state.time], tolerance)
        state = motion.end
        found = loads(line, driven, motion).tensions
        ends.append(motion.positions[:, 0])
        tops.append(motion.positions[:, -1])
        tensions.append(found.max())
        slack.append((found == 0.0).any(axis=1))
        done += count
        tell(min(1.0, done / most))
        circled = np.concatenate(ends)[-(done - before):]
        outcome, reached = _outcome(circled, np.concatenate(tops)[-(done - before):], known)
    end = np.concatenate(ends)
    settled = outcome in (STEADY, PERIODIC)
    span = AN_ORBIT if settled else min(3 * SPAN * AN_ORBIT, len(circled))
    radius, depth = np.hypot(*circled[:, :2].T), -circled[:, 2]
    return Entry(
        outcome=outcome,
        settling_time=_settling_time(end, state.time) if settled else np.nan,
        manoeuvre_time=manoeuvre.duration,
        simulated_time=state.time,
        least_radius=float(radius[-span:].min()),
        greatest_radius=float(radius[-span:].max()),
        least_depth=float(depth[-span:].min()),
        greatest_depth=float(depth[-span:].max()),
        mean_position=circled[-span:].mean(axis=0),
        greatest_tension=float(max(tensions)),
        greatest_excursion=float(radius.max()),
        lowest=float(end[:, 2].min()),
        slack=float(np.concatenate(slack).mean()),
        states=tuple(replace(k, reached=k is reached) for k in known),
    )


def _known(parameters: Parameters) -> tuple[Known, ...]:
    if not parameters.elastic:
        parameters = replace(parameters, elasticity=parameters.vibration_elasticity)
    return tuple(_described(s) for s in steady_states(parameters).states)


def _described(state: SteadyState) -> Known:
    rate = stability(state).growth_rate
    return Known(state.end_mass_radius, state.depth, state.phase_lag, rate, rate < 0.0, False)


def _outcome(end, top, known):
    """What the orbits so far, AN_ORBIT positions each from the manoeuvre's end, have come to."""
    orbits = end[: len(end) // AN_ORBIT * AN_ORBIT].reshape(-1, AN_ORBIT, 3)
    if approached(orbits, _LEFT):
        change = np.abs(orbits[-1] - orbits[-2]).max()
        near = [k for k in known if _distance(end[-1], top[-1], k) < _NEAR]
        if not near:
            return (UNDECIDED, None) if known and change > 1e-4 else (PERIODIC, None)
        if near[0].stable:
            return STEADY, near[0]
    return (OSCILLATING, None) if oscillates(orbits, 10.0 * _LEFT) else (UNDECIDED, None)


def _distance(end, top, known):
    """How far an end mass is from a steady state that turns with the tow point."""
    behind = np.arctan2(top[1], top[0]) - known.phase_lag
    r = known.end_mass_radius
    there = np.array([r * np.cos(behind), r * np.sin(behind), -known.depth])
    return np.abs(end - there).max()


def _settling_time(end, last):
    """From when on every orbit is the last one, within what is asked."""
    count = len(end) // AN_ORBIT * AN_ORBIT
    late = settled_after(end[-count:].reshape(-1, AN_ORBIT, 3), _WITHIN)
    return float(max(0.0, last - PERIOD / AN_ORBIT * (count - 1 - late)))
