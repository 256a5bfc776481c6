"""The wind that the twin flies in: the one believed, taken over little by little.

What one source tells may change, as the wind does. Another source that is believed instead is a
better knowledge of the same wind: what was flown in the one before is then wrong.
"""

from math import exp

import numpy as np

from ctcbs_ros.orbit.wind import CLIMATE, CONTRADICTION, Wind

# Time in which a change of the wind believed is taken over by two thirds [s].
_TAKEN_OVER = 5.0
# Change of the wind believed that is felt, over the tow speed.
_FELT = 0.05


class FlownWind:
    """Follows the wind believed.

    Attributes
    ----------
    velocity : (3,) ndarray
        Of the air, east, north, up [m/s]; still air until a wind is told.
    """

    def __init__(self):
        self.velocity = np.zeros(3)
        self._believed: Wind | None = None

    @property
    def known(self) -> bool:
        """Whether a wind was told."""
        return self._believed is not None

    @property
    def covariance(self) -> np.ndarray:
        """Of the wind flown in, (2, 2) [m^2/s^2]: what is not taken over yet counts as an error.

        Where none was told, it is the climate's.
        """
        if self._believed is None:
            return CLIMATE**2 * np.eye(2)
        left = self._believed.velocity - self.velocity[:2]
        return self._believed.covariance + np.outer(left, left)

    def take(self, wind: Wind, interval: float, tow_speed: float, at_once: bool) -> bool:
        """Take over the wind believed.

        Parameters
        ----------
        wind : Wind
        interval : float
            Since the sample before [s].
        tow_speed : float
            [m/s]
        at_once : bool
            Whether nothing is flown in it yet.

        Returns
        -------
        bool
            Whether what was flown in until now was never there: it is then taken over at once.
        """
        told = np.append(wind.velocity, 0.0)
        was_never_there = self._is_other(wind, tow_speed)
        if was_never_there or at_once:
            self.velocity = told
        else:
            part = 1.0 - exp(-interval / _TAKEN_OVER)
            self.velocity = self.velocity + part * (told - self.velocity)
        self._believed = wind
        return was_never_there

    def _is_other(self, wind: Wind, tow_speed: float) -> bool:
        change = wind.velocity - self.velocity[:2]
        if not np.hypot(*change) > _FELT * tow_speed:
            return False
        if self._believed is None:
            return True
        if wind.source is self._believed.source:
            return False
        return bool(change @ np.linalg.solve(wind.covariance, change) > CONTRADICTION)
