"""Rows of the design example, Chapter 5 and Table 5.1: against tow radius and deployed length."""

from dataclasses import replace
from math import inf

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.figures import curves
from ctcbs_ros.figures.rows import Row
from ctcbs_ros.scaling import FlightPoint, flight_point
from ctcbs_ros.solver.diagram import VARIED
from ctcbs_ros.solver.family import RADIUS_AT_SPEED

COLUMNS = (*curves.COLUMNS, "tow_radius_m", "cable_length_m", "frontal_area_m2")
SPEED, LARGEST, SMALLEST = 50.0, 250.0, 100.0
# Frontal areas of the two end masses [m^2]: a sphere of 50 mm, and that of Table 5.1.
FIRST, SECOND = 0.00196, 0.045
_SHORTEST = 0.02


def against_radius(name: str, frontal_area: float, elastic: bool) -> list[Row]:
    """The branches from the smallest to the largest tow radius, at one speed and cable length."""
    flight = _flight(frontal_area, elastic)
    # The thesis's gamma of the vibration is 600 at every radius.
    family = RADIUS_AT_SPEED if elastic else replace(RADIUS_AT_SPEED, elasticity=0.0)
    rows = curves.curve(name, flight.parameters, family, LARGEST, SMALLEST, LARGEST)
    return [
        row | _dimensions(flight.cable_length / row["length"], flight.cable_length, frontal_area)
        for row in rows
    ]


def against_length(name: str, frontal_area: float, elastic: bool) -> list[Row]:
    """The branches while the cable is deployed, at the largest tow radius."""
    flight = _flight(frontal_area, elastic)
    longest = flight.parameters.length
    rows = curves.curve(name, flight.parameters, VARIED["length"], longest, _SHORTEST, longest)
    return [row | _dimensions(LARGEST, row["length"] * LARGEST, frontal_area) for row in rows]


def _flight(frontal_area: float, elastic: bool) -> FlightPoint:
    """Table 5.1 at the largest tow radius."""
    table = load_configuration("design_example")
    configuration = replace(
        table,
        end_mass=replace(table.end_mass, frontal_area=frontal_area),
        cable=table.cable if elastic else replace(table.cable, youngs_modulus=inf),
    )
    return flight_point(configuration, LARGEST, SPEED, table.air.density_at(0.0))


def _dimensions(radius: float, length: float, frontal_area: float) -> Row:
    return {"tow_radius_m": radius, "cable_length_m": length, "frontal_area_m2": frontal_area}
