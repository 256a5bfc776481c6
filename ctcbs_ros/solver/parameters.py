"""Non-dimensional parameters of a circularly towed cable, with the thesis's symbols and Table 2.1.

Lengths are in tow radii a, times in 1/Omega (one orbit is 2 pi), tensions in mu a g, with mu the
cable's mass per length.
"""

from dataclasses import dataclass
from math import inf, isfinite, pi, sqrt

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels.trajectory import D_N, N_THETA, OMEGA, RHO, D, G, M, W

# (name, least, whether the least itself is allowed, whether infinity is)
_RANGES = (
    ("omega", 1e-6, True, False),  # its square divides the forces
    ("length", 1e-9, True, False),  # rounding alone would shape a shorter one
    ("end_mass", 0.0, False, False),
    ("cable_drag", 0.0, True, False),
    ("drag_ratio", 0.0, True, False),
    ("end_weight", 0.0, False, False),
    ("density", -inf, False, False),
    ("elasticity", 0.0, False, True),
    ("vibration_elasticity", 0.0, False, False),
    ("damping", 0.0, True, False),
)


@dataclass(frozen=True)
class Parameters:
    """A point in parameter space.

    Attributes
    ----------
    omega : float
        Angular velocity, sqrt(a Omega^2 / g).
    length : float
        Cable length l = L / a, unstretched.
    end_mass : float
        m = M / (mu a).
    cable_drag : float
        d_n = rho_air d_c C_Dn a / (2 mu).
    drag_ratio : float
        f = d / d_n, with the end-mass drag d = rho_air A_C C_D / (2 mu).
    end_weight : float
        w = W / (mu a g); nan (the default) means equal to `end_mass`, that is, no buoyancy.
    density : float
        rho, net weight of the cable per length over mu g; 1 without buoyancy.
    elasticity : float
        gamma = E A / (mu a g) of the steady state; inf is inextensible.
    vibration_elasticity : float
        gamma of the vibration where `elasticity` is inf (the thesis's 600).
    damping : float
        Time constant of the line's axial damping times Omega.

    Raises
    ------
    InputError
        If a value is not a number in its range.
    """

    omega: float
    length: float
    end_mass: float
    cable_drag: float
    drag_ratio: float
    end_weight: float = float("nan")
    density: float = 1.0
    elasticity: float = inf
    vibration_elasticity: float = 600.0
    damping: float = 0.0

    def __post_init__(self):
        """Refuse what makes no sense."""
        if self.end_weight != self.end_weight:
            object.__setattr__(self, "end_weight", self.end_mass)
        for name, least, closed, may_be_inf in _RANGES:
            value = getattr(self, name)
            try:
                value = float(value)
            except (TypeError, ValueError):
                raise InputError(f"{name}: a number is needed, got {value!r}") from None
            object.__setattr__(self, name, value)
            fits = value >= least if closed else value > least
            if not fits or not (isfinite(value) or (may_be_inf and value == inf)):
                bound = f"{'at least' if closed else 'above'} {least:g}" if least > -inf else ""
                allowed = " and ".join(
                    part for part in (bound, "" if may_be_inf else "finite") if part
                )
                raise InputError(f"{name}: {value:g} is not allowed, it must be {allowed}")

    @property
    def end_mass_drag(self) -> float:
        """The end-mass drag d = f d_n."""
        return self.drag_ratio * self.cable_drag

    @property
    def elastic(self) -> bool:
        """Whether the steady state stretches."""
        return self.elasticity != inf

    @property
    def gamma(self) -> float:
        """Elasticity of the vibration."""
        return self.elasticity if self.elastic else self.vibration_elasticity

    @property
    def band(self) -> float:
        """Largest |Im lambda| per radian that counts for the margin.

        It ends below the internal axial modes, whose damping only measures the resolution.
        """
        return min(5.0, 0.8 * pi * sqrt(self.gamma) / (self.length * self.omega))

    def theta(self, end_mass_radius: float = 1.0) -> np.ndarray:
        """Pack for the kernels, (8,), in the order of `ctcbs_ros.kernels.trajectory`."""
        theta = np.empty(N_THETA)
        theta[0] = end_mass_radius
        theta[OMEGA] = self.omega
        theta[M] = self.end_mass
        theta[W] = self.end_weight
        theta[D_N] = self.cable_drag
        theta[D] = self.end_mass_drag
        theta[RHO] = self.density
        theta[G] = 1.0 / self.elasticity
        return theta
