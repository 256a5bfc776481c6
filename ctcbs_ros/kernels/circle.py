"""A circle through noisy positions with velocities along it, by robust least squares."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import invert_normal

_ITERATIONS = 30


@kernel
def refine_circle(
    points, velocities, age, position_sigma, velocity_sigma, huber, most_late, circle, radial,
    along, weight, inverse,
):
    """Robust geometric fit by Gauss-Newton with Huber's weights.

    Along the circle each position is free. Eliminated, it leaves the velocity's component along
    the radius, whose error is the velocity's own and what the position's error turns the radius.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
        Velocities are nan where not known.
    age : (n,) array
        Time of each sample less that of the newest [s]; not used of a circle that stands still.
    position_sigma, velocity_sigma : (n,) arrays
        Standard deviations of one axis.
    huber, most_late : float
        Huber's constant; and how many deviations the median velocity may point off the circle's
        tangent before all velocities are believed less.
    circle : (3,) or (5,) array
        East and north of the centre, and radius; of one that drifts also its centre's velocity,
        and its centre is that at the newest sample: the start, overwritten by the fit.
    radial : (n,) array, written
        Signed distance of each position from the circle.
    along : (n,) array, written
        Component of each velocity along the radius; nan where not known.
    weight : (2, n) array, written
        Weights of `radial` and `along`: Huber's over the variance.
    inverse : (3, 3) or (5, 5) array, written
        Inverse of the normal matrix.

    Returns
    -------
    late : float
        What the deviations of `along` were multiplied by, at least 1.
    converged : bool
        Whether the last step was below 3e-4 radii.
    """
    k = circle.shape[0]
    normal = np.empty((k, k))
    right = np.empty(k)
    row = np.empty(k)
    drift_east, drift_north = 0.0, 0.0
    late = 1.0
    near = False
    for iteration in range(_ITERATIONS):
        if k == 5:
            drift_east, drift_north = circle[3], circle[4]
        if iteration == 0 or iteration == 2:
            late = _lateness(
                points, velocities, age, position_sigma, velocity_sigma, most_late, circle
            )
        normal[:] = 0.0
        right[:] = 0.0
        for i in range(points.shape[0]):
            dx = points[i, 0] - circle[0] - drift_east * age[i]
            dy = points[i, 1] - circle[1] - drift_north * age[i]
            distance = np.sqrt(dx * dx + dy * dy)
            if distance < 1e-6:
                return late, False
            ux, uy = dx / distance, dy / distance
            row[0], row[1], row[2] = -ux, -uy, -1.0
            if k == 5:
                row[3], row[4] = -ux * age[i], -uy * age[i]
            sigma = position_sigma[i]
            # Noise along the circle moves a point outwards, by this much on average.
            radial[i] = distance - 0.5 * sigma * min(sigma / distance, 1.0) - circle[2]
            weight[0, i] = _add(normal, right, row, radial[i], sigma, huber)
            along[i], weight[1, i] = np.nan, 0.0
            if np.isfinite(velocities[i, 0]):
                vx, vy = velocities[i, 0] - drift_east, velocities[i, 1] - drift_north
                out = vx * ux + vy * uy
                # d(v.unit)/d center = -(v - (v.unit) unit) / distance
                row[0], row[1] = -(vx - out * ux) / distance, -(vy - out * uy) / distance
                row[2] = 0.0
                if k == 5:
                    row[3], row[4] = row[0] * age[i] - ux, row[1] * age[i] - uy
                turned = (vy * ux - vx * uy) * sigma / distance
                sigma = late * np.sqrt(velocity_sigma[i] ** 2 + turned**2)
                along[i], weight[1, i] = out, _add(normal, right, row, out, sigma, huber)
        for j in range(k):
            for i in range(j):
                normal[i, j] = normal[j, i]
        if not invert_normal(normal, inverse):
            return late, False
        step = inverse @ right
        circle += step
        if not (circle[2] > 0.0 and np.isfinite(circle[0]) and np.isfinite(circle[1])):
            return late, False
        size = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        if k == 5:
            size += np.hypot(step[3], step[4]) * abs(age[0])
        if iteration == 0:
            # As from the fit to the samples before: `late` will not change any more.
            near = size < 1e-3 * circle[2]
        if size < 3e-4 * circle[2] and (iteration > 2 or (near and iteration > 0)):
            return late, True
    return late, False


@kernel
def _add(normal, right, row, residual, sigma, huber):
    """Add one residual to the normal equations; its weight is returned."""
    weight = min(1.0, huber / max(abs(residual / sigma), 1e-12)) / (sigma * sigma)
    for j in range(row.shape[0]):
        weighted = weight * row[j]
        right[j] -= weighted * residual
        for k in range(j + 1):
            normal[j, k] += weighted * row[k]
    return weight


@kernel
def _lateness(points, velocities, age, position_sigma, velocity_sigma, most_late, circle):
    """By how much the velocities' deviations are taken larger than stated; 1 if they are not."""
    off = np.empty(points.shape[0])
    count = 0
    drift_east, drift_north = 0.0, 0.0
    if circle.shape[0] == 5:
        drift_east, drift_north = circle[3], circle[4]
    for i in range(points.shape[0]):
        if np.isfinite(velocities[i, 0]):
            dx = points[i, 0] - circle[0] - drift_east * age[i]
            dy = points[i, 1] - circle[1] - drift_north * age[i]
            distance = max(np.hypot(dx, dy), 1e-6)
            vx, vy = velocities[i, 0] - drift_east, velocities[i, 1] - drift_north
            out = (vx * dx + vy * dy) / distance
            speed = np.hypot(vx, vy)
            turned = speed * position_sigma[i] / distance
            off[count] = abs(out) / np.hypot(velocity_sigma[i], turned)
            count += 1
    return max(1.0, np.median(off[:count]) / most_late) if count > 0 else 1.0


@kernel
def scatter(values):
    """Standard deviation of white noise on a smooth course of values, from second differences.

    Their median, so that outliers and jumps do not count. 0 for fewer than 10 finite values.
    """
    n = values.shape[0]
    second = np.empty(n)
    count = 0
    for i in range(1, n - 1):
        bend = abs(values[i - 1] - 2.0 * values[i] + values[i + 1])
        if np.isfinite(bend):
            second[count] = bend
            count += 1
    return 1.4826 * np.median(second[:count]) / np.sqrt(6.0) if count >= 8 else 0.0
