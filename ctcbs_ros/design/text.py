"""A design in words: verdict, worst points, deployment, remedies."""

from collections.abc import Iterator
from math import isfinite

from ctcbs_ros.design.changes import change_named
from ctcbs_ros.design.design import Design
from ctcbs_ros.design.limits import ENVELOPE, Limit, way_jump_text
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.remedies import Remedy
from ctcbs_ros.design.way_in import DEPLOYMENT, ENTRY, WayIn

ASSUMPTIONS = (
    "Still air: a steady wind moves the end mass far downwind of what is said here.",
    "Steady states, one at every length: how fast the winch runs is not in the model.",
    "Margins are for small disturbances; a large one may lead elsewhere.",
    "Linear elasticity, quadratic drag, none along the cable, one air density along it.",
    "Between the points computed: folds of the flown branch are traced, narrow windows of flutter "
    "may be missed.",
)
_MANY = {ENVELOPE: "points", DEPLOYMENT: "deployments", ENTRY: "entries"}
COMBINE = "No single change is enough: combine some with --set, and see what is left."


def verdict_line(design: Design) -> str:
    """The verdict and what limits the design, in one line."""
    evaluation = design.evaluation
    if not design.good:
        return f"NOT OK: {_named(design.limiting)}"
    text = (
        f"OK: one stable steady state at all {len(evaluation.points)} points of the envelope and "
        f"along all {len(evaluation.judged_ways_in)} {_MANY[evaluation.requirements.way_in]}"
    )
    nearest = design.limiting
    if nearest is not None:
        text += f"; nearest limit used to {100.0 * nearest.use:.0f} %: {nearest.text}"
    return text


def also_violated(design: Design) -> list[str]:
    """The violated limits that the verdict's line leaves out."""
    rest = [limit for limit in design.limits if not limit.good and limit is not design.limiting]
    return [_named(limit) for limit in rest]


def design_text(design: Design) -> str:
    """The whole of it, for reading in a terminal."""
    return "\n".join(_lines(design))


def _lines(design: Design) -> Iterator[str]:
    yield verdict_line(design)
    for text in also_violated(design):
        yield f"  also: {text}"
    yield ""
    yield from inputs(design)
    yield ""
    yield from _envelope_lines(design)
    yield ""
    yield from _way_in_lines(design)
    yield ""
    yield from _chart_lines(design)
    if design.cautions:
        yield ""
        yield "Cautions"
        for caution in design.cautions:
            yield f"  {caution.code}: {caution.text}"
    if not design.good:
        yield ""
        yield "Remedies, each alone and evaluated anew"
        for line in remedy_lines(design):
            yield f"  {line}"
    yield ""
    yield ASSUMPTIONS[0]


def inputs(design: Design) -> Iterator[str]:
    """What was judged, and against what."""
    evaluation = design.evaluation
    c, r = evaluation.configuration, evaluation.requirements
    cable, mass = c.cable, c.end_mass
    yield (
        f"{c.source}: {cable.length:g} m of {1000 * cable.diameter:g} mm cable, end mass "
        f"{mass.mass:g} kg with {mass.frontal_area:g} m^2, air {evaluation.density:.4g} kg/m^3"
    )
    required = ["one stable steady state"]
    if r.margin > 0.0:
        required.append(f"margin from {r.margin:g} 1/s")
    if isfinite(cable.breaking_tension):
        required.append(
            f"tension up to {r.tension * cable.breaking_tension:.4g} N "
            f"({r.tension:.3g} of the breaking tension)"
        )
    if isfinite(r.end_mass_radius):
        required.append(f"end-mass radius up to {r.end_mass_radius:g} m")
    if isfinite(r.end_mass_radius_share):
        required.append(f"end-mass radius up to {r.end_mass_radius_share:.3g} of the tow radius")
    yield f"Required: {', '.join(required)}"


def _envelope_lines(design: Design) -> Iterator[str]:
    evaluation = design.evaluation
    points = evaluation.points
    bad = sum(bool(evaluation.violations(point)) for point in points)
    (a, b), (v, w) = (
        evaluation.configuration.envelope.radius, evaluation.configuration.envelope.speed,
    )  # fmt: skip
    yield (
        f"Envelope {a:g} to {b:g} m, {v:g} to {w:g} m/s: {len(points)} points, "
        + (f"{bad} of them not good" if bad else "all good")
    )
    titles = (
        "tow radius[m]", "speed[m/s]", "states", "end-mass radius[m]", "of tow radius", "depth[m]",
        "margin[1/s]", "tension[N]", "",
    )  # fmt: skip
    yield "  " + "  ".join(titles)
    for point in notable_points(design):
        cells = point_cells(point, evaluation.violations(point))
        widths = [len(title) for title in titles]
        yield "  " + "  ".join(
            cell.rjust(width) for cell, width in zip(cells, widths, strict=True)
        ).rstrip()
    if bad:
        for speed, intervals in design.good_radii.items():
            yield f"  good radii at {speed:.4g} m/s: {interval_text(intervals)}"


def interval_text(intervals) -> str:
    """Intervals of tow radius in words."""
    return ", ".join(f"{a:.4g} to {b:.4g} m" for a, b in intervals) or "none"


def notable_points(design: Design) -> list[DesignPoint]:
    """The corners of the envelope and the worst point of each criterion, none twice."""
    rows = design.evaluation.rows
    found = [rows[0][0], rows[0][-1], rows[-1][0], rows[-1][-1]]
    for limit in design.limits:
        for point in design.evaluation.points:
            where = point.flight.radius, point.flight.speed
            if limit.phase == "envelope" and where == (limit.radius, limit.speed):
                found.append(point)
    return list(dict.fromkeys(found))


def point_cells(point: DesignPoint, violations) -> list[str]:
    """One row of the table of points."""
    flight = point.flight
    return [
        f"{flight.radius:.5g}", f"{flight.speed:.4g}", str(point.solutions),
        f"{point.end_mass_radius:.4g}", f"{point.end_mass_radius_share:.3f}",
        f"{point.depth:.4g}", f"{point.margin:.3g}", f"{point.tension:.4g}",
        ", ".join(c.value for c in violations) or "OK",
    ]  # fmt: skip


def _way_in_lines(design: Design) -> Iterator[str]:
    evaluation = design.evaluation
    ways = evaluation.judged_ways_in
    bad = [way for way in ways if evaluation.way_in_violations(way)]
    yield f"{way_in_title(design)}: " + (f"{len(bad)} of them not good" if bad else "all good")
    for limit in design.limits:
        if limit.phase != ENVELOPE:
            yield f"  {'' if limit.good else 'NOT OK: '}{limit.text}"
    for way in bad:
        for line in way_in_events(way):
            yield f"  {line}"


def way_in_title(design: Design) -> str:
    """What the ways in that count are."""
    evaluation = design.evaluation
    ways = evaluation.judged_ways_in
    if evaluation.requirements.way_in == ENTRY:
        return (
            f"Entry from straight flight to {evaluation.configuration.envelope.radius[0]:g} m "
            f"with all of the cable out, at {len(ways)} speeds"
        )
    return (
        f"Deployment from 0 to {evaluation.configuration.cable.length:g} m on {len(ways)} circles"
    )


def way_in_events(way: WayIn) -> Iterator[str]:
    """Jumps and changes of stability of one way in, in words."""
    for jump in way.jumps:
        yield f"jump {way_jump_text(jump, way.speed)}"
    for change in way.changes:
        mode = f"flutter at {change.frequency:.3g} rad/s" if change.frequency else "divergence"
        becomes = "ends" if change.becomes_stable else "begins"
        yield (
            f"{mode} {becomes} at {change.radius:.4g} m, {way.speed:.4g} m/s with "
            f"{change.cable_length:.4g} m of cable out"
        )


def _chart_lines(design: Design) -> Iterator[str]:
    rows = chart_rows(design)
    width = max(len(row[0]) for row in rows)
    yield "Design chart (non-dimensional; * outside the thesis's Table 2.1)"
    for name, *cells in rows:
        yield f"  {name.ljust(width)}  " + "  ".join(cell.rjust(15) for cell in cells).rstrip()


def chart_rows(design: Design) -> list[list[str]]:
    """The design chart: name and one cell a column."""
    def value(number) -> str:
        return "none" if number is None else f"{number:.4g}"

    def least(column, drag) -> str:
        if drag is None:
            return "not found" if column.note else "none needed"
        return f"{drag:.4g}" if isfinite(drag) else "none suffices"

    def row(name, cell):
        return [name, *(cell(column) for column in design.chart)]

    def parameter(name, key):
        return row(
            name,
            lambda c: f"{getattr(c.parameters, key):.4g}"
            + ("*" if key in c.outside_table_2_1 else ""),
        )

    return [
        row("tow radius [m]", lambda c: f"{c.radius:g}"),
        row(
            "angular velocity omega",
            lambda c: f"{c.omega[0]:.3g} to {c.omega[1]:.3g}"
            + ("*" if "omega" in c.outside_table_2_1 else ""),
        ),
        row("omega of the cusp", lambda c: value(c.cusp and c.cusp.omega)),
        parameter("cable length l", "length"),
        parameter("end mass m", "end_mass"),
        parameter("elasticity gamma", "elasticity"),
        parameter("drag ratio f", "drag_ratio"),
        parameter("cable drag d_n", "cable_drag"),
        row("least d_n for unique states", lambda c: least(c, c.critical.unique)),
        row("least d_n for stable states", lambda c: least(c, c.critical.stable)),
        row(
            "least end-mass radius",
            lambda c: "none" if c.minimum_speed is None
            else f"{c.minimum_radius:.3g} m",
        ),
        row("speed of the least radius", lambda c: "none" if c.minimum_speed is None
            else f"{c.minimum_speed:.3g} m/s"),
    ]  # fmt: skip


def remedy_lines(design: Design) -> Iterator[str]:
    """The remedies found, then what was tried in vain."""
    if design.straight_deployment_helps:
        yield (
            "deploy in straight flight, then tighten the circle: good all the way"
            f"{'' if design.evaluation.envelope_good else ', though the envelope is not'}"
            "  --deploy straight"
        )
    found = [remedy for remedy in design.remedies if remedy.found]
    for remedy in found:
        yield remedy_text(remedy)
    for remedy in design.remedies:
        if not remedy.found:
            yield vain_text(remedy)
    if not found:
        yield COMBINE


def vain_text(remedy: Remedy) -> str:
    """One remedy that was not found."""
    to = "up" if remedy.furthest > remedy.present else "down"
    still = f"; {', '.join(remedy.still)} still stands there" if remedy.still else ""
    quantity = change_named(remedy.change).quantity
    tried = f"{amount(remedy, remedy.present)} {to} to {amount(remedy, remedy.furthest)}"
    return f"{remedy.change}: {quantity} tried from {tried}, not enough alone{still}"


def remedy_text(remedy: Remedy) -> str:
    """One remedy that was found, with the options that apply it."""
    change = change_named(remedy.change)
    remark = f", {change.remark}" if change.remark else ""
    return (
        f"{remedy.change}: {change.quantity} {remedy.bound} {amount(remedy, remedy.value)} (now "
        f"{amount(remedy, remedy.present)}{remark})  {set_options(remedy)}"
    )


def set_options(remedy: Remedy) -> str:
    """The options that apply a remedy."""
    return " ".join(f"--set {key}={option(value)}" for key, value in remedy.settings.items())


def option(value) -> str:
    """A value as --set takes it."""
    if isinstance(value, tuple):
        return "'[" + ", ".join(f"{item:.6g}" for item in value) + "]'"
    return f"{value:.6g}"


def amount(remedy: Remedy, value: float) -> str:
    """A value of what a remedy changes, with its unit."""
    change = change_named(remedy.change)
    if change.quantity == "cable diameter":
        return f"{1000.0 * value:.4g} mm"
    return f"{value:.4g} {change.unit}"


def _named(limit: Limit) -> str:
    of = f"{limit.violated} of {limit.judged} {_MANY[limit.phase]}"
    return f"{limit.criterion.value}: {limit.text} ({of})"
