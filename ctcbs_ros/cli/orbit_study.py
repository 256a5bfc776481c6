"""`ctcbs orbit-study`: how good the orbit estimator is, on simulated flights with known truth."""

from dataclasses import asdict

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.study_options import add_study_options


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "orbit-study",
        help="errors of the orbit estimator on simulated flights, against its bars",
        description="Flies random circles and other tracks with simulated receiver noise, each "
        "flight with its own seed, and compares what the estimator says with the truth. Ends with "
        "1 if a bar is missed. The bars of coverage are meant for 1000 runs.",
    )
    add_study_options(parser, "flights for each kind of noise; default 1000, some four minutes")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Fly, compare, print."""
    from tqdm import tqdm

    from ctcbs_ros.orbit import study

    jobs = [*study.NOISES, "entry and departure", *study.SHAPES]
    accuracies, shapes, turns = {}, {}, None
    for job in tqdm(jobs, desc="orbit study", disable=None):
        if job in study.NOISES:
            accuracies[job] = study.accuracy(study.NOISES[job], args.runs)
        elif job in study.SHAPES:
            shapes[job] = study.taken_for_orbits(job, max(args.runs // 50, 5))
        else:
            turns = study.entry_and_departure(max(args.runs // 5, 20))
    missed = study.missed_bars(accuracies, turns, shapes)
    if args.json:
        print_json({
            "seeds": study.SEEDS,
            "accuracy": {name: asdict(value) for name, value in accuracies.items()},
            "entry_and_departure": asdict(turns),
            "taken_for_orbits": shapes,
            "missed_bars": missed,
        })
    else:
        print(_text(study, accuracies, turns, shapes, missed))
    return 1 if missed else 0


def _text(study, accuracies, turns, shapes, missed) -> str:
    runs = next(iter(accuracies.values())).runs
    lines = [
        f"Orbit after three quarters of a turn; {runs} flights, flight k seeded with "
        f"({study.SEEDS['accuracy']}, k)",
        f"{'':42}{'radius':>8}{'bias':>8}{'centre':>9}  inside the stated 95 %, in %",
        f"{'noise':42}{'%':>8}{'%':>8}{'m':>9}{'circle':>8}{'rate':>7}{'phase':>7}{'lost':>6}",
    ]
    for name, a in accuracies.items():
        covered = "".join(f"{100.0 * a.covered.get(k, 0.0):{w}.1f}" for k, w in
                          (("circle", 8), ("rate", 7), ("phase", 7)))  # fmt: skip
        lines.append(
            f"{name:42}{100.0 * a.radius:8.2f}{100.0 * a.radius_bias:8.2f}{a.center:9.2f}"
            f"{covered}{a.lost:6d}"
        )
    lines += [
        "",
        f"Entry and departure, white 1.5 m, 0.3 m/s; {turns.runs} flights, seeded with "
        f"({study.SEEDS['entry_and_departure']}, k)",
        f"{'turns':42}{'median':>8}{'95 %':>8}{'most':>9}",
    ]
    for name, values in (("from entry to the first orbit", turns.first),
                         ("from departure to none", turns.left)):  # fmt: skip
        lines.append(f"{name:42}{values[0]:8.3f}{values[1]:8.3f}{values[2]:9.3f}")
    lines += [
        "",
        f"Tracks that are no orbit: samples at which one is given, in %; "
        f"{max(runs // 50, 5)} flights, seeded with ({study.SEEDS['taken_for_orbits']}, k)",
    ]
    lines += [f"{name:42}{100.0 * share:8.1f}" for name, share in shapes.items()]
    lines += ["", *(f"MISSED: {bar}" for bar in missed)] if missed else ["", "All bars hold."]
    return "\n".join(lines)
