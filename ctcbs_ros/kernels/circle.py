"""A circle through noisy positions with velocities along it, and how well a track lies on it."""

import numpy as np
from numba import njit

from ctcbs_ros.kernels.regression import invert_normal, least_squares

_ITERATIONS = 30
_TURN = 2.0 * np.pi


@njit(cache=True)
def refine_circle(
    points, velocities, position_sigma, velocity_sigma, huber, most_late, circle, radial, along,
    weight, inverse,
):
    """Robust geometric fit by Gauss-Newton with Huber's weights.

    Along the circle each position is free. Eliminated, it leaves the velocity's component along
    the radius, whose error is the velocity's own and what the position's error turns the radius.

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
    along : (n,) array, written
        Component of each velocity along the radius; nan where not known.
    weight : (2, n) array, written
        Weights of `radial` and `along`: Huber's over the variance.
    inverse : (3, 3) array, written
        Inverse of the normal matrix.

    Returns
    -------
    late : float
        What the deviations of `along` were multiplied by, at least 1.
    converged : bool
        Whether the last step was below 3e-4 radii.
    """
    normal = np.empty((3, 3))
    right = np.empty(3)
    row = np.empty(3)
    late = _lateness(points, velocities, position_sigma, velocity_sigma, most_late, circle)
    for iteration in range(_ITERATIONS):
        if iteration == 2:
            late = _lateness(
                points, velocities, position_sigma, velocity_sigma, most_late, circle
            )
        normal[:] = 0.0
        right[:] = 0.0
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
            distance = np.hypot(dx, dy)
            if distance < 1e-6:
                return late, False
            ux, uy = dx / distance, dy / distance
            row[0], row[1], row[2] = -ux, -uy, -1.0
            sigma = position_sigma[i]
            # Noise along the circle moves a point outwards, by this much on average.
            radial[i] = distance - 0.5 * sigma * min(sigma / distance, 1.0) - circle[2]
            weight[0, i] = _add(normal, right, row, radial[i], sigma, huber)
            along[i], weight[1, i] = np.nan, 0.0
            if np.isfinite(velocities[i, 0]):
                vx, vy = velocities[i, 0], velocities[i, 1]
                out = vx * ux + vy * uy
                # d(v.unit)/d center = -(v - (v.unit) unit) / distance
                row[0], row[1] = -(vx - out * ux) / distance, -(vy - out * uy) / distance
                row[2] = 0.0
                turned = (vy * ux - vx * uy) * sigma / distance
                sigma = late * np.hypot(velocity_sigma[i], turned)
                along[i], weight[1, i] = out, _add(normal, right, row, out, sigma, huber)
        if not invert_normal(normal, inverse):
            return late, False
        step = inverse @ right
        circle += step
        if not (circle[2] > 0.0 and np.isfinite(circle[0]) and np.isfinite(circle[1])):
            return late, False
        size = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        if iteration > 2 and size < 3e-4 * circle[2]:
            return late, True
    return late, False


@njit(cache=True)
def _add(normal, right, row, residual, sigma, huber):
    """Add one residual to the normal equations; its weight is returned."""
    weight = min(1.0, huber / max(abs(residual / sigma), 1e-12)) / (sigma * sigma)
    for j in range(3):
        right[j] -= weight * row[j] * residual
        for k in range(3):
            normal[j, k] += weight * row[j] * row[k]
    return weight


@njit(cache=True)
def _lateness(points, velocities, position_sigma, velocity_sigma, most_late, circle):
    """By how much the velocities' deviations are taken larger than stated; 1 if they are not."""
    off = np.empty(points.shape[0])
    count = 0
    for i in range(points.shape[0]):
        if np.isfinite(velocities[i, 0]):
            dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
            distance = max(np.hypot(dx, dy), 1e-6)
            out = (velocities[i, 0] * dx + velocities[i, 1] * dy) / distance
            speed = np.hypot(velocities[i, 0], velocities[i, 1])
            turned = speed * position_sigma[i] / distance
            off[count] = abs(out) / np.hypot(velocity_sigma[i], turned)
            count += 1
    return max(1.0, np.median(off[:count]) / most_late) if count > 0 else 1.0


@njit(cache=True)
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


@njit(cache=True)
def propagate(
    points, velocities, time, circle, weight, inverse, operators, position_variance,
    velocity_variance, correlated_variance, correlation_time, covariance,
):
    """Covariance of the circle and of linear functions of the angles about its centre.

    The fit is linearised: each sample's error moves the result by its gain. White errors add
    their squares; an exponentially correlated error of the position is summed over all pairs of
    samples, by its recursion, and so counts as the independent samples it is worth.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
    time : (n,) array
        Rising [s].
    circle, weight, inverse
        As `refine_circle` left them.
    operators : (k, n) array
        Takes the angles to k results.
    position_variance, velocity_variance : (n,) arrays
        Of the white error of one axis.
    correlated_variance, correlation_time : (m,) arrays
        Of m first-order Gauss-Markov errors of the position of one axis.
    covariance : (3 + k, 3 + k) array, written
    """
    n, k = points.shape[0], 3 + operators.shape[0]
    gain = np.zeros((n, k, 2))
    by_velocity = np.zeros((n, k))
    tangents = np.zeros((k - 3, 2))
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        swept = 0.0
        if weight[1, i] > 0.0:
            swept = (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
        for j in range(3):
            radial = (inverse[j, 0] * ux + inverse[j, 1] * uy + inverse[j, 2]) * weight[0, i]
            turn = (inverse[j, 1] * ux - inverse[j, 0] * uy) * swept * weight[1, i]
            gain[i, j, 0] = radial * ux - turn * swept * uy
            gain[i, j, 1] = radial * uy + turn * swept * ux
            by_velocity[i, j] = turn
        for j in range(k - 3):
            share = operators[j, i] / distance
            gain[i, 3 + j, 0], gain[i, 3 + j, 1] = -share * uy, share * ux
            tangents[j, 0] -= share * uy
            tangents[j, 1] += share * ux
    for i in range(n):
        # Angles about a centre that is off by e change by -(tangent . e) / distance.
        for j in range(k - 3):
            te, tn = tangents[j, 0], tangents[j, 1]
            for axis in range(2):
                gain[i, 3 + j, axis] -= te * gain[i, 0, axis] + tn * gain[i, 1, axis]
            by_velocity[i, 3 + j] = -te * by_velocity[i, 0] - tn * by_velocity[i, 1]
    covariance[:] = 0.0
    for i in range(n):
        for j in range(k):
            for m in range(j + 1):
                covariance[j, m] += velocity_variance[i] * by_velocity[i, j] * by_velocity[i, m]
                covariance[j, m] += position_variance[i] * (
                    gain[i, j, 0] * gain[i, m, 0] + gain[i, j, 1] * gain[i, m, 1]
                )
    for c in range(correlated_variance.shape[0]):
        before = np.zeros((k, 2))
        for i in range(n):
            if i > 0:
                before *= np.exp(-(time[i] - time[i - 1]) / correlation_time[c])
            for j in range(k):
                for m in range(j + 1):
                    total = 0.0
                    for axis in range(2):
                        a, b = gain[i, j, axis], gain[i, m, axis]
                        total += a * b + a * before[m, axis] + before[j, axis] * b
                    covariance[j, m] += correlated_variance[c] * total
            before += gain[i]
    for j in range(k):
        for m in range(j):
            covariance[m, j] = covariance[j, m]


@njit(cache=True)
def widening(points, velocities, circle, angle, radial, along, weight):
    """Change of the radius in a turn and its variance, the circle fitted anew beside it.

    Positions and velocities together, since over half a turn positions cannot tell a spiral from
    another circle. A constant angle between velocity and tangent is left free: a velocity that is
    late looks like a spiral to itself.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
    circle, radial, along, weight
        As `refine_circle` left them.
    angle : (n,) array
        Continuous, about the centre [rad].

    Returns
    -------
    change : float
        [m/turn]
    variance : float
        Infinite where the samples do not tell.
    square : float
        Weighted mean square of what is left beside this change.
    """
    n = points.shape[0]
    count = n
    for i in range(n):
        count += weight[1, i] > 0.0
    late = 1 if count > n + 4 else 0
    design = np.zeros((count, 4 + late))
    off, trust = np.empty(count), np.empty(count)
    sense = 1.0 if angle[n - 1] > angle[0] else -1.0
    j = n
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        design[i, 0], design[i, 1], design[i, 2] = ux, uy, 1.0
        design[i, 3] = sense * (angle[i] - angle[n - 1]) / _TURN
        off[i], trust[i] = radial[i], weight[0, i]
        if weight[1, i] > 0.0:
            swept = (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
            design[j, 0], design[j, 1] = -swept * uy, swept * ux
            design[j, 3] = sense * swept / _TURN
            if late:
                design[j, 4] = swept * circle[2]
            off[j], trust[j] = along[i], weight[1, i]
            j += 1
    k = design.shape[1]
    solution, inverse = np.empty(k), np.empty((k, k))
    squares, determined = least_squares(design, off, trust, solution, inverse)
    if not determined:
        return 0.0, np.inf, np.inf
    square = squares / (count - k)
    return solution[3], inverse[3, 3] * max(1.0, square), square


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
def mean_rate(time, angle, sigma, with_harmonic, operator):
    """Mean angular rate and its variance, of the angle against time.

    Parameters
    ----------
    time, angle, sigma : (n,) arrays
        [s], [rad], and standard deviation of the angle [rad].
    with_harmonic : bool
        Whether a variation once a turn is fitted beside the mean.
    operator : (n,) array, written
        Takes the angles to the rate.

    Returns
    -------
    rate : float
        nan where the times do not tell.
    excess : float
        Variance of the residuals over the stated one, at least 1.
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
        return np.nan, 1.0
    for i in range(n):
        total = 0.0
        for j in range(k):
            total += inverse[1, j] * design[i, j]
        operator[i] = total * weight[i] / span
    return solution[1] / span, max(1.0, squares / max(n - k, 1))
