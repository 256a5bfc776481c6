"""How stable the motion in the wind is: its Floquet exponent, and how that changes nearby.

Where that is not known, of a motion in time: the decay of what its flights began with. Exponents
only of a motion that is known well enough: between the times at which a stiff cable's motion was
solved, few orders leave a tension that is none, and exponents that are none either.
"""

from collections.abc import Generator
from dataclasses import dataclass
from math import log, nan

import numpy as np

from ctcbs_ros.periodic.floquet import floquet_search, least_damped_search
from ctcbs_ros.prediction.wind_motion import Flight, LinearMotion
from ctcbs_ros.solver.stability import DIVERGENCE, FLUTTER, FUNCTIONS

# Two ways to pass between the motion's times may differ by this share, or per radian by this.
_KNOWN, _CLOSE = 0.05, 1e-3
# Steps a turn of what is only compared; the most of all, and of a coarse motion, which is soon
# known better; and the most functions: with those a piece of the work takes a tenth of a second.
_STEPS, _MOST_STEPS, _COARSE_STEPS = 16, 64, 32
_MOST_FUNCTIONS = 40


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
) -> Generator[float, None, LinearGrowth | None]:
    """How stable a motion is, None where that is not known well enough; yields work.

    Parameters
    ----------
    solved : LinearMotion
    functions : int
        A coordinate, that the state in still air needs.
    """
    exponent = yield from _exponent_search(solved, functions)
    seen = solved.decay
    if exponent is None and seen is not None and seen.known:
        return LinearGrowth(solved.flight, seen.growth_rate, nan, None, np.zeros(3))
    return exponent


def _exponent_search(solved: LinearMotion, functions: int):
    motion = solved.motion
    band = motion.parameters.band
    few = max((n for n in FUNCTIONS if n < functions), default=functions)
    rough = yield from least_damped_search(motion, few, band, _STEPS)
    smooth = yield from least_damped_search(motion, few, band, _STEPS, smooth=True)
    apart = abs(rough.growth_rate - smooth.growth_rate)
    if apart > max(_KNOWN * abs(rough.growth_rate), _CLOSE):
        return None
    most = (functions, _COARSE_STEPS) if solved.coarse else (_MOST_FUNCTIONS, _MOST_STEPS)
    found = yield from floquet_search(motion, functions, band, *most)
    if not found.converged:
        return None
    slopes = []  # none where the motion was flown in time
    for beside, step in solved.beside:
        there = yield from least_damped_search(beside, few, beside.parameters.band, _STEPS)
        slopes.append((there.growth_rate - rough.growth_rate) / step)
    loss = DIVERGENCE if found.diverges else FLUTTER
    return LinearGrowth(
        solved.flight, found.growth_rate, found.frequency, loss, np.array(slopes or [0.0] * 3)
    )
