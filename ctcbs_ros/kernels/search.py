"""Search for the end-mass radii whose cable ends on the tow circle, thesis (2.17).

For given parameters the end-mass radius x_d is the only unknown: with u = ln x_d,

    h(u) = x(l)^2 + y(l)^2 - 1 = 0.

h is smooth, so its roots are counted by cubic Hermite interpolation on intervals that are halved
until the cubic foretells the middle; an extremum close to zero is itself located,
so that two roots about to merge (a fold) are told from none.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel
from ctcbs_ros.kernels.trajectory import N_THETA, OK, OMEGA, RHO, X_D, D, G, M, W, integrate

MAX_STEPS = 6000
# Integration steps that a search may take: ten times what any point of thesis Table 2.1
# needs, and a fraction of a second. Beyond it h has so many roots that none means anything.
MOST_WORK = 400_000
# Strain beyond which a linear-elastic cable means nothing; bounds the search, physics.
MAX_STRAIN = 3.0


@kernel
def tow_circle(theta, length, u, tolerance, states, mesh):
    """Evaluate the tow-circle condition at ln(end-mass radius) u.

    Parameters
    ----------
    theta : (8,) array
        Parameters; x_d is overwritten.
    length, u, tolerance : float
    states : (1, 2, 6) array
        Work space.
    mesh : (MAX_STEPS + 1,) array, written
        Ends of the steps.

    Returns
    -------
    h, slope : float
        h(u) and dh/du.
    status, steps, least_tension
        Of the integration.
    """
    theta[X_D] = np.exp(u)
    directions = np.zeros((1, N_THETA))
    directions[0, X_D] = theta[X_D]
    nodes = np.array([length])
    status, steps, least = integrate(theta, directions, nodes, tolerance, MAX_STEPS, states, mesh)
    x, y = states[0, 0, 0], states[0, 0, 1]
    h = x * x + y * y - 1.0
    slope = 2.0 * (x * states[0, 1, 0] + y * states[0, 1, 1])
    if status == OK and not (np.isfinite(h) and np.isfinite(slope)):
        status = 2
    return h, slope, status, steps, least


@kernel
def largest_radius(theta, length):
    """Bound the end-mass radius: one cable length, stretched, beyond the tow circle."""
    o2 = theta[OMEGA] ** 2
    x = 1.0 + length * (1.0 + MAX_STRAIN)
    if theta[G] == 0.0:
        return 1.0 + length
    for _ in range(50):
        # Tension at the mass, and by (2.18) nowhere more than what gravity and rotation add.
        p = np.sqrt((o2 * theta[M] * x) ** 2 + (o2 * theta[D] * x * x) ** 2 + theta[W] ** 2)
        p += abs(theta[RHO]) * x + 0.5 * o2 * x * x
        tighter = 1.0 + length * (1.0 + min(MAX_STRAIN, theta[G] * p))
        if tighter > 0.999 * x:
            break
        x = tighter
    return x


@kernel
def smallest_radius(theta, length, tolerance, states, mesh):
    """Bound the end-mass radius from below: where the cable is still linear and ends far inside.

    Drag is quadratic, so that for a small enough radius the tow point's distance from the axis is
    proportional to it; if it is then well inside the tow circle, no smaller radius reaches it.

    Returns
    -------
    u : float
    work : int
        Integration steps taken.
    """
    u = np.log(1e-2)
    h, slope, status, work, _ = tow_circle(theta, length, u, tolerance, states, mesh)
    for _ in range(40):
        linear = abs(slope - 2.0 * (h + 1.0)) < 0.2 * (h + 1.0) or h + 1.0 < 1e-12
        if status == OK and h < -0.8 and linear:
            break
        u -= 1.0
        h, slope, status, steps, _ = tow_circle(theta, length, u, tolerance, states, mesh)
        work += steps
    return u, work


@kernel
def polish(theta, length, low, high, sign_low, tolerance, states, mesh):
    """Root of h in [low, high] by Newton's method, kept inside the shrinking bracket.

    Returns
    -------
    u : float
    work : int
        Integration steps taken.
    good : bool
    """
    u = 0.5 * (low + high)
    work = 0
    for _ in range(60):
        h, slope, status, steps, _ = tow_circle(theta, length, u, tolerance, states, mesh)
        work += steps
        if status != OK:
            return u, work, False
        if h * sign_low > 0.0:
            low = u
        else:
            high = u
        step = -h / slope if slope != 0.0 else np.inf
        if abs(h) < 1e-14 or abs(step) < 1e-13 or high - low < 1e-14:
            return u, work, True
        inside = low < u + step < high
        if inside and abs(step) < 1e-11:
            return u + step, work, True
        u = u + step if inside else 0.5 * (low + high)
    return u, work, False


@kernel
def _hermite(a, b, ha, da, hb, db, u):
    """Cubic Hermite interpolant and its slope at u."""
    w = b - a
    x = (u - a) / w
    h = (
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * ha
        + x * (1.0 - x) ** 2 * w * da
        + x * x * (3.0 - 2.0 * x) * hb
        - x * x * (1.0 - x) * w * db
    )
    slope = (
        6.0 * x * (x - 1.0) * (ha - hb) / w
        + (1.0 - x) * (1.0 - 3.0 * x) * da
        - x * (2.0 - 3.0 * x) * db
    )
    return h, slope


@kernel
def _extremum(theta, length, a, b, da, tolerance, states, mesh):
    """Locate the extremum of h between a and b; stop as soon as h is found across zero.

    Returns
    -------
    u, h : float
    work : int
        Integration steps taken.
    """
    low, high = a, b
    u, h, work = 0.5 * (a + b), 0.0, 0
    for _ in range(60):
        u = 0.5 * (low + high)
        h, slope, _, steps, _ = tow_circle(theta, length, u, tolerance, states, mesh)
        work += steps
        # slope da at a points toward zero: past zero means that two roots have been separated
        if h * da > 0.0 or high - low < 1e-10:
            break
        if slope * da > 0.0:
            low = u
        else:
            high = u
    return u, h, work


@kernel
def all_roots(theta, length, scan_tolerance, tolerance, roots):
    """Find every root of h, in rising order.

    Parameters
    ----------
    theta : (8,) array
        Parameters; x_d is overwritten.
    length : float
    scan_tolerance, tolerance : float
        Of the integration while searching and while polishing.
    roots : (n,) array, written
        ln(end-mass radius).

    Returns
    -------
    count : int
        Number of roots written.
    work : int
        Integration steps taken. From `MOST_WORK` on the search has been given up, and the roots
        are some only; so they are where `roots` is full.
    failures : int
        Integrations that did not finish; roots next to them may be missing.
    """
    states = np.empty((1, 2, 6))
    mesh = np.empty(MAX_STEPS + 1)
    low, work = smallest_radius(theta, length, scan_tolerance, states, mesh)
    # The outermost state is nearly straight and ends at the bound itself.
    high = np.log(largest_radius(theta, length) * (1.0 + 1e-6))
    cells = 8
    count, failures = 0, 0

    # A stack of intervals, the leftmost on top.
    stack = np.empty((400, 7))
    u1 = high
    h1, d1, s1, _, _ = tow_circle(theta, length, u1, scan_tolerance, states, mesh)
    top = 0
    for i in range(cells):
        u0 = high - (high - low) * (i + 1) / cells
        h0, d0, s0, steps, _ = tow_circle(theta, length, u0, scan_tolerance, states, mesh)
        work += steps
        if s0 != OK:
            failures += 1
        else:
            if s1 == OK:
                stack[top, 0], stack[top, 1], stack[top, 2] = u0, h0, d0
                stack[top, 3], stack[top, 4], stack[top, 5] = u1, h1, d1
                stack[top, 6] = 0.0
                top += 1
        u1, h1, d1, s1 = u0, h0, d0, s0

    while top > 0 and work < MOST_WORK and count + 1 < roots.shape[0]:
        top -= 1
        a, ha, da = stack[top, 0], stack[top, 1], stack[top, 2]
        b, hb, db = stack[top, 3], stack[top, 4], stack[top, 5]
        known = stack[top, 6] > 0.0
        width = b - a
        split = False
        middle, hm, dm = 0.0, 0.0, 0.0
        if not known and width > 1e-7:
            middle = 0.5 * (a + b)
            hm, dm, status, steps, _ = tow_circle(
                theta, length, middle, scan_tolerance, states, mesh
            )
            work += steps
            if status != OK:
                failures += 1
                continue
            guess, slope = _hermite(a, b, ha, da, hb, db, middle)
            # Far from zero a rough idea of h is enough; the slope guards against a hidden bend.
            size = max(0.02, 0.1 * min(abs(ha), abs(hm), abs(hb)))
            split = abs(guess - hm) > 0.2 * size or 0.125 * width * abs(slope - dm) > size
            stack[top, 0], stack[top, 1], stack[top, 2] = middle, hm, dm
            stack[top, 3], stack[top, 4], stack[top, 5] = b, hb, db
            stack[top, 6] = 0.0 if split else 1.0
            stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2] = a, ha, da
            stack[top + 1, 3], stack[top + 1, 4], stack[top + 1, 5] = middle, hm, dm
            stack[top + 1, 6] = 0.0 if split else 1.0
            top += 2
            continue
        if ha * hb <= 0.0:
            if ha != 0.0:
                u, steps, good = polish(theta, length, a, b, ha, tolerance, states, mesh)
                work += steps
                if good:
                    roots[count] = u
                    count += 1
                else:
                    failures += 1
            continue
        if da * ha < 0.0 and db * hb > 0.0:
            # h bends towards zero in between: does it touch?
            u, h, steps = _extremum(theta, length, a, b, da, tolerance, states, mesh)
            work += steps
            if h * ha < 0.0:
                first, steps1, good1 = polish(theta, length, a, u, ha, tolerance, states, mesh)
                second, steps2, good2 = polish(theta, length, u, b, h, tolerance, states, mesh)
                work += steps1 + steps2
                if good1 and good2:
                    roots[count] = first
                    roots[count + 1] = second
                    count += 2
                else:
                    failures += 1
    return count, work, failures
