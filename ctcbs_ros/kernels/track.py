"""Along the track: where the turn that is flown began, and where it came onto a circle."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel

# Angle [rad] that a turn adds in less time than a whole turn takes at its fastest: 3.6 times what
# five of these angles take. Where it does not, it has been flown straight. (On a circle over the
# ground the slowest such angle takes longer than that from a wind of 0.9 of the airspeed on.)
_STEP = np.pi / 9.0
_STEPS = 5
_WHOLE_TURN = 3.6


@kernel
def turn_start(time, course, reach):
    """Where the newest turn begins: straight flight before it adds no angle.

    Nor does it reach across a straight leg, or one that meanders, to the turn before that.

    Parameters
    ----------
    time : (n,) array
        [s]
    course : (n,) array
        Over ground, continuous [rad].
    reach : float
        Angle that the window holds at most [rad].

    Returns
    -------
    kept : int
        Those before it will never be needed again.
    start : int
    """
    n = course.shape[0]
    kept = n - 1
    while kept > 0 and abs(course[kept] - course[n - 1]) <= reach:
        kept -= 1
    most, advanced, fastest = 0.0, 0.0, np.inf
    steps = np.full(_STEPS, np.inf)  # when the newest ones were made, going back
    steps[0] = time[n - 1]
    for i in range(n - 1, kept - 1, -1):
        turned = abs(course[i] - course[n - 1])
        if turned > advanced + _STEP:
            if steps[0] - time[i] > _WHOLE_TURN * fastest:
                break
            fastest = min(fastest, steps[_STEPS - 1] - time[i])
            steps[1:] = steps[:-1].copy()
            steps[0], advanced = time[i], turned
        most = max(most, turned)
    start = n - 1
    while abs(course[start] - course[n - 1]) < most - 0.03 * most - 0.02:
        start -= 1
    return kept, start


@kernel
def joined_circle(points, ahead, white_sigma, correlated_sigma, circle, drift):
    """Index of the sample from which the track has been on a circle.

    A single glitch does not end the run: three samples in a row do.

    Parameters
    ----------
    points : (n, 2) array
        [m]
    ahead : (n,) array
        Time since the circle was there [s].
    white_sigma, correlated_sigma : (n,) arrays
        Standard deviations of one axis [m].
    circle, drift : (3,), (2,) arrays
        Centre and radius [m], and the centre's velocity [m/s].
    """
    away = 0
    for i in range(points.shape[0] - 1, -1, -1):
        east = points[i, 0] - circle[0] - ahead[i] * drift[0]
        north = points[i, 1] - circle[1] - ahead[i] * drift[1]
        variance = white_sigma[i] ** 2 + correlated_sigma[i] ** 2
        off = abs(np.hypot(east, north) - circle[2])
        if off * off < 16.0 * variance + (0.08 * circle[2]) ** 2:
            away = 0
        else:
            away += 1
            if away == 3:
                return i + 3
    return 0
