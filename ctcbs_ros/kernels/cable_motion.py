"""Motion of a lumped-mass cable in time, with the step chosen by its error.

A Rosenbrock method (`rosenbrock`) solves one block-tridiagonal system per step, of 3 x 3 blocks:
with positions x, velocities v, masses M, forces F and c = 1/(G h), both halves of a stage

    c u_x - u_v = p,  c M u_v - F_x u_x - F_v u_v = M q

leave (c M - F_v - F_x/c) u_v = M q + F_x p/c. Axial waves that the step does not resolve are
damped by the method; nothing limits the step but its error.

On a circle the error would be the circle's own: over a step a turning cable is cut short by its
chord, which a stiff one answers with tension. So the axes may turn about the vertical with the
aircraft, at a rate W about a centre that moves evenly. x and v stay the place from that centre and
the velocity past it, in the axes of the moment: with K y = W z x y,

    dx/dt = v - K x,  dv/dt = F/M - K v,

c u_x above becomes (c + K) u_x, and c M u_v likewise. The forces do not know of the axes, only
the wind turns; what moves steadily round the centre stands still, and steps as if it did.
"""

import numpy as np

from ctcbs_ros.kernels import rosenbrock as pair
from ctcbs_ros.kernels.block_tridiagonal import factorise, solve
from ctcbs_ros.kernels.cable_forces import N_END, STIFFNESS, derivatives, forces, masses
from ctcbs_ros.kernels.compiled import fused_kernel, kernel
from ctcbs_ros.kernels.piecewise import evaluate

_STAGES, _G = pair.STAGES, pair.G
_A, _C, _D, _E, _ALPHA = pair.A, pair.C, pair.D, pair.E, pair.ALPHA
OK, TOO_MANY_STEPS, NOT_FINITE, NO_LENGTH = range(4)
# Axes: rate of turning, centre at the beginning (3), its velocity (3).
AXES = 7
GROUND = np.zeros(AXES)


@kernel
def drive_at(drive, t, inside, x, v, wind, end, scratch):
    """Put the tow point into the last rows of x and v; write the wind and the end mass.

    drive : four signals (`piecewise`): tow point (3), wind (3), length (1), end mass (3).
    scratch : (3,) array, left with the tow point's acceleration.

    Returns
    -------
    length, length_rate, length_second : float
    """
    n = x.shape[0] - 1
    three, four = np.empty(3), np.empty(3)
    evaluate(drive[1][0], drive[1][1], t, inside, wind, three, four)
    evaluate(drive[3][0], drive[3][1], t, inside, end, three, four)
    one, rate, second = np.empty(1), np.empty(1), np.empty(1)
    evaluate(drive[2][0], drive[2][1], t, inside, one, rate, second)
    evaluate(drive[0][0], drive[0][1], t, inside, x[n], v[n], scratch)
    return one[0], rate[0], second[0]


@fused_kernel
def accelerations(drive, line, t, inside, x, v, out):
    """Write the accelerations of nodes 0 .. n-1 at a time to `out`, (n, 3).

    The last rows of x and v are set to the tow point's.
    """
    n = x.shape[0] - 1
    wind, end, scratch, mass = np.empty(3), np.empty(N_END), np.empty(3), np.empty(n)
    length, rate, second = drive_at(drive, t, inside, x, v, wind, end, scratch)
    forces(x, v, line, end, wind, length, rate, second, out)
    masses(line, end, length, n, mass)
    for i in range(n):
        for a in range(3):
            out[i, a] /= mass[i]


@kernel
def _steady(drive, axes):
    """Whether wind, as the axes have it, length and end mass never change."""
    for k in range(1, 4):
        if np.any(drive[k][1][1:] != 0.0) or drive[k][0].shape[0] > 2:
            return False
    wind = drive[1][1]
    return axes[0] == 0.0 or (wind[0, 0, 0] == axes[4] and wind[0, 0, 1] == axes[5])


@kernel
def _into(axes, since, x, v):
    """Places and velocities, (k, 3), from the ground into axes that have turned for a time."""
    c, s = np.cos(axes[0] * since), np.sin(axes[0] * since)
    for i in range(x.shape[0]):
        for a in range(3):
            x[i, a] -= axes[1 + a] + axes[4 + a] * since
            v[i, a] -= axes[4 + a]
        x[i, 0], x[i, 1] = c * x[i, 0] + s * x[i, 1], c * x[i, 1] - s * x[i, 0]
        v[i, 0], v[i, 1] = c * v[i, 0] + s * v[i, 1], c * v[i, 1] - s * v[i, 0]


@kernel
def _out_of(axes, since, x, v):
    """And back."""
    c, s = np.cos(axes[0] * since), np.sin(axes[0] * since)
    for i in range(x.shape[0]):
        x[i, 0], x[i, 1] = c * x[i, 0] - s * x[i, 1], c * x[i, 1] + s * x[i, 0]
        v[i, 0], v[i, 1] = c * v[i, 0] - s * v[i, 1], c * v[i, 1] + s * v[i, 0]
        for a in range(3):
            x[i, a] += axes[1 + a] + axes[4 + a] * since
            v[i, a] += axes[4 + a]


@kernel
def _drive_in(axes, begun, drive, t, inside, x, v, wind, end, scratch):
    """`drive_at`, with the tow point, its acceleration and the wind as the axes have them."""
    length, rate, second = drive_at(drive, t, inside, x, v, wind, end, scratch)
    if axes[0] != 0.0:
        n = x.shape[0] - 1
        since = t - begun
        _into(axes, since, x[n:], v[n:])
        c, s = np.cos(axes[0] * since), np.sin(axes[0] * since)
        for a in range(3):
            wind[a] -= axes[4 + a]
        wind[0], wind[1] = c * wind[0] + s * wind[1], c * wind[1] - s * wind[0]
        scratch[0], scratch[1] = c * scratch[0] + s * scratch[1], c * scratch[1] - s * scratch[0]
    return length, rate, second


@fused_kernel
def advance(drive, line, stops, tolerance, scale_x, scale_v, scale_t, most_steps, t, t_end, h,
            x, v, times, out_x, out_v, axes):  # fmt: skip
    """Integrate from t to t_end, writing the states at the rising `times` in between.

    Parameters
    ----------
    drive : four signals
        As in `drive_at`.
    line : (6,) array
    stops : (k,) array
        Rising times at which a signal or its slope may jump; steps end there.
    tolerance : float
        Error of a step allowed in positions, velocities and tensions, in units of the scales.
    scale_x, scale_v, scale_t : float
    most_steps : int
    t, t_end, h : float
        h is the first step to try.
    x, v : (n + 1, 3) arrays
        State at t, replaced by that reached.
    times : (m,) array
    out_x, out_v : (m, n + 1, 3) arrays, written
        By the method's own polynomial between the ends of a step: through accelerations, which
        the axial waves fill with noise, tensions would be nonsense.
    axes : (7,) array
        To step in: rate of turning, anticlockwise seen from above, centre at t and its velocity;
        `GROUND` for axes at rest. All else is as the ground has it.

    Returns
    -------
    status : int
    t, h : float
        Time reached, and the step to go on with.
    steps, rejected : int
    """
    n = x.shape[0] - 1
    steady = _steady(drive, axes)
    begun, turning = t, axes[0]
    mass, mass_now = np.empty(n), np.empty(n)
    by_x, by_v = np.empty((3, n, 3, 3)), np.empty((3, n, 3, 3))
    lower, diagonal, upper = np.empty((n, 3, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
    u_x, u_v = np.empty((_STAGES, n, 3)), np.empty((_STAGES, n, 3))
    y_x, y_v = np.empty((n + 1, 3)), np.empty((n + 1, 3))
    force, p = np.empty((n, 3)), np.empty((n, 3))
    start, driven = np.empty((n, 3)), np.empty((n, 3))
    wind, end, tow_a, scratch = np.empty(3), np.empty(N_END), np.empty(3), np.empty(3)
    tow_v, tow_start = np.empty(3), np.empty(3)
    steps, rejected, next_stop, next_time = 0, 0, 0, 0
    fresh = True
    while next_time < times.shape[0] and times[next_time] <= t:
        inside = t
        drive_at(drive, t, inside, x, v, wind, end, scratch)
        out_x[next_time], out_v[next_time] = x, v
        next_time += 1
    if turning != 0.0:
        _into(axes, 0.0, x, v)
    tiny = 1e-13 * max(abs(t), abs(t_end), t_end - t)
    while t_end - t > tiny:
        if steps + rejected >= most_steps:
            return TOO_MANY_STEPS, t, h, steps, rejected
        while next_stop < stops.shape[0] and stops[next_stop] <= t + tiny:
            next_stop += 1
        target = t_end
        if next_stop < stops.shape[0] and stops[next_stop] < t_end:
            target = stops[next_stop]
        step = h
        last = step >= (target - t) * (1.0 - 1e-9)
        if last:
            step = target - t
        middle = t + 0.5 * step
        length, rate, second = _drive_in(
            axes, begun, drive, t, t + 1e-9 * step, x, v, wind, end, tow_a
        )
        if not length > 0.0:
            return NO_LENGTH, t, h, steps, rejected
        masses(line, end, length, n, mass)
        if fresh:
            forces(x, v, line, end, wind, length, rate, second, force)
            for i in range(n):
                for a in range(3):
                    start[i, a] = force[i, a] / mass[i]
            derivatives(x, v, line, end, wind, length, rate, second, by_x, by_v)
            tow_v[:], tow_start[:] = v[n], tow_a
            tow_v[0] += turning * x[n, 1]
            tow_v[1] -= turning * x[n, 0]
            tow_start[0] += turning * v[n, 1]
            tow_start[1] -= turning * v[n, 0]
            # Explicit time derivative of the accelerations, times the masses: through the tow
            # point, and by differences through all else that changes.
            driven[:] = 0.0
            for a in range(3):
                for b in range(3):
                    driven[n - 1, a] += (
                        by_x[2, n - 1, a, b] * tow_v[b] + by_v[2, n - 1, a, b] * tow_start[b]
                    )
            if not steady:
                y_x[:], y_v[:] = x, v
                delta = 1e-4 * step
                length_1, rate_1, second_1 = _drive_in(
                    axes, begun, drive, t + delta, t + delta, y_x, y_v, wind, end, scratch
                )
                y_x[n], y_v[n] = x[n], v[n]
                forces(y_x, y_v, line, end, wind, length_1, rate_1, second_1, force)
                masses(line, end, length_1, n, mass_now)
                for i in range(n):
                    for a in range(3):
                        driven[i, a] += (
                            (force[i, a] / mass_now[i] - start[i, a]) * mass[i] / delta
                        )
            fresh = False
        c = 1.0 / (_G * step)
        # Inverse of c + K: in the plane `along` on its diagonal, `across` off it; upright `per_c`.
        per_c = 1.0 / c
        along, across = c / (c * c + turning * turning), turning / (c * c + turning * turning)
        for i in range(n):
            _implicit(by_x[0, i], by_v[0, i], along, across, per_c, lower[i])
            _implicit(by_x[1, i], by_v[1, i], along, across, per_c, diagonal[i])
            _implicit(by_x[2, i], by_v[2, i], along, across, per_c, upper[i])
            for a in range(3):
                diagonal[i, a, a] += c * mass[i]
            diagonal[i, 0, 1] -= turning * mass[i]
            diagonal[i, 1, 0] += turning * mass[i]
        factorise(lower, diagonal, upper)
        per_h = 1.0 / step
        for s in range(_STAGES):
            if s == 0:
                for i in range(n):
                    for a in range(3):
                        p[i, a] = v[i, a]
                        u_v[0, i, a] = start[i, a] * mass[i]
                    _turned(turning, x[i], v[i], mass[i], p[i], u_v[0, i])
            else:
                for i in range(n):
                    for a in range(3):
                        sum_x, sum_v = x[i, a], v[i, a]
                        for j in range(s):
                            sum_x += _A[s, j] * u_x[j, i, a]
                            sum_v += _A[s, j] * u_v[j, i, a]
                        y_x[i, a], y_v[i, a] = sum_x, sum_v
                now = t + _ALPHA[s] * step
                length_1, rate_1, second_1 = _drive_in(
                    axes, begun, drive, now, middle + (now - middle) * (1.0 - 1e-9), y_x, y_v,
                    wind, end, scratch,
                )
                forces(y_x, y_v, line, end, wind, length_1, rate_1, second_1, force)
                masses(line, end, length_1, n, mass_now)
                for i in range(n):
                    for a in range(3):
                        sum_x, sum_v = 0.0, 0.0
                        for j in range(s):
                            sum_x += _C[s, j] * u_x[j, i, a]
                            sum_v += _C[s, j] * u_v[j, i, a]
                        p[i, a] = y_v[i, a] + sum_x * per_h
                        u_v[s, i, a] = mass[i] * (force[i, a] / mass_now[i] + sum_v * per_h)
                    _turned(turning, y_x[i], y_v[i], mass[i], p[i], u_v[s, i])
            # p becomes (c + K)^-1 p.
            for i in range(n):
                p[i, 0], p[i, 1], p[i, 2] = (
                    along * p[i, 0] + across * p[i, 1], along * p[i, 1] - across * p[i, 0],
                    per_c * p[i, 2],
                )  # fmt: skip
            for i in range(n):
                for a in range(3):
                    total = 0.0
                    for b in range(3):
                        total += by_x[1, i, a, b] * p[i, b]
                        if i > 0:
                            total += by_x[0, i, a, b] * p[i - 1, b]
                        if i < n - 1:
                            total += by_x[2, i, a, b] * p[i + 1, b]
                    u_v[s, i, a] += total + step * _D[s] * driven[i, a]
            solve(lower, diagonal, upper, u_v[s])
            for i in range(n):
                u_x[s, i, 0] = p[i, 0] + along * u_v[s, i, 0] + across * u_v[s, i, 1]
                u_x[s, i, 1] = p[i, 1] + along * u_v[s, i, 1] - across * u_v[s, i, 0]
                u_x[s, i, 2] = p[i, 2] + per_c * u_v[s, i, 2]
        sum_x, sum_v = 0.0, 0.0
        for i in range(n):
            for a in range(3):
                sum_x = max(sum_x, abs(u_x[_STAGES - 1, i, a]))
                sum_v += u_v[_STAGES - 1, i, a] ** 2
        pull = line[STIFFNESS] * n / length * _greatest_stretch(y_x, u_x[_STAGES - 1])
        error = max(sum_x / scale_x, np.sqrt(sum_v / n) / scale_v, pull / scale_t) / tolerance
        if not np.isfinite(error):
            rejected += 1
            h = 0.1 * step
            if h <= tiny:
                return NOT_FINITE, t, h, steps, rejected
            continue
        factor = min(4.0, max(0.2, 0.9 * error**-0.25)) if error > 0.0 else 4.0
        if error > 1.0:
            rejected += 1
            h = step * min(factor, 0.9)
            if h <= tiny:
                return NOT_FINITE, t, h, steps, rejected
            continue
        t_new = target if last else t + step
        for i in range(n):
            for a in range(3):
                y_x[i, a] += u_x[_STAGES - 1, i, a]
                y_v[i, a] += u_v[_STAGES - 1, i, a]
        while next_time < times.shape[0] and times[next_time] <= t_new + tiny:
            part = (times[next_time] - t) / step
            _between(part, x, y_x, u_x, out_x[next_time])
            _between(part, v, y_v, u_v, out_v[next_time])
            if turning != 0.0:
                _out_of(axes, times[next_time] - begun, out_x[next_time], out_v[next_time])
            inside = middle + (times[next_time] - middle) * (1.0 - 1e-9)
            drive_at(drive, times[next_time], inside, out_x[next_time], out_v[next_time],
                     wind, end, scratch)  # fmt: skip
            next_time += 1
        x[:], v[:] = y_x, y_v
        t = t_new
        steps += 1
        fresh = True
        h = max(h, step * factor) if last else step * factor
    if turning != 0.0:
        _out_of(axes, t_end - begun, x, v)
    drive_at(drive, t_end, t_end - tiny, x, v, wind, end, scratch)
    return OK, t, h, steps, rejected


@fused_kernel
def _implicit(by_x, by_v, along, across, per_c, block):
    """Write -F_v - F_x (c + K)^-1 to a block, (3, 3)."""
    for a in range(3):
        x, y = by_x[a, 0], by_x[a, 1]
        block[a, 0] = -by_v[a, 0] - (along * x - across * y)
        block[a, 1] = -by_v[a, 1] - (along * y + across * x)
        block[a, 2] = -by_v[a, 2] - per_c * by_x[a, 2]


@fused_kernel
def _turned(turning, x, v, mass, p, q):
    """Take K x from p and M K v from q, each (3,)."""
    p[0] += turning * x[1]
    p[1] -= turning * x[0]
    q[0] += mass * turning * v[1]
    q[1] -= mass * turning * v[0]


@fused_kernel
def _greatest_stretch(x, moved):
    """Greatest change of a segment's length by small displacements of nodes 0 .. n-1, (n, 3)."""
    n = moved.shape[0]
    greatest = 0.0
    for i in range(n):
        along, square = 0.0, 0.0
        for a in range(3):
            e = x[i + 1, a] - x[i, a]
            along += e * ((moved[i + 1, a] if i < n - 1 else 0.0) - moved[i, a])
            square += e * e
        if square > 0.0:
            greatest = max(greatest, abs(along) / np.sqrt(square))
    return greatest


@kernel
def _between(part, before, after, stages, found):
    """Write nodes 0 .. n-1 at a part of a step, by the method's polynomial."""
    for i in range(found.shape[0] - 1):
        for a in range(3):
            first, second = 0.0, 0.0
            for s in range(_STAGES):
                first += _E[0, s] * stages[s, i, a]
                second += _E[1, s] * stages[s, i, a]
            bow = (1.0 - part) * (first + part * second)
            found[i, a] = (1.0 - part) * before[i, a] + part * (after[i, a] + bow)
