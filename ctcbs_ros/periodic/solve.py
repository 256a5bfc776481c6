"""The periodic motion in a steady wind, continued in wind from the steady state in still air.

With more functions and times until the end mass moves no more, or from a motion nearby.
"""

from collections.abc import Generator
from dataclasses import dataclass, fields
from math import atan2, cos, hypot, inf, isfinite, nan, sin

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.periodic.elements import DEGREE, at_arc_lengths, interpolated
from ctcbs_ros.periodic.factors import Storage, bytes_needed
from ctcbs_ros.periodic.fourier import fourier, resampled, times
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.periodic.newton import Solved, newton_steps
from ctcbs_ros.periodic.tow_path import GROUND_SPEED, TowPath
from ctcbs_ros.pieces import drained
from ctcbs_ros.solver.blas import one_blas_thread
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import SteadyState

# By how much the end mass may be off [a]: what is aimed at, and what is still called converged.
ACCURACY, CONVERGED = 1e-5, 1e-3
# Numbers of elements tried on the steady state. The result has enough to give it to this share of
# the accuracy asked for: there is more to resolve in a wind.
_ELEMENTS, _SHARE = (2, 3, 4, 6, 8, 12, 16, 24), 0.01
_STILL = 3  # times that hold a motion that is steady in the rotating frame
# Wind, as a fraction of the tow speed: the first step, the longest and the shortest.
_FIRST, _LONGEST, _SHORTEST = 0.05, 0.1, 2e-3
# Least part of the way from one motion to another that is gone at once.
_LEAST_PART = 0.1
# Compression that is not taken for the error of few elements, in end weights.
_SLACK = 0.3
# Least tension at which the search was ended by the slack that follows, in end weights.
_NEARLY_SLACK = 0.2
# What the orders left out may come to, as a multiple of the last ones there.
_TAIL = 5.0
# Times of a turn that show where the end mass is, and the error in still air that their number of
# elements is for.
_COARSE = (9, 1e-5)
# Most times added at once.
_MORE_TIMES = 16


@dataclass(frozen=True)
class Effort:
    """How well a motion is to be known, and what is done for it at most.

    Attributes
    ----------
    accuracy : float
        Functions and times are added until the end mass moves by less [a].
    converged : float
        Where no more are allowed, this is enough.
    most_times, most_elements : int
        By default a matrix of one element takes 12 MB, all of them some seconds.
    most_memory : float
        For the factors of a matrix [bytes], see `bytes_needed`.
    ladder : tuple of (int, float)
        Times of a turn that a continuation begins with, and the error in still air that its
        number of elements is for; then what is tried where those do not suffice.
    """

    accuracy: float = ACCURACY
    converged: float = CONVERGED
    most_times: int = 81
    most_elements: int = 48
    most_memory: float = inf
    ladder: tuple[tuple[int, float], ...] = ((13, 1e-3), (21, 1e-4), (33, 1e-6))

    def allows(self, count: int, parts: int) -> bool:
        """Whether so many times and elements are within it."""
        return (
            count <= self.most_times and parts <= self.most_elements
            and bytes_needed(count, parts) <= self.most_memory
        )

    def __post_init__(self):
        """Refuse an accuracy that is none."""
        if not (isfinite(self.accuracy) and self.accuracy > 0.0):
            raise InputError(
                f"accuracy: {self.accuracy:g} is not allowed, it must be above 0 and finite"
            )


@dataclass(frozen=True)
class Found:
    """A periodic motion, or None with the reason.

    Where the search ended for that: `reached`, the path with the most wind that it was found for,
    and whether the cable is `nearly_slack` there; or `uncertain`, by how much the end mass may be
    off [a].
    """

    motion: PeriodicMotion | None
    reason: str
    reached: TowPath | None = None
    nearly_slack: bool = False
    uncertain: float = nan


def periodic_motion(
    state: SteadyState, path: TowPath, accuracy: float = ACCURACY
) -> Found:
    """The motion that a steady state becomes as the wind rises.

    Parameters
    ----------
    state : SteadyState
        In still air, of a cable that stretches.
    path : TowPath
        With the wind.
    accuracy : float
        Functions and times are added until the end mass moves by less [a].

    Returns
    -------
    Found

    Raises
    ------
    InputError
        If the cable does not stretch.
    """
    with one_blas_thread():
        return drained(motion_search(state, path, Effort(accuracy)))


def motion_search(
    state: SteadyState, path: TowPath, effort: Effort, storage: Storage | None = None
) -> Generator[float, None, Found]:
    """As `periodic_motion`, piece by piece: yields the work of each, see `newton_steps`."""
    p = state.parameters
    if not p.elastic:
        raise InputError(
            "elasticity: inf is not allowed, the periodic motion is that of a cable that stretches"
        )
    limit, found = "", None
    _, enough = yield from _in_still_air(state, _SHARE * effort.accuracy, storage)
    for count, error in effort.ladder:
        still, _ = yield from _in_still_air(state, error, storage)
        if still is None:
            return Found(None, "Newton's method does not find the steady state in still air again")
        wind, reached = yield from _continued(p, path, resampled(still, count), storage)
        if wind < path.wind:
            limit = _limit(p, wind, reached)
            continue
        refined = yield from _refined(p, path, reached, enough, effort, storage)
        found = _judged(refined, effort.converged)
        if found.motion is not None:
            return found
    return Found(None, limit or found.reason)


def coarse_search(
    state: SteadyState, path: TowPath, converged: float, storage: Storage | None = None
) -> Generator[float, None, Found]:
    """The motion in the few orders that make up its place: quick, also where more lead nowhere.

    Its residual is an estimate: the last orders there are. Otherwise as `motion_search`.
    """
    p, (count, error) = state.parameters, _COARSE
    if not p.elastic:
        raise InputError(
            "elasticity: inf is not allowed, the periodic motion is that of a cable that stretches"
        )
    still, _ = yield from _in_still_air(state, error, storage)
    if still is None:
        return Found(None, "Newton's method does not find the steady state in still air again")
    wind, reached = yield from _continued(p, path, resampled(still, count), storage)
    if wind < path.wind:
        nearly_slack = reached.least_tension < _NEARLY_SLACK * p.end_weight
        return Found(None, _limit(p, wind, reached), TowPath(path.kind, wind), nearly_slack)
    left = _tail(reached.values)[0] / _TAIL
    return _judged(
        PeriodicMotion(p, path, reached.values, left, reached.least_tension, reached.factors),
        converged,
    )


def refined_search(
    motion: PeriodicMotion, effort: Effort, storage: Storage | None = None
) -> Generator[float, None, Found]:
    """A motion with more functions and times, until the end mass moves no more."""
    begun = Solved(motion.values, motion.least_tension, 0, motion.factors)
    enough = motion.values.shape[2] // DEGREE
    finer = yield from _refined(
        motion.parameters, motion.path, begun, enough, effort, storage
    )
    return _judged(finer, effort.converged)


def _limit(p: Parameters, wind: float, reached: Solved) -> str:
    return (
        f"Newton's method does not converge beyond a wind of {wind:.3g} of the tow speed, "
        f"where the least tension is {max(reached.least_tension, 0.0) / p.end_weight:.2g} "
        "of the end weight"
    )


def followed(motion: PeriodicMotion, parameters: Parameters, path: TowPath) -> Found:
    """The motion of other parameters or another wind nearby, with as many elements and times.

    On the whole way at once, or else in parts.

    Parameters
    ----------
    motion : PeriodicMotion
    parameters : Parameters
    path : TowPath

    Returns
    -------
    Found
        Its residual is that of the motion it started from, or more where the highest orders have
        grown.
    """
    with one_blas_thread():
        return drained(followed_search(motion, parameters, path))


def followed_search(
    motion: PeriodicMotion, parameters: Parameters, path: TowPath, converged: float = CONVERGED,
    safety: float = 1.0, storage: Storage | None = None,
) -> Generator[float, None, Found]:
    """As `followed`, piece by piece: yields the work of each, see `newton_steps`.

    The part `safety` of what the highest orders may leave out counts: a fifth is those themselves.
    """  # fmt: skip
    values, p, done, step = motion.values, motion.parameters, 0.0, 1.0
    factors = motion.factors
    while done < 1.0:
        there = min(done + step, 1.0)
        q = _between(motion.parameters, parameters, there)
        wind = motion.path.wind + (path.wind - motion.path.wind) * there
        # The same shape, as far along the cable in proportion.
        guess = values * (q.length / p.length)
        solved = yield from newton_steps(q, TowPath(path.kind, wind), guess, factors, storage)
        if solved is None:
            step *= 0.5
            if step < _LEAST_PART:
                return Found(None, "Newton's method does not converge from the motion before")
            continue
        values, p, done, factors = solved.values, q, there, solved.factors
    residual = max(motion.residual, safety * _tail(values)[0])
    return _judged(
        PeriodicMotion(parameters, path, values, residual, solved.least_tension, factors),
        converged,
    )


def _between(before: Parameters, after: Parameters, share: float) -> Parameters:
    """Parameters on the way from some to others."""
    if share == 1.0:
        return after
    pairs = ((f.name, getattr(before, f.name), getattr(after, f.name)) for f in fields(Parameters))
    return Parameters(**{name: a + share * (b - a) for name, a, b in pairs})


def _judged(motion: PeriodicMotion, converged: float) -> Found:
    """Refuse what is no motion of a cable."""
    if not motion.residual <= converged:
        known = f" (uncertain by {motion.residual:.2g} of the tow radius)"
        return Found(
            None, "the end mass still moves with more functions and times than are allowed"
            + (known if isfinite(motion.residual) else ""),
            uncertain=motion.residual,
        )  # fmt: skip
    if not motion.least_tension > 0.0:
        return Found(None, "the cable goes slack in this wind")
    return Found(motion, "")


def still_air_motion(state: SteadyState, error: float) -> np.ndarray | None:
    """The steady state at three times of a turn, (3, 3, n), known to an error [a]; or None."""
    with one_blas_thread():
        return drained(_in_still_air(state, error, None))[0]


def _in_still_air(state: SteadyState, error: float, storage: Storage | None):
    """The steady state at three times, (3, 3, n), in as many functions as give it so well."""
    p, path = state.parameters, TowPath(GROUND_SPEED, 0.0)
    lag, solved = state.phase_lag, None
    expected = np.array(
        [state.end_mass_radius * cos(lag), -state.end_mass_radius * sin(lag), -state.depth]
    )
    for count in _ELEMENTS:
        guess = _projected(state, count)
        solved = (yield from newton_steps(p, path, guess, storage=storage)) or solved
        if solved is not None:
            end = solved.values[0, :, 0] + [1.0, 0.0, 0.0]
            if np.abs(end - expected).max() < error:
                break
    return (None, 0) if solved is None else (solved.values, solved.values.shape[2] // DEGREE)


def _projected(state: SteadyState, count: int) -> np.ndarray:
    """The steady state's shape in a number of elements, in the ground frame, (3, 3, n)."""
    length = state.parameters.length
    top = state.cable([length])[0][0]

    def turned(arc_lengths):
        """Positions relative to the tow point while that is on the x axis, (3, k)."""
        order = np.argsort(arc_lengths)
        positions = np.empty((arc_lengths.size, 3))
        positions[order] = state.cable(arc_lengths[order])[0]
        back = (positions[:, 0] + 1j * positions[:, 1]) * np.exp(-1j * atan2(top[1], top[0]))
        return np.stack([back.real - hypot(top[0], top[1]), back.imag, positions[:, 2] - top[2]])

    x, y, z = interpolated(turned, length, count)
    flat = np.multiply.outer(np.exp(1j * times(_STILL)), x + 1j * y)
    return np.stack([flat.real, flat.imag, np.broadcast_to(z, flat.shape)], axis=1)


def _continued(p: Parameters, path: TowPath, still: np.ndarray, storage: Storage | None):
    """Raise the wind: how far Newton's method or a slack cable let it, and the motion there."""
    wind, step, before = 0.0, _FIRST, None
    here = yield from newton_steps(p, TowPath(path.kind, 0.0), still, storage=storage)
    here = here or Solved(still, 0.0, 0)
    while wind < path.wind and here.least_tension > -_SLACK * p.end_weight:
        # No last step that is too short to tell a direction from.
        there = path.wind if path.wind - wind < 1.5 * step else wind + step
        guess = here.values
        if before is not None:
            guess = guess + (guess - before[0]) * (there - wind) / (wind - before[1])
        found = yield from newton_steps(p, TowPath(path.kind, there), guess, storage=storage)
        if found is None:
            step *= 0.4
            if step < _SHORTEST:
                break
            continue
        before, here, wind = (here.values, wind), found, there
        step = min(_LONGEST, step * (1.6 if found.steps <= 3 else 1.0))
    return wind, here


def _refined(p, path, solved: Solved, enough: int, effort: Effort, storage: Storage | None):
    """Add elements and times until the end mass moves no more."""
    residual = inf
    while residual > effort.accuracy:
        values = solved.values
        now = values.shape[0], values.shape[2] // DEGREE
        wanted = _more(now, values, enough, effort.accuracy)
        finer = yield from _solved_in_more(p, path, values, now, wanted, effort, storage)
        if finer is None:
            break
        count = max(values.shape[0], finer.values.shape[0])
        ends = (resampled(v[:, :, 0], 2 * count + 1) for v in (values, finer.values))
        moved = float(np.abs(np.subtract(*ends)).max())
        solved, residual = finer, max(moved, _tail(finer.values)[0])
    return PeriodicMotion(
        p, path, solved.values, residual, solved.least_tension, solved.factors
    )


def _solved_in_more(p, path, values, now, wanted, effort: Effort, storage: Storage | None):
    """Newton's method from a motion in so many times and elements to one in more."""
    count, parts = wanted
    # High orders ring: where one number of times leads nowhere, another may.
    for some in ((count, parts), (count + 8, parts), (count, now[1]), (count + 16, parts)):
        if some != now and effort.allows(*some):
            guess = _in_more(values, *some, p.length)
            found = yield from newton_steps(p, path, guess, storage=storage)
            if found is not None:
                return found
    return None


def _more(now, values, enough: int, accuracy: float) -> tuple[int, int]:
    """How many times and elements to go on with from so many now."""
    count, parts = now
    tail, falls = _tail(values)
    if tail > 0.5 * accuracy:
        orders = np.log(tail / (0.2 * accuracy)) / -np.log(falls)
        count += min(max(2 * int(np.ceil(orders)), 4), _MORE_TIMES)
    return count, max(parts + (parts + 2) // 3, enough)


def _in_more(values, count: int, parts: int, length: float) -> np.ndarray:
    """The same motion in other numbers of times and elements."""
    finer = resampled(values, count)
    if parts * DEGREE == values.shape[2]:
        return finer
    return interpolated(lambda s: at_arc_lengths(finer, length, s), length, parts)


def _tail(values: np.ndarray) -> tuple[float, float]:
    """What the orders left out may move the end mass by, and the factor an order falls by."""
    waves = np.abs(fourier(values[:, :, 0])).max(axis=1)
    last, before = waves[-2:].max(), waves[-4:-2].max()
    falls = np.sqrt(last / before) if before > last else 0.9
    return _TAIL * float(last), float(np.clip(falls, 0.1, 0.9))
