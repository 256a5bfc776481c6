"""A circle through noisy positions with velocities along it, and how well a track lies on it."""

import numpy as np
from numba import njit

from ctcbs_ros.kernels.regression import invert_normal, least_squares, line

_ITERATIONS = 30
_TURN = 2.0 * np.pi


@njit(cache=True)
def refine_circle(
    points, velocities, position_sigma, velocity_sigma, huber, most_late, circle, radial, inverse
):
    """Robust geometric fit by Gauss-Newton with Huber's weights.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
        Velocities are nan where not known.
    position_sigma, velocity_sigma : (n,) arrays
        Standard deviations of one axis.
    huber, most_late : float
        Huber's constant; and how many deviations the median velocity may point off the circle's
        tangent before all velocities are believed less.
    circle : (3,) array
        East and north of the centre, and radius: the start, overwritten by the fit.
    radial : (n,) array, written
        Signed distance of each position from the circle.
    inverse : (3, 3) array, written
        Inverse of the normal matrix: the covariance of `circle` where the deviations hold.

    Returns
    -------
    inflation : float
        Variance of the residuals over the stated one.
    converged : bool
        Whether the last step was below 3e-4 radii.
    """
    normal = np.empty((3, 3))
    right = np.empty(3)
    row = np.empty(3)
    late = _lateness(points, velocities, velocity_sigma, most_late, circle)
    for _ in range(_ITERATIONS):
        normal[:] = 0.0
        right[:] = 0.0
        squares, total = 0.0, 0.0
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
            distance = np.hypot(dx, dy)
            if distance < 1e-6:
                return 0.0, False
            ux, uy = dx / distance, dy / distance
            row[0], row[1], row[2] = -ux, -uy, -1.0
            weight, square = _add(
                normal, right, row, distance - circle[2], position_sigma[i], huber
            )
            total += weight
            squares += square
            if np.isfinite(velocities[i, 0]):
                vx, vy = velocities[i, 0], velocities[i, 1]
                along = vx * ux + vy * uy
                # d(v.unit)/d center = -(v - (v.unit) unit) / distance
                row[0], row[1] = -(vx - along * ux) / distance, -(vy - along * uy) / distance
                row[2] = 0.0
                weight, square = _add(normal, right, row, along, velocity_sigma[i] * late, huber)
                total += weight
                squares += square
        if not invert_normal(normal, inverse):
            return 0.0, False
        step = inverse @ right
        circle += step
        if not (circle[2] > 0.0 and np.isfinite(circle[0]) and np.isfinite(circle[1])):
            return 0.0, False
        if np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2) < 3e-4 * circle[2]:
            for i in range(points.shape[0]):
                distance = np.hypot(points[i, 0] - circle[0], points[i, 1] - circle[1])
                radial[i] = distance - circle[2]
            return squares / max(total - 3.0, 1.0), True
    return 0.0, False


@njit(cache=True)
def _add(normal, right, row, residual, sigma, huber):
    """Add one residual to the normal equations; its weight and weighted square are returned."""
    scaled = residual / sigma
    weight = min(1.0, huber / max(abs(scaled), 1e-12))
    for j in range(3):
        right[j] -= weight * row[j] / sigma * scaled
        for k in range(3):
            normal[j, k] += weight * row[j] * row[k] / (sigma * sigma)
    return weight, weight * scaled * scaled


@njit(cache=True)
def _lateness(points, velocities, velocity_sigma, most_late, circle):
    """By how much the velocities' deviations are taken larger than stated; 1 if they are not."""
    off = np.empty(points.shape[0])
    count = 0
    for i in range(points.shape[0]):
        if np.isfinite(velocities[i, 0]):
            dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
            along = (velocities[i, 0] * dx + velocities[i, 1] * dy) / np.hypot(dx, dy)
            off[count] = abs(along) / velocity_sigma[i]
            count += 1
    return max(1.0, np.median(off[:count]) / most_late) if count > 0 else 1.0


@njit(cache=True)
def continuous_angles(points, center_east, center_north, time, rate, angle):
    """Angle about the centre, carried across gaps at the last known rate [rad/s], 0 if none.

    points : (n, 2); time : (n,); angle : (n,), written
    """
    before = 0.0
    for i in range(points.shape[0]):
        raw = np.arctan2(points[i, 1] - center_north, points[i, 0] - center_east)
        if i == 0:
            angle[0] = raw
        else:
            expected = (time[i] - time[i - 1]) * rate
            angle[i] = (
                angle[i - 1] + (raw - before - expected + np.pi) % _TURN - np.pi + expected
            )
        before = raw


@njit(cache=True)
def newest_offset(radial, angle, reach):
    """Median distance from the circle over the newest part of the track, and its samples.

    radial, angle : (n,); reach : angle [rad] that counts as newest, at least three samples
    """
    n = radial.shape[0]
    part = np.empty(n)
    count = 0
    for i in range(n):
        if abs(angle[i] - angle[n - 1]) < reach or i >= n - 3:
            part[count] = radial[i]
            count += 1
    return np.median(part[:count]), count


@njit(cache=True)
def trend(radial, angle):
    """Change of the distance from the circle [m] in a turn."""
    return line(np.abs(angle - angle[0]), radial, np.ones(angle.shape[0]))[1] * _TURN


@njit(cache=True)
def progress(radial, angle, time, sense, arc, believed, quiet):
    """How steadily the track goes round.

    Parameters
    ----------
    radial, angle, time : (n,) arrays
    sense : int
    arc : float
        Angle covered [rad].
    believed : float
        Distance from the circle beyond which a sample does not count [m].
    quiet : float
        Angle that noise alone may make [rad].

    Returns
    -------
    back : float
        Part of the steps that go back.
    newest : float
        Angle gained over the newest five steps [rad].
    broken : bool
        Whether a step is longer than strong wind explains.
    """
    n = radial.shape[0]
    step, duration = np.empty(n), np.empty(n)
    count, before, total = 0, -1, 0.0
    for i in range(n):
        if abs(radial[i]) < believed:
            if before >= 0:
                step[count] = (angle[i] - angle[before]) * sense
                duration[count] = time[i] - time[before]
                total += duration[count]
                count += 1
            before = i
    if count == 0:
        return 0.0, 0.0, False
    back, newest, broken = 0, 0.0, False
    for i in range(count):
        back += step[i] < -quiet
        # In strong wind the rate along a circle held over the ground is up to twice its mean.
        broken |= step[i] > 2.0 * arc / total * duration[i] + quiet + 0.3
        if i >= count - 5:
            newest += step[i]
    return back / count, newest, broken


@njit(cache=True)
def mean_rate(time, angle, sigma, with_harmonic):
    """Mean angular rate and its variance, of the angle against time.

    Parameters
    ----------
    time, angle, sigma : (n,) arrays
        [s], [rad], and standard deviation of the angle [rad].
    with_harmonic : bool
        Whether a variation once a turn is fitted beside the mean.

    Returns
    -------
    rate : float
    variance : float
        From the scatter of the residuals where that is more than sigma.
    """
    n = time.shape[0]
    k = 4 if with_harmonic else 2
    span = time[n - 1] - time[0]
    design = np.empty((n, k))
    weight = np.empty(n)
    shifted = angle - angle[n - 1]
    for i in range(n):
        design[i, 0] = 1.0
        design[i, 1] = (time[i] - time[n - 1]) / span
        if with_harmonic:
            design[i, 2] = np.cos(angle[i])
            design[i, 3] = np.sin(angle[i])
        weight[i] = 1.0 / sigma[i] ** 2
    solution = np.empty(k)
    inverse = np.empty((k, k))
    squares, determined = least_squares(design, shifted, weight, solution, inverse)
    if not determined:
        return np.nan, np.inf
    variance = inverse[1, 1] * max(1.0, squares / max(n - k, 1))
    return solution[1] / span, variance / span**2


@njit(cache=True)
def velocity_circle(rows, turn):
    """Centre of the circle of ground velocities, the wind, beside a trend of the airspeed.

    Parameters
    ----------
    rows : (n, 3) array
        Time [s], velocity east and north [m/s].
    turn : float
        Duration of a turn [s].

    Returns
    -------
    east, north : float
        [m/s]
    error : float
        Standard deviation of the two together [m/s].
    determined : bool
        Whether the velocities are different enough.
    """
    n = rows.shape[0]
    design = np.empty((n, 4))
    squared = np.empty(n)
    speed = np.sqrt(np.mean(rows[:, 1] ** 2 + rows[:, 2] ** 2))
    if not 0.0 < speed < np.inf:
        return 0.0, 0.0, np.inf, False
    middle = np.mean(rows[:, 0])
    for i in range(n):
        # |v|^2 = 2 w.v + A^2 - |w|^2, in units of the speed
        east, north = rows[i, 1] / speed, rows[i, 2] / speed
        design[i, 0], design[i, 1] = 2.0 * east, 2.0 * north
        design[i, 2], design[i, 3] = 1.0, (rows[i, 0] - middle) / turn
        squared[i] = east**2 + north**2
    solution = np.empty(4)
    inverse = np.empty((4, 4))
    squares, determined = least_squares(design, squared, np.ones(n), solution, inverse)
    if not determined:
        return 0.0, 0.0, np.inf, False
    error = np.sqrt((inverse[0, 0] + inverse[1, 1]) * squares / (n - 4)) * speed
    return solution[0] * speed, solution[1] * speed, error, True
