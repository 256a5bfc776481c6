"""`ctcbs simulate-cable`: the cable in time, on a circle or a track, in wind, reeled, released.

All that is driven is non-dimensional inside (radii a, times 1/Omega, masses mu a); with --config
what the user gives and gets is in SI.
"""

import csv
import sys
from dataclasses import asdict, replace
from math import inf, isfinite, pi
from pathlib import Path

import numpy as np

from ctcbs_ros.cli.cable_units import GIVEN_ELASTICITY, units_and_parameters, vector
from ctcbs_ros.cli.numbers import number
from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.steady import add_flight, add_nondimensional
from ctcbs_ros.cli.tow_path import read_csv, read_tow_path
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file, writable

_A_PERIOD = 64  # states given in an orbit
_SHORTEST = 1.0 / 300.0  # of the cable: what is hauled in further is a mass on its winch
_SMOOTH = 0.5  # orbits that a change of wind or length takes to begin and to end


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "simulate-cable",
        help="the cable in time: entries, wind, winch, pick-up and release",
        description="Simulate an elastic cable (lumped masses, quadratic drag) towed round a "
        "circle anticlockwise, or along a track. Units: tow radii, 1/Omega, mu a; with --config "
        "m, s, kg. Axes: x, y level and z up from the circle's centre in the tow plane, with the "
        "tow point on +x at the start; of a log east, north, up. An inextensible cable is "
        "simulated with its vibration elasticity (600).",
    )
    add_nondimensional(parser, GIVEN_ELASTICITY)
    add_flight(parser)
    group = parser.add_argument_group("motion")
    add = group.add_argument
    add("--orbits", type=number(float, 0.1, 10000), default=20.0, metavar="N", help="default 20")
    add("--segments", type=number(int, 2, 1000), default=40, metavar="N", help="default 40")
    add(
        "--start", choices=("steady", "hanging"), default="steady",
        help="the steady state in still air (default; on a track that of straight flight in the "
        "wind), or hanging below, moving as the tow point",
    )
    add(
        "--end-mass-radius", type=float, metavar="X",
        help="of several steady states the one nearest to this; default the smallest",
    )
    add(
        "--wind", metavar="X,Y[,Z]",
        help="velocity of the air, over the tow speed (m/s with --config), reached in an orbit: "
        "3,0 moves towards +x; not a direction that it blows from, as simulate has; or a CSV file "
        "with columns t, x, y[, z]; or 'log', as the --track's autopilot says, right or wrong",
    )
    add("--reel-to", type=float, metavar="L", help="cable length to reel to, from the start on")
    add("--reel-rate", type=float, metavar="R", help="how fast, over the tow speed (or m/s)")
    add("--new-end-mass", type=float, metavar="M", help="end mass after a pick-up or release")
    add("--new-after", type=float, metavar="N", help="orbits until then")
    add(
        "--track", metavar="FILE",
        help="path of the tow point instead of the circle: a flight log of any kind that replay "
        "takes (with --config), or a CSV file with columns t, x, y, z",
    )
    add("--from", dest="begin", type=number(float, 0.0, 1e9), metavar="T",
        help="begin at this time of the track; default: the longest way without gap or jump")
    add("--to", dest="finish", type=number(float, 0.0, 1e9), metavar="T", help="end there")
    add(
        "--smooth", type=number(float, 0.0, 1e3), metavar="T",
        help="oscillations of the track faster than this are noise; default 2 s of a log, 0 else",
    )
    add(
        "--drag-at", choices=("segments", "nodes"), default="segments",
        help="where the cable's drag is taken: the middle of segments (default), or as MoorDyn "
        "does; they agree as segments grow in number",
    )
    add("--tolerance", type=number(float, 1e-10, 1e-2), default=1e-4, metavar="X",
        help="error of a step over length and tow speed, default 1e-4")  # fmt: skip
    add("--json", action="store_true", help="the result as JSON on stdout")
    add("-o", "--output", metavar="FILE",
        help="CSV of end mass, tow point and tension in time: s, m, N with --config, else "
        "1/Omega, tow radii, mu a^2 Omega^2")  # fmt: skip
    parser.set_defaults(run=run)


def run(args) -> int:
    """Simulate, and print what came of it."""
    from ctcbs_ros.cli.cable_run import simulate_showing
    from ctcbs_ros.dynamics.cable import drive
    from ctcbs_ros.dynamics.line import line_of
    from ctcbs_ros.dynamics.settled import outcome, passage

    if args.output:
        writable(args.output)
    path = _path(args)
    if path is not None and args.config is not None:
        _units_of_track(args, path)
    elif path is not None and path.smooth > 0.0:
        raise InputError("--track: a log is in SI, --config is needed")
    units, parameters = units_and_parameters(args)
    line = line_of(parameters, args.drag_at == "nodes")
    period = 2.0 * pi
    tow, first, last = _tow(args, units, path, period)
    wind = _wind(args, units, path, tow, first, last, period)
    driven = drive(
        line, tow, wind, _length(args, units, line, first), _end(args, units, line, first, period)
    )
    state = _start(args, units, parameters, line, driven, first)
    count = max(2, round((last - first) / period * _A_PERIOD) + 1)
    times = np.linspace(first, last, count)
    try:
        motion = simulate_showing(line, driven, state, times, args.tolerance)
    except ArithmeticError as error:
        print(f"ctcbs: error: {error}", file=sys.stderr)
        return 1
    if path is None:
        found = asdict(outcome(line, driven, motion, period)) | {"orbits": (last - first) / period}
    else:
        found = asdict(passage(line, driven, motion))
    result = _in_units(found, units)
    result |= {"segments": args.segments, "steps": motion.steps, "steps_rejected": motion.rejected}
    if args.output:
        _write(args.output, line, driven, motion, units)
    if args.json:
        printed = {"parameters": asdict(parameters), "units": units["names"], "end": result}
        if path is not None:
            printed["track"] = {"from": float(path.times[0]), "to": float(path.times[-1]),
                                "origin": path.origin}  # fmt: skip
        print_json(printed)
    elif path is None:
        _print(result, units)
    else:
        _print_passage(result, units)
    return 0


def _path(args):
    """The track's path, or None on a circle."""
    if args.track is not None:
        return read_tow_path(args.track, args.begin, args.finish)
    for flag, value in (("--from", args.begin), ("--to", args.finish), ("--smooth", args.smooth)):
        if value is not None:
            raise InputError(f"{flag}: only with --track")
    return None


def _units_of_track(args, path):
    """On a track radius and speed are but units: those of the cable and of the track."""
    from ctcbs_ros.configuration import load_configuration

    if args.radius is None:
        args.radius = load_configuration(args.config).cable.length
    if args.speed is None:
        args.speed = max(path.speed, 1.0)


def _tow(args, units, path, period):
    """The tow point's path, and from when to when it is flown."""
    from ctcbs_ros.dynamics.signal import circle, smoothed

    if path is None:
        end = args.orbits * period
        return circle(1.0, 1.0, 0.0, end), 0.0, end
    times = path.times / units["time"]
    smooth = (path.smooth if args.smooth is None else args.smooth) / units["time"]
    tow = smoothed(times, path.positions / units["length"], smooth, f"--track {args.track}")
    return tow, float(times[0]), float(times[-1])


def _wind(args, units, path, tow, first, last, period):
    """The wind in time; an InputError where it is faster than the aircraft."""
    from ctcbs_ros.dynamics.signal import linear

    if args.wind is None:
        return None
    if args.wind == "log":
        if path is None:
            raise InputError("--wind log: only with a --track LOG, whose wind it is")
        if not path.wind_times.size:
            raise InputError(
                f"--wind log: nobody tells the wind in {args.track}, or in the part of it that is "
                "flown; give --wind X,Y, the velocity of the air, or leave --wind out: still air"
            )
        times, values = path.wind_times, path.wind
    elif (numbers := vector(args.wind, "--wind")) is not None:
        times = np.array([first, first + period]) * units["time"]
        values = np.stack([np.zeros(3), numbers])
    elif Path(args.wind).exists():
        rows = read_csv(args.wind, "--wind", ("t", "x", "y", "z"))
        times, values = rows[:, 0], rows[:, 1:]
    else:
        raise InputError(f"--wind {args.wind}: neither X,Y[,Z] nor a file")
    values = values * units["time"] / units["length"]
    fastest = 1.0
    if path is not None:
        way = tow.at(np.linspace(first, last, 2000))
        fastest = np.linalg.norm(np.diff(way, axis=0), axis=1).max() * 1999.0 / (last - first)
    if np.linalg.norm(values, axis=1).max(initial=0.0) >= fastest:
        raise InputError(
            f"--wind {args.wind}: X,Y, the velocity of the air (no bearing), must be below "
            "the tow speed"
        )
    if len(values) == 1:
        times, values = times + np.array([0.0, 1.0]), np.repeat(values, 2, axis=0)
    return linear(times / units["time"], values, "--wind")


def _start(args, units, parameters, line, driven, first):
    """The cable at the beginning."""
    from ctcbs_ros.dynamics.cable import hanging
    from ctcbs_ros.dynamics.equilibrium import trailing

    if args.start != "hanging" and args.track is None:
        return _steady(args, units, parameters)
    tow = driven.tow_point
    here, velocity = tow.at(first), (tow.at(first + 1e-6) - tow.at(first)) / 1e-6
    line = replace(line, length=float(driven.length.at(first)[0]))
    if args.start == "hanging":
        state = hanging(line, args.segments, here, velocity)
    else:
        state = trailing(line, args.segments, here, velocity, driven.wind.at(first))
    return replace(state, time=first)


def _length(args, units, line, first):
    """From the length at the start to another, the rate rising and falling smoothly."""
    from ctcbs_ros.dynamics.signal import held, spline

    if args.reel_to is None and args.reel_rate is None:
        return None
    if args.reel_to is None or args.reel_rate is None:
        raise InputError("--reel-to and --reel-rate: only together")
    for name, value in (("--reel-to", args.reel_to), ("--reel-rate", args.reel_rate)):
        if not 0.0 < value < inf:
            raise InputError(f"{name}: {value:g} is not allowed, it must be above 0 and finite")
    shortest = _SHORTEST * line.length * units["length"]
    if args.reel_to < shortest:
        raise InputError(
            f"--reel-to: {args.reel_to:g} is not allowed, at least {shortest:.3g} must stay out"
        )
    rate = args.reel_rate * units["time"] / units["length"]
    if rate >= 1.0:
        raise InputError(
            f"--reel-rate: {args.reel_rate:g} is not allowed, it must be below the tow speed"
        )
    change = args.reel_to / units["length"] - line.length
    if change == 0.0:
        return None
    smooth = min(_SMOOTH * 2.0 * pi, abs(change) / rate)
    whole = abs(change) / rate + smooth  # a trapezium of the rate
    before = first - smooth
    t = np.linspace(before, first + whole + smooth, 401)
    s = np.clip(t - first, 0.0, whole)
    up, down = np.minimum(s, smooth), np.clip(s - (whole - smooth), 0.0, smooth)
    flown = 0.5 * up**2 / smooth + (s - up) - 0.5 * down**2 / smooth
    return held(spline(t, line.length + np.sign(change) * rate * flown, "--reel-to"))


def _end(args, units, line, first, period):
    from ctcbs_ros.dynamics.signal import steps

    if args.new_end_mass is None and args.new_after is None:
        return None
    if args.new_end_mass is None or args.new_after is None:
        raise InputError("--new-end-mass and --new-after: only together")
    for name, value in (("--new-end-mass", args.new_end_mass), ("--new-after", args.new_after)):
        if not (isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value:g} is not allowed, it must be above 0 and finite")
    before, after = line.end, line.end
    more = args.new_end_mass / units["mass"] - line.end_mass
    gravity = line.end_weight / line.end_mass
    after = after + np.array([more, more * gravity, 0.0])
    return steps([first + args.new_after * period], [before, after], "--new-end-mass")


def _steady(args, units, parameters):
    """The discretised steady state that is asked for."""
    from ctcbs_ros.dynamics.equilibrium import equilibrium
    from ctcbs_ros.solver.steady_state import steady_states

    if not parameters.elastic:
        parameters = replace(parameters, elasticity=parameters.vibration_elasticity)
    found = steady_states(parameters)
    if not found.states:
        raise InputError(f"no steady state to start from: {found.reason}; try --start hanging")
    wanted = 0.0 if args.end_mass_radius is None else args.end_mass_radius / units["length"]
    state = min(found.states, key=lambda s: abs(s.end_mass_radius - wanted))
    return equilibrium(state, args.segments, args.drag_at == "nodes")


def _in_units(result, units):
    force = units["force"]
    plain = ("settled", "slack", "phase_lag", "orbits")
    scaled = {}
    for key, value in result.items():
        unit = 1.0 if key in plain else force if key == "greatest_tension" else units["length"]
        if isinstance(value, np.ndarray):
            scaled[key] = [float(v) * unit for v in value]
        else:
            scaled[key] = value if isinstance(value, bool) else float(value) * unit
    return scaled


def _write(file, line, driven, motion, units):
    from ctcbs_ros.dynamics.loads import loads

    force = units["force"]
    tensions = loads(line, driven, motion).tensions * force
    with atomic_file(file) as handle:
        writer = csv.writer(handle)
        ends = [f"{what}_{axis}" for what in ("end_mass", "tow_point") for axis in "xyz"]
        writer.writerow(["t", *ends, "tension_tow_point", "greatest_tension"])
        for t, x, tension in zip(motion.times, motion.positions, tensions, strict=True):
            numbers = [t * units["time"], *(x[0] * units["length"]), *(x[-1] * units["length"]),
                       tension[-1], tension.max()]  # fmt: skip
            writer.writerow([f"{value:.9g}" for value in numbers])


def _print(result, units) -> None:
    length, tension = units["names"]["length"], units["names"]["tension"]
    x, y, z = result["mean_position"]
    state = "settled" if result["settled"] else "NOT settled"
    print(f"after {result['orbits']:.4g} orbits: {state}; in the last one")
    for name, whence in (("radius", "about the tow circle's axis"), ("depth", "below its plane")):
        print(f"  {name:<9}{result[name]:.6g} {length} {whence}, from "
              f"{result['least_' + name]:.6g} to {result['greatest_' + name]:.6g}")  # fmt: skip
    print(f"  lag      {np.degrees(result['phase_lag']):.4g} deg behind the tow point")
    print(f"  mean     x {x:.5g}, y {y:.5g}, z {z:.5g} {length}")
    beside = float(np.hypot(x, y))
    if beside > 0.01 * result["radius"]:
        print(f"           {beside:.4g} {length} beside the axis: the mass moves about that "
              "place, and the radius above is not that of its own path")  # fmt: skip
    print(f"in all: greatest tension {result['greatest_tension']:.5g} {tension}, lowest point "
          f"{result['lowest']:.5g} {length}, greatest radius {result['greatest_excursion']:.5g} "
          f"{length}, slack {100.0 * result['slack']:.3g} % of the time")  # fmt: skip


def _print_passage(result, units) -> None:
    length, tension = units["names"]["length"], units["names"]["tension"]
    x, y, z = result["end_mass"]
    print(f"at the end the mass is at x {x:.5g}, y {y:.5g}, z {z:.5g} {length}")
    for name, what in (("depth", "below"), ("distance", "beside")):
        print(f"  {what} the tow point {result['least_' + name]:.5g} to "
              f"{result['greatest_' + name]:.5g} {length}")  # fmt: skip
    print(f"greatest tension {result['greatest_tension']:.5g} {tension}, lowest point "
          f"{result['lowest']:.5g} {length}, slack {100.0 * result['slack']:.3g} % of the time")
