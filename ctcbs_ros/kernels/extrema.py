"""Extrema of h over the end-mass radius: pairs of steady states about to be born or to vanish.

On a cut tau = const of a family (`ctcbs_ros.kernels.continuation`) the states are the zeros of
h(u). A maximum of h below zero, or a minimum above it, is a pair of states that does not exist
there; its height and dh/dtau foretell whether it does beside the cut.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.continuation import level
from ctcbs_ros.kernels.search import MAX_STEPS, largest_radius, smallest_radius
from ctcbs_ros.kernels.trajectory import N_THETA, OK

_CELLS = 10


@kernel
def local_extrema(theta, exponents, length, length_exponent, tau, tolerance, found):
    """Find the local extrema of h(u) on one cut.

    Parameters
    ----------
    theta, exponents, length, length_exponent
        The family, at tau = 0.
    tau : float
    tolerance : float
        Of the integration.
    found : (n, 4) array, written
        u, h, dh/dtau and the kind, 1 for a maximum and -1 for a minimum, in falling u.

    Returns
    -------
    int
        Number of rows written.
    """
    states, mesh = np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1)
    work = np.empty((1, 2, 6))
    here = np.empty(N_THETA)
    for i in range(N_THETA):
        here[i] = theta[i] * np.exp(exponents[i] * tau)
    end = length * np.exp(length_exponent * tau)
    low, _ = smallest_radius(here, end, tolerance, work, mesh)
    high = np.log(largest_radius(here, end) * (1.0 + 1e-6))
    # A stack of intervals (a, h, h_u, b, h, h_u, depth), the rightmost on top.
    stack = np.empty((200, 7))
    top, count = 0, 0
    a = low
    ha, da, _, status_a = level(
        theta, exponents, length, length_exponent, tau, a, tolerance, states, mesh
    )
    for i in range(_CELLS):
        b = low + (high - low) * (i + 1) / _CELLS
        hb, db, _, status_b = level(
            theta, exponents, length, length_exponent, tau, b, tolerance, states, mesh
        )
        if status_a == OK and status_b == OK:
            stack[top] = np.array((a, ha, da, b, hb, db, 0.0))
            top += 1
        a, ha, da, status_a = b, hb, db, status_b
    while top > 0 and count < found.shape[0]:
        top -= 1
        a, ha, da = stack[top, 0], stack[top, 1], stack[top, 2]
        b, hb, db, depth = stack[top, 3], stack[top, 4], stack[top, 5], stack[top, 6]
        middle = 0.5 * (a + b)
        h, slope, _, status = level(
            theta, exponents, length, length_exponent, tau, middle, tolerance, states, mesh
        )
        if status != OK:
            continue
        width = b - a
        # What a cubic through both ends makes of the middle.
        guess = 0.5 * (ha + hb) + 0.125 * width * (da - db)
        guess_slope = 1.5 * (hb - ha) / width - 0.25 * (da + db)
        size = max(0.02, 0.1 * min(abs(ha), abs(h), abs(hb)))
        rough = abs(guess - h) > 0.2 * size or 0.125 * width * abs(guess_slope - slope) > size
        if rough and depth < 12.0:
            stack[top] = np.array((a, ha, da, middle, h, slope, depth + 1.0))
            stack[top + 1] = np.array((middle, h, slope, b, hb, db, depth + 1.0))
            top += 2
            continue
        for half in range(2):
            if half == 0:
                left, right, dl, dr = middle, b, slope, db
            else:
                left, right, dl, dr = a, middle, da, slope
            if not dl * dr < 0.0 or count == found.shape[0]:
                continue
            kind = 1.0 if dl > 0.0 else -1.0
            u, value, h_tau = 0.0, 0.0, 0.0
            # The height's error is of second order in the place's.
            for _ in range(8):
                share = min(max(dl / (dl - dr), 0.05), 0.95)
                u = left + share * (right - left)
                value, d, h_tau, status = level(
                    theta, exponents, length, length_exponent, tau, u, tolerance, states, mesh
                )
                if status != OK or abs(d) * (right - left) < 0.02 * abs(value) + 1e-9:
                    break
                if d * dl > 0.0:
                    left, dl = u, d
                else:
                    right, dr = u, d
            found[count, 0], found[count, 1] = u, value
            found[count, 2], found[count, 3] = h_tau, kind
            count += 1
    return count
