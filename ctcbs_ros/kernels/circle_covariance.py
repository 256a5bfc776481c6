"""What the samples' errors, white and correlated in time, leave in a fitted circle."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel


@kernel
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
