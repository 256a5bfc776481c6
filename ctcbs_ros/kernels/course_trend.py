"""Whether the radius changes, by the velocities alone: the course over the way flown."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import least_squares

_TURN = 2.0 * np.pi
# Share of a velocity's error that is taken to last through all samples.
_LASTING = 0.25


@kernel
def course_widening(velocities, age, radius, velocity_sigma, drifts):
    """Change of the radius in a turn and its variance, by the course over the way flown.

    The course turns by a radian on a way as long as the radius, wherever the centre is and at
    whatever speed: so the way is a parabola of the course where the radius changes steadily.
    A velocity that is late is late in both, and positions are not asked.

    Parameters
    ----------
    velocities : (n, 2) array
        [m/s]; nan where not known.
    age : (n,) array
        [s], rising.
    radius : float
        About that of the circle [m].
    velocity_sigma : (n,) array
        Standard deviation of one axis [m/s].
    drifts : bool
        Whether the circle may drift at any velocity, which is then fitted beside.

    Returns
    -------
    change : float
        [m/turn]
    variance : float
        Infinite where the samples do not tell.
    """
    n = velocities.shape[0]
    design, way, trust = np.zeros((n + 2, 5)), np.zeros(n + 2), np.zeros(n + 2)
    before = (0.0, 0.0, 0.0)
    for i in range(n):
        now = velocities[i]
        speed = np.hypot(now[0], now[1])
        if not speed > 0.0:
            return 0.0, np.inf
        east, north = now[0] / speed, now[1] / speed
        if i > 0:
            last = velocities[i - 1]
            turned = np.arctan2(
                last[0] * now[1] - last[1] * now[0], last[0] * now[0] + last[1] * now[1]
            )
            step = 0.5 * (age[i] - age[i - 1])
            design[i, 1] = design[i - 1, 1] + turned
            way[i] = way[i - 1] + step * (speed + before[0])
            # What a velocity that is added all the time does to the way.
            design[i, 3] = design[i - 1, 3] + step * (east + before[1])
            design[i, 4] = design[i - 1, 4] + step * (north + before[2])
        before = (speed, east, north)
        trust[i] = (speed / (radius * velocity_sigma[i])) ** 2
    course = design[n - 1, 1]
    sense = 1.0 if course > 0.0 else -1.0
    for i in range(n):
        turned = sense * (design[i, 1] - course)
        design[i, 0], design[i, 1], design[i, 2] = 1.0, turned, turned * turned / (2.0 * _TURN)
        # And to the course.
        square = velocities[i, 0] ** 2 + velocities[i, 1] ** 2
        design[i, 3] += sense * radius * velocities[i, 1] / square
        design[i, 4] -= sense * radius * velocities[i, 0] / square
    for axis in range(2):
        design[n + axis, 3 + axis] = 1.0
        if not drifts:
            trust[n + axis] = 1.0 / (_LASTING**2 * np.mean(velocity_sigma**2))
    solution, inverse = np.empty(5), np.empty((5, 5))
    squares, determined = least_squares(design, way, trust, solution, inverse)
    if not determined or n < 8:
        return 0.0, np.inf
    # What errors of the speed sum up to on the way.
    summed, rest = 0.0, 0.0
    for i in range(n - 1, -1, -1):
        for m in range(5):
            rest += inverse[2, m] * design[i, m] * trust[i]
        step = 0.5 * (age[min(i + 1, n - 1)] - age[max(i - 1, 0)])
        summed += (step * rest * velocity_sigma[i]) ** 2
    return solution[2], (inverse[2, 2] + summed) * max(1.0, squares / (n - 5))
