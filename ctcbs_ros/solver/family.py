"""One-parameter changes of the flight: what varies, and how each parameter follows.

Each is a power law in every non-dimensional parameter; tau is the logarithm of what varies. Two
are what a pilot can do: change the angular rate at this radius, change the radius at this speed.
"""

from dataclasses import dataclass, replace
from math import exp, inf, log

import numpy as np

from ctcbs_ros.kernels.trajectory import D_N, N_THETA, OMEGA, D, G, M, W
from ctcbs_ros.solver.parameters import Parameters


@dataclass(frozen=True)
class Family:
    """Exponents of the parameters along a family.

    `elasticity` is that of the vibration, too; `rate`, that of Omega, scales the damping.
    """

    name: str
    omega: float = 0.0
    length: float = 0.0
    mass: float = 0.0
    cable_drag: float = 0.0
    end_mass_drag: float = 0.0
    elasticity: float = 0.0
    rate: float = 0.0

    def exponents(self) -> np.ndarray:
        """Exponents in the order of the kernels' theta, (8,)."""
        e = np.zeros(N_THETA)
        e[OMEGA] = self.omega
        e[M] = e[W] = self.mass
        e[D_N] = self.cable_drag
        e[D] = self.end_mass_drag
        e[G] = -self.elasticity
        return e

    def at(self, parameters: Parameters, tau: float) -> Parameters:
        """The parameters at tau; tau = 0 gives `parameters` themselves."""
        return replace(
            parameters,
            omega=parameters.omega * exp(self.omega * tau),
            length=parameters.length * exp(self.length * tau),
            end_mass=parameters.end_mass * exp(self.mass * tau),
            end_weight=parameters.end_weight * exp(self.mass * tau),
            cable_drag=parameters.cable_drag * exp(self.cable_drag * tau),
            drag_ratio=parameters.drag_ratio * exp((self.end_mass_drag - self.cable_drag) * tau),
            elasticity=parameters.elasticity * exp(self.elasticity * tau),
            vibration_elasticity=parameters.vibration_elasticity * exp(self.elasticity * tau),
            # The time constant of the line does not change, its product with Omega does.
            damping=parameters.damping * exp(self.rate * tau),
        )


# Angular rate (or speed) at fixed tow radius: omega = Omega sqrt(a / g).
ANGULAR_RATE = Family("angular_rate", omega=1.0, rate=1.0)
# Tow radius at fixed speed: lengths, masses and gamma are in units of a, d_n is proportional to a.
RADIUS_AT_SPEED = Family(
    "radius", omega=-0.5, length=-1.0, mass=-1.0, cable_drag=1.0, elasticity=-1.0, rate=-1.0
)


def at_omega_one(parameters: Parameters) -> Parameters:
    """Those at omega = 1 and the same tow radius: from there tau of `ANGULAR_RATE` is ln omega."""
    return ANGULAR_RATE.at(parameters, -log(parameters.omega))


def family_between(start: Parameters, end: Parameters) -> tuple[Family, float]:
    """The family that leads from one parameter point to another, and the tau of the other.

    Air buoyancy of the cable (`density`) stays that of the start: it is no power law, and changes
    by parts in a thousand.
    """
    def ratio(name):
        before, after = getattr(start, name), getattr(end, name)
        # What is nothing or infinite (no drag, no stretch) is no power law, and stays.
        return log(after / before) if 0.0 < before < inf and 0.0 < after < inf else 0.0

    changes = {
        "omega": ratio("omega"),
        "length": ratio("length"),
        "mass": ratio("end_mass"),
        "cable_drag": ratio("cable_drag"),
        "end_mass_drag": ratio("end_mass_drag"),
        "elasticity": ratio("gamma") if start.elastic == end.elastic else 0.0,
        "rate": ratio("damping"),
    }
    distance = max(sum(change**2 for change in changes.values()) ** 0.5, 1e-12)
    scaled = {name: change / distance for name, change in changes.items()}
    return Family("between", **scaled), distance
