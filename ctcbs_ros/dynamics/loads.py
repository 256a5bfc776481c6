"""What a motion is judged by: tensions, energy, and the powers that change it."""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.dynamics.cable import Drive, Motion
from ctcbs_ros.dynamics.line import Line


@dataclass(frozen=True)
class Loads:
    """Forces and energies at the m times of a motion.

    Attributes
    ----------
    tensions : (m, n) ndarray
        Of the segments, the end mass's first; 0 where one is slack.
    kinetic, elastic, potential : (m,) ndarrays
        Energies; the potential one is 0 where all weight is at height 0.
    tow_power : (m,) ndarray
        What the tow point puts into nodes 0 .. n-1.
    air_power : (m,) ndarray
        What the air puts into them; in still air it is negative.
    dashpot_power : (m,) ndarray
        What the line's damping puts into them, never positive.
    """

    tensions: np.ndarray
    kinetic: np.ndarray
    elastic: np.ndarray
    potential: np.ndarray
    tow_power: np.ndarray
    air_power: np.ndarray
    dashpot_power: np.ndarray

    @property
    def energy(self) -> np.ndarray:
        """Total energy, (m,)."""
        return self.kinetic + self.elastic + self.potential


def loads(line: Line, driven: Drive, motion: Motion) -> Loads:
    """Forces and energies of a motion.

    Energies hold for a cable that is neither paid out nor hauled in.

    Parameters
    ----------
    line : Line
    driven : Drive
        What the motion was simulated with.
    motion : Motion
    """
    x, v = motion.positions, motion.velocities
    n = x.shape[1] - 1
    h = driven.length.at(motion.times) / n
    wind = driven.wind.at(motion.times)[:, None]
    end_mass, end_weight, end_drag = driven.end.at(motion.times).T
    along = np.diff(x, axis=1)
    size = np.linalg.norm(along, axis=2)
    t = along / np.maximum(size, 1e-9 * h)[..., None]
    strain = size / h - 1.0
    opening = np.einsum("mja,mja->mj", t, np.diff(v, axis=1)) / h
    growth = np.gradient(h[:, 0], motion.times) if len(h) > 1 else np.zeros(1)
    opening -= size * growth[:, None] / h**2
    spring = line.stiffness * np.maximum(strain, 0.0)
    tensions = np.where(
        strain > 0.0, np.maximum(spring + line.stiffness * line.damping * opening, 0.0), 0.0
    )
    on_nodes = np.zeros_like(x)
    per_drag = line.drag * h[..., None]
    if line.drag_at_nodes:
        chord = np.concatenate([along[:, :1], x[:, 2:] - x[:, :-2], along[:, -1:]], axis=1)
        chord /= np.maximum(np.linalg.norm(chord, axis=2), 1e-9 * h)[..., None]
        on_nodes += per_drag * _drag(v - wind, chord)
        on_nodes[:, 0] *= 0.5
    else:
        drag = per_drag * _drag(0.5 * (v[:, 1:] + v[:, :-1]) - wind, t)
        on_nodes[:, :-1] += 0.5 * drag
        on_nodes[:, 1:] += 0.5 * drag
    ball = v[:, 0] - wind[:, 0]
    on_nodes[:, 0] -= end_drag[:, None] * np.linalg.norm(ball, axis=1, keepdims=True) * ball
    mass = np.repeat(line.mass_per_length * h, n, axis=1)
    mass[:, 0] = end_mass + 0.5 * line.mass_per_length * h[:, 0]
    weight = np.repeat(line.weight_per_length * h, n, axis=1)
    weight[:, 0] = end_weight + 0.5 * line.weight_per_length * h[:, 0]
    free = v[:, :-1]
    return Loads(
        tensions=tensions,
        kinetic=0.5 * np.einsum("mi,mia,mia->m", mass, free, free),
        elastic=0.5 * np.einsum("mj,mj->m", spring, np.maximum(strain, 0.0) * h),
        potential=np.einsum("mi,mi->m", weight, x[:, :-1, 2]),
        tow_power=tensions[:, -1] * np.einsum("ma,ma->m", t[:, -1], v[:, -1]),
        air_power=np.einsum("mia,mia->m", on_nodes[:, :-1], free),
        dashpot_power=np.einsum("mj,mj->m", spring - tensions, opening * h),
    )


def _drag(air_speed, tangent):
    """Drag across a tangent per length and coefficient, (m, j, 3), of speeds against the air."""
    along = np.einsum("mja,mja->mj", air_speed, tangent)[..., None] * tangent
    across = air_speed - along
    return -np.linalg.norm(across, axis=2, keepdims=True) * across
