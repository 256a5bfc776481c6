"""Forces on a moving elastic cable at points of it, with their derivatives.

With e = |r_s|, t = r_s / e and v the velocity through the air, drag and tension per unstretched
length are, lengths in a, times in 1/Omega,

    drag = d_n |v_n| v_n,    v_n = v - (v.t) t,
    pull = p t / omega^2,    p = gamma (e - 1 + damping e')

At a steady state in the rotating frame the derivatives are those of `ctcbs_ros.kernels.galerkin`.
"""

import numpy as np

from ctcbs_ros.kernels.compiled import kernel


@kernel
def local_forces(
    omega, cable_drag, gamma, damping, r_s, v, r_st, wanted,
    drag, pull, drag_by_v, drag_by_slope, pull_by_slope, pull_by_rate,
):  # fmt: skip
    """Drag and pull at many points, and their derivatives by v, r_s and r_st.

    omega, cable_drag, gamma, damping : parameters
    r_s, v, r_st : (k, 3), derivative by arc length, velocity through the air, rate of r_s
    wanted : whether the derivatives are
    drag, pull : (k, 3); drag_by_v, drag_by_slope, pull_by_slope, pull_by_rate : (k, 3, 3), written

    Returns the least tension of all points.
    """
    per_o2 = 1.0 / omega**2
    t = np.empty(3)
    n = np.empty(3)
    least = np.inf
    for k in range(r_s.shape[0]):
        e = np.sqrt(r_s[k, 0] ** 2 + r_s[k, 1] ** 2 + r_s[k, 2] ** 2)
        opening, v_t = 0.0, 0.0
        for a in range(3):
            t[a] = r_s[k, a] / e
            opening += t[a] * r_st[k, a]
            v_t += t[a] * v[k, a]
        p = gamma * (e - 1.0 + damping * opening)
        least = min(least, p)
        speed = 0.0
        for a in range(3):
            n[a] = v[k, a] - v_t * t[a]
            speed += n[a] ** 2
        speed = np.sqrt(speed)
        for a in range(3):
            drag[k, a] = cable_drag * speed * n[a]
            pull[k, a] = per_o2 * p * t[a]
        if not wanted:
            continue
        for a in range(3):
            for b in range(3):
                along = t[a] * t[b]
                across = (1.0 if a == b else 0.0) - along
                # The Jacobian of |v_n| v_n is |v_n| I + v_n v_n^T / |v_n|, 0 where v_n is.
                pair = n[a] * n[b] / speed if speed > 0.0 else 0.0
                drag_by_v[k, a, b] = cable_drag * (speed * across + pair)
                drag_by_slope[k, a, b] = -cable_drag / e * (
                    speed * (t[a] * n[b] + v_t * across) + v_t * pair
                )
                pull_by_slope[k, a, b] = per_o2 * (
                    gamma * along + p / e * across
                    + gamma * damping * t[a] * (r_st[k, b] - opening * t[b]) / e
                )
                pull_by_rate[k, a, b] = per_o2 * gamma * damping * along
    return least


@kernel
def element_matrix(first, second, mass, damping, stiffness, matrix):
    """Derivative of an element's residuals at all times by its unknowns at all times, transposed.

    Rows and columns run over functions, then coordinates, then times.

    first, second : (k, k), time derivatives of values at k times
    mass : (f, f); damping, stiffness : (k, f, 3, f, 3); matrix : (3 f k, 3 f k), written
    """
    times = first.shape[0]
    functions = mass.shape[0]
    for s in range(functions):
        for b in range(3):
            for i in range(times):
                column = (3 * s + b) * times + i
                for r in range(functions):
                    for a in range(3):
                        row = (3 * r + a) * times
                        for j in range(times):
                            entry = first[j, i] * damping[j, r, a, s, b]
                            if a == b:
                                entry += second[j, i] * mass[r, s]
                            matrix[column, row + j] = entry
                        matrix[column, row + i] += stiffness[i, r, a, s, b]
