"""The continuation table as arrays over (tow radius, speed, state), and the look-up of guesses.

Every node holds all steady states of its point, isolated ones included, in rising end-mass radius,
each with its derivatives along radius and speed: a guess near a node is its Taylor polynomial. So
no interpolation crosses a fold, and no two branches are ever mixed.
"""

from dataclasses import dataclass, fields
from math import log

import numpy as np

from ctcbs_ros.scaling import FlightPoint

# A guess further (in ln) from what the table was built for is left to the full solve.
_BEYOND_ENVELOPE = log(1.1)
_OTHER_CONFIGURATION = log(1.15)


@dataclass(frozen=True)
class Table:
    """All states over the envelope; (r, v, s) arrays are nan where a node has fewer states.

    Attributes
    ----------
    radius : (r,) ndarray
        Tow radii [m].
    speed : (v,) ndarray
        Speeds [m/s].
    density, cable_length, end_mass : float
        Air density [kg/m^3], cable length [m] and end mass [kg] that it was built for.
    count : (r, v) int ndarray
        Number of states.
    end_mass_radius, depth, phase_lag, tension_end_mass, tension_tow_point : (r, v, s) ndarray
        Non-dimensional.
    radius_slope : (r, v, s, 2) ndarray
        d ln(end_mass_radius) by d ln(tow radius) at this speed, and by d ln(speed) at this radius.
    growth_rate, frequency : (r, v, s) ndarray
        Of the least damped mode, per radian of orbit.
    functions : (r, v, s) ndarray
        Galerkin functions that the margin converged with.
    fold_angular_rate, fold_radius : (r, v, s, 2) ndarray
        ln of the quantity at the nearest fold below and above, over its value here; nan if none.
    """

    radius: np.ndarray
    speed: np.ndarray
    density: float
    cable_length: float
    end_mass: float
    count: np.ndarray
    end_mass_radius: np.ndarray
    depth: np.ndarray
    phase_lag: np.ndarray
    tension_end_mass: np.ndarray
    tension_tow_point: np.ndarray
    radius_slope: np.ndarray
    growth_rate: np.ndarray
    frequency: np.ndarray
    functions: np.ndarray
    fold_angular_rate: np.ndarray
    fold_radius: np.ndarray

    def __post_init__(self):
        """Cache what every look-up needs: logarithms, and what is known of each cell."""
        object.__setattr__(self, "_ln_radius", np.log(self.radius))
        object.__setattr__(self, "_ln_speed", np.log(self.speed))
        object.__setattr__(self, "_is_sure", self._sure_cells())
        object.__setattr__(self, "_may_end", self._cells_with_ends())

    def guesses(self, point: FlightPoint) -> list[float] | None:
        """End-mass radii (over the tow radius) near which all states of a point lie.

        Parameters
        ----------
        point : FlightPoint

        Returns
        -------
        list of float or None
            In rising order; None outside the envelope, for another cable length, end mass or air
            density than the table is good for, and where the number of states is not sure.
        """
        cell = self._cell(point)
        if cell is None:
            return None
        if not self._is_sure[cell]:
            return None
        i, d_radius = _nearest(self._ln_radius, log(point.radius))
        j, d_speed = _nearest(self._ln_speed, log(point.speed))
        n = self.count[i, j]
        slope = self.radius_slope[i, j, :n]
        shift = slope[:, 0] * d_radius + slope[:, 1] * d_speed
        return (self.end_mass_radius[i, j, :n] * np.exp(shift.clip(-0.5, 0.5))).tolist()

    def may_end(self, point: FlightPoint) -> bool:
        """Whether any branch around a point ends in a fold that the table knows of."""
        cell = self._cell(point)
        return cell is None or bool(self._may_end[cell])

    def _sure_cells(self) -> np.ndarray:
        """Cells whose four nodes have as many states, with no fold between two of them.

        Beyond a fold that lies between two nodes a cell may hold more states.

        Returns
        -------
        (r - 1, v - 1) bool ndarray
        """
        wide = np.diff(self._ln_radius)[:, None, None]
        high = np.diff(self._ln_speed)[:, None]
        radius, rate = self.fold_radius, self.fold_angular_rate
        along_radius = np.any((radius[:-1, ..., 1] < wide) | (radius[1:, ..., 0] > -wide), axis=2)
        along_speed = np.any(
            (rate[:, :-1, :, 1] < high) | (rate[:, 1:, :, 0] > -high), axis=2
        )
        folds = along_radius[:, :-1] | along_radius[:, 1:] | along_speed[:-1] | along_speed[1:]
        count = _corners(self.count)
        return (count.min(axis=0) == count.max(axis=0)) & (count.min(axis=0) > 0) & ~folds

    def _cells_with_ends(self) -> np.ndarray:
        """Cells around which a branch ends in a fold that the table knows of, as above."""
        folds = np.isfinite(self.fold_angular_rate) | np.isfinite(self.fold_radius)
        return _corners((self.count > 1) | np.any(folds, axis=(2, 3))).any(axis=0)

    def _cell(self, point: FlightPoint) -> tuple[int, int] | None:
        """Lower indices of the four nodes around a point; None where the table does not apply."""
        for here, there in (
            (point.density, self.density),
            (point.cable_length, self.cable_length),
            (point.end_mass, self.end_mass),
        ):
            if abs(log(here / there)) > _OTHER_CONFIGURATION:
                return None
        index = []
        for axis, value in (
            (self._ln_radius, log(point.radius)),
            (self._ln_speed, log(point.speed)),
        ):
            if not axis[0] - _BEYOND_ENVELOPE <= value <= axis[-1] + _BEYOND_ENVELOPE:
                return None
            index.append(min(max(int(axis.searchsorted(value)) - 1, 0), axis.size - 2))
        return tuple(index)

    def summary(self) -> dict:
        """Figures for a person: size, envelope, number of states, margins, folds."""
        margin = -self.growth_rate / (self.radius[:, None] / self.speed[None, :])[..., None]
        several = self.count > 1
        folds = np.isfinite(self.fold_angular_rate).any() or np.isfinite(self.fold_radius).any()
        return {
            "radius_m": [float(self.radius[0]), float(self.radius[-1])],
            "speed_m_s": [float(self.speed[0]), float(self.speed[-1])],
            "nodes": list(self.count.shape),
            "cable_length_m": self.cable_length,
            "end_mass_kg": self.end_mass,
            "air_density_kg_m3": self.density,
            "states": [int(self.count.min()), int(self.count.max())],
            "nodes_with_several_states": int(several.sum()),
            "branches_end_in_folds": bool(folds),
            "margin_per_s": [float(np.nanmin(margin)), float(np.nanmax(margin))],
            "unstable_states": int((self.growth_rate >= 0.0).sum()),
            "size_bytes": int(sum(np.asarray(getattr(self, f.name)).nbytes for f in fields(self))),
        }


def _corners(nodes: np.ndarray) -> np.ndarray:
    """What the four nodes of each cell have, (4, r - 1, v - 1), of an array over the nodes."""
    return np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[:-1, 1:], nodes[1:, 1:]])


def _nearest(axis: np.ndarray, value: float) -> tuple[int, float]:
    """Index of the nearest grid line, and the distance from it."""
    i = int(np.argmin(np.abs(axis - value)))
    return i, value - axis[i]
