"""`ctcbs steady`: all steady states of one point, with their stability."""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import asdict
from math import degrees, isfinite, nan

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.errors import InputError

_NONDIMENSIONAL = ("omega", "length", "end_mass", "cable_drag", "drag_ratio")
_OPTIONAL = ("end_weight", "density", "elasticity", "vibration_elasticity", "damping")
_FLIGHT = ("radius", "speed")
INEXTENSIBLE_ELASTICITY = "gamma of the steady state, and of the vibration unless inf; default inf"
# Nylon, of all ropes the one that gives way most, breaks at 15 to 28 %: beyond this no cable
# follows Hooke's law, nor keeps the diameter that its drag is reckoned with.
_LARGEST_STRAIN = 0.2


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "steady",
        help="all steady states of one point, and their stability",
        description="All steady states of a point, isolated ones included, and their stability. "
        "Give the non-dimensional parameters, or a configuration with radius and speed. Ends with "
        "1 where states may be missing or are not converged, as a note on standard error says.",
    )
    add_nondimensional(parser)
    add_flight(parser)
    parser.add_argument(
        "--band", type=float,
        help="largest |Im| of an eigenvalue that counts, per radian of orbit "
        "(default: 5, or less where the internal axial modes begin)",
    )
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    parser.set_defaults(run=run)


def add_nondimensional(
    parser: argparse.ArgumentParser, elasticity: str = INEXTENSIBLE_ELASTICITY
) -> None:
    """Add the non-dimensional parameters (thesis Table 2.1); elasticity says what it is there."""
    group = parser.add_argument_group("non-dimensional parameters")
    for name, meaning in (
        ("omega", "angular velocity, sqrt(a Omega^2/g)"),
        ("length", "cable length, L/a"),
        ("end-mass", "end mass, M/(mu a)"),
        ("cable-drag", "cable drag d_n"),
        ("drag-ratio", "end-mass drag over cable drag, d/d_n"),
        ("end-weight", "end weight, W/(mu a g); default: the end mass"),
        ("density", "net weight of the cable over its weight; default 1"),
        ("elasticity", elasticity),
        ("vibration-elasticity", "gamma of the vibration of an inextensible cable; default 600"),
        ("damping", "time constant of the line's axial damping times Omega; default 0"),
    ):
        group.add_argument(f"--{name}", type=float, metavar="X", help=meaning)


def add_flight(parser: argparse.ArgumentParser) -> None:
    """Add a configuration and the flight it is taken on."""
    group = parser.add_argument_group("in SI units")
    group.add_argument("--config", metavar="FILE", help="configuration file")
    group.add_argument("--radius", type=float, metavar="M", help="tow radius [m]")
    group.add_argument("--speed", type=float, metavar="M/S", help="tow speed [m/s]")
    group.add_argument("--cable-length", type=float, metavar="M", help="cable paid out [m]")
    group.add_argument(
        "--altitude", type=float, metavar="M",
        help="height above mean sea level for the standard atmosphere [m], default 0",
    )


def parameters_from(args):
    """`Parameters` from the non-dimensional arguments; an InputError names what is missing."""
    from ctcbs_ros.solver.parameters import Parameters

    missing = [name for name in _NONDIMENSIONAL if getattr(args, name) is None]
    if missing:
        flags = " ".join("--" + name.replace("_", "-") for name in missing)
        raise InputError(f"missing: {flags}")
    given = {
        name: getattr(args, name)
        for name in (*_NONDIMENSIONAL, *_OPTIONAL)
        if getattr(args, name) is not None
    }
    return Parameters(**given)


def refuse_flight(args) -> None:
    """Refuse what only a configuration gives a meaning to."""
    for name in (*_FLIGHT, "cable_length", "altitude"):
        if getattr(args, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: only with --config")


def flight_from(args):
    """`FlightPoint` from --config, --radius, --speed; an InputError names what is missing."""
    return configured_flight(args)[1]


def configured_flight(args):
    """`Configuration` and `FlightPoint`; an InputError names what is missing."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.scaling import flight_point

    extra = [n for n in (*_NONDIMENSIONAL, *_OPTIONAL) if getattr(args, n) is not None]
    if extra:
        flags = " ".join("--" + name.replace("_", "-") for name in extra)
        raise InputError(f"{flags}: not with --config, the file decides")
    missing = [f"--{name}" for name in _FLIGHT if getattr(args, name) is None]
    if missing:
        raise InputError(f"missing with --config: {' '.join(missing)}")
    configuration = load_configuration(args.config)
    if args.altitude is not None and configuration.air.model == "constant":
        raise InputError(
            "--altitude: only with air.model standard_atmosphere; the density of "
            f"{configuration.source} is constant"
        )
    altitude = 0.0 if args.altitude is None else args.altitude
    density = configuration.air.density_at(altitude)
    if not isfinite(density):
        raise InputError(f"--altitude: {altitude:g} m is outside the standard atmosphere's range")
    point = flight_point(configuration, args.radius, args.speed, density, args.cable_length)
    return configuration, point


def run(args) -> int:
    """Solve, and print as JSON or as a table."""
    from ctcbs_ros.cli.steady_limits import point_warnings, state_warnings
    from ctcbs_ros.prediction.record import warning_record
    from ctcbs_ros.solver.stability import stability
    from ctcbs_ros.solver.steady_state import steady_states

    if args.band is not None and not 0.0 < args.band < float("inf"):
        raise InputError(f"--band: {args.band:g} is not allowed, it must be above 0 and finite")
    configuration = flight = None
    if args.config is not None:
        configuration, flight = configured_flight(args)
        parameters = flight.parameters
        outside = [warning_record(w) for w in point_warnings(configuration, flight)]
    else:
        refuse_flight(args)
        parameters = parameters_from(args)
    altitude = nan if args.altitude is None else args.altitude
    found = steady_states(parameters)
    solutions = []
    for state in found.states:
        damping = stability(state, args.band)
        solution = {
            "end_mass_radius": state.end_mass_radius,
            "depth": state.depth,
            "phase_lag": state.phase_lag,
            "tension_end_mass": state.tension_end_mass,
            "tension_tow_point": state.tension_tow_point,
            "greatest_tension": state.greatest_tension,
            "greatest_strain": state.greatest_tension / parameters.elasticity,
            "growth_rate": damping.growth_rate,
            "frequency": damping.frequency,
            "stable": damping.stable,
            "nearest_loss": damping.nearest_loss,
            "residual": state.residual,
            "converged": state.converged and damping.converged,
            "functions": damping.functions,
            "band": damping.band,
        }
        if flight is not None:
            solution["si"] = flight.state_si(state, damping)
            told = state_warnings(configuration, flight, state, damping, altitude)
            solution["warnings"] = [warning_record(warning) for warning in told]
        solutions.append(solution)
    if args.json:
        result = {"parameters": asdict(parameters), "solutions": solutions}
        if flight is not None:
            result["flight"] = {
                "radius_m": flight.radius,
                "speed_m_s": flight.speed,
                "angular_rate_rad_s": flight.angular_rate,
                "cable_length_m": flight.cable_length,
                "end_mass_kg": flight.end_mass,
                "air_density_kg_m3": flight.density,
            }
            result["warnings"] = outside
        if found.reason:
            result["reason"] = found.reason
        print_json(result)
    else:
        _print_table(solutions, flight, found.reason)
        if flight is not None:
            _print_warnings(outside, solutions, configuration, altitude)
    for note in _notes(solutions, found.reason):
        print(f"ctcbs: note: {note}", file=sys.stderr)
    failed = not found.complete or not all(solution["converged"] for solution in solutions)
    return 1 if failed else 0


def _notes(solutions, reason) -> Iterator[str]:
    """What is to be known of the result that its figures do not say."""
    if reason:
        yield reason
    for number, solution in enumerate(solutions, 1):
        which = f"state {number} of {len(solutions)}"
        strain = solution["greatest_strain"]
        if strain > _LARGEST_STRAIN:
            yield (
                f"{which} is stretched by {strain:.3g} times its length; beyond "
                f"{_LARGEST_STRAIN:g} no cable follows Hooke's law: no real one hangs so"
            )
        if not solution["converged"]:
            yield f"{which}: its stability has not converged"


def _print_table(solutions, flight, reason) -> None:
    if flight is None:
        header = "radius/a  depth/a  lag[deg]  T_mass  T_tow  T_max  margin/rad  freq/rad  stable"
        rows = [
            (s["end_mass_radius"], s["depth"], degrees(s["phase_lag"]), s["tension_end_mass"],
             s["tension_tow_point"], s["greatest_tension"], -s["growth_rate"], s["frequency"])
            for s in solutions
        ]
    else:
        header = (
            "radius[m]  depth[m]  lag[deg]  T_mass[N]  T_tow[N]  T_max[N]  margin[1/s]  "
            "freq[rad/s]  stable"
        )
        rows = [
            (si["end_mass_radius_m"], si["depth_m"], degrees(si["phase_lag_rad"]),
             si["tension_end_mass_n"], si["tension_tow_point_n"], si["greatest_tension_n"],
             -si["growth_rate_per_s"], si["frequency_per_s"])
            for si in (s["si"] for s in solutions)
        ]
    if not solutions:
        print(f"no steady state: {reason}")
        return
    titles = header.split()
    widths = [max(len(title), 9) for title in titles]
    print("  ".join(title.rjust(width) for title, width in zip(titles, widths, strict=True)))
    for solution, row in zip(solutions, rows, strict=True):
        cells = [f"{value:.5g}" for value in row] + ["yes" if solution["stable"] else "NO"]
        print("  ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True)))
    print("margin: decay rate of the least damped mode, -growth_rate; negative is unstable")


def _print_warnings(outside, solutions, configuration, altitude) -> None:
    """Where the envelope is left and a limit broken; or that none is."""
    told = [(warning, "") for warning in outside]
    for solution in solutions:
        radius = solution["si"]["end_mass_radius_m"]
        where = f" (the state at {radius:.5g} m)" if len(solutions) > 1 else ""
        told += [(warning, where) for warning in solution["warnings"]]
    for warning, where in told:
        print(f"{warning['code']}: {warning['text']}{where}")
    if not told and solutions:
        print(f"within envelope and limits of {configuration.source}")
    if solutions and not isfinite(altitude - configuration.limits.ground_level_amsl):
        print("height above the ground not judged: it takes --altitude and ground.level_amsl")
