"""SI to non-dimensional parameters and back: the one place where the two meet."""

from dataclasses import dataclass
from math import inf, sqrt

from ctcbs_ros.atmosphere import GRAVITY
from ctcbs_ros.configuration import Configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import Stability
from ctcbs_ros.solver.steady_state import SteadyState


@dataclass(frozen=True)
class FlightPoint:
    """What is flown, in SI units, and its non-dimensional parameters.

    Attributes
    ----------
    radius : float
        Tow radius a [m].
    speed : float
        Tow speed V [m/s].
    density : float
        Air density [kg/m^3].
    cable_length : float
        Unstretched length paid out [m].
    end_mass : float
        Mass at the end [kg].
    mass_per_length : float
        mu [kg/m].
    parameters : Parameters
    """

    radius: float
    speed: float
    density: float
    cable_length: float
    end_mass: float
    mass_per_length: float
    parameters: Parameters

    @property
    def angular_rate(self) -> float:
        """Omega [rad/s], the unit of rates."""
        return self.speed / self.radius

    @property
    def tension_unit(self) -> float:
        """mu a g [N], the unit of tensions."""
        return self.mass_per_length * self.radius * GRAVITY

    def state_si(self, state: SteadyState, stability: Stability) -> dict:
        """The figures of a steady state in SI units, the unit at the end of each name."""
        return {
            "end_mass_radius_m": state.end_mass_radius * self.radius,
            "depth_m": state.depth * self.radius,
            "phase_lag_rad": state.phase_lag,
            "tension_end_mass_n": state.tension_end_mass * self.tension_unit,
            "tension_tow_point_n": state.tension_tow_point * self.tension_unit,
            "greatest_tension_n": state.greatest_tension * self.tension_unit,
            "growth_rate_per_s": stability.growth_rate * self.angular_rate,
            "frequency_per_s": stability.frequency * self.angular_rate,
        }


def flight_point(
    configuration: Configuration,
    radius: float,
    speed: float,
    density: float,
    cable_length: float | None = None,
    end_mass: float | None = None,
) -> FlightPoint:
    """Scale a configuration flown at a radius and a speed.

    Parameters
    ----------
    configuration : Configuration
    radius : float
        Tow radius [m].
    speed : float
        Tow speed [m/s].
    density : float
        Air density [kg/m^3].
    cable_length, end_mass : float, optional
        Where they differ from the configuration now [m], [kg].

    Returns
    -------
    FlightPoint

    Raises
    ------
    InputError
        If a quantity is not positive and finite.

    Notes
    -----
    Thesis (2.3)-(2.5), (2.8), (2.22), (2.23). Buoyancy is counted, of the end mass and of the
    cable, where the end mass's displaced volume is given.
    """
    cable, mass = configuration.cable, configuration.end_mass
    cable_length = cable.length if cable_length is None else cable_length
    end_mass = mass.mass if end_mass is None else end_mass
    for name, value, unit in (
        ("radius", radius, "m"), ("speed", speed, "m/s"), ("air density", density, "kg/m^3"),
        ("cable length", cable_length, "m"), ("end mass", end_mass, "kg"),
    ):
        if not 0.0 < value < inf:
            raise InputError(
                f"{name}: {value:g} {unit} is not allowed, it must be above 0 and finite"
            )
    mu = cable.mass_per_length
    buoyant = mass.displaced_volume > 0.0
    net_mass = end_mass - (density * mass.displaced_volume if buoyant else 0.0)
    if net_mass <= 0.0:
        raise InputError(
            f"end mass: {end_mass:g} kg is lighter than the air it displaces, "
            f"{end_mass - net_mass:g} kg"
        )
    cable_drag = 0.5 * density * cable.diameter * cable.drag_coefficient * radius / mu
    end_mass_drag = 0.5 * density * mass.frontal_area * mass.drag_coefficient / mu
    parameters = Parameters(
        omega=speed / sqrt(radius * GRAVITY),
        length=cable_length / radius,
        end_mass=end_mass / (mu * radius),
        cable_drag=cable_drag,
        drag_ratio=end_mass_drag / cable_drag,
        end_weight=net_mass / (mu * radius),
        density=1.0 - density * cable.area / mu if buoyant else 1.0,
        elasticity=cable.youngs_modulus / (cable.density * radius * GRAVITY),
        damping=cable.axial_damping * speed / radius,
    )
    return FlightPoint(radius, speed, density, cable_length, end_mass, mu, parameters)
