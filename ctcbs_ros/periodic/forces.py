"""Drag and tension of a moving cable and its end mass, in arrays of any arrangement."""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.kernels.cable_waves import local_forces
from ctcbs_ros.solver.parameters import Parameters


@dataclass(frozen=True)
class Local:
    """Forces at the points of a cable at several times, and their derivatives (see the kernel).

    Attributes
    ----------
    drag, pull : (k, ..., 3) ndarrays
    drag_by_v, drag_by_slope, pull_by_slope, pull_by_rate : (k, ..., 3, 3) ndarrays
        Empty where they were not wanted.
    least_tension : float
    """

    drag: np.ndarray
    pull: np.ndarray
    drag_by_v: np.ndarray
    drag_by_slope: np.ndarray
    pull_by_slope: np.ndarray
    pull_by_rate: np.ndarray
    least_tension: float


def forces(p: Parameters, r_s, v, r_st, wanted: bool = True) -> Local:
    """Forces at points of any arrangement: r_s, v through the air, and r_st are (..., 3)."""
    shape = r_s.shape
    flat = [np.ascontiguousarray(a).reshape(-1, 3) for a in (r_s, v, r_st)]
    points = flat[0].shape[0]
    drag, pull = np.empty((points, 3)), np.empty((points, 3))
    some = (points, 3, 3) if wanted else (0, 3, 3)
    by = [np.empty(some) for _ in range(4)]
    least = local_forces(
        p.omega, p.cable_drag, p.gamma, p.damping, *flat, wanted, drag, pull, *by
    )
    if wanted:
        by = [a.reshape(*shape, 3) for a in by]
    return Local(drag.reshape(shape), pull.reshape(shape), *by, float(least))


def end_drag(p: Parameters, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drag of the end mass at velocities (k, 3) through the air, and its derivative (k, 3, 3)."""
    speed = np.linalg.norm(v, axis=-1)[:, None, None]
    pair = v[:, :, None] * v[:, None, :] / np.maximum(speed, 1e-300)
    d = p.end_mass_drag
    return d * speed[:, :, 0] * v, d * (speed * np.eye(3) + pair)
