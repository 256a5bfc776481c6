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
        """Cache the logarithms that every look-up needs."""
        object.__setattr__(self, "_ln_radius", np.log(self.radius))
        object.__setattr__(self, "_ln_speed", np.log(self.speed))

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
        around = self.count[cell]
        if around.min() != around.max() or around.min() == 0 or self._folds_on_edge(cell):
            return None
        i, d_radius = _nearest(self._ln_radius, log(point.radius))
        j, d_speed = _nearest(self._ln_speed, log(point.speed))
        n = self.count[i, j]
        slope = self.radius_slope[i, j, :n]
        shift = slope[:, 0] * d_radius + slope[:, 1] * d_speed
        return list(self.end_mass_radius[i, j, :n] * np.exp(np.clip(shift, -0.5, 0.5)))

    def may_end(self, point: FlightPoint) -> bool:
        """Whether any branch around a point ends in a fold that the table knows of."""
        cell = self._cell(point)
        if cell is None or self.count[cell].max() > 1:
            return True
        folds = (self.fold_angular_rate[cell], self.fold_radius[cell])
        return any(np.any(np.isfinite(fold)) for fold in folds)

    def _folds_on_edge(self, cell) -> bool:
        """Whether a branch folds between two nodes of a cell: then it may hold more states."""
        radii, speeds = cell
        along_radius, along_speed = self.fold_radius[cell], self.fold_angular_rate[cell]
        width = np.diff(self._ln_radius[radii])[0]
        height = np.diff(self._ln_speed[speeds])[0]
        return bool(
            np.any(along_radius[0, ..., 1] < width)
            or np.any(along_radius[1, ..., 0] > -width)
            or np.any(along_speed[:, 0, ..., 1] < height)
            or np.any(along_speed[:, 1, ..., 0] > -height)
        )

    def _cell(self, point: FlightPoint):
        """Index of the four nodes around a point; None where the table does not apply."""
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
            lower = min(max(int(np.searchsorted(axis, value)) - 1, 0), axis.size - 2)
            index.append(slice(lower, lower + 2))
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


def _nearest(axis: np.ndarray, value: float) -> tuple[int, float]:
    """Index of the nearest grid line, and the distance from it."""
    i = int(np.argmin(np.abs(axis - value)))
    return i, value - axis[i]
