"""What drives a cable in time, as piecewise cubics: tow point, wind, length paid out, end mass."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from ctcbs_ros.errors import InputError


@dataclass(frozen=True)
class Signal:
    """A quantity in time with d components.

    Attributes
    ----------
    breaks : (k + 1,) ndarray
        Rising times; the first and the last piece go on beyond them.
    coefficients : (4, k, d) ndarray
        Of powers 0 to 3 of the time since a piece's beginning.
    stops : (j,) ndarray
        Breaks at which the quantity or its first derivatives jump.
    """

    breaks: np.ndarray
    coefficients: np.ndarray
    stops: np.ndarray

    def at(self, times) -> np.ndarray:
        """Values at times of any shape, with a last axis of d; at a jump those after it."""
        times = np.asarray(times, float)
        last = len(self.breaks) - 2
        i = np.clip(np.searchsorted(self.breaks, times, "right") - 1, 0, last)
        s = (times - self.breaks[i])[..., None]
        c0, c1, c2, c3 = self.coefficients[:, i]
        return c0 + s * (c1 + s * (c2 + s * c3))

    @property
    def compiled(self) -> tuple[np.ndarray, np.ndarray]:
        """What the kernels take."""
        return self.breaks, self.coefficients


def constant(value, name: str = "value") -> Signal:
    """One that never changes."""
    value = _finite(np.atleast_1d(np.asarray(value, float)), name)
    coefficients = np.zeros((4, 1, value.size))
    coefficients[0, 0] = value
    return Signal(np.array([0.0, 1.0]), coefficients, np.empty(0))


def steps(times, values, name: str = "value") -> Signal:
    """One that is constant between jumps.

    Parameters
    ----------
    times : (k - 1,) array_like
        Rising times of the jumps.
    values : (k, d) array_like
        Before the first jump, then after each.
    name : str
        For the error.
    """
    times = _rising(times, name, least=1)
    values = _rows(values, len(times) + 1, name)
    breaks = np.concatenate([[times[0] - 1.0], times, [times[-1] + 1.0]])
    coefficients = np.zeros((4, *values.shape))
    coefficients[0] = values
    return Signal(breaks, coefficients, times)


def linear(times, values, name: str = "value") -> Signal:
    """One that goes straight from sample to sample, and is constant before and after them.

    Parameters
    ----------
    times : (k,) array_like
        Rising.
    values : (k, d) array_like
    name : str
        For the error.
    """
    times = _rising(times, name, least=2)
    values = _rows(values, len(times), name)
    breaks = np.concatenate([[times[0] - 1.0], times, [times[-1] + 1.0]])
    coefficients = np.zeros((4, len(times) + 1, values.shape[1]))
    coefficients[0] = np.concatenate([values[:1], values])
    coefficients[1, 1:-1] = np.diff(values, axis=0) / np.diff(times)[:, None]
    return Signal(breaks, coefficients, times)


def spline(times, values, name: str = "value", periodic: bool = False) -> Signal:
    """The cubic spline through samples, twice continuously differentiable.

    Parameters
    ----------
    times : (k,) array_like
        Rising.
    values : (k, d) array_like
    name : str
        For the error.
    periodic : bool
        Whether the last sample is the first again; slopes then agree there too.
    """
    times = _rising(times, name, least=3)
    values = _rows(values, len(times), name)
    found = CubicSpline(times, values, bc_type="periodic" if periodic else "not-a-knot")
    return Signal(times, np.ascontiguousarray(found.c[::-1]), np.empty(0))


def smoothed(times, values, period: float, name: str = "value") -> Signal:
    """The smoothing spline through noisy samples, twice continuously differentiable.

    Parameters
    ----------
    times : (k,) array_like
        Rising, at least 5.
    values : (k, d) array_like
    period : float
        Of an oscillation that it lets pass by half; one n times as long is damped by 1/(1 + n^4).
        0 for the cubic spline through all samples.
    name : str
        For the error.
    """
    if period == 0.0:
        return spline(times, values, name)
    times = _rising(times, name, least=5)
    values = _rows(values, len(times), name)
    # The least of sum |f - y|^2 + penalty * integral |f''|^2 answers a sine of the rate w with
    # 1/(1 + penalty * interval * w^4).
    penalty = (period / (2.0 * np.pi)) ** 4 / np.median(np.diff(times))
    smooth = [make_smoothing_spline(times, v, lam=penalty)(times) for v in values.T]
    found = CubicSpline(times, np.column_stack(smooth), bc_type="natural")  # the same spline
    # A step over many knots would see of what noise is left only where its stages fall.
    return Signal(times, np.ascontiguousarray(found.c[::-1]), times)


def sampled(
    function: Callable, start: float, end: float, interval: float, name: str = "value"
) -> Signal:
    """The cubic spline through samples of a smooth function of time.

    Parameters
    ----------
    function : callable
        Of times (k,), giving (k, d).
    start, end, interval : float
        The error falls with the fourth power of the interval.
    name : str
        For the error.
    """
    times = np.linspace(start, end, max(5, int(np.ceil((end - start) / interval)) + 1))
    return spline(times, function(times), name)


def held(signal: Signal) -> Signal:
    """The same signal, constant before its first break and after its last."""
    first, last = signal.breaks[[0, -1]]
    far = 1e9 * (last - first)
    ends = np.zeros((4, 2, signal.coefficients.shape[2]))
    ends[0] = signal.at([first, last])
    return Signal(
        np.concatenate([[first - far], signal.breaks, [last + far]]),
        np.concatenate([ends[:, :1], signal.coefficients, ends[:, 1:]], axis=1),
        np.unique(np.concatenate([[first], signal.stops, [last]])),
    )


def circle(radius: float, rate: float, start: float, end: float) -> Signal:
    """A tow point on a circle about the origin, anticlockwise from (radius, 0, 0) at time 0.

    256 knots a turn: the spline is off by 1e-9 of the radius.
    """

    def place(t):
        return radius * np.stack([np.cos(rate * t), np.sin(rate * t), 0.0 * t], axis=-1)

    return sampled(place, start, end, 2.0 * np.pi / abs(rate) / 256.0, "tow point")


def _finite(values, name):
    if not np.all(np.isfinite(values)):
        raise InputError(f"{name}: it must be finite, and is not")
    return values


def _rising(times, name, least):
    times = _finite(np.atleast_1d(np.asarray(times, float)), f"{name}, times")
    if times.ndim != 1 or times.size < least:
        raise InputError(f"{name}: {times.size} times are not enough, {least} are needed")
    if np.any(np.diff(times) <= 0.0):
        i = int(np.argmax(np.diff(times) <= 0.0))
        raise InputError(f"{name}: times must rise, and {times[i + 1]:g} follows {times[i]:g}")
    return times


def _rows(values, count, name):
    values = _finite(np.asarray(values, float), name)
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2 or len(values) != count:
        raise InputError(f"{name}: {count} rows are needed, got an array of {values.shape}")
    return np.ascontiguousarray(values)
