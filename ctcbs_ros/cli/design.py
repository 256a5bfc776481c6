"""`ctcbs design`: verdict on a design, what limits it, and what to change by how much."""

import argparse
from math import inf, isfinite
from pathlib import Path

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.errors import InputError


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "design",
        help="verdict on a design, what limits it, and what to change by how much",
        description="Judge every point of the envelope and of the deployment: one steady state, "
        "stable, end-mass radius, tension. Where something fails, find the least change of each "
        "kind that makes all of it good. A verdict of NOT OK is a result like any other and ends "
        "with 0; --exit-code makes it 1.",
    )
    add = parser.add_argument
    add("config", metavar="CONFIG", help="configuration file")
    add(
        "--set", dest="settings", action="append", default=[], metavar="KEY=VALUE",
        help="another value for a parameter of the file, such as cable.length=1200; repeatable",
    )
    add(
        "--max-end-mass-radius", metavar="X",
        help="largest end-mass radius with all of the cable out: in metres (20), or of the tow "
        "radius (10%%); default: no limit",
    )
    add(
        "--min-margin", type=float, default=0.0, metavar="X",
        help="least decay rate of the least damped mode [1/s]; default 0, just stable",
    )
    add(
        "--safety-factor", type=float, metavar="X",
        help="breaking tension over the largest tension allowed; "
        "default 1/limits.tension_fraction",
    )
    add(
        "--deploy", choices=("circling", "straight"), default="circling",
        help="the cable is paid out on the circle (default), or in straight flight before it",
    )
    add(
        "--grid", type=int, default=17, metavar="N",
        help="tow radii computed, half as many speeds, deployments at some of them; default 17",
    )
    add(
        "--altitude", type=float, metavar="M",
        help="height above mean sea level for the standard atmosphere [m]; default: the ground's, "
        "or 0",
    )
    add("--report", metavar="FILE", help="write a report with plots (one HTML file)")
    add("--json", action="store_true", help="the result, with all points, as JSON on stdout")
    add("--exit-code", action="store_true", help="end with 1 where the verdict is NOT OK")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Carry the design out and print it."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.design.design import carry_out
    from ctcbs_ros.design.record import design_record
    from ctcbs_ros.design.report import write_report
    from ctcbs_ros.design.text import design_text
    from ctcbs_ros.files import writable
    from ctcbs_ros.worker_pool import worker_pool

    configuration = load_configuration(args.config, args.settings)
    density = _density(args, configuration)
    requirements = _requirements(args, configuration)
    grid = _grid(args.grid)
    if args.report:
        if Path(args.report).suffix not in ("", ".html", ".htm"):
            raise InputError(f"--report {args.report}: a report is one .html file")
        writable(args.report)
    with worker_pool() as pool:
        design = carry_out(configuration, density, requirements, grid, pool, progress=True)
    if args.report:
        write_report(args.report, design)
    if args.json:
        print_json(design_record(design))
    else:
        print(design_text(design))
    return 1 if args.exit_code and not design.good else 0


def _density(args: argparse.Namespace, configuration) -> float:
    ground = configuration.limits.ground_level_amsl
    altitude = args.altitude
    if altitude is None:
        altitude = ground if isfinite(ground) else 0.0
    elif configuration.air.model == "constant":
        raise InputError("--altitude: only with air.model standard_atmosphere")
    density = configuration.air.density_at(altitude)
    if not isfinite(density):
        raise InputError(f"--altitude: {altitude:g} m is outside the standard atmosphere's range")
    return density


def _requirements(args: argparse.Namespace, configuration):
    from ctcbs_ros.design.requirements import Requirements
    from ctcbs_ros.design.way_in import DEPLOYMENT, ENTRY

    radius, share = _radius_limit(args.max_end_mass_radius)
    if not 0.0 <= args.min_margin < inf:
        raise InputError(
            f"--min-margin: {args.min_margin:g} 1/s is not allowed, 0 or more is needed"
        )
    tension = configuration.limits.tension_fraction
    if args.safety_factor is not None:
        if not 1.0 <= args.safety_factor < inf:
            raise InputError(
                f"--safety-factor: {args.safety_factor:g} is not allowed, 1 or more is needed"
            )
        if not isfinite(configuration.cable.breaking_tension):
            raise InputError(
                f"--safety-factor: needs cable.breaking_tension, which {configuration.source} "
                "does not give"
            )
        tension = 1.0 / args.safety_factor
    way_in = ENTRY if args.deploy == "straight" else DEPLOYMENT
    return Requirements(radius, share, args.min_margin, tension, way_in)


def _radius_limit(text: str | None) -> tuple[float, float]:
    """Limits in metres and over the tow radius; inf for none."""
    if text is None:
        return inf, inf
    try:
        value = float(text.removesuffix("%"))
    except ValueError:
        value = -1.0
    if not 0.0 < value < inf:
        raise InputError(
            f"--max-end-mass-radius: {text!r} is not allowed; metres (20) or a percentage of the "
            "tow radius (10%) is, above 0"
        )
    return (inf, value / 100.0) if text.endswith("%") else (value, inf)


def _grid(radii: int):
    from ctcbs_ros.design.evaluation import Grid

    if not 2 <= radii <= 200:
        raise InputError(f"--grid: {radii} is not allowed, 2 to 200 is")
    return Grid(
        radii=radii,
        speeds=max((radii + 1) // 2, 2),
        deployed_radii=max((radii + 3) // 4, 2),
        deployed_speeds=max((radii + 1) // 6, 2),
    )
