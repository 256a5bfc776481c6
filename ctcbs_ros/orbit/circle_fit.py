"""Least-squares circle through positions, with the velocities tangent to it.

Residuals are geometric: each position's distance from the circle and each velocity's component
along the radius, in units of their standard deviations. Nothing is assumed of the speed along the
circle, so that a circle held over the ground in wind fits as well as one in still air.
"""

from dataclasses import dataclass

import numpy as np

# Huber's constant: 95 % efficiency for normal errors (Huber and Ronchetti, Robust Statistics).
HUBER = 1.345
_ITERATIONS = 30
# A velocity late by its receiver's filter is off by far more than its stated error, all around the
# circle: beyond this many deviations all velocities are believed less.
_LATE = 2.0


@dataclass(frozen=True)
class CircleFit:
    """A circle in the plane.

    Attributes
    ----------
    center : (2,) ndarray
        [m]
    radius : float
        [m]
    radial : (n,) ndarray
        Signed distance of each position from the circle [m], positive outside.
    covariance : (3, 3) ndarray
        Of (center, radius), inflated where the residuals exceed the stated errors.
    inflation : float
        Variance of the residuals over the stated one, at least 1.
    """

    center: np.ndarray
    radius: float
    radial: np.ndarray
    covariance: np.ndarray
    inflation: float


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
    center, radius = np.array(start[0], float), float(start[1])
    moving = np.isfinite(velocities[:, 0])
    v = velocities[moving]
    n = len(points)
    jacobian = np.zeros((n + len(v), 3))
    converged, first = False, True
    for _ in range(_ITERATIONS):
        offset = points - center
        distance = np.hypot(offset[:, 0], offset[:, 1])
        if np.any(distance < 1e-6):
            return None
        unit = offset / distance[:, None]
        radial = distance - radius
        along = np.sum(v * unit[moving], axis=1)
        if first:
            first = False
            late = np.median(np.abs(along) / velocity_sigma[moving]) / _LATE if len(v) else 0.0
            sigma = np.concatenate([position_sigma, velocity_sigma[moving] * max(1.0, late)])
        residual = np.concatenate([radial, along]) / sigma
        jacobian[:n, :2] = -unit
        jacobian[:n, 2] = -1.0
        # d(v.unit)/d center = -(v - (v.unit) unit)/distance
        jacobian[n:, :2] = -(v - along[:, None] * unit[moving]) / distance[moving][:, None]
        weight = np.minimum(1.0, HUBER / np.maximum(np.abs(residual), 1e-12))
        scaled = jacobian * (np.sqrt(weight) / sigma)[:, None]
        normal = scaled.T @ scaled
        try:
            step = np.linalg.solve(normal, -scaled.T @ (np.sqrt(weight) * residual))
        except np.linalg.LinAlgError:
            return None
        center, radius = center + step[:2], radius + step[2]
        if not radius > 0.0 or not np.all(np.isfinite(center)):
            return None
        if np.linalg.norm(step) < 3e-4 * radius:
            converged = True
            break
    if not converged:
        return None
    radial = np.hypot(*(points - center).T) - radius
    used = np.sum(weight * residual**2) / max(weight.sum() - 3.0, 1.0)
    inflation = max(1.0, float(used))
    return CircleFit(center, radius, radial, np.linalg.inv(normal) * inflation, inflation)
