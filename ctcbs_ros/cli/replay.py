"""`ctcbs replay`: predictions of a recorded flight, through the core or through the node."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from ctcbs_ros.cli.numbers import number
from ctcbs_ros.cli.output import finite_or_null, print_json

RATES = (0.0, 1000.0)  # as the parameter replay.rate


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "replay",
        help="predictions of a recorded flight",
        description="Predict the end mass of a recorded flight, and sum the flight up. "
        "Times are in seconds of the vehicle's clock from the first believed sample.",
    )
    add = parser.add_argument
    add("log", metavar="LOG", help="flight log: .tlog, raw MAVLink, .BIN, .ulg, or a ROS 2 bag")
    add("--config", required=True, metavar="CONFIG", help="configuration file")
    add("--table", metavar="FILE", help="continuation table; default: one in the user's cache")
    add(
        "--through",
        choices=("core", "node"),
        default="core",
        help="the core alone, or the ROS 2 node in its own process; default core",
    )
    add(
        "--rate",
        type=number(float, *RATES),
        default=0.0,
        metavar="R",
        help="speed over the log's own clock; default 0, as fast as it goes",
    )
    add("--out", metavar="DIR", help="folder for the tables (CSV), the summary and plots")
    add("--json", action="store_true", help="the summary as JSON on stdout")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Replay the log, write the results and print the summary."""
    from ctcbs_ros.configuration import find_configuration, load_configuration
    from ctcbs_ros.parameter_file import read_parameter_file
    from ctcbs_ros.plots import write_plots
    from ctcbs_ros.replay.folder import complete_folder
    from ctcbs_ros.replay.text import summary_text
    from ctcbs_ros.replay.through_node import NodeFailure
    from ctcbs_ros.schema import checked_parameters
    from ctcbs_ros.telemetry.beacon import beacon_wanted
    from ctcbs_ros.telemetry.source import open_log

    file = find_configuration(args.config)
    configuration = load_configuration(file)
    parameters = checked_parameters(read_parameter_file(file), str(file))
    wanted = parameters["mavlink.system"] or None, parameters["mavlink.component"] or None
    named = configuration.beacon
    beacon = beacon_wanted(named.system_id, named.component_id, named.topic)
    log = open_log(args.log, *wanted, beacon)  # what is no log is refused before a table is built
    table_file = args.table or parameters["table.file"]

    # Everything is imported by now: interrupted amid an import, Python may end without its code.
    if args.through == "node":
        replay = _through_node(args, file, configuration, table_file)
    else:
        replay = _through_core(args, log, configuration, table_file, parameters["twin.enabled"])
    try:
        if args.out:
            with complete_folder(args.out) as folder:
                summary = _replay_into(folder, replay, beacon is not None)
                title, limits = Path(args.log).name, configuration.limits
                why_none = write_plots(folder, summary["orbits"], limits, title)
            pictures = f" (no pictures: {why_none})" if why_none else ""
            print(f"Results: {args.out}{pictures}", file=sys.stderr)
        else:
            summary = replay(lambda record: None, lambda record: None)
    except NodeFailure as error:
        print(f"ctcbs: error: {error}", file=sys.stderr)
        return 1
    if args.json:
        print_json(summary)
    else:
        print(summary_text(summary))
    return 0


def _through_core(args, log, configuration, table_file, with_twin):
    """A function that replays the log through the core, given what takes its records."""
    from ctcbs_ros.beacon.comparer import BeaconComparer
    from ctcbs_ros.prediction.predictor import Predictor
    from ctcbs_ros.prediction.warm_up import spare_collector
    from ctcbs_ros.replay.core import replay_through_core
    from ctcbs_ros.table import table_for

    def replay(take, take_comparison):
        predictor = Predictor(configuration, table_for(configuration, table_file), with_twin)
        comparer = None
        if configuration.beacon.present:
            comparer = BeaconComparer(
                configuration.beacon, predictor.frame, configuration.cable.length
            )
        spare_collector()
        beside = {"comparer": comparer, "take_comparison": take_comparison}
        return _timed(partial(replay_through_core, log, predictor, args.rate, **beside), take)

    return replay


def _through_node(args, file, configuration, table_file):
    """A function that replays the log through the node, given what takes its records."""
    from ctcbs_ros.replay.through_node import replay_through_node, require_ros
    from ctcbs_ros.table import table_for

    def replay(take, take_comparison):
        require_ros()
        table_for(configuration, table_file)  # built here if need be, with a progress bar
        beside = {"take_comparison": take_comparison} if configuration.beacon.present else {}
        way = partial(replay_through_node, args.log, file, table_file, args.rate, **beside)
        return _timed(way, take)

    return replay


def _timed(replay: Callable, take: Callable):
    """The summary of a replay shown by a progress bar, with the time that it took."""
    started = time.monotonic()
    with _progress_bar(take) as take_and_show:
        summary = replay(take_and_show)
    return summary | {"wall_s": time.monotonic() - started}


def _replay_into(folder: Path, replay, with_beacon: bool):
    """Replay with tables and summary written into a folder."""
    from ctcbs_ros.replay.tables import ReplayTables

    tables = ReplayTables(folder, with_beacon)
    try:
        summary = replay(tables.add, tables.add_comparison)
    finally:
        tables.close()
    text = json.dumps(finite_or_null(summary), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n")
    return summary


@contextmanager
def _progress_bar(take: Callable) -> Iterator[Callable]:
    """A bar on standard error; yields `take` with the part of the log read as second argument."""
    from tqdm import tqdm

    interval = 0.1 if sys.stderr.isatty() else 5.0
    layout = "{desc}: {percentage:3.0f} %|{bar}| {elapsed}<{remaining}{postfix}"
    started = time.monotonic()
    first_time = None
    with tqdm(desc="replay", total=1.0, bar_format=layout, mininterval=interval) as bar:

        def take_and_show(record, progress):
            nonlocal first_time
            take(record)
            now = record["vehicle_time_s"]
            if now is not None and first_time is None:
                first_time = now
            # Before the bar is drawn, which would show what was true at its last drawing.
            if now is not None and now > first_time:
                flown = now - first_time
                rate = flown / (time.monotonic() - started)
                told = f"{rate:.1f}" if rate < 10.0 else f"{rate:.0f}"
                bar.set_postfix_str(f"log {flown:.0f} s, {told} x real time", refresh=False)
            bar.update(progress - bar.n)

        yield take_and_show
