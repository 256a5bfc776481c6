"""What the commands that fly many simulated flights share: their options, and the verdict."""

import argparse


def add_study_options(parser: argparse.ArgumentParser, runs_help: str) -> None:
    """Add --runs and --json."""
    parser.add_argument("--runs", type=_runs, default=1000, metavar="N", help=runs_help)
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")


def verdict(missed: list[str]) -> list[str]:
    """Lines that say which bars are missed, or that none is."""
    return [f"MISSED: {bar}" for bar in missed] or ["All bars hold."]


def _runs(text: str) -> int:
    value = int(text)
    if not 20 <= value <= 100_000:
        raise argparse.ArgumentTypeError("20 to 100000 is allowed")
    return value
