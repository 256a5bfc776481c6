"""The tension that a motion needs, by the equations of motion from the end mass up.

What the motion's stretch says of it is the stretch's error times the elasticity: of a stiff cable
in few orders and elements, nothing. Weight, drag and inertia need no more than the motion's place.
"""

from functools import lru_cache

import numpy as np

from ctcbs_ros.periodic.elements import at_arc_lengths
from ctcbs_ros.periodic.forces import end_drag, forces
from ctcbs_ros.periodic.fourier import at_times, fourier
from ctcbs_ros.periodic.motion import PeriodicMotion


def under_tension(
    motion: PeriodicMotion, points: int, when: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slope, velocity through the air and rate of the slope along the cable, (k, q, 3) each.

    Parameters
    ----------
    motion : PeriodicMotion
    points : int
        q, Gauss points along the cable, the lowest first.
    when : (k,) ndarray
        Times.

    Returns
    -------
    tuple of ndarray
        In the ground frame. The slope has the motion's direction, and the length that gives the
        cable the tension which the motion needs: of an exact motion it is the motion's own.
    """
    p = motion.parameters
    nodes = 0.5 * p.length * (1.0 + _gauss(points)[0])
    waves = fourier(motion.values)
    place, rate, push = (at_times(waves, when, order) for order in range(3))
    _, velocity, acceleration = motion.path.motion(when)
    velocity = velocity - [motion.path.air_velocity, 0.0, 0.0]

    def along(values, order=0):
        return np.moveaxis(at_arc_lengths(values, p.length, nodes, order), 1, -1)

    slope, opening = along(place, 1), along(rate, 1)
    through = along(rate) + velocity[:, None]
    direction = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    load = along(push) + acceleration[:, None] + forces(p, slope, through, opening, False).drag
    load[..., 2] += p.density / p.omega**2
    at_end = p.end_mass * (push[..., 0] + acceleration) + end_drag(p, velocity + rate[..., 0])[0]
    at_end[:, 2] += p.end_weight / p.omega**2
    pull = at_end[:, None] + 0.5 * p.length * np.einsum("ij,kja->kia", _gauss(points)[1], load)
    # A cable bears none below 0: what the few orders of a coarse motion say of it may be below,
    # and would let its shortest waves grow.
    tension = np.maximum(p.omega**2 * np.sum(pull * direction, axis=-1), 0.0)
    strain = tension / p.gamma - p.damping * np.sum(opening * direction, axis=-1)
    return direction * (1.0 + strain)[..., None], through, opening


@lru_cache(maxsize=16)
def _gauss(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points in [-1, 1], and what makes integrals from -1 up to them of values there."""
    legendre = np.polynomial.legendre
    x, w = legendre.leggauss(points)
    coefficients = (np.arange(points)[:, None] + 0.5) * legendre.legvander(x, points - 1).T * w
    integrals = [legendre.legval(x, legendre.legint(one, lbnd=-1)) for one in np.eye(points)]
    return x, np.array(integrals).T @ coefficients
