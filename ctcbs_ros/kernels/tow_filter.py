"""The tow point's filter and the path that it leads along, sample by sample.

The filter's mean has rows position, velocity, acceleration and columns east, north, up; east and
north share a covariance, up has its own. Turning at a rate W, d2u/dt2 = -W^2 u of the velocity u
through the air; of the vertical the rate is 0. See `ctcbs_ros.twin.tow_point` for the idea.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel


@kernel
def follow(mean, off, level, upright, jerk, rate, wind, breaks, slowness, position, velocity,
           position_sigma, velocity_sigma, doubt, doubt_time, knots):  # fmt: skip
    """Take in the next sample: the path's positions and velocities at some times up to it.

    Parameters
    ----------
    mean : (3, 3) array
        Replaced by the mean after the sample.
    off : (2, 3) array
        Path less filter, position and velocity; replaced likewise.
    level, upright : (3, 3) arrays
        Covariances, replaced likewise.
    jerk : (2,) array
        Densities of its noise, level and upright [m^2/s^5].
    rate : float
        Of turning [rad/s].
    wind : (3,) array
    breaks : (k + 1,) array
        Rising times since the sample before, the first 0 and the last that of the sample.
    slowness : float
        Of the way that takes a correction over [s].
    position, velocity : (3,) arrays
        The velocity nan where there is none.
    position_sigma, velocity_sigma : float
        Of one axis.
    doubt, doubt_time : float
        What positions have said against the filter lately, and how long that counts [s].
    knots : (2, k + 1, 3) array, written
        Positions and velocities of the path.

    Returns
    -------
    missed, sigma, doubt : float
        How far the position is from where the filter led, level; its standard deviation along an
        axis; and the new doubt.
    """
    last = breaks.shape[0] - 1
    interval = breaks[last]
    begun = mean.copy()
    foreseen = np.empty((3, 3))
    moved(begun, interval, rate, wind, foreseen)
    spread(level, interval, rate, jerk[0])
    spread(upright, interval, 0.0, jerk[1])
    square = (position[0] - foreseen[0, 0]) ** 2 + (position[1] - foreseen[0, 1]) ** 2
    variance = level[0, 0] + position_sigma**2
    mean[:] = foreseen
    _correct(mean, level, upright, 0, position, position_sigma)
    doubt += min(1.0, interval / doubt_time) * (0.5 * square / variance - doubt)
    if np.isfinite(velocity[0]):
        _correct(mean, level, upright, 1, velocity, velocity_sigma * max(1.0, doubt))
    # The path nears what the filter says now, and would have said of the time before.
    here, left = np.empty((3, 3)), np.empty((2, 3))
    moved(mean, -interval, rate, wind, here)
    for r in range(2):
        for a in range(3):
            knots[r, 0, a] = begun[r, a] + off[r, a]
            off[r, a] = knots[r, 0, a] - here[r, a]
    for i in range(1, last + 1):
        moved(mean, breaks[i] - interval, rate, wind, here)
        decayed(off, breaks[i], slowness, left)
        for r in range(2):
            for a in range(3):
                knots[r, i, a] = here[r, a] + left[r, a]
    off[:] = left
    return np.sqrt(square), np.sqrt(variance), doubt


@kernel
def moved(mean, t, rate, wind, found):
    """Write the filter's mean after a time t, or before, (3, 3), to `found`."""
    one, two = transition(t, rate), transition(t, 0.0)
    for a in range(3):
        part = one if a < 2 else two
        speed = mean[1, a] - wind[a]
        for r in range(3):
            found[r, a] = part[r, 0] * mean[0, a] + part[r, 1] * speed + part[r, 2] * mean[2, a]
        found[0, a] += wind[a] * t
        found[1, a] += wind[a]


@kernel
def transition(t, rate):
    """Of position, velocity and acceleration of one axis over a time t, (3, 3)."""
    found = np.zeros((3, 3))
    found[0, 0] = 1.0
    angle = rate * t
    if abs(angle) < 1e-4:
        found[0, 1], found[0, 2] = t, 0.5 * t * t
        found[1, 1], found[1, 2] = 1.0, t
        found[2, 2] = 1.0
        return found
    c, s = np.cos(angle), np.sin(angle)
    found[0, 1], found[0, 2] = s / rate, (1.0 - c) / rate**2
    found[1, 1], found[1, 2] = c, s / rate
    found[2, 1], found[2, 2] = -rate * s, c
    return found


@kernel
def spread(covariance, t, rate, density):
    """Replace a covariance, (3, 3), by that a time t later, white noise of the jerk added."""
    part, half = transition(t, rate), np.zeros((3, 3))
    for r in range(3):
        for s in range(3):
            for k in range(3):
                half[r, s] += part[r, k] * covariance[k, s]
    for r in range(3):
        for s in range(3):
            covariance[r, s] = density * _jerked(r, s, t)
            for k in range(3):
                covariance[r, s] += half[r, k] * part[s, k]


@kernel
def _jerked(r, s, t):
    """What noise of the jerk of density 1 does in a time t: covariance of derivatives r and s.

    Each is the noise's integral, with the weight (t - u)^(2 - r)/(2 - r)!.
    """
    power = 5 - r - s
    factor = (2.0 if r == 0 else 1.0) * (2.0 if s == 0 else 1.0)
    return t**power / (factor * power)


@kernel
def _correct(mean, level, upright, row, measured, sigma):
    for a in range(3):
        covariance = level if a < 2 else upright
        per = 1.0 / (covariance[row, row] + sigma * sigma)
        miss = measured[a] - mean[row, a]
        for r in range(3):
            mean[r, a] += covariance[r, row] * per * miss
    for covariance in (level, upright):
        per = 1.0 / (covariance[row, row] + sigma * sigma)
        across = covariance[row].copy()
        for r in range(3):
            gain = covariance[r, row] * per
            for s in range(3):
                covariance[r, s] -= gain * across[s]


@kernel
def decayed(off, t, slowness, left):
    """Write a difference of position and velocity, (2, 3), after a critically damped time t."""
    k = 1.0 / slowness
    fade = np.exp(-k * t)
    for a in range(3):
        b = off[1, a] + k * off[0, a]
        left[0, a] = (off[0, a] + b * t) * fade
        left[1, a] = (off[1, a] - k * b * t) * fade


@kernel
def cubics(breaks, positions, velocities, coefficients):
    """Write the cubics through positions and velocities, (k + 1, 3), as `piecewise` has them."""
    for i in range(breaks.shape[0] - 1):
        per = 1.0 / (breaks[i + 1] - breaks[i])
        for a in range(3):
            slope = (positions[i + 1, a] - positions[i, a]) * per
            first, last = velocities[i, a], velocities[i + 1, a]
            coefficients[0, i, a], coefficients[1, i, a] = positions[i, a], first
            coefficients[2, i, a] = (3.0 * slope - 2.0 * first - last) * per
            coefficients[3, i, a] = (first + last - 2.0 * slope) * per * per
