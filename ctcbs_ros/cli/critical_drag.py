"""`ctcbs critical-drag`: the least cable drag for unique and for stable solutions."""

from math import inf

from ctcbs_ros.cli.cusp import add_arguments, parameters_from
from ctcbs_ros.cli.output import print_json

_MEANINGS = {
    "unique": "there is one steady state",
    "stable": "the state at the first minimum of the end-mass radius is stable",
    "required": "both",
    "stable_everywhere": "every state of the branch from omega 0 on is stable",
}


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "critical-drag",
        help="least cable drag for unique and for stable solutions",
        description="Least cable drag above which every omega up to --omega-max has one steady "
        "state (unique), the state at the first minimum of the end-mass radius is stable "
        "(stable), and every state of the branch connected to omega -> 0 up to --omega-max is "
        "stable (stable_everywhere). `required` is the larger of unique and stable. The first "
        "minimum is, at each drag, that of least omega on the branch connected to omega -> 0; "
        "where that branch has none, the one followed from larger drag onto the branch that has "
        "parted from it. Where a value is null, `reasons` says why: either no drag is needed, as "
        "the condition holds at all that are looked at, or none suffices. It also says where "
        "stable is the drag above which there is no minimum.",
    )
    add_arguments(parser)
    parser.set_defaults(run=run)


def run(args) -> int:
    """Find both and print them."""
    from ctcbs_ros.solver.critical_drag import critical_drag
    from ctcbs_ros.solver.surface import DRAG_RANGE

    found = critical_drag(parameters_from(args), args.omega_max, everywhere=True)
    values = {
        "unique": found.unique,
        "stable": found.stable,
        "required": found.required,
        "stable_everywhere": found.stable_everywhere,
    }
    low, high = DRAG_RANGE
    words = {
        None: f"none needed: holds at every d_n from {low:g} to {high:g}",
        inf: f"none suffices: fails even at d_n {high:g}",
    }
    reasons = {name: words[value] for name, value in values.items() if value in words}
    if found.minimum_ends:
        reasons["stable"] = "above this drag the end-mass radius has no minimum over omega"
    if args.json:
        print_json({**values, "reasons": reasons})
    else:
        print(f"From which cable drag on, for omega up to {args.omega_max:g}:")
        for name, value in values.items():
            drag = "" if words.get(value) else f"d_n {value:.9g}"
            told = ", ".join(filter(None, (drag, reasons.get(name))))
            print(f"{_MEANINGS[name]:{max(map(len, _MEANINGS.values()))}}  {told}")
    return 0
