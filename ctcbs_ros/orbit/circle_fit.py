"""Least-squares circle through positions, with the velocities tangent to it.

Residuals are geometric: each position's distance from the circle and each velocity's component
along the radius, in units of their standard deviations. Nothing is assumed of the speed along the
circle, so that a circle held over the ground in wind fits as well as one in still air. A circle
that drifts, as one flown at constant bank does with the air, has the velocity of its centre fitted
beside: positions and velocities are then those relative to it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ctcbs_ros.kernels.circle import refine_circle

# Huber's constant: 95 % efficiency for normal errors (Huber and Ronchetti, Robust Statistics).
HUBER = 1.345
# A velocity late by its receiver's filter is off by far more than its stated error, all around the
# circle: beyond this many deviations all velocities are believed less.
_LATE = 2.0


@dataclass(frozen=True)
class CircleFit:
    """A circle in the plane; n samples.

    Attributes
    ----------
    circle : (3,) ndarray
        Centre at the newest sample, and radius [m].
    drift : (2,) ndarray
        Velocity of the centre [m/s]; nought of a circle that stands still.
    points, velocities : (n, 2) ndarray
        Of the samples, relative to the drift: as if all were flown about `center`.
    radial : (n,) ndarray
        Signed distance of each position from the circle [m], positive outside.
    along : (n,) ndarray
        Component of each velocity along the radius [m/s]; nan where not known.
    weight : (2, n) ndarray
        Of `radial` and `along`: Huber's over the variance.
    inverse : (3, 3) or (5, 5) ndarray
        Of the normal matrix of centre, radius and, if it is fitted, drift.
    late : float
        What the deviations of the velocities were multiplied by, at least 1.
    """

    circle: np.ndarray
    drift: np.ndarray
    points: np.ndarray
    velocities: np.ndarray
    radial: np.ndarray
    along: np.ndarray
    weight: np.ndarray
    inverse: np.ndarray
    late: float

    @cached_property
    def center(self) -> tuple[float, float]:
        """At the newest sample [m]."""
        return float(self.circle[0]), float(self.circle[1])

    @cached_property
    def radius(self) -> float:
        """[m]"""
        return float(self.circle[2])

    @property
    def start(self) -> np.ndarray:
        """Centre, radius and drift, (5,), for `fit_circle`."""
        return np.concatenate((self.circle, self.drift))

    @property
    def drifts(self) -> bool:
        """Whether the drift was fitted."""
        return len(self.inverse) == 5


def algebraic_circle(points: np.ndarray) -> np.ndarray | None:
    """Taubin's algebraic fit, the start of the geometric one.

    Parameters
    ----------
    points : (n, 2) ndarray
        [m]

    Returns
    -------
    (3,) ndarray or None
        Centre and radius [m]; None where the points lie on a line.

    References
    ----------
    G. Taubin, Estimation of planar curves, IEEE PAMI 13 (1991); in the form of N. Chernov,
    Circular and Linear Regression (2010), section 5.
    """
    mean = points.mean(axis=0)
    x, y = (points - mean).T
    z = x * x + y * y
    z_mean = z.mean()
    if z_mean == 0.0:
        return None
    z0 = (z - z_mean) / (2.0 * np.sqrt(z_mean))
    _, _, v = np.linalg.svd(np.column_stack([z0, x, y]), full_matrices=False)
    a0, b, c = v[2]
    a = a0 / (2.0 * np.sqrt(z_mean))
    if abs(a) < 1e-12:
        return None
    center = -np.array([b, c]) / (2.0 * a)
    radius = np.sqrt(center @ center + z_mean)
    return np.array([*(center + mean), radius])


def drifting_start(
    points: np.ndarray, velocities: np.ndarray, age: np.ndarray
) -> np.ndarray | None:
    """Centre, radius and drift of a circle flown at constant rate, by linear least squares.

    With v = d + Omega J (x - c - d t), the velocities are linear in x, t and the constants
    Omega, Omega J d and d - Omega J c.

    Parameters
    ----------
    points, velocities : (n, 2) ndarray
        [m], [m/s]; nan where not known.
    age : (n,) ndarray
        [s], zero at the newest sample.

    Returns
    -------
    (5,) ndarray or None
        None where fewer than six velocities are known, or nothing turns.
    """
    known = np.isfinite(velocities[:, 0])
    if known.sum() < 6:
        return None
    x, v, t = points[known], velocities[known], age[known]
    middle, span = x.mean(axis=0), max(np.ptp(t), 1e-9)
    x = x - middle
    size = max(float(np.sqrt(np.mean(x * x))), 1e-9)
    n = len(x)
    design = np.zeros((2 * n, 5))
    design[:n, 0], design[n:, 0] = -x[:, 1] / size, x[:, 0] / size
    design[:n, 1] = design[n:, 2] = t / span
    design[:n, 3] = design[n:, 4] = 1.0
    found, *_ = np.linalg.lstsq(design, v.T.ravel(), rcond=None)
    rate = found[0] / size
    if rate == 0.0:
        return None
    # J (x, y) = (-y, x): from -Omega J d and d - Omega J c.
    east, north = -found[2] / span / rate, found[1] / span / rate
    center = np.array([(found[4] - north) / -rate, (found[3] - east) / rate])
    offset = x - center - np.outer(t, (east, north))
    radius = float(np.median(np.hypot(*offset.T)))
    start = np.array([*(center + middle), radius, east, north])
    return start if np.isfinite(start).all() else None


def fit_circle(
    points: np.ndarray,
    velocities: np.ndarray,
    position_sigma: np.ndarray,
    velocity_sigma: np.ndarray,
    start: np.ndarray | None = None,
    age: np.ndarray | None = None,
) -> CircleFit | None:
    """Robust geometric fit by Gauss-Newton with Huber's weights.

    Parameters
    ----------
    points : (n, 2) ndarray
        [m]
    velocities : (n, 2) ndarray
        [m/s]; nan where not known.
    position_sigma, velocity_sigma : (n,) ndarray
        Standard deviations of one axis [m], [m/s].
    start : (5,) ndarray, optional
        Centre, radius and drift; by default the algebraic fit of a circle that stands still, or
        `drifting_start`. The drift is not used of a circle that stands still.
    age : (n,) ndarray, optional
        Time less that of the newest sample [s]: the drift is fitted, too.

    Returns
    -------
    CircleFit or None
        None where the fit does not converge.
    """
    points, velocities = np.ascontiguousarray(points), np.ascontiguousarray(velocities)
    n = len(points)
    size = 3 if age is None else 5
    age = np.zeros(n) if age is None else np.ascontiguousarray(age)
    if start is not None:
        circle = start[:size].copy()
    elif size == 5:
        circle = drifting_start(points, velocities, age)
    else:
        circle = algebraic_circle(points)
    if circle is None:
        return None
    radial, along, weight = np.empty(n), np.empty(n), np.empty((2, n))
    inverse = np.empty((size, size))
    late, converged = refine_circle(
        points, velocities, age, np.ascontiguousarray(position_sigma),
        np.ascontiguousarray(velocity_sigma), HUBER, _LATE, circle, radial, along, weight, inverse,
    )
    if not converged:
        return None
    drift = np.zeros(2)
    if size == 5:
        drift = circle[3:]
        points, velocities = points - np.outer(age, drift), velocities - drift
    return CircleFit(
        circle[:3], drift, points, velocities, radial, along, weight, inverse, late
    )
