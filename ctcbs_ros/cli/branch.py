"""`ctcbs branch`: every branch of steady states in one varying parameter, with its events."""

import argparse
import csv
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import log
from typing import TYPE_CHECKING

from ctcbs_ros.cli.branch_text import branch_lines
from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.steady import (
    add_flight,
    add_nondimensional,
    flight_from,
    parameters_from,
    refuse_flight,
)
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file, writable

if TYPE_CHECKING:  # imported where they are needed: --help waits for no compiler
    from ctcbs_ros.solver.diagram import Event
    from ctcbs_ros.solver.family import Family
    from ctcbs_ros.solver.parameters import Parameters

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
        "Give the other non-dimensional parameters, or --config with --radius and --speed. "
        'connected_to_zero, "main" in the table, is a branch that leads to the one state at '
        "omega -> 0 when the aircraft slows down with all else kept, whatever varies here; of two "
        "such branches the folds that join them are beyond the range. The others are isolated.",
    )
    parser.add_argument(
        "--vary", required=True, metavar="WHAT", type=_varied,
        help=f"what varies: {_one_of(_NONDIMENSIONAL)}; with --config radius [m], speed [m/s] or "
        "cable-length [m]",
    )
    parser.add_argument("--from", dest="low", type=float, required=True, metavar="X")
    parser.add_argument("--to", dest="high", type=float, required=True, metavar="X")
    add_nondimensional(parser)
    add_flight(parser)
    parser.add_argument("--csv", metavar="FILE", help="write the points as CSV")
    parser.add_argument("--plot", metavar="FILE", help="draw the diagram (PNG, PDF or SVG)")
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    parser.set_defaults(run=run)


def _varied(name: str) -> str:
    found = name.replace("_", "-")
    if found not in (*_NONDIMENSIONAL, *_SI):
        raise argparse.ArgumentTypeError(
            f"{name!r} cannot vary; {_one_of(_NONDIMENSIONAL)} can, and with --config "
            f"{_one_of(_SI)}"
        )
    return found


def _one_of(names) -> str:
    *names, last = names
    return f"{', '.join(names)} or {last}"


def run(args) -> int:
    """Trace, and print as JSON or as a table."""
    if args.plot and not args.plot.endswith(_PICTURES):
        raise InputError(f"--plot {args.plot}: must end in {', '.join(_PICTURES)}")
    for path in filter(None, (args.csv, args.plot)):
        writable(path)
    from ctcbs_ros.solver.diagram import diagram

    problem = _problem(args)
    branches = diagram(problem.parameters, problem.family, problem.value, args.low, args.high)
    result = _record(problem, branches)
    result["notes"] = _notes(problem, args.low, args.high, branches)
    if args.csv:
        _write_csv(args.csv, problem, result["branches"])
    if args.plot:
        from ctcbs_ros.plots_diagram import plot_diagram

        plot_diagram(args.plot, problem.name, result)
    if args.json:
        print_json(result)
    else:
        for line in branch_lines(problem.name, result):
            print(line)
        sys.stdout.flush()
    for note in result["notes"]:
        print(f"ctcbs: note: {note}", file=sys.stderr)
    return 0


@dataclass(frozen=True)
class _Problem:
    """What varies, from where, under which name; in SI also the scales at each value of it."""

    parameters: "Parameters"
    family: "Family"
    value: float
    name: str
    scales: Callable[[float], tuple[float, float]] | None = None  # tow radius, angular rate

    def of(self, found, **rates: float) -> dict[str, float]:
        """Keys of a point or an event: where it is, and rates per radian, per second as well."""
        keys = {self.name: found.value, "omega": found.omega}
        keys["end_mass_radius"] = found.end_mass_radius
        keys |= rates
        if self.scales is not None:
            radius, angular_rate = self.scales(found.value)
            keys["end_mass_radius_m"] = found.end_mass_radius * radius
            keys |= {f"{name}_per_s": rate * angular_rate for name, rate in rates.items()}
        return keys


def _record(problem: _Problem, branches) -> dict:
    """The result but for its notes; events carry the number of their branch, from 1."""
    from ctcbs_ros.solver.diagram import first_minimum

    def events(*kinds: str) -> "list[tuple[int, Event]]":
        return [
            (number, event)
            for number, branch in enumerate(branches, 1)
            for kind in kinds
            for event in getattr(branch, kind)
        ]

    minimum = first_minimum(branches)
    return {
        "branches": [
            {
                "connected_to_zero": branch.connected_to_zero,
                "points": [
                    {
                        **problem.of(point, growth_rate=point.growth_rate),
                        "stable": point.stable,
                        "status": point.status,
                    }
                    for point in branch.points
                ],
            }
            for branch in branches
        ],
        "folds": [{**problem.of(e), "branch": n} for n, e in events("folds")],
        "hopf": [
            {**problem.of(e, frequency=e.frequency), "branch": n} for n, e in events("hopf")
        ],
        "first_minimum": next(
            ({**problem.of(e), "branch": n} for n, e in events("minima") if e is minimum), None
        ),
        "extrema": [
            {**problem.of(e), "branch": n, "kind": e.kind} for n, e in events("minima", "maxima")
        ],
        "stability_changes": [
            {**problem.of(e), "branch": n, "kind": e.kind} for n, e in events("stability_changes")
        ],
    }


def _notes(problem: _Problem, first: float, last: float, branches) -> list[str]:
    """What the reader has to know: parameters beyond Table 2.1, points not to be trusted."""
    from ctcbs_ros.design.chart import TABLE_2_1

    ends = [
        problem.family.at(problem.parameters, log(x / problem.value)) for x in (first, last)
    ]
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
    if problem.name == _SI["radius"]:
        notes.append("minima and maxima are those of the end-mass radius over the tow radius")
    return notes


def _problem(args) -> _Problem:
    from ctcbs_ros.solver.diagram import VARIED
    from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED, Family

    key = args.vary.replace("-", "_")
    in_si = args.vary in _SI
    if in_si and args.config is None:
        raise InputError(
            f"--vary {args.vary}: needs --config; without it vary {_one_of(_NONDIMENSIONAL)}"
        )
    if not in_si and args.config is not None:
        raise InputError(f"--vary {args.vary}: not with --config; vary {_one_of(_SI)}")
    if getattr(args, key) is not None:
        raise InputError(
            f"--{args.vary} {getattr(args, key):g}: not with --vary {args.vary}, which goes "
            "--from one value --to another"
        )
    # Any point of the range will do to start from.
    setattr(args, key, args.low)
    if not in_si:
        refuse_flight(args)
        return _Problem(parameters_from(args), VARIED[key], args.low, key)
    flight = flight_from(args)
    family, scales = {
        "radius": (RADIUS_AT_SPEED, lambda radius: (radius, flight.speed / radius)),
        "speed": (ANGULAR_RATE, lambda speed: (flight.radius, speed / flight.radius)),
        "cable-length": (
            Family("cable_length", length=1.0), lambda _: (flight.radius, flight.angular_rate)
        ),
    }[args.vary]
    return _Problem(flight.parameters, family, args.low, _SI[args.vary], scales)


def _write_csv(path: str, problem: _Problem, branches) -> None:
    columns = ["branch", "connected_to_zero", problem.name, "omega", "end_mass_radius"]
    columns += ["growth_rate", "stable", "status"]
    if problem.scales is not None:
        columns += ["end_mass_radius_m", "growth_rate_per_s"]
    with atomic_file(path) as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(columns)))
        writer.writeheader()
        for number, branch in enumerate(branches, 1):
            for point in branch["points"]:
                writer.writerow(
                    {"branch": number, "connected_to_zero": branch["connected_to_zero"], **point}
                )
