"""All states of a configuration over drag and omega, for tests that look instead of following."""

from dataclasses import replace

from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import steady_states

FIG_31 = Parameters(omega=1.0, length=3.0, end_mass=50.0, cable_drag=1.0, drag_ratio=1.0)
FIG_41 = Parameters(omega=1.0, length=3.0, end_mass=3.5, cable_drag=1.0, drag_ratio=0.1)


def states_at(parameters, drag, omega):
    return steady_states(replace(parameters, cable_drag=drag, omega=omega)).states


def most_states(parameters, drag, omegas):
    return max(len(states_at(parameters, drag, omega)) for omega in omegas)
