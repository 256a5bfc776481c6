"""The margin of the state flown, converged at a fraction of its cost.

A converged margin takes two numbers of functions in each orbit. The difference between them moves
slowly: from one orbit to the next only the smaller number is computed, and the difference added.
"""

from dataclasses import replace

from ctcbs_ros.prediction.jumps import is_elsewhere
from ctcbs_ros.solver.stability import FUNCTIONS, Stability, stability
from ctcbs_ros.solver.steady_state import SteadyState

# A change of frequency, per radian of orbit, that may mean another mode.
_OTHER_MODE = 0.05


class MarginFollower:
    """Stability of the tracked state from orbit to orbit."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the state: the next one is computed in full."""
        self._checked_at: SteadyState | None = None

    def update(self, state: SteadyState) -> Stability:
        """Stability of a state, computed in full only far from where it was last.

        Parameters
        ----------
        state : SteadyState

        Returns
        -------
        Stability
        """
        if self._checked_at is None or is_elsewhere(self._checked_at, state):
            return self._check(state)
        now = stability(state, functions=(self._fewer,))
        if abs(now.frequency - self._coarse.frequency) > _OTHER_MODE:
            return self._check(state)
        return replace(
            self._full,
            growth_rate=self._full.growth_rate + now.growth_rate - self._coarse.growth_rate,
            frequency=max(self._full.frequency + now.frequency - self._coarse.frequency, 0.0),
            band=now.band,
        )

    def _check(self, state: SteadyState) -> Stability:
        self._checked_at = state
        self._full = stability(state)
        self._fewer = FUNCTIONS[max(FUNCTIONS.index(self._full.functions) - 1, 0)]
        self._coarse = stability(state, functions=(self._fewer,))
        return self._full
