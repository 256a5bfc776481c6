"""What a cable and its end mass are, in any consistent units: what the forces need of them."""

from dataclasses import dataclass, fields
from math import inf, isfinite

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels.cable_forces import (
    DAMPING,
    DRAG,
    DRAG_AT_NODES,
    MASS,
    N_LINE,
    STIFFNESS,
    WEIGHT,
)
from ctcbs_ros.solver.parameters import Parameters

_POSITIVE = ("mass_per_length", "stiffness", "length", "end_mass", "end_weight")
_NOT_NEGATIVE = ("damping", "drag", "end_drag")


@dataclass(frozen=True)
class Line:
    """A cable with its end mass, as it is at the beginning.

    In SI, or non-dimensional (lengths in tow radii, times in 1/Omega, masses in mu a).

    Attributes
    ----------
    mass_per_length : float
        mu [kg/m].
    stiffness : float
        EA [N].
    weight_per_length : float
        Net of buoyancy [N/m].
    drag : float
        0.5 rho_air d_c C_Dn, the force per length and speed squared across the cable [kg/m^2].
    length : float
        Unstretched [m].
    end_mass, end_weight, end_drag : float
        Mass [kg], net weight [N] and 0.5 rho_air A_C C_D [kg/m] of the end mass.
    damping : float
        Time constant of the axial dashpots [s].
    drag_at_nodes : bool
        Whether the cable's drag is taken at the nodes, as MoorDyn does, or in the middle of the
        segments, which is the more accurate (`ctcbs_ros.kernels.cable_forces`).
    """

    mass_per_length: float
    stiffness: float
    weight_per_length: float
    drag: float
    length: float
    end_mass: float
    end_weight: float
    end_drag: float
    damping: float = 0.0
    drag_at_nodes: bool = False

    def __post_init__(self):
        """Refuse what makes no sense."""
        for field in fields(self):
            value = getattr(self, field.name)
            least = 0.0 if field.name in _POSITIVE + _NOT_NEGATIVE else -inf
            fits = value > least or (value == least and field.name in _NOT_NEGATIVE)
            if not (isfinite(value) and fits):
                bound = {True: "above 0 and ", False: "at least 0 and "}[field.name in _POSITIVE]
                bound = bound if least == 0.0 else ""
                raise InputError(
                    f"{field.name}: {value:g} is not allowed, it must be {bound}finite"
                )

    def packed(self) -> np.ndarray:
        """For the kernels, (6,), in the order of `ctcbs_ros.kernels.cable_forces`."""
        line = np.empty(N_LINE)
        line[MASS] = self.mass_per_length
        line[STIFFNESS] = self.stiffness
        line[DAMPING] = self.damping
        line[WEIGHT] = self.weight_per_length
        line[DRAG] = self.drag
        line[DRAG_AT_NODES] = self.drag_at_nodes
        return line

    def scaled(self, length_unit: float, time_unit: float, mass_unit: float) -> "Line":
        """The same line with every quantity times its unit, as from non-dimensional to SI.

        For `line_of`'s lines the units are a, 1/Omega and mu a.
        """
        force = mass_unit * length_unit / time_unit**2
        return Line(
            mass_per_length=self.mass_per_length * mass_unit / length_unit,
            stiffness=self.stiffness * force,
            weight_per_length=self.weight_per_length * force / length_unit,
            drag=self.drag * mass_unit / length_unit**2,
            length=self.length * length_unit,
            end_mass=self.end_mass * mass_unit,
            end_weight=self.end_weight * force,
            end_drag=self.end_drag * mass_unit / length_unit,
            damping=self.damping * time_unit,
            drag_at_nodes=self.drag_at_nodes,
        )

    @property
    def end(self) -> np.ndarray:
        """End mass, its weight and its drag for the kernels, (3,)."""
        return np.array([self.end_mass, self.end_weight, self.end_drag])


def line_of(parameters: Parameters, drag_at_nodes: bool = False) -> Line:
    """Non-dimensional line of a parameter point: radii a, times 1/Omega, masses mu a.

    A force's unit is then mu a^2 Omega^2, omega^2 times the solver's mu a g.
    An inextensible point takes its `vibration_elasticity`: a line in time always stretches.
    """
    p = parameters
    square = p.omega**2
    return Line(
        mass_per_length=1.0,
        stiffness=p.gamma / square,
        weight_per_length=p.density / square,
        drag=p.cable_drag,
        length=p.length,
        end_mass=p.end_mass,
        end_weight=p.end_weight / square,
        end_drag=p.end_mass_drag,
        damping=p.damping,
        drag_at_nodes=drag_at_nodes,
    )
