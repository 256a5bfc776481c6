"""`ctcbs orbit-study`: how good the orbit estimator is, on simulated flights with known truth."""

from dataclasses import asdict

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.study_options import add_study_options, verdict

# Flights that one worker flies at a time.
_CHUNK = 50


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "orbit-study",
        help="errors of the orbit estimator on simulated flights, against its bars",
        description="Flies random circles and other tracks with simulated receiver noise, each "
        "flight with its own seed, and compares what the estimator says with the truth. Ends with "
        "1 if a bar is missed. The bars of coverage are meant for 1000 runs.",
    )
    add_study_options(parser, "flights for each kind of noise; default 1000, about 6 minutes")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Fly, compare, print."""
    from concurrent.futures import as_completed

    from tqdm import tqdm

    from ctcbs_ros.orbit import (
        study,
        study_bars,
        study_cases,
        study_comparison,
        study_convergence,
    )
    from ctcbs_ros.orbit.study_cases import seed_of
    from ctcbs_ros.worker_pool import worker_pool

    calls = {}
    for name, noise in study_cases.NOISES.items():
        flights = range(max(args.runs // noise.cost, 20))
        for first in flights[::_CHUNK]:
            part = flights[first : first + _CHUNK]
            calls["accuracy", name, first] = (study.errors, noise, part, seed_of(name))
    for shape in study.SHAPES:
        calls["shape", shape, 0] = (study.taken_for_orbits, shape, _shape_flights(args.runs))
    for case in study_convergence.CASES:
        calls["convergence", case, 0] = (
            study_convergence.fly_convergence, case, _convergence_flights(args.runs)
        )  # fmt: skip
    for case in study_comparison.CASES:
        calls["comparison", case, 0] = (study_comparison.comparison, case, max(args.runs // 5, 20))
    calls["turns", "", 0] = (study.entry_and_departure, max(args.runs // 5, 20))
    results = {}
    with worker_pool() as pool, tqdm(total=len(calls), desc="orbit study", disable=None) as bar:
        jobs = {pool.submit(*call): key for key, call in calls.items()}
        for job in as_completed(jobs):
            results[jobs[job]] = job.result()
            bar.update()

    def of(kind):
        return {name: results[kind, name, 0] for k, name, first in calls if k == kind}

    accuracies = {}
    for name, noise in study_cases.NOISES.items():
        parts = [results[key] for key in calls if key[:2] == ("accuracy", name)]
        accuracies[name] = study.summary(noise, [run for part in parts for run in part])
    shapes, turns, comparisons = of("shape"), results["turns", "", 0], of("comparison")
    converging = of("convergence")
    bars = study_bars.bars(accuracies, turns, shapes, converging)
    missed = study_bars.missed(bars)
    if args.json:
        print_json({
            "seeds": study.SEEDS,
            "accuracy": [{"noise": name, **asdict(value)} for name, value in accuracies.items()],
            "entry_and_departure": asdict(turns),
            "taken_for_orbits": [{"track": name, "share": v} for name, v in shapes.items()],
            "convergence": [{"change": name, **asdict(v)} for name, v in converging.items()],
            "comparison": [
                {"method": name, "case": case, **asdict(value)}
                for case, found in comparisons.items() for name, value in found.items()
            ],
            "bars": [asdict(bar) for bar in bars],
            "missed_bars": missed,
        })  # fmt: skip
    else:
        lines = _text(study, accuracies, turns, shapes, converging, comparisons)
        print("\n".join([*lines, "", *(bar.line() for bar in bars), "", *verdict(missed)]))
    return 1 if missed else 0


def _shape_flights(runs: int) -> int:
    return max(runs // 25, 5)


def _convergence_flights(runs: int) -> int:
    return max(runs // 33, 3)


def _text(study, accuracies, turns, shapes, converging, comparisons) -> list[str]:
    runs = next(iter(accuracies.values())).runs
    lines = [
        f"Orbit after 0.75 turns unless said; {runs} flights, flight k of case j seeded with "
        f"({study.SEEDS['accuracy']}, j, k)",
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
        f"{_shape_flights(runs)} flights, seeded with ({study.SEEDS['taken_for_orbits']}, k)",
    ]
    lines += [f"{name:42}{100.0 * share:8.1f}" for name, share in shapes.items()]
    lines += [
        "",
        f"An autopilot converges onto its circle, changes or leaves it: orbits within 1.8 turns, "
        f"in %; {_convergence_flights(runs)} flights, flight k of case j seeded with "
        f"({study.SEEDS['convergence']}, j, k)",
        f"{'inside the stated 95 %':42}{'radius':>8}{'circle':>8}{'orbits':>8}"
        f"{'0.3-0.6 turns':>15}{'orbits':>8}{'settled':>9}",
    ]
    lines += [
        f"{name:42}{100.0 * c.interval:8.1f}{100.0 * c.covered:8.1f}{100.0 * c.stated:8.1f}"
        f"{100.0 * c.early:15.1f}{100.0 * c.early_stated:8.1f}{100.0 * c.settled:9.1f}"
        for name, c in converging.items()
    ]
    for case, found in comparisons.items():
        lines += [
            "",
            f"Methods, white 1.5 m, 0.3 m/s, {case}; "
            f"{max(runs // 5, 20)} flights, seeded with ({study.SEEDS['comparison']}, k)",
            f"{'root mean square error':42}{'radius %':>9}{'centre m':>9}{'worst radius %':>15}"
            f"{'lost':>6}",
        ]
        lines += [
            f"{name:42}{100.0 * c.radius:9.2f}{c.center:9.2f}{100.0 * c.worst:15.2f}"
            f"{c.lost:6d}"
            for name, c in found.items()
        ]
    return lines
