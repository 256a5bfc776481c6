"""A circle through noisy positions with velocities along it, and how well a track lies on it."""

import numpy as np
from numba import njit

from ctcbs_ros.kernels.regression import invert_normal, least_squares

_ITERATIONS = 30
_TURN = 2.0 * np.pi


@njit(cache=True)
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
            distance = np.hypot(dx, dy)
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
                sigma = late * np.hypot(velocity_sigma[i], turned)
                along[i], weight[1, i] = out, _add(normal, right, row, out, sigma, huber)
        if not invert_normal(normal, inverse):
            return late, False
        step = inverse @ right
        circle += step
        if not (circle[2] > 0.0 and np.isfinite(circle[0]) and np.isfinite(circle[1])):
            return late, False
        size = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        if k == 5:
            size += np.hypot(step[3], step[4]) * abs(age[0])
        if iteration > 2 and size < 3e-4 * circle[2]:
            return late, True
    return late, False


@njit(cache=True)
def _add(normal, right, row, residual, sigma, huber):
    """Add one residual to the normal equations; its weight is returned."""
    weight = min(1.0, huber / max(abs(residual / sigma), 1e-12)) / (sigma * sigma)
    for j in range(row.shape[0]):
        right[j] -= weight * row[j] * residual
        for k in range(row.shape[0]):
            normal[j, k] += weight * row[j] * row[k]
    return weight


@njit(cache=True)
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
    points, velocities, age, circle, weight, inverse, operators, position_variance,
    velocity_variance, correlated_sigma, correlation_time, covariance,
):
    """Covariance of the circle and of linear functions of the angles about its centre.

    The fit is linearised: each sample's error moves the result by its gain. White errors add
    their squares; an exponentially correlated error of the position is summed over all pairs of
    samples, by its recursion, and so counts as the independent samples it is worth.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
        Relative to the drift of the circle, if it has one.
    age : (n,) array
        Rising [s], zero at the newest sample.
    circle : (3,) array
        Centre and radius.
    weight, inverse
        As `refine_circle` left them; p is the size of `inverse`.
    operators : (k, n) array
        Takes the angles to k results.
    position_variance, velocity_variance : (n,) arrays
        Of the white error of one axis.
    correlated_sigma : (m, n) array
        Standard deviations of m first-order Gauss-Markov errors of the position of one axis.
    correlation_time : (m,) array
        [s]
    covariance : (p + k, p + k) array, written
    """
    n, p = points.shape[0], inverse.shape[0]
    k = p + operators.shape[0]
    gain = np.zeros((n, k, 2))
    by_velocity = np.zeros((n, k))
    # What the angles lose by a shift of the centre, and by a drift.
    tangents = np.zeros((k - p, 4))
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        swept = 0.0
        if weight[1, i] > 0.0:
            swept = (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
        for j in range(p):
            radial = inverse[j, 0] * ux + inverse[j, 1] * uy + inverse[j, 2]
            turn = (inverse[j, 1] * ux - inverse[j, 0] * uy) * swept
            if p == 5:
                out = inverse[j, 3] * ux + inverse[j, 4] * uy
                radial += age[i] * out
                turn += out + age[i] * (inverse[j, 4] * ux - inverse[j, 3] * uy) * swept
            radial *= weight[0, i]
            turn *= weight[1, i]
            gain[i, j, 0] = radial * ux - turn * swept * uy
            gain[i, j, 1] = radial * uy + turn * swept * ux
            by_velocity[i, j] = turn
        for j in range(k - p):
            share = operators[j, i] / distance
            gain[i, p + j, 0], gain[i, p + j, 1] = -share * uy, share * ux
            for q in range(2):
                tangents[j, q] += gain[i, p + j, q]
                tangents[j, 2 + q] += gain[i, p + j, q] * age[i]
    for i in range(n):
        for j in range(k - p):
            for q in range(4 if p == 5 else 2):
                # East and north of the centre, and of the drift behind the radius.
                moved = q if q < 2 else q + 1
                for axis in range(2):
                    gain[i, p + j, axis] -= tangents[j, q] * gain[i, moved, axis]
                by_velocity[i, p + j] -= tangents[j, q] * by_velocity[i, moved]
    covariance[:] = 0.0
    for i in range(n):
        for j in range(k):
            for m in range(j + 1):
                covariance[j, m] += velocity_variance[i] * by_velocity[i, j] * by_velocity[i, m]
                covariance[j, m] += position_variance[i] * (
                    gain[i, j, 0] * gain[i, m, 0] + gain[i, j, 1] * gain[i, m, 1]
                )
    for c in range(correlation_time.shape[0]):
        before = np.zeros((k, 2))
        for i in range(n):
            if i > 0:
                before *= np.exp(-(age[i] - age[i - 1]) / correlation_time[c])
            sigma = correlated_sigma[c, i]
            for j in range(k):
                for m in range(j + 1):
                    total = 0.0
                    for axis in range(2):
                        a, b = sigma * gain[i, j, axis], sigma * gain[i, m, axis]
                        total += a * b + a * before[m, axis] + before[j, axis] * b
                    covariance[j, m] += total
            before += sigma * gain[i]
    for j in range(k):
        for m in range(j):
            covariance[m, j] = covariance[j, m]


@njit(cache=True)
def widening(
    points, velocities, age, circle, drifts, angle, radial, along, weight, correlated_sigma,
    correlation_time,
):
    """Change of the radius in a turn and its variance, the circle fitted anew beside it.

    Positions and velocities together, since over half a turn positions cannot tell a spiral from
    another circle. A constant angle between velocity and tangent is left free: a velocity that is
    late looks like a spiral to itself.

    Parameters
    ----------
    points, velocities : (n, 2) arrays
        Relative to the drift of the circle, if it has one.
    age : (n,) array
        [s], zero at the newest sample.
    circle : (3,) array
        Centre and radius.
    drifts : bool
        Whether its drift is fitted anew, too.
    radial, along, weight
        As `refine_circle` left them.
    angle : (n,) array
        Continuous, about the centre [rad].
    correlated_sigma : (n,) array
        Standard deviation of the Gauss-Markov error of the position of one axis [m].
    correlation_time : float
        [s]

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
    drift = 4 + late
    design = np.zeros((count, drift + (2 if drifts else 0)))
    off, trust = np.empty(count), np.empty(count)
    sense = 1.0 if angle[n - 1] > angle[0] else -1.0
    j = n
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        design[i, 0], design[i, 1], design[i, 2] = ux, uy, 1.0
        design[i, 3] = sense * (angle[i] - angle[n - 1]) / _TURN
        if drifts:
            design[i, drift], design[i, drift + 1] = ux * age[i], uy * age[i]
        off[i], trust[i] = radial[i], weight[0, i]
        if weight[1, i] > 0.0:
            swept = (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
            design[j, 0], design[j, 1] = -swept * uy, swept * ux
            design[j, 3] = sense * swept / _TURN
            if late:
                design[j, 4] = swept * circle[2]
            if drifts:
                design[j, drift] = ux - age[i] * swept * uy
                design[j, drift + 1] = uy + age[i] * swept * ux
            off[j], trust[j] = along[i], weight[1, i]
            j += 1
    k = design.shape[1]
    solution, inverse = np.empty(k), np.empty((k, k))
    squares, determined = least_squares(design, off, trust, solution, inverse)
    if not determined:
        return 0.0, np.inf, np.inf
    square = squares / (count - k)
    # How each position's error moves the change: outwards, and by turning the radius.
    gain = np.zeros((n, 2))
    j = n
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        out, turn = 0.0, 0.0
        for m in range(k):
            out += inverse[3, m] * design[i, m] * trust[i]
        if weight[1, i] > 0.0:
            for m in range(k):
                turn += inverse[3, m] * design[j, m] * trust[j]
            turn *= (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
            j += 1
        gain[i, 0] = correlated_sigma[i] * (out * ux - turn * uy)
        gain[i, 1] = correlated_sigma[i] * (out * uy + turn * ux)
    correlated = 0.0
    before = np.zeros(2)
    for i in range(n):
        if i > 0:
            before *= np.exp(-(age[i] - age[i - 1]) / correlation_time)
        for axis in range(2):
            correlated += gain[i, axis] * (gain[i, axis] + 2.0 * before[axis])
        before += gain[i]
    return solution[3], inverse[3, 3] * max(1.0, square) + correlated, square


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
