"""What is flown by MoorDyn and by the product: the cases, all with one end mass and one line."""

from dataclasses import dataclass

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.parameters import Parameters

# The runs have these segments, and those of steady states and winds half of them as well.
SEGMENTS = 40


@dataclass(frozen=True)
class Case:
    """A circle, with wind or without.

    Attributes
    ----------
    name : str
    parameters : Parameters
    wind : float
        Over the tow speed, towards +x.
    winch : (float, float, float) or None
        Where the length paid out changes, evenly: when that begins and ends in MoorDyn's time [s],
        and to how much of the first.
    duration, step : float
        Of MoorDyn's run, and its time step [s]; a minute of it takes the tow point from rest to
        its rate.
    """

    name: str
    parameters: Parameters
    wind: float = 0.0
    duration: float = 500.0
    step: float = 0.01
    winch: tuple[float, float, float] | None = None


def _design() -> Parameters:
    """The thesis's design example (Chapter 5) at its largest radius."""
    return flight_point(load_configuration("design_example"), 250.0, 50.0, 1.18).parameters


# Thesis Fig. 3.1, d_n 10, with the stretch of gamma 600; nearly inextensible; Fig. 4.1, d_n 3.
SOFT = Parameters(1.6, 3.0, 50.0, 10.0, 1.0, elasticity=600.0)
STIFF = Parameters(1.6, 3.0, 50.0, 10.0, 1.0, elasticity=6e4)
LIGHT = Parameters(2.0, 3.0, 3.5, 3.0, 0.1, elasticity=600.0)
DESIGN = _design()

STEADY = (
    Case("gamma 600", SOFT, duration=1300.0),
    Case("design example", DESIGN, duration=900.0),
    Case("Fig. 4.1, d_n 3", LIGHT, duration=900.0),
)
ENTRIES = (
    Case("gamma 600", SOFT),
    Case("design example", DESIGN),
    Case("gamma 60,000", STIFF, duration=150.0, step=0.001),
)
# From 400 s on one mode is left of the way to the steady state.
DECAY = Case("gamma 600", SOFT, duration=900.0)
# Stable at 0.32 of the tow radius, which a rough entry misses.
ROUGH = Case(
    "Fig. 4.1, d_n 1.33, omega 2.4", Parameters(2.4, 3.0, 3.5, 1.33, 0.1, elasticity=600.0)
)
# Reeled out to more than a tenth longer, and in, on the circle.
WINCHES = (
    Case("gamma 600, reeled out by 15 %", SOFT, duration=300.0, winch=(120.0, 220.0, 1.15)),
    Case("design example, reeled in by 15 %", DESIGN, duration=300.0, winch=(120.0, 220.0, 0.85)),
)
WINDS = (
    Case("design example, 5 %", DESIGN, 0.05, 600.0),
    Case("design example, 10 %", DESIGN, 0.10, 600.0),
    Case("design example, 20 %", DESIGN, 0.20, 600.0),
    Case("gamma 600, 10 %", SOFT, 0.10, 1200.0),
    Case("Fig. 4.1, d_n 3, 10 %", LIGHT, 0.10, 900.0),
)
# Largest differences allowed [%].
BARS = {"same segments": 0.1, "limit": 0.02, "in time": 0.1, "periodic": 0.5, "decay": 3.0,
        "frequency": 1.0, "oscillation": 2.0}  # fmt: skip
