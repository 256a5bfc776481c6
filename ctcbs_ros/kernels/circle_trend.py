"""Whether the radius of a fitted circle changes: a spiral's growth, and how well it is known."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import least_squares

_TURN = 2.0 * np.pi


@kernel
def widening(
    points, velocities, age, circle, drifts, angle, radial, along, weight, correlated_sigma,
    correlation_time, by_course,
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
    by_course : (float, float)
        The same change and its variance, as `course_widening` knows it.

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
    known = by_course[1] < np.inf
    count += known
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
    if known:
        design[j, 3], off[j], trust[j] = 1.0, by_course[0], 1.0 / by_course[1]
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


@kernel
def lag(points, velocities, age, circle, weight, inverse, angle, operators, rate, moved):
    """What a fitted circle is off by, for each metre a turn that its radius changes unseen.

    The circle is one of constant radius through all samples; the truth is that at the newest one,
    flown at constant speed. To first order.

    Parameters
    ----------
    points, velocities, age, circle, weight, inverse, angle
        As `widening` has them; `inverse` as `refine_circle` left it, of size p.
    operators : (2, n) array
        Take the angles to rate and phase.
    rate : float
        [rad/s], positive anticlockwise.
    moved : (p + 2,) array, written
        Of centre, radius, drift if p is 5, rate and phase.
    """
    n, p = points.shape[0], inverse.shape[0]
    sense = 1.0 if rate > 0.0 else -1.0
    right, row = np.zeros(p), np.empty(p)
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        distance = np.hypot(dx, dy)
        ux, uy = dx / distance, dy / distance
        row[0], row[1], row[2] = ux, uy, 1.0
        if p == 5:
            row[3], row[4] = ux * age[i], uy * age[i]
        # A metre a turn, as in the design of `widening`.
        trust = weight[0, i] * sense * (angle[i] - angle[n - 1]) / _TURN
        for j in range(p):
            right[j] += trust * row[j]
        if weight[1, i] > 0.0:
            swept = (velocities[i, 1] * ux - velocities[i, 0] * uy) / distance
            row[0], row[1], row[2] = -swept * uy, swept * ux, 0.0
            if p == 5:
                row[3], row[4] = ux - age[i] * swept * uy, uy + age[i] * swept * ux
            trust = weight[1, i] * sense * swept / _TURN
            for j in range(p):
                right[j] += trust * row[j]
    for j in range(p):
        moved[j] = 0.0
        for k in range(p):
            moved[j] += inverse[j, k] * right[k]
    # The angles are about the wrong centre, and of a rate that falls as the radius grows.
    moved[p] = moved[p + 1] = 0.0
    bend = sense * rate * rate / (2.0 * _TURN * circle[2])
    for i in range(n):
        dx, dy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        east, north = moved[0], moved[1]
        if p == 5:
            east += age[i] * moved[3]
            north += age[i] * moved[4]
        turned = (dy * east - dx * north) / (dx * dx + dy * dy) - bend * age[i] * age[i]
        for j in range(2):
            moved[p + j] += operators[j, i] * turned
