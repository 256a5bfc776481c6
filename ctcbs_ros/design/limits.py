"""What limits a design: each criterion's worst point, and by how much it is met or missed."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, log, nan

from ctcbs_ros.design.evaluation import Evaluation
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.requirements import Criterion, tension_limit
from ctcbs_ros.design.way_in import Jump

ENVELOPE = "envelope"


@dataclass(frozen=True)
class Limit:
    """One criterion over the envelope or over the ways in.

    Attributes
    ----------
    criterion : Criterion
    phase : str
        "envelope" (all of the cable out), "deployment" or "entry".
    text : str
        The worst point in words, with its figure, its limit and their units.
    value, limit : float
        The figure at the worst point and what it is measured against, in `unit`; inf or nan where
        there is none.
    unit : str
    use : float
        How much of the limit is used up there: above 1 it is violated; 0 where there is no limit.
    radius, speed, cable_length : float
        Where that is [m], [m/s], [m].
    violated, judged : int
        Points (or ways in) that violate it, of how many.
    """

    criterion: Criterion
    phase: str
    text: str
    value: float
    limit: float
    unit: str
    use: float
    radius: float
    speed: float
    cable_length: float
    violated: int
    judged: int

    @property
    def good(self) -> bool:
        """Whether nothing violates it."""
        return self.violated == 0


def limits(evaluation: Evaluation) -> tuple[Limit, ...]:
    """All criteria that a design is judged by, the gravest first, the envelope before the rest."""
    return tuple((*_envelope_limits(evaluation), *_way_in_limits(evaluation)))


def limiting(found: Iterable[Limit]) -> Limit | None:
    """The gravest violated limit; where none is, the one used up most; None if none is used."""
    found = list(found)
    violated = [limit for limit in found if not limit.good]
    if violated:
        return violated[0]
    return max((x for x in found if x.use > 0.0), key=lambda x: x.use, default=None)


def _envelope_limits(evaluation: Evaluation) -> Iterable[Limit]:
    points = evaluation.points
    by_point = [(point, evaluation.violations(point)) for point in points]
    row = _rows(ENVELOPE, [found for _, found in by_point])
    flown = [point for point in points if point.state is not None]
    yield from _missing_rows(points, row)
    if not flown:
        return
    yield _solutions_row(flown, "one steady state everywhere", row)
    jumping = [point for point, found in by_point if Criterion.JUMPED in found]
    if jumping:
        nearest = min(jumping, key=lambda point: abs(point.nearest_jump))
        yield row(
            Criterion.JUMPED, nearest.flight,
            f"the end mass jumps inside the envelope: {jump_text(nearest)}",
            nearest.nearest_jump, use=1.0,
        )  # fmt: skip
    yield _margin_row(evaluation, flown, row)
    yield _tension_row(evaluation, flown, row)
    yield _radius_row(evaluation, flown, row)


def _way_in_limits(evaluation: Evaluation) -> Iterable[Limit]:
    judged = [(way, evaluation.way_in_violations(way)) for way in evaluation.judged_ways_in]
    row = _rows(evaluation.requirements.way_in, [found for _, found in judged])
    points = [point for way, _ in judged for point in way.points]
    flown = [point for point in points if point.state is not None]
    jumps = [(jump, way.speed) for way, _ in judged for jump in way.jumps]
    # After a jump onto nothing stable there is nothing to follow.
    if not jumps:
        yield from _missing_rows(points, row)
    if not flown:
        return
    yield _solutions_row(flown, "one steady state at every point computed", row)
    if jumps:
        jump, speed = max(jumps, key=lambda pair: _size(pair[0]))
        yield row(
            Criterion.JUMPED, jump, f"the end mass jumps {way_jump_text(jump, speed)}",
            jump.before, unit="m", use=1.0, speed=speed,
        )  # fmt: skip
    least = min(flown, key=lambda point: point.margin)
    text = (
        f"stable all the way: least margin {least.margin:.3g} 1/s at {place(least)}"
        if least.stable
        else _unstable_text(least)
    )
    use = 0.0 if least.stable else inf
    yield row(Criterion.UNSTABLE, least.flight, text, least.margin, 0.0, "1/s", use)
    yield _tension_row(evaluation, flown, row)


def _rows(phase: str, violations: Sequence[Sequence[Criterion]]) -> Callable[..., Limit]:
    """Makes the `Limit` of a criterion, given what each point or way in of a phase violates."""
    def row(criterion, where, text, value, limit=nan, unit="", use=0.0, speed=None):
        violated = sum(criterion in found for found in violations)
        return Limit(
            criterion, phase, text, value, limit, unit, use, where.radius,
            where.speed if speed is None else speed, where.cable_length, violated,
            len(violations),
        )  # fmt: skip

    return row


def _missing_rows(points: Iterable[DesignPoint], row) -> Iterable[Limit]:
    missing = [point for point in points if point.state is None]
    if missing:
        why = missing[0].reason or "the state was lost"
        text = f"no steady state at {place(missing[0])}: {why}"
        yield row(Criterion.NO_SOLUTION, missing[0].flight, text, float(len(missing)), 0.0)


def _solutions_row(flown: list[DesignPoint], one: str, row) -> Limit:
    most = max(flown, key=lambda point: point.solutions)
    several = f"{most.solutions} steady states at {place(most)}, 1 is required"
    return row(
        Criterion.MULTIPLE_SOLUTIONS, most.flight, one if most.solutions == 1 else several,
        float(most.solutions), 1.0,
    )  # fmt: skip


def _margin_row(evaluation: Evaluation, flown: list[DesignPoint], row) -> Limit:
    least = min(flown, key=lambda point: point.margin)
    required = evaluation.requirements.margin
    use = inf if least.margin <= 0.0 else required / least.margin
    if not least.stable:
        # Counted for both: a point that is unstable has no margin either.
        return row(
            Criterion.UNSTABLE, least.flight, _unstable_text(least), least.margin, required,
            "1/s", use,
        )  # fmt: skip
    return row(
        Criterion.LOW_MARGIN, least.flight,
        f"least margin {least.margin:.3g} 1/s at {place(least)}, "
        + (f"{required:.3g} 1/s is required" if required else "above 0 is required"),
        least.margin, required, "1/s", use,
    )  # fmt: skip


def _unstable_text(least: DesignPoint) -> str:
    return (
        f"{least.damping.nearest_loss} at {place(least)}: disturbances grow at "
        f"{-least.margin:.3g} 1/s"
    )


def _tension_row(evaluation: Evaluation, flown: list[DesignPoint], row) -> Limit:
    tightest = max(flown, key=lambda point: point.tension)
    allowed = tension_limit(evaluation.configuration, evaluation.requirements)
    breaking = evaluation.configuration.cable.breaking_tension
    against = (
        f"of {allowed:.4g} N allowed ({evaluation.requirements.tension:.3g} of the breaking "
        f"tension {breaking:.4g} N)"
        if isfinite(allowed)
        else "not judged, the breaking tension is not given"
    )
    return row(
        Criterion.TENSION_LIMIT, tightest.flight,
        f"tension {tightest.tension:.4g} N at {place(tightest)}, {against}",
        tightest.tension, allowed, "N", tightest.tension / allowed,
    )  # fmt: skip


def _radius_row(evaluation: Evaluation, flown: list[DesignPoint], row) -> Limit:
    requirements = evaluation.requirements

    def use(point):
        return point.end_mass_radius / requirements.radius_limit(point.flight.radius)

    widest = max(
        flown, key=use if requirements.limits_radius else lambda point: point.end_mass_radius
    )
    limit = requirements.radius_limit(widest.flight.radius)
    against = f"limit {limit:.4g} m" if isfinite(limit) else "no limit given"
    return row(
        Criterion.END_MASS_RADIUS, widest.flight,
        f"end-mass radius {widest.end_mass_radius:.4g} m "
        f"({widest.end_mass_radius_share:.3g} of the tow radius) at {place(widest)}, {against}",
        widest.end_mass_radius, limit, "m", use(widest),
    )  # fmt: skip


def _size(jump: Jump) -> float:
    """How far a jump goes, in ln(radius); onto nothing stable is the worst."""
    return abs(log(jump.after / jump.before)) if isfinite(jump.after) else inf


def way_jump_text(jump: Jump, speed: float) -> str:
    """A jump on a way in, in words."""
    onto = f"to {jump.after:.4g} m" if isfinite(jump.after) else "to no stable state"
    return (
        f"at {jump.radius:.4g} m, {speed:.4g} m/s with {jump.cable_length:.4g} m of cable out: "
        f"from a radius of {jump.before:.4g} m {onto}"
    )


def place(point: DesignPoint) -> str:
    """Where a point is, in words."""
    flight = point.flight
    return f"{flight.radius:.5g} m, {flight.speed:.4g} m/s, {flight.cable_length:.4g} m of cable"


def jump_text(point: DesignPoint) -> str:
    """The nearest jump of a point in words."""
    relative = point.nearest_jump
    in_speed = point.jump_in_speed / point.flight.speed - 1.0
    where = (
        f"a speed of {point.jump_in_speed:.4g} m/s"
        if relative == in_speed
        else f"a tow radius of {point.jump_in_radius:.4g} m"
    )
    return f"at {where} ({relative:+.1%} from {place(point)})"
