"""Forces on the nodes of a lumped-mass cable in the ground frame, and their derivatives.

n equal segments join n + 1 nodes; node 0 carries the end mass, node n is the tow point. Half of a
segment's mass, weight and drag goes to each of its nodes. A segment from node j to j + 1, of
unstretched length h and stretched vector e = |e| t, with the mean velocity u of its nodes against
the air, u_n = u - (u.t) t:

    tension  T = EA (|e|/h - 1 + eta d/dt(|e|/h)), along t, and never below 0
    drag     -k h |u_n| u_n, on the unstretched length
    weight   -q h in z

Drag may be taken at the nodes instead, as MoorDyn does: there u is the node's velocity, t goes
along the chord from one neighbour to the other, and h is half of each segment beside it. Both are
of second order in h; their errors have opposite signs.

Any consistent units do: SI, or lengths in tow radii and times in 1/Omega.

While cable is paid out or hauled in, nodes stay at fixed fractions of the length and move along
the cable. With the rate L' and the fraction i/n, c = L'/L i/n and d/dsigma along that fraction,
the acceleration of a node is that of the cable that is just there plus

    2 c dv/dsigma - c^2 d2x/dsigma2 + (L''/L - 2 (L'/L)^2) i/n dx/dsigma.

That motion is along the cable, where there is no drag.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import fused_kernel, kernel

# Columns of `line`: mass per length, EA, eta, net weight per length, k, and 1 for drag at nodes.
MASS, STIFFNESS, DAMPING, WEIGHT, DRAG, DRAG_AT_NODES = range(6)
N_LINE = 6
# Columns of `end`: mass, net weight, drag over speed squared.
END_MASS, END_WEIGHT, END_DRAG = range(3)
N_END = 3
# Of a segment folded to nothing, the direction means nothing either; it only must be finite.
_FOLDED = 1e-9


@kernel
def masses(line, end, length, n, mass):
    """Write the masses of nodes 0 .. n-1 to `mass`, (n,)."""
    h = length / n
    for i in range(n):
        mass[i] = line[MASS] * h
    mass[0] = end[END_MASS] + 0.5 * line[MASS] * h


@fused_kernel
def forces(x, v, line, end, wind, length, length_rate, length_second, force):
    """Write the forces on nodes 0 .. n-1, divided by nothing, to `force`, (n, 3).

    Parameters
    ----------
    x, v : (n + 1, 3) arrays
        Positions and velocities of the nodes, the tow point last.
    line : (6,) array
    end : (3,) array
    wind : (3,) array
        Velocity of the air.
    length, length_rate, length_second : float
        Unstretched length and its first two derivatives in time.
    """
    n = x.shape[0] - 1
    h = length / n
    h_rate = length_rate / n
    stiffness, eta, k = line[STIFFNESS], line[DAMPING], line[DRAG]
    half_weight = 0.5 * line[WEIGHT] * h
    at_nodes = line[DRAG_AT_NODES] > 0.0
    half_drag = 0.0 if at_nodes else 0.5 * k * h
    for i in range(n):
        force[i, 0], force[i, 1], force[i, 2] = 0.0, 0.0, -2.0 * half_weight
    for j in range(n):
        ex, ey, ez = x[j + 1, 0] - x[j, 0], x[j + 1, 1] - x[j, 1], x[j + 1, 2] - x[j, 2]
        size = max(np.sqrt(ex * ex + ey * ey + ez * ez), _FOLDED * h)
        per = 1.0 / size
        tx, ty, tz = ex * per, ey * per, ez * per
        strain = size / h - 1.0
        tension = 0.0
        if strain > 0.0:
            rate = 0.0
            if eta > 0.0:
                rate = (
                    tx * (v[j + 1, 0] - v[j, 0])
                    + ty * (v[j + 1, 1] - v[j, 1])
                    + tz * (v[j + 1, 2] - v[j, 2])
                ) / h - size * h_rate / (h * h)
            tension = max(0.0, stiffness * (strain + eta * rate))
        ux = 0.5 * (v[j, 0] + v[j + 1, 0]) - wind[0]
        uy = 0.5 * (v[j, 1] + v[j + 1, 1]) - wind[1]
        uz = 0.5 * (v[j, 2] + v[j + 1, 2]) - wind[2]
        along = ux * tx + uy * ty + uz * tz
        ux -= along * tx
        uy -= along * ty
        uz -= along * tz
        c = -half_drag * np.sqrt(ux * ux + uy * uy + uz * uz)
        force[j, 0] += tension * tx + c * ux
        force[j, 1] += tension * ty + c * uy
        force[j, 2] += tension * tz + c * uz
        if j + 1 < n:
            force[j + 1, 0] += -tension * tx + c * ux
            force[j + 1, 1] += -tension * ty + c * uy
            force[j + 1, 2] += -tension * tz + c * uz
    ux, uy, uz = v[0, 0] - wind[0], v[0, 1] - wind[1], v[0, 2] - wind[2]
    c = end[END_DRAG] * np.sqrt(ux * ux + uy * uy + uz * uz)
    force[0, 0] -= c * ux
    force[0, 1] -= c * uy
    force[0, 2] -= c * uz + end[END_WEIGHT] - half_weight
    if at_nodes:
        for i in range(n):
            below = max(i - 1, 0)
            ex = x[i + 1, 0] - x[below, 0]
            ey = x[i + 1, 1] - x[below, 1]
            ez = x[i + 1, 2] - x[below, 2]
            per = 1.0 / max(np.sqrt(ex * ex + ey * ey + ez * ez), _FOLDED * h)
            tx, ty, tz = ex * per, ey * per, ez * per
            ux, uy, uz = v[i, 0] - wind[0], v[i, 1] - wind[1], v[i, 2] - wind[2]
            along = ux * tx + uy * ty + uz * tz
            ux -= along * tx
            uy -= along * ty
            uz -= along * tz
            c = -k * h * np.sqrt(ux * ux + uy * uy + uz * uz)
            if i == 0:
                c *= 0.5
            force[i, 0] += c * ux
            force[i, 1] += c * uy
            force[i, 2] += c * uz
    if length_rate != 0.0 or length_second != 0.0:
        grow = length_rate / length
        second = length_second / length - 2.0 * grow * grow
        mass = line[MASS] * h
        for i in range(1, n):
            turn, bend, shift = mass * i * grow, mass * (i * grow) ** 2, 0.5 * mass * i * second
            for a in range(3):
                force[i, a] += (
                    turn * (v[i + 1, a] - v[i - 1, a])
                    - bend * (x[i + 1, a] - 2.0 * x[i, a] + x[i - 1, a])
                    + shift * (x[i + 1, a] - x[i - 1, a])
                )


@fused_kernel
def derivatives(x, v, line, end, wind, length, length_rate, length_second, by_x, by_v):
    """Write the derivatives of `forces` by positions and velocities.

    Parameters
    ----------
    x, v, line, end, wind, length, length_rate, length_second
        As in `forces`.
    by_x, by_v : (3, n, 3, 3) arrays
        Blocks of node i by nodes i - 1, i and i + 1; those of the first row's i - 1 stay 0.
    """
    n = x.shape[0] - 1
    h = length / n
    h_rate = length_rate / n
    stiffness, eta, k = line[STIFFNESS], line[DAMPING], line[DRAG]
    at_nodes = line[DRAG_AT_NODES] > 0.0
    by_x[:] = 0.0
    by_v[:] = 0.0
    e, t, u, w = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for j in range(n):
        for a in range(3):
            e[a] = x[j + 1, a] - x[j, a]
            w[a] = v[j + 1, a] - v[j, a]
            u[a] = 0.5 * (v[j, a] + v[j + 1, a]) - wind[a]
        size = max(np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), _FOLDED * h)
        per = 1.0 / size
        for a in range(3):
            t[a] = e[a] * per
        strain = size * (1.0 / h) - 1.0
        opening = t[0] * w[0] + t[1] * w[1] + t[2] * w[2]
        rate = opening / h - size * h_rate / (h * h)
        tension = stiffness * (strain + eta * rate)
        taut = strain > 0.0 and tension > 0.0
        if not taut:
            tension = 0.0
        axial = stiffness / h if taut else 0.0
        dashpot = axial * eta
        across = tension * per
        along = u[0] * t[0] + u[1] * t[1] + u[2] * t[2]
        for a in range(3):
            u[a] -= along * t[a]
        speed = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        per_speed = 1.0 / speed if speed > 0.0 else 0.0
        c = 0.0 if at_nodes else 0.5 * k * h
        pull = axial - dashpot * h_rate / h
        for a in range(3):
            for b in range(3):
                tt = t[a] * t[b]
                normal = (1.0 if a == b else 0.0) - tt
                uu = u[a] * u[b] * per_speed
                # of the tension, of half the drag
                f_e = pull * tt + across * normal
                if taut:
                    f_e += dashpot * per * t[a] * (w[b] - opening * t[b])
                f_w = dashpot * tt
                d_e = c * per * (along * uu + speed * (t[a] * u[b] + along * normal))
                d_u = -0.5 * c * (speed * normal + uu)
                by_x[1, j, a, b] += -f_e - d_e
                by_x[2, j, a, b] += f_e + d_e
                by_v[1, j, a, b] += -f_w + d_u
                by_v[2, j, a, b] += f_w + d_u
                if j + 1 < n:
                    by_x[0, j + 1, a, b] += f_e - d_e
                    by_x[1, j + 1, a, b] += -f_e + d_e
                    by_v[0, j + 1, a, b] += f_w + d_u
                    by_v[1, j + 1, a, b] += -f_w + d_u
    for a in range(3):
        u[a] = v[0, a] - wind[a]
    speed = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    per_speed = 1.0 / speed if speed > 0.0 else 0.0
    for a in range(3):
        for b in range(3):
            by_v[1, 0, a, b] -= end[END_DRAG] * u[a] * u[b] * per_speed
        by_v[1, 0, a, a] -= end[END_DRAG] * speed
    if at_nodes:
        for i in range(n):
            below = max(i - 1, 0)
            for a in range(3):
                e[a] = x[i + 1, a] - x[below, a]
                u[a] = v[i, a] - wind[a]
            size = max(np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), _FOLDED * h)
            per = 1.0 / size
            for a in range(3):
                t[a] = e[a] * per
            along = u[0] * t[0] + u[1] * t[1] + u[2] * t[2]
            for a in range(3):
                u[a] -= along * t[a]
            speed = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
            per_speed = 1.0 / speed if speed > 0.0 else 0.0
            c = k * h
            if i == 0:
                c *= 0.5
            lower = 1 if i == 0 else 0  # the block of the node that the chord begins at
            for a in range(3):
                for b in range(3):
                    normal = (1.0 if a == b else 0.0) - t[a] * t[b]
                    uu = u[a] * u[b] * per_speed
                    d_e = c * per * (along * uu + speed * (t[a] * u[b] + along * normal))
                    by_x[2, i, a, b] += d_e
                    by_x[lower, i, a, b] -= d_e
                    by_v[1, i, a, b] -= c * (speed * normal + uu)
    if length_rate != 0.0 or length_second != 0.0:
        grow = length_rate / length
        second = length_second / length - 2.0 * grow * grow
        mass = line[MASS] * h
        for i in range(1, n):
            turn, bend, shift = mass * i * grow, mass * (i * grow) ** 2, 0.5 * mass * i * second
            for a in range(3):
                by_x[0, i, a, a] += -bend - shift
                by_x[1, i, a, a] += 2.0 * bend
                by_x[2, i, a, a] += -bend + shift
                by_v[0, i, a, a] -= turn
                by_v[2, i, a, a] += turn
