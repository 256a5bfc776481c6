"""`ctcbs wind-study`: how good the wind of a turn is, on simulated turns with known truth."""

from dataclasses import asdict

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.study_options import add_study_options, verdict


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "wind-study",
        help="errors of the wind estimated from a turn, against their bars",
        description="Flies random turns with simulated noise, each with its own seed, and "
        "compares wind and airspeed with the truth. Ends with 1 if a bar is missed.",
    )
    add_study_options(parser, "turns of each kind; default 1000, half a minute")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Fly, compare, print."""
    from tqdm import tqdm

    from ctcbs_ros.orbit import wind_study as study

    found = {
        name: study.wind_accuracy(conditions, args.runs)
        for name, conditions in tqdm(study.CASES.items(), desc="wind study", disable=None)
    }
    missed = study.missed_wind_bars(found)
    if args.json:
        accuracies = {name: asdict(accuracy) for name, accuracy in found.items()}
        print_json({"seed": study.SEED, "accuracy": accuracies, "missed_bars": missed})
    else:
        print(_text(study, found, missed, args.runs))
    return 1 if missed else 0


def _text(study, found, missed, runs) -> str:
    lines = [
        f"Wind at the end of a turn; {runs} turns of each kind, turn k seeded with "
        f"({study.SEED}, k). Errors in % of the airspeed, one axis.",
        f"{'':38}{'wind':>7}{'stated':>8}{'inside 95 %':>13}{'airspeed':>10}{'unknown':>9}",
    ]
    for name, a in found.items():
        lines.append(
            f"{name:38}{100.0 * a.error:7.2f}{100.0 * a.stated:8.2f}{100.0 * a.covered:11.1f} %"
            f"{100.0 * a.airspeed_error:10.2f}{a.unknown:9d}"
        )
    return "\n".join([*lines, "", *verdict(missed)])
