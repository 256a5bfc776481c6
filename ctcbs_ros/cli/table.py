"""`ctcbs table build CONFIG -o FILE` and `ctcbs table info FILE`."""

import sys

from ctcbs_ros.cli.output import print_json


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser("table", help="build or describe a continuation table")
    actions = parser.add_subparsers(dest="action", metavar="{build,info}", required=True)
    build = actions.add_parser("build", help="compute the table of a configuration's envelope")
    build.add_argument("config", metavar="CONFIG", help="configuration file")
    build.add_argument("-o", "--output", required=True, metavar="FILE", help="file to write")
    build.set_defaults(run=run_build)
    info = actions.add_parser("info", help="describe a table")
    info.add_argument("file", metavar="FILE", help="table file")
    info.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    info.set_defaults(run=run_info)


def run_build(args) -> int:
    """Build a table and write it."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.files import writable
    from ctcbs_ros.table.build import build_table
    from ctcbs_ros.table.storage import save_table

    configuration = load_configuration(args.config)
    writable(args.output)
    table = build_table(configuration)
    save_table(table, configuration, args.output)
    print(f"{args.output}: {_states(table.summary())}", file=sys.stderr)
    return 0


def run_info(args) -> int:
    """Describe a table."""
    from ctcbs_ros.table.storage import load_table, read_header

    summary = {**read_header(args.file), **load_table(args.file).summary()}
    if args.json:
        print_json(summary)
        return 0
    low, high = summary["radius_m"]
    slow, fast = summary["speed_m_s"]
    least, most = summary["margin_per_s"]
    print(f"{args.file}: built from {summary['source']}, format {summary['format_version']}")
    print(f"  configuration  {summary['configuration_hash']}")
    print(f"  envelope       radius {low:g} to {high:g} m, speed {slow:g} to {fast:g} m/s")
    print(
        f"  for            cable {summary['cable_length_m']:g} m, end mass "
        f"{summary['end_mass_kg']:g} kg, air {summary['air_density_kg_m3']:g} kg/m^3"
    )
    print(f"  nodes          {summary['nodes'][0]} x {summary['nodes'][1]}: {_states(summary)}")
    print(f"  margin         {least:.4g} to {most:.4g} 1/s, {summary['unstable_states']} unstable")
    print(f"  folds          {'yes' if summary['branches_end_in_folds'] else 'none within reach'}")
    return 0


def _states(summary: dict) -> str:
    low, high = summary["states"]
    if low == high == 1:
        return "one steady state everywhere"
    several = summary["nodes_with_several_states"]
    return f"{low} to {high} steady states, several at {several} nodes"
