"""Peer: the cable as an initial-value problem with scipy, as one would write it by hand.

`solve_ivp` from the end mass to the tow point for many trial radii at once; all states by a scan
and `brentq`, the cusp by `scipy.optimize.root` on differences. It shares nothing with the solver
but the equations (docs/thesis.md), so it judges the solver's accuracy as well as its speed.
"""

from math import exp, inf, log

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, newton, root

from ctcbs_ros.solver.parameters import Parameters

SCAN = 300
_MOST_STRAIN = 3.0


def end_force(p: Parameters, end_mass_radius):
    """Tension vector at the end mass, (3, ...)."""
    x = end_mass_radius
    o2 = p.omega**2
    return np.array([-o2 * p.end_mass * x, o2 * p.end_mass_drag * x * x, p.end_weight + 0.0 * x])


def slope(p: Parameters, position, force):
    """Slopes of position and tension vector along the cable, each (3, n)."""
    o2 = p.omega**2
    x, y, _ = position
    tension = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    tx, ty, tz = force / tension
    along = x * ty - y * tx
    nx, ny, nz = -y - along * tx, x - along * ty, -along * tz
    drag = o2 * p.cable_drag * np.sqrt(nx * nx + ny * ny + nz * nz)
    stretch = 1.0 + tension / p.elasticity
    return (
        np.array([stretch * tx, stretch * ty, stretch * tz]),
        np.array([drag * nx - o2 * x, drag * ny - o2 * y, drag * nz + p.density]),
    )


def shapes(p: Parameters, radii, arc_lengths, rtol) -> np.ndarray:
    """Position and tension vector, (6, n, k), of n end-mass radii at k arc lengths."""
    radii = np.atleast_1d(np.asarray(radii, float))
    start = np.zeros((6, radii.size))
    start[0], start[3:] = radii, end_force(p, radii)

    def rhs(_, flat):
        y = flat.reshape(6, -1)
        return np.concatenate(slope(p, y[:3], y[3:])).ravel()

    size = np.concatenate([np.ones(3), np.full(3, np.abs(start[3:]).max())])
    flown = solve_ivp(
        rhs, (0.0, p.length), start.ravel(), "DOP853", t_eval=arc_lengths, rtol=rtol,
        atol=0.01 * rtol * np.repeat(size, radii.size),
    )  # fmt: skip
    return flown.y.reshape(6, radii.size, -1)


def miss(p: Parameters, radii, rtol) -> np.ndarray:
    """x^2 + y^2 - 1 at the tow point, (n,), thesis (2.17)."""
    end = shapes(p, radii, (p.length,), rtol)[:, :, -1]
    return end[0] ** 2 + end[1] ** 2 - 1.0


def all_states(p: Parameters, scan: int = SCAN) -> np.ndarray:
    """End-mass radii of all states that a scan of `scan` trial radii shows, rising."""
    most = 1.0 + p.length * (1.0 + (_MOST_STRAIN if p.elasticity < inf else 0.0))
    radii = np.unique(
        np.concatenate(
            [np.geomspace(1e-7, most, scan // 2), np.linspace(0.01, most, scan - scan // 2)]
        )
    )
    h = miss(p, radii, 1e-6)
    return np.array(
        [
            brentq(lambda x: miss(p, x, 1e-11)[0], radii[i], radii[i + 1], rtol=1e-10)
            for i in np.flatnonzero(h[:-1] * h[1:] < 0.0)
        ]
    )


def tight_state(p: Parameters, end_mass_radius: float) -> float:
    """The end-mass radius near a given one, integrated to the last digits of a double."""
    return newton(
        lambda x: miss(p, x, 1e-13)[0], end_mass_radius, x1=end_mass_radius * (1.0 + 1e-6),
        tol=1e-13 * end_mass_radius,
    )  # fmt: skip


def cusp(p: Parameters, omega, cable_drag, end_mass_radius) -> tuple[float, float, float]:
    """The cusp near (omega, d_n, end-mass radius), at a fixed drag ratio.

    h = h_u = h_uu = 0, u = ln(end-mass radius), by five-point differences of one vectorised
    integration, and scipy's `root`.
    """
    step = 0.02
    shifts = step * np.arange(-2, 3)

    def equations(z):
        here = Parameters(
            exp(z[0]), p.length, p.end_mass, exp(z[1]), p.drag_ratio, elasticity=p.elasticity
        )
        h = miss(here, np.exp(z[2] + shifts), 1e-11)
        first = h @ np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * step)
        second = h @ np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * step**2)
        return h[2], first, second

    found = root(equations, (log(omega), log(cable_drag), log(end_mass_radius)), tol=1e-9)
    return tuple(np.exp(found.x).tolist())
