"""Signals in time as piecewise cubics: tow point, wind, length paid out, end mass.

A signal is `breaks`, (k + 1,), and `coefficients`, (4, k, d): on [breaks[i], breaks[i + 1]] it is
sum_j coefficients[j, i] (t - breaks[i])^j. Outside, the first and the last piece go on. It may
jump at a break: which side counts is told by a second time, `inside`.
"""


from ctcbs_ros.kernels.compiled import kernel


@kernel
def piece(breaks, inside):
    """Index of the piece that holds the time `inside`."""
    low, high = 0, breaks.shape[0] - 2
    while low < high:
        middle = (low + high + 1) // 2
        if breaks[middle] <= inside:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def evaluate(breaks, coefficients, t, inside, value, rate, second):
    """Write the signal and its first two derivatives at t, each (d,)."""
    i = piece(breaks, inside)
    s = t - breaks[i]
    for a in range(value.shape[0]):
        c0, c1 = coefficients[0, i, a], coefficients[1, i, a]
        c2, c3 = coefficients[2, i, a], coefficients[3, i, a]
        value[a] = c0 + s * (c1 + s * (c2 + s * c3))
        rate[a] = c1 + s * (2.0 * c2 + s * 3.0 * c3)
        second[a] = 2.0 * c2 + s * 6.0 * c3
