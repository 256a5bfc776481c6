"""The angle about the centre of a circle: its course in time, and what it says of the flight."""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.regression import least_squares

_TURN = 2.0 * np.pi


@kernel
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


@kernel
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


@kernel
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
        Whether a step is longer than strong wind explains, and not that of a glitch.
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
    # In strong wind the rate along a circle held over the ground is up to twice its mean.
    fastest, least = 2.0 * arc / total, quiet + 0.3
    for i in range(count):
        back += step[i] < -quiet
        if step[i] > fastest * duration[i] + least:
            # A glitch steps there and back again, in either order; a broken track does not.
            returned = False
            for j in (i - 1, i + 1):
                if 0 <= j < count:
                    both = fastest * (duration[i] + duration[j]) + least
                    returned |= step[i] + step[j] <= both and step[j] < -quiet
            broken |= not returned
        if i >= count - 5:
            newest += step[i]
    return back / count, newest, broken


@kernel
def mean_rate(time, angle, sigma, with_harmonic, operator, harmonic):
    """Mean angular rate and its variance, of the angle against time.

    Parameters
    ----------
    time, angle, sigma : (n,) arrays
        [s], [rad], and standard deviation of the angle [rad].
    with_harmonic : bool
        Whether a variation once a turn is fitted beside the mean.
    operator : (n,) array, written
        Takes the angles to the rate.
    harmonic : (2,) array, written
        Of that variation: of the cosine and the sine of the angle [rad]; else nought.

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
    harmonic[:] = 0.0
    if not determined:
        return np.nan, 1.0
    for i in range(n):
        total = 0.0
        for j in range(k):
            total += inverse[1, j] * design[i, j]
        operator[i] = total * weight[i] / span
    if with_harmonic:
        harmonic[:] = solution[2:]
    return solution[1] / span, max(1.0, squares / max(n - k, 1))


@kernel
def newest_phase(time, angle, sigma, harmonic, reach, operator):
    """Angle at the newest sample, from a line through the newest part of the turn.

    Beside the variation once a turn, where that is known: the line misses its bend.

    Parameters
    ----------
    time, angle, sigma : (n,) arrays
        [s], [rad], and standard deviation of the angle, of any scale.
    harmonic : (2,) array
        As `mean_rate` left it.
    reach : float
        Time that counts as newest [s], at least three samples.
    operator : (n,) array of nought, written
        Takes the angles to the phase.
    """
    n = time.shape[0]
    first = max(n - 3, 0)
    while first > 0 and time[first - 1] > time[n - 1] - reach:
        first -= 1
    total, mean = 0.0, 0.0
    for i in range(first, n):
        operator[i] = 1.0 / sigma[i] ** 2
        total += operator[i]
    for i in range(first, n):
        operator[i] /= total
        mean += operator[i] * (time[i] - time[n - 1])
    spread = 0.0
    for i in range(first, n):
        spread += operator[i] * (time[i] - time[n - 1] - mean) ** 2
    phase, even = 0.0, 0.0
    for i in range(first, n):
        if spread > 0.0:
            operator[i] *= 1.0 - mean * (time[i] - time[n - 1] - mean) / spread
        phase += operator[i] * angle[i]
        even += operator[i] * (angle[i] - swing(angle[i], harmonic))
    # Not at the newest angle, whose noise would count once more.
    return even + swing(even + swing(phase, harmonic), harmonic)


@kernel
def swing(angle, harmonic):
    """Variation once a turn at an angle [rad]; `harmonic` as `mean_rate` left it."""
    return harmonic[0] * np.cos(angle) + harmonic[1] * np.sin(angle)
