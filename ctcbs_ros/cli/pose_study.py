"""`ctcbs pose-study`: whether the pose's covariance holds, by drawn orbits and whole flights."""

from dataclasses import asdict

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.study_options import add_study_options, verdict


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "pose-study",
        help="the pose's covariance against orbits drawn from it and simulated flights",
        description="Draws orbits from an orbit's covariance, follows the end mass to each, and "
        "compares the spread with the covariance stated; then predicts simulated flights with "
        "noise and compares the true steady position with what is stated. Ends with 1 if a bar is "
        "missed.",
    )
    add_study_options(parser, "orbits drawn for each case, and a tenth as many flights in each of "
                      "both senses and hemispheres; default 1000, about four minutes")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Draw, fly, compare, print."""
    from tqdm import tqdm

    from ctcbs_ros.prediction import pose_study as study

    flights = [(place, sense) for place in study.PLACES for sense in (1, -1)]
    spreads, flown = {}, {}
    for job in tqdm([*study.CASES, *flights], desc="pose study", disable=None):
        if isinstance(job, str):
            spreads[job] = study.spread(study.CASES[job], args.runs)
        else:
            place, sense = job
            name = f"{place}, {'anticlockwise' if sense > 0 else 'clockwise'}"
            flown[name] = study.flown(place, sense, max(args.runs // 10, 5))
    missed = study.missed_pose_bars(spreads, flown)
    if args.json:
        print_json({
            "seeds": study.SEEDS,
            "drawn": {name: asdict(found) for name, found in spreads.items()},
            "flown": {name: asdict(found) for name, found in flown.items()},
            "missed_bars": missed,
        })
    else:
        print(_text(study, spreads, flown, missed))
    return 1 if missed else 0


def _text(study, spreads, flown, missed) -> str:
    runs = next(iter(spreads.values())).runs
    lines = [
        f"Orbits drawn from an orbit's covariance, the end mass followed to each; {runs} draws, "
        f"seed {study.SEEDS['drawn']}. Fold: distance in standard deviations.",
        f"{'':28}{'fold':>7}{'beyond, stated':>16}{'':5}stated [m]{'':15}drawn / stated"
        f"{'':7}inside",
        f"{'':28}{'':7}{'%':>8}{'%':>8}{'east':>8}{'north':>8}{'up':>8}"
        f"{'east':>9}{'north':>7}{'up':>7}{'yaw':>7}{'95 %':>9}",
    ]
    for name, s in spreads.items():
        ratios = [d / e for d, e in zip(s.drawn, s.stated, strict=True)]
        lines.append(
            f"{name:28}{s.fold_distance:7.2f}{100.0 * s.jumped:8.1f}{100.0 * s.stated_jumped:8.1f}"
            + "".join(f"{value:8.2f}" for value in s.stated[:3])
            + f"{ratios[0]:9.2f}" + "".join(f"{ratio:7.2f}" for ratio in ratios[1:])
            + f"{100.0 * s.covered:7.1f} %"
        )  # fmt: skip
    runs = next(iter(flown.values())).runs
    lines += [
        "",
        f"Flights of the small drone, 1.5 m and 0.3 m/s of noise, 1.1 to 1.6 turns; {runs} each, "
        f"flight k seeded with ({study.SEEDS['flown']}, k, place, sense)",
        f"{'':28}{'error [m]':>11}{'stated [m]':>12}{'inside 95 %':>13}{'lost':>6}",
    ]
    lines += [
        f"{name:28}{f.error:11.2f}{f.stated:12.2f}{100.0 * f.covered:11.1f} %{f.lost:6d}"
        for name, f in flown.items()
    ]
    return "\n".join([*lines, "", *verdict(missed)])
