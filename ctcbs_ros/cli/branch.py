"""`ctcbs branch`: every branch of steady states in one varying parameter, with its events."""

import csv
import sys
from collections import Counter
from math import log

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.steady import add_flight, add_nondimensional, flight_from, parameters_from
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file, writable

_SI = {"radius": "radius_m", "speed": "speed_m_s", "cable-length": "cable_length_m"}
_PICTURES = (".png", ".pdf", ".svg")
_NONDIMENSIONAL = ("omega", "length", "end-mass", "cable-drag", "drag-ratio")


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "branch",
        help="all branches in one varying parameter, with folds, Hopf points and extrema",
        description="All branches of steady states in a range of one parameter, isolated ones "
        "included, with their folds, Hopf points and the first minimum of the end-mass radius. "
        "Give the other non-dimensional parameters, or --config with --radius and --speed.",
    )
    parser.add_argument(
        "--vary", required=True, choices=(*_NONDIMENSIONAL, *_SI),
        type=lambda name: name.replace("_", "-"),
        help="what varies; radius [m], speed [m/s] and cable-length [m] with --config",
    )
    parser.add_argument("--from", dest="low", type=float, required=True, metavar="X")
    parser.add_argument("--to", dest="high", type=float, required=True, metavar="X")
    add_nondimensional(parser)
    add_flight(parser)
    parser.add_argument("--csv", metavar="FILE", help="write the points as CSV")
    parser.add_argument("--plot", metavar="FILE", help="draw the diagram (PNG, PDF or SVG)")
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Trace, and print as JSON or as a table."""
    if args.plot and not args.plot.endswith(_PICTURES):
        raise InputError(f"--plot {args.plot}: must end in {', '.join(_PICTURES)}")
    for path in filter(None, (args.csv, args.plot)):
        writable(path)
    from ctcbs_ros.solver.diagram import diagram, first_minimum

    parameters, family, value, name = _problem(args)
    branches = diagram(parameters, family, value, args.low, args.high)
    minimum = first_minimum(branches)
    result = {
        "branches": [
            {
                "connected_to_zero": branch.connected_to_zero,
                "points": [
                    {
                        **_varied(name, point),
                        "end_mass_radius": point.end_mass_radius,
                        "growth_rate": point.growth_rate,
                        "stable": point.stable,
                        "status": point.status,
                    }
                    for point in branch.points
                ],
            }
            for branch in branches
        ],
        "folds": [_event(name, e) for branch in branches for e in branch.folds],
        "hopf": [
            {**_event(name, e), "frequency": e.frequency} for b in branches for e in b.hopf
        ],
        "first_minimum": minimum and _event(name, minimum),
        "extrema": [
            {**_event(name, e), "kind": e.kind} for b in branches for e in (*b.minima, *b.maxima)
        ],
        "stability_changes": [
            {**_event(name, e), "kind": e.kind} for b in branches for e in b.stability_changes
        ],
        "notes": _notes(parameters, family, value, name, args, branches),
    }
    if args.csv:
        _write_csv(args.csv, name, result["branches"])
    if args.plot:
        from ctcbs_ros.plots_diagram import plot_diagram

        plot_diagram(args.plot, name, result)
    if args.json:
        print_json(result)
    else:
        _print(name, result)
    for note in result["notes"]:
        print(f"ctcbs: note: {note}", file=sys.stderr)
    return 0


def _notes(parameters, family, value, name, args, branches) -> list[str]:
    """What the reader has to know: parameters beyond Table 2.1, points not to be trusted."""
    from ctcbs_ros.design.chart import TABLE_2_1

    ends = [family.at(parameters, log(x / value)) for x in (args.low, args.high)]
    notes = []
    for key, (low, high) in TABLE_2_1.items():
        first, last = sorted(getattr(end, key) for end in ends)
        # Rounding of a value given as the bound itself is no excess.
        if first < low * (1.0 - 1e-9) or last > high * (1.0 + 1e-9):
            span = f"{first:.5g}" if first == last else f"{first:.5g} to {last:.5g}"
            notes.append(
                f"{key} {span}: beyond the thesis's Table 2.1 ({low:g} to {high:g}), computed all "
                "the same"
            )
    doubtful = Counter(p.status for b in branches for p in b.points if p.status != "ok")
    notes += [f"{count} points: {status}" for status, count in doubtful.items()]
    if not branches:
        notes.append("no steady state anywhere in the range")
    return notes


def _event(name: str, event) -> dict[str, float]:
    return {**_varied(name, event), "end_mass_radius": event.end_mass_radius}


def _varied(name: str, point) -> dict[str, float]:
    """The varied value under its name, and omega."""
    return {name: point.value, "omega": point.omega}


def _problem(args):
    """Parameters, family, present value of what varies, and its name in the result."""
    from ctcbs_ros.solver.diagram import VARIED
    from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, Family

    if args.vary in _SI:
        if args.config is None:
            raise InputError(f"--vary {args.vary}: needs --config")
        key = args.vary.replace("-", "_")
        # What varies need not be given; any point of the range will do to start from.
        if getattr(args, key) is None:
            setattr(args, key, args.low)
        flight = flight_from(args)
        family, value = {
            "radius": (RADIUS_AT_SPEED, flight.radius),
            "speed": (ANGULAR_RATE, flight.speed),
            "cable-length": (Family("cable_length", length=1.0), flight.cable_length),
        }[args.vary]
        return flight.parameters, family, value, _SI[args.vary]
    if args.config is not None:
        raise InputError(f"--vary {args.vary}: not with --config; vary {' or '.join(_SI)}")
    key = args.vary.replace("-", "_")
    if getattr(args, key) is None:
        setattr(args, key, args.low)
    parameters = parameters_from(args)
    return parameters, VARIED[key], getattr(parameters, key), key


def _write_csv(path: str, name: str, branches) -> None:
    names = list(dict.fromkeys([name, "omega"]))
    columns = ["branch", "connected_to_zero", *names, "end_mass_radius", "growth_rate", "stable"]
    columns.append("status")
    with atomic_file(path) as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        for number, branch in enumerate(branches, 1):
            for point in branch["points"]:
                writer.writerow(
                    {"branch": number, "connected_to_zero": branch["connected_to_zero"], **point}
                )


def _print(name: str, result) -> None:
    for number, branch in enumerate(result["branches"], 1):
        points = branch["points"]
        values = [p[name] for p in points]
        kind = "connected to omega -> 0" if branch["connected_to_zero"] else "isolated"
        unstable = sum(not p["stable"] for p in points)
        print(
            f"branch {number}: {kind}, {name} {min(values):.5g} to {max(values):.5g}, "
            f"{len(points)} points, {unstable} unstable"
        )
    if result["branches"] and not result["folds"]:
        print("no folds on any of them")
    for title, key in (("fold", "folds"), ("Hopf point", "hopf")):
        for event in result[key]:
            extra = f", frequency {event['frequency']:.5g}" if key == "hopf" else ""
            print(
                f"{title}: {name} {event[name]:.9g}, end-mass radius "
                f"{event['end_mass_radius']:.6g}{extra}"
            )
    for event in result["stability_changes"]:
        print(
            f"stability changes ({event['kind']}): {name} {event[name]:.9g}, end-mass radius "
            f"{event['end_mass_radius']:.6g}"
        )
    minimum = result["first_minimum"]
    if minimum:
        print(
            f"first minimum of the end-mass radius: {minimum['end_mass_radius']:.6g} at {name} "
            f"{minimum[name]:.9g}"
        )
    sys.stdout.flush()
