"""Options of the commands that fly many simulated flights: how many, and how it is told."""

import argparse


def add_study_options(parser: argparse.ArgumentParser, runs_help: str) -> None:
    """Add --runs and --json."""
    parser.add_argument("--runs", type=_runs, default=1000, metavar="N", help=runs_help)
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")


def _runs(text: str) -> int:
    value = int(text)
    if not 20 <= value <= 100_000:
        raise argparse.ArgumentTypeError("20 to 100000 is allowed")
    return value
