"""`ctcbs twin-study`: whether the twin's stated errors hold, by simulated flights."""

from dataclasses import asdict

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.study_options import add_study_options, verdict


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "twin-study",
        help="the twin's stated errors against a finer cable on simulated flights",
        description="Simulates flights with errors of the receiver and of the wind told, and "
        "compares where the twin has the end mass with a finer cable along the true path. Ends "
        "with 1 if a bar is missed.",
    )
    add_study_options(parser, "flights of each of six cases; default 40, some minutes")
    parser.set_defaults(run=run, runs=40)


def run(args) -> int:
    """Fly, compare, print."""
    from tqdm import tqdm

    from ctcbs_ros.prediction import twin_study as study

    flown = {case: [] for case in study.CASES}
    jobs = [(case, number) for case in study.CASES for number in range(args.runs)]
    for case, number in tqdm(jobs, desc="twin study", unit="flight", disable=None):
        flown[case].append(study.course(case, number))
    found = {case: study.summed_up(courses) for case, courses in flown.items()}
    missed = study.missed_bars(found)
    if args.json:
        cases = {case: asdict(coverage) for case, coverage in found.items()}
        print_json({"seed": study.SEED, "cases": cases, "missed_bars": missed})
    else:
        print(_text(study, found, missed))
    return 1 if missed else 0


def _text(study, found, missed) -> str:
    runs = next(iter(found.values())).runs
    lines = [
        f"Flights of the small drone, {runs} of each case, flight k seeded with ({study.SEED}, k, "
        "case). Errors that stay:",
        f"position {study.STAYS:g} m, wind told {study.WIND:g} m/s; white: {study.WHITE:g} m, "
        f"{study.VELOCITY:g} m/s; each along one axis. Once valid, but for the last column:",
        f"{'':36}{'valid':>7}{'after [s]':>11}{'off [m]':>9}{'stated [m]':>12}"
        f"{'square, of 3':>14}{'inside 95 %':>13}{'before':>10}",
    ]
    lines += [
        f"{case:36}{c.valid:7d}{c.waited:11.0f}{c.error:9.1f}{c.stated:12.1f}{c.square:14.1f}"
        f"{100.0 * c.covered:11.1f} %{100.0 * c.covered_before:8.1f} %"
        for case, c in found.items()
    ]
    return "\n".join([*lines, "", *verdict(missed)])
