"""`ctcbs periodic`: the periodic motion of the end mass in a steady wind, and its stability."""

import argparse
import sys
from dataclasses import asdict
from math import inf, isnan

import numpy as np

from ctcbs_ros.cli.output import print_json
from ctcbs_ros.cli.steady import add_nondimensional, parameters_from
from ctcbs_ros.errors import InputError

_ELASTICITY = 600.0
# The cable in time, where no periodic motion is found.
_FLYING = {"segments": 48, "left": 2e-4, "most_turns": 100, "tolerance": 1e-4}
# Orders smaller than this share of the tow radius are not printed.
_LEAST_SHOWN = 1e-9


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "periodic",
        help="the motion of the end mass in a steady wind, and its stability",
        description="The periodic motion of the end mass of an aircraft that holds a circle over "
        "the ground in a steady wind, continued from the steady state in still air, and its "
        "stability. Ground frame about the circle's centre, lengths in tow radii: the air moves "
        "towards +x, the orbit is anticlockwise, z is up. A circle that drifts with the air is in "
        "still air: `ctcbs steady`.",
    )
    add_nondimensional(parser, f"gamma, finite; default {_ELASTICITY:g}")
    parser.add_argument(
        "--wind", type=_fraction, metavar="W",
        help="a fraction, 0.1 say: speed of the air, moving towards +x, over that of the tow "
        "point (see --path); no direction, and no m/s",
    )
    parser.add_argument(
        "--path", default="ground-speed",
        help="what is constant round the circle, and what the wind is a fraction of: "
        "ground-speed (default) or airspeed",
    )
    parser.add_argument(
        "--state", type=int, metavar="N",
        help="which of several steady states in still air is continued, 1 for the smallest "
        "end-mass radius; by default the one that straight flight leads to",
    )
    parser.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Solve, and print as JSON or as a table."""
    from ctcbs_ros.periodic.floquet import floquet
    from ctcbs_ros.periodic.solve import periodic_motion
    from ctcbs_ros.periodic.tow_path import TowPath
    from ctcbs_ros.solver.stability import stability

    if args.wind is None:
        raise InputError("missing: --wind")
    if args.elasticity is None:
        args.elasticity = _ELASTICITY
    if args.elasticity == inf:
        raise InputError("--elasticity: inf is not allowed here, the cable has to stretch")
    path = TowPath(args.path, args.wind)
    parameters = parameters_from(args)
    state, reason = _state(parameters, args.state)
    result = {
        "mean": None, "harmonics": [], "growth_rate": None, "stable": None, "residual": None,
        "source": None,
    }  # fmt: skip
    if state is not None:
        found = periodic_motion(state, path)
        reason = found.reason or reason
        if found.motion is not None:
            modes = floquet(found.motion, stability(state).functions)
            result |= _described(found.motion, state) | {
                "growth_rate": modes.growth_rate,
                "stable": modes.stable,
                "source": "periodic",
                "frequency": modes.frequency,
                "converged": modes.converged,
                "functions": modes.functions,
                "band": modes.band,
            }
        else:
            flown = _flown(state, path)
            reason = f"{found.reason}: the motion is that of the cable flown in time"
            if flown.motion is None:
                reason = f"{found.reason}; flown in time, {flown.reason}"
            else:
                result |= _described(flown.motion, state) | {
                    # Turns that repeat are those of a motion that disturbances leave.
                    "growth_rate": None if isnan(flown.growth_rate) else flown.growth_rate,
                    "stable": True,
                    "source": "time-domain",
                    "turns": flown.turns,
                    "slack": flown.slack,
                }
    if args.json:
        given = {"parameters": asdict(parameters), "wind": args.wind, "path": args.path}
        print_json(given | result | ({"reason": reason} if reason else {}))
    else:
        _print_table(result, reason)
    if reason:
        print(f"ctcbs: note: {reason}", file=sys.stderr)
    return 0


def _flown(state, path):
    """What the cable comes to that is flown in time from still air."""
    from ctcbs_ros.dynamics.equilibrium import equilibrium
    from ctcbs_ros.pieces import drained
    from ctcbs_ros.twin.turns import Flown, Flying, refined_turns_search

    try:
        begun = equilibrium(state, _FLYING["segments"] // 2)
    except ArithmeticError as error:
        return Flown(None, str(error))
    how = Flying(**_FLYING)
    return drained(refined_turns_search(state.parameters, path, begun, True, how))[1]


def _described(motion, state) -> dict:
    """Where the end mass is, and in still air."""
    x, y, z = motion.mean.tolist()
    return {
        "mean": {"downwind": x, "crosswind": y, "depth": -z},
        "harmonics": [
            {"order": order, "x": amplitude[0], "y": amplitude[1], "z": amplitude[2]}
            for order, amplitude in enumerate(_shown(motion.harmonics).tolist(), 1)
        ],
        "residual": motion.residual,
        "least_tension": motion.least_tension,
        "still_air": {
            "end_mass_radius": state.end_mass_radius, "depth": state.depth,
            "phase_lag": state.phase_lag,
        },
    }  # fmt: skip


def _fraction(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: one number is needed, the air's speed towards +x over the tow speed"
        ) from None


def _state(parameters, number: int | None):
    """The steady state to begin with, or None; and what is to be said of the choice."""
    from ctcbs_ros.solver.flown import branch_from_straight_flight, match
    from ctcbs_ros.solver.steady_state import steady_states

    found = steady_states(parameters)
    count = len(found.states)
    if number is not None and not 1 <= number <= max(count, 1):
        told = "is 1 steady state" if count == 1 else f"are {count} steady states"
        raise InputError(f"--state: {number} is not allowed, there {told}")
    if count == 0:
        return None, f"no steady state in still air: {found.reason}"
    if number is not None or count == 1:
        return found.states[(number or 1) - 1], found.reason
    flown = branch_from_straight_flight(parameters).end_mass_radius
    chosen = match(found.states, flown) if flown == flown else None
    several = f"{count} steady states in still air"
    if chosen is None:
        return None, f"{several}, none of which straight flight leads to; choose with --state"
    return found.states[chosen], f"{several}; state {chosen + 1} is continued, see --state"


def _shown(harmonics: np.ndarray) -> np.ndarray:
    """Without the orders at the end that are too small to be told from rounding."""
    some = np.flatnonzero(harmonics.max(axis=1) > _LEAST_SHOWN)
    return harmonics[: some[-1] + 1 if some.size else 1]


def _print_table(result: dict, reason: str) -> None:
    if result["mean"] is None:
        print(f"no periodic motion: {reason}")
        return
    mean = result["mean"]
    # Rounding must not choose a side in still air.
    mean = {name: round(value, 9) + 0.0 for name, value in mean.items()}
    along = "downwind" if mean["downwind"] >= 0.0 else "UPWIND"
    side = "left" if mean["crosswind"] >= 0.0 else "right"
    print(
        f"mean: {abs(mean['downwind']):.5g} {along} (x {mean['downwind']:+.5g}) and "
        f"{abs(mean['crosswind']):.5g} to the {side} of the circle's centre, looking downwind "
        f"(y {mean['crosswind']:+.5g}), depth {mean['depth']:.5g} tow radii"
    )
    if mean["downwind"] < 0.0:
        print(
            "  upwind can be right: in wind the drag shakes the cable, which stretches, once an "
            "orbit; near the rate of its own bounce that turns the offset round"
        )
    print("order          x          y          z   half of peak to peak, in tow radii")
    for row in result["harmonics"]:
        if max(row["x"], row["y"], row["z"]) >= 1e-6:
            print(f"{row['order']:5d} {row['x']:10.6f} {row['y']:10.6f} {row['z']:10.6f}")
    growth = result["growth_rate"]
    margin = "margin not known" if growth is None else f"margin {-growth:.5g} per radian of orbit"
    print(
        f"{margin}, {'stable' if result['stable'] else 'UNSTABLE'}; a finer solution would move "
        f"the end mass by about {result['residual']:.1g} tow radii"
    )
    if result["source"] == "time-domain":
        slack = f"; some of it is slack for {100.0 * result['slack']:.0f} % of a turn"
        print(
            f"of the cable flown in time, the same from turn to turn after {result['turns']}"
            + (slack if result["slack"] > 0.0 else "")
        )
