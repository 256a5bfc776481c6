"""`ctcbs figures DIR`: the thesis's figures, computed and drawn again."""

from ctcbs_ros.errors import InputError


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "figures",
        help="compute and draw the thesis's figures",
        description="Computes the figures of the thesis on all cores and writes each as CSV and "
        "PNG (fig_3.1.csv, fig_3.1.png, ...).",
    )
    parser.add_argument("folder", metavar="DIR", help="folder to write into, made if need be")
    parser.add_argument(
        "--only", metavar="N[,N...]", help="figures to make, such as 3.1,4.2; default all"
    )
    parser.set_defaults(run=run)


def run(args) -> int:
    """Make the figures and print each file that is written."""
    from ctcbs_ros.figures.catalogue import FIGURES
    from ctcbs_ros.figures.produce import produce

    numbers = list(FIGURES) if args.only is None else _chosen(args.only, FIGURES)
    produce(args.folder, [FIGURES[number] for number in numbers], announce=_print)
    return 0


def _print(file) -> None:
    print(file, flush=True)


def _chosen(only: str, allowed) -> list[str]:
    """The figures' numbers, each once."""
    numbers = [number.strip() for number in only.split(",")]
    for number in numbers:
        if number not in allowed:
            raise InputError(
                f"--only: {number or 'nothing'} is not a figure, allowed are {', '.join(allowed)}"
            )
    return list(dict.fromkeys(numbers))
