"""Small weighted least-squares problems by their normal equations, on plain arrays.

Columns are centred or of order one where they are set up, so that squaring the condition costs no
accuracy that telemetry has.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel

# A pivot this small beside its diagonal: the columns depend on each other.
_DEPENDENT = 1e-13


@kernel
def invert_normal(normal, inverse):
    """Invert a symmetric positive definite matrix by Cholesky's method.

    normal : (k, k), kept; inverse : (k, k), written. Returns whether it is positive definite.
    """
    k = normal.shape[0]
    low = np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1):
            total = normal[i, j]
            for m in range(j):
                total -= low[i, m] * low[j, m]
            if i == j:
                # A nan or an infinity fails as well.
                if not (_DEPENDENT * normal[i, i] < total < np.inf):
                    return False
                low[i, i] = np.sqrt(total)
            else:
                low[i, j] = total / low[j, j]
    # Its inverse, and from that the inverse of the product.
    for j in range(k):
        low[j, j] = 1.0 / low[j, j]
        for i in range(j + 1, k):
            total = 0.0
            for m in range(j, i):
                total -= low[i, m] * low[m, j]
            low[i, j] = total / low[i, i]
    for i in range(k):
        for j in range(i + 1):
            total = 0.0
            for m in range(i, k):
                total += low[m, i] * low[m, j]
            inverse[i, j] = total
            inverse[j, i] = total
    return True


@kernel
def least_squares(design, y, weight, solution, inverse):
    """Minimise the sum of weight (y - design solution)^2.

    Parameters
    ----------
    design : (n, k) array
    y, weight : (n,) arrays
        Weights are inverse variances.
    solution : (k,) array, written
    inverse : (k, k) array, written
        Of the normal matrix: the covariance of the solution where the weights hold.

    Returns
    -------
    squares : float
        The least sum.
    determined : bool
        Whether the columns are independent; otherwise nothing is written.
    """
    n, k = design.shape
    normal = np.zeros((k, k))
    right = np.zeros(k)
    for m in range(n):
        for i in range(k):
            right[i] += weight[m] * design[m, i] * y[m]
            for j in range(i + 1):
                normal[i, j] += weight[m] * design[m, i] * design[m, j]
    for i in range(k):
        for j in range(i):
            normal[j, i] = normal[i, j]
    if not invert_normal(normal, inverse):
        return np.inf, False
    for i in range(k):
        solution[i] = 0.0
        for j in range(k):
            solution[i] += inverse[i, j] * right[j]
    squares = 0.0
    for m in range(n):
        off = y[m]
        for i in range(k):
            off -= design[m, i] * solution[i]
        squares += weight[m] * off * off
    return squares, True


@kernel
def line(x, y, weight):
    """Weighted straight line.

    x, y, weight : (n,) arrays

    Returns
    -------
    at_zero, slope : float
    variance_at_zero, variance_of_slope : float
        Where the weights are inverse variances; the slope's is infinite where all x are the same.
    squares : float
        Weighted sum of the squares that are left.
    """
    total, x_mean, y_mean = 0.0, 0.0, 0.0
    for i in range(x.shape[0]):
        total += weight[i]
        x_mean += weight[i] * x[i]
        y_mean += weight[i] * y[i]
    x_mean /= total
    y_mean /= total
    xx, xy = 0.0, 0.0
    for i in range(x.shape[0]):
        xx += weight[i] * (x[i] - x_mean) ** 2
        xy += weight[i] * (x[i] - x_mean) * (y[i] - y_mean)
    slope = xy / xx if xx > 0.0 else 0.0
    by_slope = 1.0 / xx if xx > 0.0 else np.inf
    squares = 0.0
    for i in range(x.shape[0]):
        squares += weight[i] * (y[i] - y_mean - slope * (x[i] - x_mean)) ** 2
    of_zero = 1.0 / total + (x_mean * x_mean * by_slope if x_mean != 0.0 else 0.0)
    return y_mean - slope * x_mean, slope, of_zero, by_slope, squares


@kernel
def correlated_form(gain, time, correlation_time, form):
    """Covariance of linear combinations of a first-order Gauss-Markov error of unit variance.

    Its correlation exp(-|t_i - t_j|/T) is a product of those from sample to sample, so one pass
    over the samples sums it.

    Parameters
    ----------
    gain : (k, n) array
        Takes the errors to the combinations.
    time : (n,) array
        Rising [s].
    correlation_time : float
        T [s].
    form : (k, k) array, written
    """
    k, n = gain.shape
    form[:] = 0.0
    before = np.zeros(k)
    for i in range(n):
        if i > 0:
            before *= np.exp((time[i - 1] - time[i]) / correlation_time)
        for p in range(k):
            for q in range(k):
                form[p, q] += gain[p, i] * (gain[q, i] + before[q]) + before[p] * gain[q, i]
        for p in range(k):
            before[p] += gain[p, i]
