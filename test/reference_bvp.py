"""Steady states by means that share no code with the solver, from the thesis's equations alone.

Two ways, neither the solver's:

* `boundary_value_problem`: scipy.integrate.solve_bvp on the unit tangent t and the closed form of
  the tension, p + p^2/(2 gamma) = P(0) + rho z + omega^2/2 (x_d^2 - x^2 - y^2), x_d an unknown;
* `brute_force`: scipy's DOP853 over a fine grid of x_d, its sign changes refined by brentq.

A point is a plain dict: omega, l, m, d_n, f, and where they differ from the default w (= m),
rho (= 1), gamma (= inf).
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq


@dataclass(frozen=True)
class Reference:
    """A steady state of the reference."""

    x_d: float
    depth: float
    lag: float
    tension_end_mass: float
    tension_tow_point: float


def filled(point):
    """The point with its defaults: (omega, l, m, w, d_n, d, rho, 1/gamma)."""
    m, d_n = point["m"], point["d_n"]
    return (
        point["omega"], point["l"], m, point.get("w", m), d_n, point["f"] * d_n,
        point.get("rho", 1.0), 1.0 / point.get("gamma", np.inf),
    )  # fmt: skip


def load(point, x, y, t):
    """Right-hand side of d(p t)/ds on unit tangents t, (3, ...)."""
    omega, _, _, _, d_n, _, rho, _ = filled(point)
    v = np.array([-y, x, np.zeros_like(x)])
    v_n = v - np.sum(v * t, axis=0) * t
    f = omega**2 * d_n * np.sqrt(np.sum(v_n * v_n, axis=0)) * v_n
    f[0] -= omega**2 * x
    f[1] -= omega**2 * y
    f[2] += rho
    return f


def end_force(point, x_d):
    """p t at the end mass."""
    omega, _, m, w, _, d, _, _ = filled(point)
    return np.array([-(omega**2) * m * x_d, omega**2 * d * x_d**2, w * np.ones_like(x_d)])


def shoot(point, x_d, rtol=1e-9, dense=None):
    """States (6, n) at the tow point, p t integrated upwards from every x_d, (n,), at once.

    With `dense` (arc lengths) the states there, (6, n, len(dense)).
    """
    x_d = np.atleast_1d(np.asarray(x_d, float))
    length, g = point["l"], filled(point)[-1]
    n = x_d.size

    def rhs(_, flat):
        y = flat.reshape(6, n)
        p = np.sqrt(np.sum(y[3:] ** 2, axis=0))
        t = y[3:] / p
        return np.concatenate([(1.0 + g * p) * t, load(point, y[0], y[1], t)]).ravel()

    start = np.zeros((6, n))
    start[0] = x_d
    start[3:] = end_force(point, x_d)
    scale = np.repeat(np.maximum(np.abs(start).max(axis=0)[None, :] * 1e-3, 1e-12), 6, axis=0)
    solution = solve_ivp(
        rhs, (0.0, length), start.ravel(), "DOP853", rtol=rtol, atol=rtol * scale.ravel(),
        t_eval=dense,
    )
    assert solution.success
    if dense is None:
        return solution.y[:, -1].reshape(6, n)
    return solution.y.reshape(6, n, -1)


def greatest_tension(point, x_d):
    """Largest |p t| along the cable: scipy's dense output on a fine grid, then a parabola."""
    s = np.linspace(0.0, point["l"], 4001)
    p = np.linalg.norm(shoot(point, x_d, 1e-11, s)[3:, 0], axis=0)
    i = int(p.argmax())
    if i in (0, s.size - 1):
        return p[i]
    left, right = p[i - 1] - p[i], p[i + 1] - p[i]
    return p[i] - (right - left) ** 2 / (8.0 * (left + right))


def residual(point, x_d, rtol=1e-9):
    """x^2 + y^2 - 1 at the tow point, (n,)."""
    end = shoot(point, x_d, rtol)
    return end[0] ** 2 + end[1] ** 2 - 1.0


def grid(point, n, most_strain=3.0):
    """n end-mass radii in rising order, in each decade that matters."""
    length = point["l"] * (1.0 + (most_strain if filled(point)[-1] > 0.0 else 0.0))
    most = 1.0 + length
    return np.unique(
        np.concatenate([np.geomspace(1e-9, most, n // 2), np.linspace(0.01, most, n - n // 2)])
    )


def brute_force(point, n=600, batch=60, closest=None):
    """All x_d with the tow point on the unit circle, from a fine scan; (k,) rising.

    `closest`, a list, takes the least |x^2 + y^2 - 1| of the extrema that do not reach zero: a
    count is only certain when none is small.
    """
    x = grid(point, n)
    h = np.concatenate(
        [residual(point, x[i : i + batch], 1e-7) for i in range(0, x.size, batch)]
    )
    # Where h bends towards zero between nodes, look closer before counting.
    for _ in range(2):
        bends = [
            i for i in range(1, x.size - 1)
            if abs(h[i]) < min(abs(h[i - 1]), abs(h[i + 1])) and h[i - 1] * h[i + 1] > 0.0
            and h[i] * h[i - 1] > 0.0 and abs(h[i]) < 0.3
        ]  # fmt: skip
        if not bends:
            break
        new = np.unique(np.concatenate([np.linspace(x[i - 1], x[i + 1], 22)[1:-1] for i in bends]))
        x = np.concatenate([x, new])
        h = np.concatenate([h, residual(point, new, 1e-9)])
        x, unique = np.unique(x, return_index=True)
        h = h[unique]
    if closest is not None:
        closest += [abs(h[i]) for i in range(1, x.size - 1)
                    if abs(h[i]) <= min(abs(h[i - 1]), abs(h[i + 1]))
                    and h[i] * h[i - 1] > 0.0 and h[i] * h[i + 1] > 0.0]  # fmt: skip
    return np.array(
        [
            brentq(lambda v: residual(point, v, 1e-12)[0], x[i], x[i + 1], xtol=1e-13, rtol=1e-12)
            for i in np.flatnonzero(h[:-1] * h[1:] < 0.0)
        ]
    )


def boundary_value_problem(point, x_d, tol=1e-9, nodes=400):
    """Solve for the state near x_d by collocation.

    Returns
    -------
    Reference, and a function of arc length giving (x, y, z, t_x, t_y, t_z)
    """
    omega, length, _, _, _, _, rho, g = filled(point)

    def tension(y, x_d):
        p_d = np.linalg.norm(end_force(point, x_d))
        total = p_d + 0.5 * g * p_d**2
        total = total + rho * y[2] + 0.5 * omega**2 * (x_d**2 - y[0] ** 2 - y[1] ** 2)
        # The root of p + g p^2/2 = total that stays finite for g = 0.
        return 2.0 * total / (1.0 + np.sqrt(1.0 + 2.0 * g * total))

    def rhs(_, y, unknown):
        p = tension(y, unknown[0])
        t = y[3:]
        f = load(point, y[0], y[1], t)
        return np.vstack([(1.0 + g * p) * t, (f - np.sum(f * t, axis=0) * t) / p])

    def ends(bottom, top, unknown):
        force = end_force(point, unknown[0])
        return np.concatenate(
            [
                bottom[:3] - [unknown[0], 0.0, 0.0],
                bottom[3:] - force / np.linalg.norm(force),
                [top[0] ** 2 + top[1] ** 2 - 1.0],
            ]
        )

    s = np.linspace(0.0, length, nodes)
    guess = shoot(point, [x_d], 1e-8, s)[:, 0]
    guess[3:] /= np.linalg.norm(guess[3:], axis=0)
    found = solve_bvp(rhs, ends, s, guess, p=[x_d], tol=tol, max_nodes=200_000)
    assert found.success, found.message
    top, radius = found.y[:, -1], found.p[0]
    reference = Reference(
        radius, top[2], np.arctan2(top[1], top[0]) % (2.0 * np.pi),
        tension(found.y[:, 0], radius), tension(top, radius),
    )  # fmt: skip
    return reference, found.sol
