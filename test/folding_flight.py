"""A flight in SI units with three steady states: thesis Fig. 3.1, d_n 4.8, tow radius 100 m.

The line is thick and heavy and hardly dragged, so that m = 50, l = 3, f = 1 and, at about 31 m/s,
omega = 1.
"""

from dataclasses import replace
from math import inf, pi, sqrt

from points import TAUT_INSIDE

from ctcbs_ros.configuration import configuration_from_mapping

GRAVITY = 9.80665
RADIUS = 100.0
UNIT_SPEED = sqrt(RADIUS * GRAVITY)  # omega = 1
AIR = 1.2
DENSITY = 8000.0  # of the line


def folding_mapping(
    d_n=4.8, radius=(90.0, 110.0), speed=(26.0, 40.0), youngs_modulus=inf, m=50.0, f=1.0,
    length=3.0,
):  # fmt: skip
    """Parameters as of a file, from the definitions of the thesis alone."""
    diameter = 0.001
    mu = DENSITY * pi / 4.0 * diameter**2
    drag_coefficient = d_n * mu / (0.5 * AIR * diameter * RADIUS)
    return {
        "cable": {
            "length": length * RADIUS,
            "diameter": diameter,
            "density": DENSITY,
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


def taut_inside(share, fraction=0.5):
    """`points.TAUT_INSIDE` in SI units, and its speed at RADIUS.

    `fraction` of the breaking tension is `share` of the tension where it is greatest: inside the
    cable 7.960 mu a g, and no more than 6.221 at its ends.
    """
    speed = TAUT_INSIDE["omega"] * UNIT_SPEED
    modulus = TAUT_INSIDE["gamma"] * DENSITY * RADIUS * GRAVITY
    one = folding_configuration(
        "taut.yaml", speed=(0.99 * speed, 1.01 * speed), radius=(0.99 * RADIUS, 1.01 * RADIUS),
        youngs_modulus=modulus, length=TAUT_INSIDE["l"],
        **{key: TAUT_INSIDE[key] for key in ("d_n", "m", "f")},
    )  # fmt: skip
    unit = one.cable.mass_per_length * RADIUS * GRAVITY
    cable = replace(one.cable, breaking_tension=share * 7.960 * unit / fraction)
    limits = replace(one.limits, tension_fraction=fraction)
    return replace(one, cable=cable, limits=limits), speed
