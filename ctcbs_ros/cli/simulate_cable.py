"""`ctcbs simulate-cable`: the cable in time, on a circle or a track, in wind, reeled, released.

All that is driven is non-dimensional inside (radii a, times 1/Omega, masses mu a); with --config
what the user gives and gets is in SI.
"""

import csv
from dataclasses import asdict, replace
from math import inf, isfinite, pi

import numpy as np

from ctcbs_ros.cli.numbers import number
from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.steady import add_flight, add_nondimensional, flight_from, parameters_from
from ctcbs_ros.cli.steady import refuse_flight as refuse
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file, writable

_DEFAULT_ELASTICITY = 600.0
_A_PERIOD = 64  # states given in an orbit
_SMOOTH = 0.5  # orbits that a change of wind or length takes to begin and to end


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "simulate-cable",
        help="the cable in time: entries, wind, winch, pick-up and release",
        description="Simulate an elastic cable (lumped masses, quadratic drag) towed round a "
        "circle anticlockwise, or along a track. Units: tow radii, 1/Omega, mu a; with --config "
        "m, s, kg. An inextensible cable is simulated with its vibration elasticity (600).",
    )
    add_nondimensional(parser)
    add_flight(parser)
    group = parser.add_argument_group("motion")
    add = group.add_argument
    add("--orbits", type=number(float, 0.1, 10000), default=20.0, metavar="N", help="default 20")
    add("--segments", type=number(int, 2, 1000), default=40, metavar="N", help="default 40")
    add(
        "--start", choices=("steady", "hanging"), default="steady",
        help="the steady state in still air (default), or hanging below, moving as the tow point",
    )
    add(
        "--end-mass-radius", type=float, metavar="X",
        help="of several steady states the one nearest to this; default the smallest",
    )
    add(
        "--wind", metavar="X,Y[,Z]",
        help="velocity of the air, over the tow speed (m/s with --config), reached in an orbit",
    )
    add("--reel-to", type=float, metavar="L", help="cable length to reel to, from the start on")
    add("--reel-rate", type=float, metavar="R", help="how fast, over the tow speed (or m/s)")
    add("--new-end-mass", type=float, metavar="M", help="end mass after a pick-up or release")
    add("--new-after", type=float, metavar="N", help="orbits until then")
    add(
        "--track", metavar="FILE",
        help="CSV with columns t, x, y, z of the tow point, instead of the circle",
    )
    add(
        "--drag-at", choices=("segments", "nodes"), default="segments",
        help="where the cable's drag is taken: the middle of segments (default), or as MoorDyn "
        "does; they agree as segments grow in number",
    )
    add("--tolerance", type=number(float, 1e-10, 1e-2), default=1e-4, metavar="X",
        help="error of a step over length and tow speed, default 1e-4")  # fmt: skip
    add("--json", action="store_true", help="the result as JSON on stdout")
    add("-o", "--output", metavar="FILE", help="CSV of end mass, tow point and tension in time")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Simulate, and print what came of it."""
    from ctcbs_ros.dynamics.cable import drive, hanging, simulate
    from ctcbs_ros.dynamics.line import line_of
    from ctcbs_ros.dynamics.settled import outcome

    if args.output:
        writable(args.output)
    units, parameters = _problem(args)
    line = line_of(parameters, args.drag_at == "nodes")
    period = 2.0 * pi
    tow, first, last = _tow(args, units, period)
    driven = drive(
        line, tow, _wind(args, units, first, period), _length(args, units, line, first),
        _end(args, units, line, first, period),
    )  # fmt: skip
    if args.start == "hanging" or args.track:
        here, velocity = tow.at(first), (tow.at(first + 1e-6) - tow.at(first)) / 1e-6
        state = replace(hanging(line, args.segments, here, velocity), time=first)
    else:
        state = _steady(args, units, parameters)
    count = max(2, round((last - first) / period * _A_PERIOD) + 1)
    times = np.linspace(first, last, count)
    motion = simulate(line, driven, state, times, args.tolerance)
    found = outcome(line, driven, motion, period)
    result = _in_units(asdict(found), units)
    result |= {"orbits": (last - first) / period, "segments": args.segments,
               "steps": motion.steps, "steps_rejected": motion.rejected}  # fmt: skip
    if args.output:
        _write(args.output, line, driven, motion, units)
    if args.json:
        print_json({"parameters": asdict(parameters), "units": units["names"], "end": result})
    else:
        _print(result, units)
    return 0


def _problem(args):
    """Units of what is given and printed, and the parameters."""
    if args.config is not None:
        flight = flight_from(args)
        units = {
            "length": flight.radius, "time": 1.0 / flight.angular_rate,
            "mass": flight.mass_per_length * flight.radius,
            "names": {"length": "m", "time": "s", "mass": "kg", "tension": "N"},
        }  # fmt: skip
        return units, flight.parameters
    refuse(args)
    parameters = parameters_from(args)
    if args.elasticity is None and args.vibration_elasticity is None:
        parameters = replace(parameters, elasticity=_DEFAULT_ELASTICITY)
    units = {
        "length": 1.0, "time": 1.0, "mass": 1.0,
        "names": {"length": "a", "time": "1/Omega", "mass": "mu a", "tension": "mu a^2 Omega^2"},
    }  # fmt: skip
    return units, parameters


def _tow(args, units, period):
    """The tow point's path, and from when to when it is flown."""
    from ctcbs_ros.dynamics.signal import circle, spline

    if args.track is None:
        end = args.orbits * period
        return circle(1.0, 1.0, 0.0, end), 0.0, end
    rows = _read_track(args.track)
    times = rows[:, 0] / units["time"]
    path = spline(times, rows[:, 1:] / units["length"], f"--track {args.track}")
    return path, float(times[0]), float(times[-1])


def _read_track(file):
    try:
        with open(file, newline="", encoding="utf-8") as handle:
            rows = list(csv.DictReader(handle))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--track {file}: cannot be read: {error}") from None
    try:
        values = np.array([[float(row[name]) for name in ("t", "x", "y", "z")] for row in rows])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"--track {file}: numbers in columns t, x, y, z are needed ({error})"
        ) from None
    if len(values) < 4:
        raise InputError(f"--track {file}: {len(values)} rows are not enough, 4 are needed")
    gaps = np.diff(values[:, 0])
    if np.any(gaps > 20.0 * np.median(gaps)):
        i = int(np.argmax(gaps))
        raise InputError(f"--track {file}: a gap of {gaps[i]:g} after t = {values[i, 0]:g}")
    speeds = np.linalg.norm(np.diff(values[:, 1:], axis=0), axis=1) / np.maximum(gaps, 1e-300)
    usual = np.median(speeds)
    if np.any(speeds > 10.0 * usual) and usual > 0.0:
        i = int(np.argmax(speeds))
        raise InputError(
            f"--track {file}: a jump after t = {values[i, 0]:g}, {speeds[i] / usual:.0f} times "
            "as fast as usual"
        )
    return values


def _wind(args, units, first, period):
    from ctcbs_ros.dynamics.signal import linear

    if args.wind is None:
        return None
    try:
        wind = np.array([float(part) for part in args.wind.split(",")])
    except ValueError:
        wind = np.empty(0)
    if wind.size not in (2, 3) or not np.all(np.isfinite(wind)):
        raise InputError(f"--wind {args.wind}: two or three numbers are needed, X,Y[,Z]")
    wind = np.concatenate([wind, np.zeros(3 - wind.size)]) * units["time"] / units["length"]
    if np.linalg.norm(wind) >= 1.0 and args.track is None:
        raise InputError(f"--wind {args.wind}: it must be below the tow speed")
    return linear([first, first + period], [np.zeros(3), wind], "--wind")


def _length(args, units, line, first):
    """From the length at the start to another, the rate rising and falling smoothly."""
    from ctcbs_ros.dynamics.signal import spline

    if args.reel_to is None and args.reel_rate is None:
        return None
    if args.reel_to is None or args.reel_rate is None:
        raise InputError("--reel-to and --reel-rate: only together")
    for name, value in (("--reel-to", args.reel_to), ("--reel-rate", args.reel_rate)):
        if not 0.0 < value < inf:
            raise InputError(f"{name}: {value:g} is not allowed, it must be above 0 and finite")
    change = args.reel_to / units["length"] - line.length
    if change == 0.0:
        return None
    rate = args.reel_rate * units["time"] / units["length"]
    smooth = min(_SMOOTH * 2.0 * pi, abs(change) / rate)
    whole = abs(change) / rate + smooth  # a trapezium of the rate
    before = first - smooth
    t = np.linspace(before, first + whole + smooth, 401)
    s = np.clip(t - first, 0.0, whole)
    up, down = np.minimum(s, smooth), np.clip(s - (whole - smooth), 0.0, smooth)
    flown = 0.5 * up**2 / smooth + (s - up) - 0.5 * down**2 / smooth
    return spline(t, line.length + np.sign(change) * rate * flown, "--reel-to")


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
    force = units["mass"] * units["length"] / units["time"] ** 2
    plain = ("settled", "slack", "phase_lag")
    scaled = {}
    for key, value in result.items():
        unit = 1.0 if key in plain else force if key == "greatest_tension" else units["length"]
        if isinstance(value, np.ndarray):
            scaled[key] = [float(v) * unit for v in value]
        else:
            scaled[key] = value if isinstance(value, bool) else value * unit
    return scaled


def _write(file, line, driven, motion, units):
    from ctcbs_ros.dynamics.loads import loads

    force = units["mass"] * units["length"] / units["time"] ** 2
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
    for name in ("radius", "depth"):
        print(f"  {name:<9}{result[name]:.6g} {length}, from {result['least_' + name]:.6g} "
              f"to {result['greatest_' + name]:.6g}")  # fmt: skip
    print(f"  lag      {np.degrees(result['phase_lag']):.4g} deg")
    print(f"  mean     {x:.5g}, {y:.5g}, {z:.5g} {length}")
    print(f"in all: greatest tension {result['greatest_tension']:.5g} {tension}, lowest point "
          f"{result['lowest']:.5g} {length}, greatest radius {result['greatest_excursion']:.5g} "
          f"{length}, slack {100.0 * result['slack']:.3g} % of the time")  # fmt: skip
