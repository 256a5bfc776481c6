"""A periodic motion of the towed cable: where each point of it is at every time of a turn."""

from dataclasses import dataclass, field

import numpy as np

from ctcbs_ros.periodic.elements import at_arc_lengths
from ctcbs_ros.periodic.factors import Factors
from ctcbs_ros.periodic.fourier import at_times, fourier
from ctcbs_ros.periodic.tow_path import TowPath
from ctcbs_ros.solver.parameters import Parameters

# Harmonics of the end mass below this are rounding [a].
_LEAST_AMPLITUDE = 1e-12


@dataclass(frozen=True)
class PeriodicMotion:
    """The motion in the ground frame about the centre of the tow circle, non-dimensional.

    The tow point is at (1, 0, 0) at time 0 and goes anticlockwise, z is up, the air moves
    towards +x, and a turn takes 2 pi.

    Attributes
    ----------
    parameters : Parameters
    path : TowPath
    values : (k, 3, n) ndarray
        Coefficients of the n functions of arc length of `elements`, in x, y and z, at k times of a
        turn: where the cable is relative to the tow point. The first is the end mass's.
    residual : float
        By how much the end mass may be off because of the finite number of functions and times
        [a], estimated from a coarser solution; nan where there was none.
    least_tension : float
        Along the cable over the turn.
    factors : Factors, optional
        Of the last matrix of Newton's method, for motions nearby.
    """

    parameters: Parameters
    path: TowPath
    values: np.ndarray = field(repr=False)
    residual: float
    least_tension: float
    factors: Factors | None = field(default=None, repr=False, compare=False)

    def end_mass(self, times) -> np.ndarray:
        """Position of the end mass at times of any shape, with a last axis of 3."""
        return self._tow_point(times) + at_times(fourier(self.values[:, :, 0]), times)

    def end_mass_velocity(self, times) -> np.ndarray:
        """Its velocity over the ground, the same way."""
        return self.path.motion(times)[1] + at_times(fourier(self.values[:, :, 0]), times, 1)

    def cable(self, time: float, arc_lengths) -> np.ndarray:
        """Positions at unstretched arc lengths from the end mass, (k, 3)."""
        coefficients = at_times(fourier(self.values), time)
        length = self.parameters.length
        return self._tow_point(time) + at_arc_lengths(coefficients, length, arc_lengths).T

    def _tow_point(self, times) -> np.ndarray:
        return self.path.motion(times)[0]

    def end_mass_fourier(self) -> np.ndarray:
        """Complex amplitudes of the end mass by order, (orders, 3); the first is the mean.

        At constant airspeed the tow circle itself has all orders.
        """
        count = 4 * self.values.shape[0] + 1
        turn = 2.0 * np.pi * np.arange(count) / count
        return fourier(self.end_mass(turn))[: 2 * self.values.shape[0]]

    @property
    def mean(self) -> np.ndarray:
        """Mean position of the end mass over a turn, (3,)."""
        return self.end_mass_fourier()[0].real

    @property
    def harmonics(self) -> np.ndarray:
        """Half of peak to peak of the orders 1, 2, ... of the end mass, (orders, 3)."""
        amplitudes = np.abs(self.end_mass_fourier()[1:])
        some = np.flatnonzero(amplitudes.max(axis=1) > _LEAST_AMPLITUDE)
        return amplitudes[: some[-1] + 1 if some.size else 1]
