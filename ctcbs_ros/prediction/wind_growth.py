"""How stable the motion in the wind is: its Floquet exponent, and how that changes nearby.

Of a coarse motion and of one in time as of any other, unless the highest of its orders matter to
the exponent. Where that is not known, of a motion in time: the decay of what its flights began
with.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from math import log, nan

import numpy as np

from ctcbs_ros.periodic.floquet import floquet_search, least_damped_search
from ctcbs_ros.periodic.fourier import at_times, fourier, times
from ctcbs_ros.periodic.motion import PeriodicMotion
from ctcbs_ros.prediction.wind_motion import Flight, LinearMotion
from ctcbs_ros.prediction.wind_reasons import COARSE, NOT_CONVERGED
from ctcbs_ros.solver.stability import DIVERGENCE, FLUTTER, FUNCTIONS

# What the highest third of the orders may change of an exponent, as a share of it, or per radian.
_KNOWN, _CLOSE = 0.1, 1e-3
# What more functions or steps may change of it.
_CONVERGED = 0.02
# Steps a turn of what is only compared, the most of all, and the most functions, unless still air
# needs more: so much is done within some seconds.
_STEPS, _MOST_STEPS, _MOST_FUNCTIONS = 16, 64, 27


@dataclass(frozen=True)
class LinearGrowth:
    """The exponent of the least damped mode of a motion, with its derivatives.

    Attributes
    ----------
    flight : Flight
        For which it was computed.
    growth_rate : float
        Per radian of orbit.
    frequency : float
        In the rotating frame, per radian; nan where it was seen to decay only.
    nearest_loss : str or None
        See `ctcbs_ros.prediction.prediction.Margin`.
    slopes : (3,) ndarray
        Of the growth rate by ln radius, ln rate and wind [m/s].
    """

    flight: Flight
    growth_rate: float
    frequency: float
    nearest_loss: str | None
    slopes: np.ndarray

    def at(self, flight: Flight) -> float:
        """Growth rate of a flight nearby, per radian of orbit."""
        there = self.flight
        away = np.array([
            log(flight.radius / there.radius), log(flight.rate / there.rate),
            flight.wind - there.wind,
        ])  # fmt: skip
        return self.growth_rate + float(self.slopes @ away)


def growth_search(
    solved: LinearMotion, functions: int
) -> Generator[float, None, LinearGrowth | str]:
    """How stable a motion is, or why that is not known well enough; yields work.

    Parameters
    ----------
    solved : LinearMotion
    functions : int
        A coordinate, that the state in still air needs.
    """
    exponent = yield from _exponent_search(solved, functions)
    seen = solved.decay
    if isinstance(exponent, str) and seen is not None and seen.known:
        return LinearGrowth(solved.flight, seen.growth_rate, nan, None, np.zeros(3))
    return exponent


def _exponent_search(solved: LinearMotion, functions: int):
    motion = solved.motion
    band = motion.parameters.band
    few = max((n for n in FUNCTIONS if n < functions), default=functions)
    rough = yield from least_damped_search(motion, few, band, _STEPS)
    fewer = yield from least_damped_search(_in_fewer_orders(motion), few, band, _STEPS)
    apart = abs(rough.growth_rate - fewer.growth_rate)
    if not apart <= max(_KNOWN * abs(rough.growth_rate), _CLOSE):
        return COARSE
    found = yield from floquet_search(
        motion, functions, band, max(functions, _MOST_FUNCTIONS), _MOST_STEPS, _CONVERGED
    )
    if not found.converged:
        return NOT_CONVERGED
    slopes = []
    if solved.known_as is not None:
        rough = yield from least_damped_search(solved.known_as, few, band, _STEPS)
    for beside, step in solved.beside:
        there = yield from least_damped_search(beside, few, beside.parameters.band, _STEPS)
        slopes.append((there.growth_rate - rough.growth_rate) / step)
    loss = DIVERGENCE if found.diverges else FLUTTER
    return LinearGrowth(
        solved.flight, found.growth_rate, found.frequency, loss, np.array(slopes)
    )


def _in_fewer_orders(motion: PeriodicMotion) -> PeriodicMotion:
    """The same without the highest third of its orders."""
    orders = motion.values.shape[0] // 2
    count = 2 * (orders - orders // 3) + 1
    waves = fourier(motion.values)[: count // 2 + 1]
    return replace(motion, values=at_times(waves, times(count)), factors=None)
