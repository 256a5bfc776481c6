"""`ctcbs bench`: speed and memory, each figure beside what people would use instead."""

import json
import sys
from contextlib import nullcontext

from ctcbs_ros.cli.numbers import number
from ctcbs_ros.cli.output import print_json
from ctcbs_ros.files import atomic_file, writable


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "bench",
        help="speed and memory, against scipy, AUTO-07p, MoorDyn and others",
        description="Measures speed and memory in turn with what people would use instead. "
        "Peers that are not installed are left out. Ends with 1 if --compare shows a row slower.",
    )
    add = parser.add_argument
    add("--json", action="store_true", help="the report as JSON on stdout")
    add("--out", metavar="FILE", help="write the report as JSON")
    add("--compare", metavar="FILE", help="tell which rows are 30 %% slower than in that report")
    add("--only", metavar="ROW,...", help="only these rows")
    add("--quick", action="store_true", help="fewer rounds, without table-build and the node")
    add(
        "--points", type=number(int, 3, 100_000), default=40, metavar="N",
        help="random points of row all-states; default 40, 1000 take some minutes",
    )
    add("--plot", metavar="FILE", help="draw error and cost against size instead (PNG, PDF, SVG)")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Measure, print, write and compare."""
    for path in filter(None, (args.out, args.plot)):
        writable(path)
    if args.plot:
        from ctcbs_ros.bench.cost import plot_costs

        plot_costs(args.plot)
        return 0

    from ctcbs_ros.bench.compare import changes, read_report
    from ctcbs_ros.bench.report import document, row_document, text
    from ctcbs_ros.bench.run import chosen_rows, measure

    before = read_report(args.compare) if args.compare else {}
    rows = chosen_rows(args.only, args.quick)
    # Opened first: a file that cannot be written is told before minutes of measuring.
    with atomic_file(args.out) if args.out else nullcontext() as file:
        report = document(measure(rows, args.quick, args.points), args.quick)
        if file:
            json.dump(report, file, indent=2, allow_nan=False)
            file.write("\n")
    slower = False
    if args.compare:
        by_name = {row.name: row for row in rows}

        def again(name):
            ((row, outcome),) = measure([by_name[name]], args.quick, args.points)
            return row_document(row, outcome)

        found = changes(report, before, again)
        slower = any(change.slower for change in found)
        report["comparison"] = [
            {
                "row": c.row, "factor": c.factor, "by": c.by, "slower": c.slower,
                "measured": c.measured,
            }
            for c in found
        ]  # fmt: skip
    if args.json:
        print_json(report)
    else:
        print(text(report))
        _print_comparison(report, args.compare)
    return 1 if slower else 0


def _print_comparison(report: dict, path: str | None) -> None:
    if "comparison" not in report:
        return
    print(f"\nCost of each row over that in {path}:")
    for change in report["comparison"]:
        times = change["measured"]
        least = f", the least of {times} measurements" if times > 1 else ""
        mark = "  SLOWER" if change["slower"] else ""
        print(f"  {change['row']:<14}{change['factor']:6.2f}  by {change['by']}{least}{mark}")
    sys.stdout.flush()
