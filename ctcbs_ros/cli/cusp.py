"""`ctcbs cusp`: where the folds of the connected branch are born."""

import argparse

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.errors import InputError

_NEEDED = ("length", "end_mass", "drag_ratio")


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "cusp",
        help="omega and cable drag at which two folds merge",
        description="The cusp of largest cable drag at an omega up to --omega-max, at a fixed "
        "drag ratio, on whatever branch. Where there is none the result is null, and says whether "
        "anything folds at all (stretch can make folds vanish).",
    )
    add_arguments(parser)
    parser.set_defaults(run=run)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `cusp` and `critical-drag` take."""
    parser.add_argument("--length", type=float, metavar="X", help="cable length, L/a")
    parser.add_argument("--end-mass", type=float, metavar="X", help="end mass, M/(mu a)")
    parser.add_argument("--drag-ratio", type=float, metavar="X", help="d/d_n")
    parser.add_argument("--elasticity", type=float, metavar="X", help="gamma; default inf")
    parser.add_argument(
        "--omega-max", type=float, default=3.0, metavar="X",
        help="largest omega that counts; default 3",
    )
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")


def parameters_from(args):
    """`Parameters` but for omega and drag, which the commands vary."""
    from ctcbs_ros.solver.parameters import Parameters

    missing = ["--" + n.replace("_", "-") for n in _NEEDED if getattr(args, n) is None]
    if missing:
        raise InputError(f"missing: {' '.join(missing)}")
    if not 0.02 < args.omega_max <= 10.0:
        raise InputError(f"--omega-max: {args.omega_max:g} is not allowed, 0.02 to 10 is")
    extra = {} if args.elasticity is None else {"elasticity": args.elasticity}
    return Parameters(1.0, args.length, args.end_mass, 1.0, args.drag_ratio, **extra)


def _reason(args, folds: bool) -> str:
    """Why there is no cusp."""
    from ctcbs_ros.kernels.search import MAX_STRAIN
    from ctcbs_ros.solver.surface import DRAG_RANGE

    drags = f"cable drag {DRAG_RANGE[0]:g} to {DRAG_RANGE[1]:g}"
    if folds:
        return f"no cusp up to omega {args.omega_max:g}: the folds there reach it without one"
    stretch = ""
    if args.elasticity is not None:
        stretch = f", and an elasticity of {args.elasticity:g} below a strain of {MAX_STRAIN:g}"
    return f"no folds at any omega up to {args.omega_max:g}, {drags}{stretch}"


def run(args) -> int:
    """Find the cusp and print it."""
    from ctcbs_ros.solver.cusp import cusp, least_unique_drag

    parameters = parameters_from(args)
    found = cusp(parameters, args.omega_max)
    result = {
        "omega": found and found.omega,
        "cable_drag": found and found.cable_drag,
        "end_mass_radius": found and found.end_mass_radius,
    }
    if found is None:
        result["folds"] = least_unique_drag(parameters, args.omega_max) is not None
        result["reason"] = _reason(args, result["folds"])
    if args.json:
        print_json(result)
    elif found is None:
        print(result["reason"])
    else:
        print(
            f"cusp at omega {found.omega:.9g}, cable drag {found.cable_drag:.9g}, end-mass radius "
            f"{found.end_mass_radius:.6g}"
        )
    return 0
