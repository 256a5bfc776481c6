"""Least-squares circle through positions, with the velocities tangent to it.

Residuals are geometric: each position's distance from the circle and each velocity's component
along the radius, in units of their standard deviations. Nothing is assumed of the speed along the
circle, so that a circle held over the ground in wind fits as well as one in still air.
"""

from dataclasses import dataclass

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
    center : (2,) ndarray
        [m]
    radius : float
        [m]
    radial : (n,) ndarray
        Signed distance of each position from the circle [m], positive outside.
    along : (n,) ndarray
        Component of each velocity along the radius [m/s]; nan where not known.
    weight : (2, n) ndarray
        Of `radial` and `along`: Huber's over the variance.
    inverse : (3, 3) ndarray
        Of the normal matrix.
    late : float
        What the deviations of the velocities were multiplied by, at least 1.
    """

    center: np.ndarray
    radius: float
    radial: np.ndarray
    along: np.ndarray
    weight: np.ndarray
    inverse: np.ndarray
    late: float

    @property
    def circle(self) -> np.ndarray:
        """Centre and radius, (3,) [m]."""
        return np.array([*self.center, self.radius])


def algebraic_circle(points: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Taubin's algebraic fit, the start of the geometric one.

    Parameters
    ----------
    points : (n, 2) ndarray
        [m]

    Returns
    -------
    center : (2,) ndarray
    radius : float
        Or None where the points lie on a line.

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
    return center + mean, float(radius)


def fit_circle(
    points: np.ndarray,
    velocities: np.ndarray,
    position_sigma: np.ndarray,
    velocity_sigma: np.ndarray,
    start: tuple[np.ndarray, float] | None = None,
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
    start : tuple of center (2,) and radius, optional
        By default the algebraic fit.

    Returns
    -------
    CircleFit or None
        None where the fit does not converge.
    """
    if start is None:
        start = algebraic_circle(points)
        if start is None:
            return None
    points = np.ascontiguousarray(points)
    circle = np.array([*start[0], start[1]], float)
    n = len(points)
    radial, along, weight, inverse = np.empty(n), np.empty(n), np.empty((2, n)), np.empty((3, 3))
    late, converged = refine_circle(
        points, np.ascontiguousarray(velocities), np.ascontiguousarray(position_sigma),
        np.ascontiguousarray(velocity_sigma), HUBER, _LATE, circle, radial, along, weight, inverse,
    )
    if not converged:
        return None
    return CircleFit(circle[:2], float(circle[2]), radial, along, weight, inverse, late)
