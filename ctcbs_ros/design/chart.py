"""The steps of the thesis's design chart (Fig. 5.1) at one tow radius.

Speed and radius give omega, payload and cable give l, m and d_n. omega must lie above that of the
cusp, below which the end mass circles nearly as wide as the aircraft (Fig. 3.4); d_n above the
least for unique and for stable solutions (Figs. 3.3, 4.2). What then is left is to make the
end-mass radius small.
"""

from dataclasses import dataclass
from math import sqrt

from ctcbs_ros.atmosphere import GRAVITY
from ctcbs_ros.configuration import Configuration
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.critical_drag import CriticalDrag, critical_drag
from ctcbs_ros.solver.cusp import OMEGA_MAX, cusp
from ctcbs_ros.solver.first_minimum import first_minimum_state
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.surface import LocusPoint

# Thesis Table 2.1: what its figures cover.
TABLE_2_1 = {
    "omega": (0.0, 3.0),
    "end_mass": (3.5, 100.0),
    "cable_drag": (0.0, 2000.0),
    "drag_ratio": (0.1, 4.0),
    "length": (1.5, 6.0),
}


@dataclass(frozen=True)
class ChartColumn:
    """The chart at one tow radius.

    Attributes
    ----------
    radius : float
        Tow radius [m].
    parameters : Parameters
        At the lowest speed.
    omega : (float, float)
        At the lowest and the highest speed.
    cusp : LocusPoint or None
        None where no drag makes a fold.
    critical : CriticalDrag
        Least d_n for unique solutions up to `omega_max`, and for a stable first minimum.
    omega_max : float
    minimum_speed, minimum_radius : float or None
        Speed [m/s] at which the end-mass radius is least, and that radius [m]: the first minimum
        with rising speed. None where there is none up to omega 10.
    note : str
        Why figures are missing, if any are.
    """

    radius: float
    parameters: Parameters
    omega: tuple[float, float]
    cusp: LocusPoint | None
    critical: CriticalDrag
    omega_max: float
    minimum_speed: float | None
    minimum_radius: float | None
    note: str = ""

    @property
    def above_cusp(self) -> bool:
        """Whether every speed's omega is above the cusp's, or there is no cusp."""
        return self.cusp is None or bool(self.omega[0] >= self.cusp.omega)

    @property
    def enough_drag(self) -> bool:
        """Whether the cable drag is above what unique and stable solutions need."""
        required = self.critical.required
        return required is None or bool(self.parameters.cable_drag >= required)

    @property
    def outside_table_2_1(self) -> tuple[str, ...]:
        """Parameters beyond what the thesis's figures cover."""
        values = [(name, getattr(self.parameters, name)) for name in TABLE_2_1 if name != "omega"]
        values += [("omega", omega) for omega in self.omega]
        return tuple(
            dict.fromkeys(
                name
                for name, value in values
                if not TABLE_2_1[name][0] <= value <= TABLE_2_1[name][1]
            )
        )


def chart_column(configuration: Configuration, density: float, radius: float) -> ChartColumn:
    """Go through the chart at one tow radius.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    radius : float
        [m]

    Returns
    -------
    ChartColumn
    """
    slow, fast = configuration.envelope.speed
    parameters = flight_point(configuration, radius, slow, density).parameters
    unit = sqrt(radius * GRAVITY)
    omega = slow / unit, fast / unit
    omega_max = max(OMEGA_MAX, omega[1])
    found, critical, minimum, note = None, CriticalDrag(None, None, None), None, ""
    try:
        found = cusp(parameters, omega_max)
        critical = critical_drag(parameters, omega_max)
        minimum = first_minimum_state(parameters)
    except ArithmeticError as error:
        note = str(error)
    return ChartColumn(
        radius, parameters, omega, found, critical, omega_max,
        None if minimum is None else minimum.parameters.omega * unit,
        None if minimum is None else minimum.end_mass_radius * radius,
        note,
    )
