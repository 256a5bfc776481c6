"""The linearised cable by shooting: what moves the tow point, from what moves the end mass.

Newton's law of a piece of cable and of the end mass in the rotating frame, linearised by complex
steps and integrated from the end mass up with scipy. With displacements growing as exp(lambda t),
lambda is an eigenvalue where the determinant is zero (an Evans function); no functions are chosen
and nothing has to converge. An inextensible cable is one with 1/gamma = 0, in its vibration too.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

UP = np.array([0.0, 0.0, 1.0])
STEP = 1e-30


def turned(a):
    """k x a."""
    return np.array([-a[1], a[0], 0.0 * a[0]])


def square_law(v):
    """|v| v, without abs, for complex steps."""
    square = v @ v
    return np.sqrt(square) * v if square.real > 0.0 else 0.0 * v


def motion(r, growth):
    """Velocity and acceleration of a displacement r exp(growth t) of the rotating frame."""
    velocity = growth * r + turned(r)
    return velocity, growth * velocity + turned(velocity)


def tow_point_matrix(p, end_mass_radius, growth=0.0):
    """Displacements of the upper end by those of the end mass, (3, 3), at a real growth rate."""
    square, compliance = p.omega**2, 1.0 / p.elasticity

    def upward(r, force, v, a):
        t = force / np.sqrt(force @ force)
        drag = p.cable_drag * square_law(v - (v @ t) * t)
        return np.concatenate([t + compliance * force, p.density * UP + square * (a + drag)])

    def end_force(v, a):
        return p.end_weight * UP + square * (p.end_mass * a + p.end_mass_drag * square_law(v))

    def column(function, *places_and_changes):
        moved = [place + 1j * STEP * change for place, change in places_and_changes]
        return function(*moved).imag / STEP

    def right_side(_, y):
        r, force = y[:3], y[3:6]
        at_rest = motion(r, 0.0)
        out = [upward(r, force, *at_rest)]
        for u, g in y[6:].reshape(3, 2, 3):
            moved = zip(at_rest, motion(u, growth), strict=True)
            out.append(column(upward, (r, u), (force, g), *moved))
        return np.concatenate(out)

    r = np.array([end_mass_radius, 0.0, 0.0])
    at_rest = motion(r, 0.0)
    start = [r, end_force(*at_rest)]
    for u in np.eye(3):
        moved = zip(at_rest, motion(u, growth), strict=True)
        start += [u, column(end_force, *moved)]
    end = solve_ivp(
        right_side, (0.0, p.length), np.concatenate(start), method="DOP853", rtol=1e-9, atol=1e-11
    ).y[:, -1]
    return end[6:].reshape(3, 2, 3)[:, 0].T


def divergence_rate(p, end_mass_radius, most=5.0):
    """The real growth rate between 0 and `most` at which the tow point need not move."""
    return brentq(
        lambda x: np.linalg.det(tow_point_matrix(p, end_mass_radius, x)), 0.0, most, rtol=1e-6
    )
