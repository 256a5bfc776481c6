"""`ctcbs entry`: a planned entry simulated, and which state it ends in."""

import sys
from dataclasses import asdict, replace
from math import atan, degrees, inf, isfinite, radians

import numpy as np

from ctcbs_ros.cli.cable_units import GIVEN_ELASTICITY, units_and_parameters, vector
from ctcbs_ros.cli.numbers import number
from ctcbs_ros.cli.output import finite_or_null, print_json
from ctcbs_ros.cli.steady import add_nondimensional
from ctcbs_ros.errors import InputError

# What each way in needs, and what it may have besides.
_OPTIONS = {
    "straight": ((), ("bank_rate",)),
    "deploy": (("deployed", "reel_rate"), ()),
    "speed": (("from_speed", "acceleration"), ()),
    "radius": (("from_radius", "radius_rate"), ()),
    "hanging": ((), ()),
}
_LENGTHS = ("least_radius", "greatest_radius", "least_depth", "greatest_depth",
            "greatest_excursion", "lowest")  # fmt: skip


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "entry",
        help="a planned entry simulated: which state is reached, and when",
        description="Simulate an entry into a circle until the end mass is settled: from straight "
        "flight, paying out on the circle, or from another speed or radius. Says which state is "
        "reached and when it is within 5 % of the tow radius of it for good, greatest tension "
        "and excursion and lowest height on the way, or that the mass keeps oscillating. SI with "
        "CONFIG; else tow radii, tow speeds and 1/Omega.",
    )
    parser.add_argument("config", metavar="CONFIG", nargs="?", help="configuration file")
    group = parser.add_argument_group("the circle, with CONFIG")
    for name, unit, meaning in (
        ("radius", "M", "tow radius [m]"), ("speed", "M/S", "speed over the ground [m/s]"),
        ("cable-length", "M", "cable paid out in the end [m]"),
        ("altitude", "M", "height for the standard atmosphere [m], default 0"),
    ):  # fmt: skip
        group.add_argument(f"--{name}", type=float, metavar=unit, help=meaning)
    add_nondimensional(parser, GIVEN_ELASTICITY)
    add = parser.add_argument_group("the way in").add_argument
    add("--from", dest="start", choices=tuple(_OPTIONS), required=True,
        help="straight flight; deploy, on the circle; another speed or radius; or hanging "
        "vertically at the tow speed")  # fmt: skip
    for name, unit, meaning in (
        ("bank-rate", "DEG/S", "straight: degrees a second (or in 1/Omega), default 5"),
        ("deployed", "L", "deploy: length paid out at first"),
        ("reel-rate", "R", "deploy: greatest rate of paying out"),
        ("from-speed", "V", "speed: at first"),
        ("acceleration", "A", "speed: how fast it changes"),
        ("from-radius", "R", "radius: at first"),
        ("radius-rate", "R", "radius: how fast it changes"),
    ):
        add(f"--{name}", type=float, metavar=unit, help=meaning)
    add("--wind", metavar="X,Y[,Z]",
        help="velocity of the air [m/s with CONFIG, else over the tow speed]: 3,0 moves towards "
        "+x, where the tow point begins its anticlockwise circle over the ground; not a direction "
        "that it blows from, as simulate has")  # fmt: skip
    add("--height", type=float, metavar="M", help="of the tow plane above the ground")
    add("--orbits", type=number(float, 1, 10000), default=100.0, metavar="N",
        help="flown at most, default 100")  # fmt: skip
    add("--segments", type=number(int, 2, 1000), default=40, metavar="N", help="default 40")
    add("--json", action="store_true", help="the result as JSON on stdout")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Simulate the entry, and print what it comes to."""
    from ctcbs_ros.cli.cable_run import progress
    from ctcbs_ros.dynamics.entry import enter

    units, parameters = units_and_parameters(args)
    if args.config is not None:
        _refuse_bank(args)
    wind = _wind(args, units)
    if args.height is not None and not isfinite(args.height):
        raise InputError(f"--height: {args.height:g} is not allowed, it must be finite")
    manoeuvre = _manoeuvre(args, units, parameters)
    try:
        with progress("entry") as bar:
            entry = enter(parameters, manoeuvre, wind, args.orbits, args.segments,
                          tell=lambda part: bar.update(part - bar.n))  # fmt: skip
    except ArithmeticError as error:
        print(f"ctcbs: error: {error}", file=sys.stderr)
        return 1
    result = _in_units(entry, units, args.height)
    result["bank"] = atan(parameters.omega**2)
    told = _warnings(args, result, units)
    result["warnings"] = list(dict.fromkeys(warning.code.value for warning in told))
    result["warnings_told"] = [f"{warning.code.value}: {warning.text}" for warning in told]
    if args.json:
        print_json({"parameters": asdict(parameters), "units": units["names"],
                    "from": args.start, **finite_or_null(result)})  # fmt: skip
    else:
        _print(result, units)
    return 0


def _manoeuvre(args, units, parameters):
    """The way in, of options that belong to it and are there."""
    from ctcbs_ros.dynamics import manoeuvre as ways

    needed, optional = _OPTIONS[args.start]
    for name in (name for options in _OPTIONS.values() for group in options for name in group):
        value, flag = getattr(args, name), "--" + name.replace("_", "-")
        if value is None:
            if name in needed:
                raise InputError(f"{flag}: needed with --from {args.start}")
            continue
        if name not in needed + optional:
            raise InputError(f"{flag}: not with --from {args.start}")
        if not 0.0 < value < inf:
            raise InputError(f"{flag}: {value:g} is not allowed, it must be above 0 and finite")
    length, time = units["length"], units["time"]
    speed = length / time
    if args.start == "straight":
        rate = radians(5.0 if args.bank_rate is None else args.bank_rate)
        return ways.from_straight(parameters, rate * time)
    if args.start == "deploy":
        deployed = args.deployed / length
        _refuse_same("--deployed", deployed, parameters.length)
        return ways.paying_out(parameters, deployed, args.reel_rate / speed)
    if args.start == "speed":
        _refuse_same("--from-speed", args.from_speed / speed, 1.0)
        return ways.changing_speed(
            parameters, args.from_speed / speed, args.acceleration * time / speed
        )
    if args.start == "radius":
        _refuse_same("--from-radius", args.from_radius / length, 1.0)
        return ways.changing_radius(
            parameters, args.from_radius / length, args.radius_rate / speed
        )
    return ways.hanging_below(parameters)


def _refuse_bank(args):
    """Refuse circles steeper than an aircraft flies, those that the way in begins with as well."""
    from ctcbs_ros.simulated_flight import LARGEST_BANK, bank_of

    for radius, speed in (
        (args.radius, args.speed),
        (args.from_radius or args.radius, args.speed),
        (args.radius, args.from_speed or args.speed),
    ):
        bank = bank_of(radius, speed)
        if bank > LARGEST_BANK:
            raise InputError(
                f"radius {radius:g} m at speed {speed:g} m/s: needs a bank of "
                f"{degrees(bank):.0f} deg; at most {degrees(LARGEST_BANK):.0f} deg are flown"
            )


def _refuse_same(flag, first, last):
    if abs(first - last) <= 1e-9 * last:
        raise InputError(f"{flag}: it is that of the circle already, nothing changes")


def _wind(args, units):
    if args.wind is None:
        return np.zeros(3)
    wind = vector(args.wind, "--wind")
    if wind is None:
        raise InputError(f"--wind {args.wind}: two or three numbers are needed, X,Y[,Z]")
    wind = wind * units["time"] / units["length"]
    if np.linalg.norm(wind) >= 1.0:
        raise InputError(
            f"--wind {args.wind}: X,Y, the velocity of the air (no bearing), must be below "
            "the tow speed"
        )
    return wind


def _in_units(entry, units, height):
    """The figures of an entry in the user's units, by the names of the JSON."""
    length, time = units["length"], units["time"]
    states = [
        asdict(replace(s, end_mass_radius=s.end_mass_radius * length, depth=s.depth * length,
                       growth_rate=s.growth_rate / time)) for s in entry.states
    ]  # fmt: skip
    found = {name: getattr(entry, name) * length for name in _LENGTHS}
    lowest = found.pop("lowest")
    reached = next((s for s in states if s["reached"]), None)
    return {
        "outcome": entry.outcome,
        "state": reached,
        "settling_time": entry.settling_time * time,
        "manoeuvre_time": entry.manoeuvre_time * time,
        "simulated_time": entry.simulated_time * time,
        **found,
        "mean_position": [float(x) * length for x in entry.mean_position],
        "lowest_height": lowest + (0.0 if height is None else height),
        "above_ground": height is not None,
        "greatest_tension": entry.greatest_tension * units["force"],
        "slack": entry.slack,
        "steady_states": states,
    }


def _warnings(args, result, units):
    """What the entry breaks, as the predictor says it."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
    from ctcbs_ros.prediction.warnings import (
        envelope_warnings,
        ground_warnings,
        tension_warnings,
    )

    found = []
    flown = f"{result['simulated_time']:.5g} {units['names']['time']}"
    why = {
        "oscillating": "the end mass keeps oscillating",
        "undecided": f"nothing has settled in the {flown} simulated",
    }.get(result["outcome"])
    if why is not None:
        found.append(Warning(WarningCode.UNSTABLE, Level.ERROR, why))
    if args.config is None:
        return found
    configuration = load_configuration(args.config)
    limits = configuration.limits
    found += envelope_warnings(args.radius, args.speed, configuration.envelope)
    found += tension_warnings(result["greatest_tension"], configuration.cable, limits)
    if result["above_ground"]:
        # --height is above the ground there, wherever the file has it.
        limits = replace(limits, ground_level_amsl=0.0)
        found += ground_warnings(result["lowest_height"], limits)
    return found


def _print(result, units) -> None:
    length, time, force = (units["names"][n] for n in ("length", "time", "tension"))
    state = result["state"]
    span = (f"radius {result['least_radius']:.5g} to {result['greatest_radius']:.5g} {length}, "
            f"depth {result['least_depth']:.5g} to {result['greatest_depth']:.5g} {length}")
    if result["outcome"] == "steady":
        print(f"ends in the steady state of radius {state['end_mass_radius']:.5g} {length}, "
              f"depth {state['depth']:.5g} {length}, lag {degrees(state['phase_lag']):.4g} deg")
    elif result["outcome"] == "periodic":
        x, y, z = result["mean_position"]
        print(f"ends the same from orbit to orbit about {x:.5g}, {y:.5g}, {z:.5g} {length}: "
              f"{span}")
    elif result["outcome"] == "oscillating":
        print(f"ends in a large oscillation: {span}")
    else:
        print(f"NOT settled after {result['simulated_time']:.5g} {time}: {span}")
    settled = result["settling_time"]
    if isfinite(settled):
        print(f"  from {settled:.4g} {time} on within 5 % of the tow radius of it; the manoeuvre "
              f"takes {result['manoeuvre_time']:.4g} {time}")
    print(f"  the circle takes a bank of {degrees(result['bank']):.3g} deg")
    print(f"  greatest tension {result['greatest_tension']:.5g} {force}, greatest distance from "
          f"the axis on the circle {result['greatest_excursion']:.5g} {length}")
    height, of = result["lowest_height"], "ground" if result["above_ground"] else "tow plane"
    side = "above" if height >= 0.0 else "below"
    print(f"  the mass comes as low as {abs(height):.5g} {length} {side} the {of}, the cable is "
          f"slack {100.0 * result['slack']:.3g} % of the time")
    for other in result["steady_states"]:
        if not other["reached"]:
            kind = "stable, but missed" if other["stable"] else "unstable"
            print(f"  not reached: radius {other['end_mass_radius']:.5g} {length}, depth "
                  f"{other['depth']:.5g} {length}, {kind}")
    for told in result["warnings_told"]:
        print(f"  {told}")
