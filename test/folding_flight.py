"""A flight in SI units with three steady states: thesis Fig. 3.1, d_n 4.8, tow radius 100 m.

The line is thick and heavy and hardly dragged, so that m = 50, l = 3, f = 1 and, at about 31 m/s,
omega = 1.
"""

from math import inf, pi, sqrt

from ctcbs_ros.configuration import configuration_from_mapping

GRAVITY = 9.80665
RADIUS = 100.0
UNIT_SPEED = sqrt(RADIUS * GRAVITY)  # omega = 1
AIR = 1.2


def folding_mapping(
    d_n=4.8, radius=(90.0, 110.0), speed=(26.0, 40.0), youngs_modulus=inf, m=50.0, f=1.0
):
    """Parameters as of a file, from the definitions of the thesis alone."""
    diameter, density = 0.001, 8000.0
    mu = density * pi / 4.0 * diameter**2
    drag_coefficient = d_n * mu / (0.5 * AIR * diameter * RADIUS)
    return {
        "cable": {
            "length": 3.0 * RADIUS,
            "diameter": diameter,
            "density": density,
            "youngs_modulus": youngs_modulus,
            "drag_coefficient": drag_coefficient,
        },
        "end_mass": {
            "mass": m * mu * RADIUS,
            "frontal_area": f * diameter * drag_coefficient * RADIUS,
            "drag_coefficient": 1.0,
        },
        "air": {"density": AIR},
        "envelope": {"radius": list(radius), "speed": list(speed)},
    }


def folding_configuration(source="folding.yaml", **others):
    """The checked configuration of `folding_mapping`."""
    return configuration_from_mapping(folding_mapping(**others), str(source))
