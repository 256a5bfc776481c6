"""How fast what is left of a motion's approach decays, seen from turn to turn.

Of several flights of the cable at once, each with what its own beginning left: one rate for all,
with its error by how far they scatter about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan, pi, sqrt

import numpy as np

# Changes from one turn to the next [a]: above, the decay is not that of a small disturbance;
# below, it is drowned in the error of the steps.
_SMALL, _SEEN = 0.1, 2e-5
# Its standard error, over the rate, up to which a rate is known.
_KNOWN = 0.1


@dataclass(frozen=True)
class Decay:
    """The common rate of some flights.

    Attributes
    ----------
    growth_rate : float
        Per radian of orbit, negative for a decay; nan where no two turns tell it.
    sigma : float
        Its standard error; inf where nothing is left over to judge it by.
    """

    growth_rate: float = nan
    sigma: float = inf

    @property
    def known(self) -> bool:
        """Whether it is a decay, told to a tenth."""
        return isfinite(self.growth_rate) and self.sigma < -_KNOWN * self.growth_rate


def decay(flights: Sequence[np.ndarray]) -> Decay:
    """The rate at which the changes from turn to turn become less, by least squares.

    Parameters
    ----------
    flights : sequence of (k,) ndarrays
        Each the sizes of its changes [a], turn after turn; k may differ.

    Returns
    -------
    Decay
        A straight line in the logarithm for each flight, all of one slope.
    """
    across, along, points, lines = [], [], 0, 0
    for changes in flights:
        turns = np.flatnonzero((changes < _SMALL) & (changes > _SEEN))
        if turns.size < 2:
            continue
        sizes = np.log(changes[turns])
        across.append(turns - turns.mean())
        along.append(sizes - sizes.mean())
        points, lines = points + turns.size, lines + 1
    if not lines:
        return Decay()
    x, y = np.concatenate(across), np.concatenate(along)
    slope, left_over = float(x @ y / (x @ x)), points - lines - 1
    turn = 2.0 * pi
    if left_over < 1:
        return Decay(slope / turn)
    scatter = float(np.sum((y - slope * x) ** 2)) / left_over
    return Decay(slope / turn, sqrt(scatter / float(x @ x)) / turn)
