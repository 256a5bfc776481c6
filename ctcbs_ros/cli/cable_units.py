"""The units in which a command about the cable in time is given its figures, and gives its own."""

from dataclasses import replace

import numpy as np

from ctcbs_ros.cli.steady import flight_from, parameters_from, refuse_flight
from ctcbs_ros.errors import InputError

_DEFAULT_ELASTICITY = 600.0
# Help of --elasticity where a cable that does not stretch is simulated as one that hardly does.
GIVEN_ELASTICITY = (
    f"gamma; default the vibration's, {_DEFAULT_ELASTICITY:g} unless given, as for inf"
)


def units_and_parameters(args):
    """Units and parameters of --config with a flight, or of the non-dimensional arguments.

    Parameters
    ----------
    args
        With the attributes of `add_nondimensional` and `add_flight` (`ctcbs_ros.cli.steady`).

    Returns
    -------
    units : dict
        The user's unit of "length", "time", "mass" and "force" in one of the kernels', and their
        "names".
    parameters : Parameters
    """
    if args.config is not None:
        flight = flight_from(args)
        names = {"length": "m", "time": "s", "mass": "kg", "tension": "N"}
        mass = flight.mass_per_length * flight.radius
        return _units(flight.radius, 1.0 / flight.angular_rate, mass, names), flight.parameters
    refuse_flight(args)
    parameters = parameters_from(args)
    if args.elasticity is None and args.vibration_elasticity is None:
        parameters = replace(parameters, elasticity=_DEFAULT_ELASTICITY)
    names = {"length": "a", "time": "1/Omega", "mass": "mu a", "tension": "mu a^2 Omega^2"}
    return _units(1.0, 1.0, 1.0, names), parameters


def _units(length, time, mass, names):
    return {
        "length": length, "time": time, "mass": mass, "force": mass * length / time**2,
        "names": names,
    }  # fmt: skip


def vector(text: str, flag: str) -> np.ndarray | None:
    """Three numbers of X,Y[,Z]; None where the text holds no numbers."""
    try:
        given = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return None
    if given.size not in (2, 3) or not np.all(np.isfinite(given)):
        raise InputError(
            f"{flag} {text}: two or three numbers are needed, X,Y[,Z], none of them nan or inf"
        )
    return np.concatenate([given, np.zeros(3 - given.size)])
