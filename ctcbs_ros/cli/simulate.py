"""`ctcbs simulate`: a flight log of the tow aircraft circling, in real MAVLink messages."""

import re
import sys
from math import cos, inf, radians, sin

from ctcbs_ros.errors import InputError

CENTER = "47.4,8.5"
HEIGHT_ABOVE_CABLE = 100.0  # m
BEACON_LATE = 0.07  # s by which its first sample is later than the aircraft's


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "simulate",
        help="make a flight log",
        description="Make a MAVLink log of straight entry, turns over a fixed ground circle at "
        "constant airspeed, and straight exit.",
    )
    # A latitude south is a value, not an option: argparse knows plain negative numbers only.
    parser._negative_number_matcher = re.compile(r"-\.?\d")
    add = parser.add_argument
    add("--config", required=True, metavar="FILE", help="configuration whose envelope is flown in")
    add("--radius", required=True, type=float, metavar="M", help="radius of the circle [m]")
    add("--speed", required=True, type=float, metavar="M/S", help="airspeed [m/s]")
    add("--turns", required=True, type=float, metavar="N", help="turns in all")
    add("--sense", choices=("cw", "ccw"), default="ccw", help="seen from above, default ccw")
    add("--center", default=CENTER, metavar="LAT,LON", help=f"[deg], default {CENTER}")
    add("--height", type=float, metavar="M", help="above home [m], default cable length + 100")
    add("--rate", type=float, default=5.0, metavar="HZ", help="positions a second, default 5")
    add(
        "--wind", metavar="M/S,FROM_DEG",
        help="speed [m/s] and the direction that it blows from [deg, 0 north, 90 east, to 360]: "
        "3,270 is a west wind; simulate-cable and entry take a velocity X,Y instead",
    )
    add("--position-noise", type=float, default=0.0, metavar="M", help="standard deviation [m]")
    add("--velocity-noise", type=float, default=0.0, metavar="M/S", help="the same [m/s]")
    add("--gap", metavar="START,DURATION", help="loss of the link [s]")
    add("--radius-change", metavar="RADIUS,AFTER_TURNS", help="spiral to another radius [m]")
    add(
        "--beacon", type=int, metavar="SYSTEM",
        help="a beacon on the payload, a MAVLink system of its own: where the cable in time, "
        "towed along the flight, has the end mass",
    )
    add("--beacon-offset", metavar="E,N,U", help="by which its positions are wrong [m]")
    add("--beacon-noise", type=float, metavar="M", help="standard deviation of them [m]")
    add("--seed", type=int, default=0, metavar="N", help="of the noise, default 0")
    add("-o", "--output", required=True, metavar="FILE", help="log to write (.tlog)")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Simulate the flight and write its log."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.simulate import simulate_flight, write_tlog

    configuration = load_configuration(args.config)
    latitude, longitude = _pair("--center", args.center, "LAT,LON")
    wind = (0.0, 0.0)
    if args.wind:
        strength, from_deg = _pair("--wind", args.wind, "M/S,FROM_DEG")
        if not 0.0 <= strength < inf:
            raise InputError(f"--wind {args.wind}: the speed must be finite and not negative")
        if not 0.0 <= from_deg <= 360.0:
            raise InputError(
                f"--wind {args.wind}: from {from_deg:g} deg is not allowed, it must be 0 to 360 "
                "(M/S,FROM_DEG)"
            )
        wind = (-strength * sin(radians(from_deg)), -strength * cos(radians(from_deg)))
    change = None
    if args.radius_change:
        change = _pair("--radius-change", args.radius_change, "RADIUS,AFTER_TURNS")
    gap = _pair("--gap", args.gap, "START,DURATION") if args.gap else None
    height = args.height
    if height is None:
        height = configuration.cable.length + HEIGHT_ABOVE_CABLE

    flight = simulate_flight(
        args.radius, args.speed, args.turns,
        sense=1 if args.sense == "ccw" else -1,
        height=height, rate=args.rate, wind=wind, radius_change=change,
    )  # fmt: skip
    beacon = _beacon(args, configuration, flight)
    radii = [args.radius] + ([change[0]] if change else [])
    _note_outside(configuration, "radius", "m", radii)
    _note_outside(configuration, "speed", "m/s", [args.speed])
    samples = write_tlog(
        args.output, flight, latitude=latitude, longitude=longitude,
        position_noise=args.position_noise, velocity_noise=args.velocity_noise,
        gap=gap, seed=args.seed, beacon=beacon,
    )  # fmt: skip
    print(f"{args.output}: {samples} positions in {flight.time[-1]:.0f} s", file=sys.stderr)
    return 0


def _beacon(args, configuration, flight):
    """The payload's beacon; None without --beacon."""
    from ctcbs_ros.cli.cable_run import progress
    from ctcbs_ros.simulate import SimulatedBeacon, simulate_payload

    if args.beacon is None:
        for option in ("--beacon-offset", "--beacon-noise"):
            if getattr(args, option[2:].replace("-", "_")) is not None:
                raise InputError(f"{option}: only with --beacon")
        return None
    offset = (0.0, 0.0, 0.0)
    if args.beacon_offset is not None:
        offset = _numbers("--beacon-offset", args.beacon_offset, "E,N,U", 3)
    with progress("payload") as bar:
        payload = simulate_payload(
            configuration, flight, late=BEACON_LATE, tell=lambda part: bar.update(part - bar.n)
        )
    return SimulatedBeacon(payload, args.beacon, offset, args.beacon_noise or 0.0)


def _numbers(option: str, text: str, form: str, count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise InputError(f"{option} {text}: must be {count} numbers, {form}")
    return numbers


def _pair(option: str, text: str, form: str) -> tuple[float, float]:
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: must be two numbers, {form}") from None
    return first, second


def _note_outside(configuration, name: str, unit: str, values: list[float]) -> None:
    low, high = getattr(configuration.envelope, name)
    for value in values:
        if not low <= value <= high:
            print(
                f"note: {name} {value:g} {unit} is outside the envelope of "
                f"{configuration.source}, {low:g} to {high:g} {unit}",
                file=sys.stderr,
            )
