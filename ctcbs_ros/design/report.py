"""A design as one HTML file, its plots inside it, to be read without anything else."""

import base64
from collections.abc import Iterable
from html import escape
from math import inf, isfinite
from pathlib import Path

from ctcbs_ros import __version__
from ctcbs_ros.design.changes import change_named
from ctcbs_ros.design.design import Design
from ctcbs_ros.design.remedies import Remedy
from ctcbs_ros.design.report_plots import envelope_plot, way_in_plot
from ctcbs_ros.design.text import (
    ASSUMPTIONS,
    COMBINE,
    also_violated,
    amount,
    chart_rows,
    interval_text,
    notable_points,
    point_cells,
    set_options,
    vain_text,
    verdict_line,
    way_in_events,
    way_in_title,
)
from ctcbs_ros.files import atomic_file

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; margin: .5rem 0 1rem; font-size: .92rem; }
th, td { border-bottom: 1px solid #ddd; padding: .25rem .7rem .25rem 0; text-align: left;
  vertical-align: top; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
.verdict { padding: .8rem 1rem; border-left: .5rem solid; font-size: 1.05rem; }
.ok { border-color: #2a8a3e; background: #eaf6ec; }
.bad { border-color: #c22; background: #fbeaea; }
code { background: #f3f3f3; padding: .1rem .25rem; }
img { width: 100%; height: auto; } .small { color: #555; font-size: .88rem; }
@media print { h2 { break-after: avoid; } table, img { break-inside: avoid; } }
"""


def write_report(path: str | Path, design: Design) -> None:
    """Write the report, whole or not at all.

    Parameters
    ----------
    path : str or Path
        In a folder that is there.
    design : Design

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    content = report(design)
    with atomic_file(path) as file:
        file.write(content)


def report(design: Design) -> str:
    """The whole HTML document."""
    evaluation = design.evaluation
    title = f"Design of {Path(evaluation.configuration.source).name}"
    sections = [
        f"<h1>{escape(title)}</h1>",
        _verdict(design),
        _section("What limits it", _limits(design)),
        _remedies(design) if not design.good else "",
        _section("Cautions", _list(f"{c.code}: {c.text}" for c in design.cautions))
        if design.cautions
        else "",
        _section("Inputs", _inputs(design)),
        _section("Envelope, all of the cable out", _envelope(design)),
        _section(way_in_title(design), _way_in(design)),
        _section("Design chart", _chart(design)),
        _section("What these figures hold for", _list(ASSUMPTIONS)),
        f'<p class="small">ctcbs_ros {escape(__version__)}, '
        f"{escape(evaluation.configuration.source)}</p>",
    ]
    body = "\n".join(section for section in sections if section)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def _verdict(design: Design) -> str:
    kind = "ok" if design.good else "bad"
    lines = [verdict_line(design), *(f"also: {text}" for text in also_violated(design))]
    return f'<p class="verdict {kind}">' + "<br>\n".join(map(escape, lines)) + "</p>"


def _section(title: str, content: str) -> str:
    return f"<h2>{escape(title)}</h2>\n{content}"


def _list(items: Iterable[str]) -> str:
    return "<ul>\n" + "\n".join(f"<li>{escape(item)}</li>" for item in items) + "\n</ul>"


def _table(
    header: Iterable[str], rows: Iterable[Iterable[str]], numbers: range | tuple = ()
) -> str:
    """A table of texts; the columns of `numbers` to the right."""
    def cells(tag: str, texts: Iterable[str]) -> str:
        return "".join(
            f"<{tag}{' class=n' if i in numbers else ''}>{text}</{tag}>"
            for i, text in enumerate(escape(text) for text in texts)
        )

    head = cells("th", header)
    lines = "\n".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>"


def _image(content: bytes, meaning: str) -> str:
    data = base64.b64encode(content).decode("ascii")
    return f'<img alt="{escape(meaning)}" src="data:image/png;base64,{data}">'


def _limits(design: Design) -> str:
    rows = []
    for limit in design.limits:
        # Not "met": a limit named UNSTABLE that is met reads like its opposite.
        verdict = "OK" if limit.good else f"NOT OK: {limit.violated} of {limit.judged}"
        if limit.limit == inf:
            verdict = "not judged"
        told = 0.0 < limit.use < 100.0 and isfinite(limit.limit)
        used = f"{100.0 * limit.use:.0f} %" if told else ""
        rows.append((limit.phase, limit.criterion.value, verdict, used, limit.text))
    header = "phase", "criterion", "verdict", "limit used", "worst"
    return _table(header, rows, (3,))


def _remedies(design: Design) -> str:
    found = [remedy for remedy in design.remedies if remedy.found]
    parts = []
    if design.straight_deployment_helps:
        parts.append(
            "<p>The cable paid out in straight flight, and the circle tightened then, is "
            "good all the way (<code>--deploy straight</code>).</p>"
        )
    if found:
        parts.append(
            "<p>The least change of each kind that makes the whole verdict good, alone and "
            "evaluated anew:</p>"
        )
        header = "change", "to", "now", "not enough", "option", "with"
        parts.append(_table(header, (_remedy_row(remedy) for remedy in found), (2, 3)))
    else:
        parts.append(f"<p>{escape(COMBINE)}</p>")
    vain = [vain_text(remedy) for remedy in design.remedies if not remedy.found]
    if vain:
        parts.append(f"<p>Tried in vain:</p>{_list(vain)}")
    return _section("What to change", "\n".join(parts))


def _remedy_row(remedy: Remedy) -> tuple[str, ...]:
    change = change_named(remedy.change)
    return (
        remedy.change,
        f"{change.quantity} {remedy.bound} {amount(remedy, remedy.value)}",
        amount(remedy, remedy.present),
        amount(remedy, remedy.missed),
        set_options(remedy),
        change.remark,
    )


def _inputs(design: Design) -> str:
    evaluation = design.evaluation
    c, r = evaluation.configuration, evaluation.requirements
    cable, mass = c.cable, c.end_mass

    def given(value: float, unit: str, without: str) -> str:
        return f"{value:.6g} {unit}" if isfinite(value) else without

    rows = [
        ("Aircraft: tow radius", f"{c.envelope.radius[0]:g} to {c.envelope.radius[1]:g} m"),
        ("Aircraft: speed", f"{c.envelope.speed[0]:g} to {c.envelope.speed[1]:g} m/s"),
        ("Cable: length", f"{cable.length:g} m"),
        ("Cable: diameter", f"{1000.0 * cable.diameter:g} mm"),
        ("Cable: density", f"{cable.density:g} kg/m^3"),
        ("Cable: Young's modulus", given(cable.youngs_modulus, "Pa", "infinite (no stretch)")),
        ("Cable: drag coefficient", f"{cable.drag_coefficient:g}"),
        ("Cable: axial damping", f"{cable.axial_damping:g} s"),
        ("Cable: breaking tension", given(cable.breaking_tension, "N", "not given")),
        ("End mass: mass", f"{mass.mass:g} kg"),
        ("End mass: frontal area", f"{mass.frontal_area:g} m^2"),
        ("End mass: drag coefficient", f"{mass.drag_coefficient:g}"),
        ("End mass: displaced volume", f"{mass.displaced_volume:g} m^3"),
        ("Air: density", f"{evaluation.density:.4g} kg/m^3"),
        ("Required: steady states", "one, stable, with no jump on the way in"),
        ("Required: margin", f"above {r.margin:g} 1/s"),
        ("Required: end-mass radius", _radius_limit(r.end_mass_radius, r.end_mass_radius_share)),
        ("Required: tension", f"up to {r.tension:.3g} of the breaking tension"),
    ]
    return _table(("input", "value"), rows)


def _radius_limit(metres: float, share: float) -> str:
    limits = [f"up to {metres:g} m"] if isfinite(metres) else []
    limits += [f"up to {share:.3g} of the tow radius"] if isfinite(share) else []
    return " and ".join(limits) or "no limit given"


def _envelope(design: Design) -> str:
    evaluation = design.evaluation
    header = (
        "tow radius [m]", "speed [m/s]", "steady states", "end-mass radius [m]",
        "over tow radius", "depth [m]", "margin [1/s]", "tension [N]", "verdict",
    )  # fmt: skip
    rows = (point_cells(p, evaluation.violations(p)) for p in notable_points(design))
    good = "".join(
        f"<li>{speed:.4g} m/s: {escape(interval_text(intervals))}</li>"
        for speed, intervals in design.good_radii.items()
    )
    lowest = max((p.depth for p in evaluation.points if p.state is not None), default=0.0)
    height = evaluation.configuration.limits.minimum_height
    return (
        _image(envelope_plot(design), "End-mass radius, margin and tension over the envelope")
        + "<p>Corners of the envelope and the worst points:</p>"
        + _table(header, rows, range(8))
        + f"<p>Tow radii that are good:</p><ul>{good}</ul>"
        + f"<p>The end mass hangs up to {lowest:.4g} m below the aircraft: "
        f"limits.minimum_height ({height:g} m) needs {lowest + height:.4g} m above the ground.</p>"
    )


def _way_in(design: Design) -> str:
    evaluation = design.evaluation
    events = [line for way in evaluation.judged_ways_in for line in way_in_events(way)]
    return _image(
        way_in_plot(design), "End-mass radius, margin and tension on the way in"
    ) + (_list(events) if events else "<p>No jump and no change of stability on the way.</p>")


def _chart(design: Design) -> str:
    header, *rows = chart_rows(design)
    table = _table(header, rows, range(1, len(header)))
    return (
        "<p>Non-dimensional parameters as in the thesis's Table 2.1 (* outside it), and what its "
        "chart (Fig. 5.1) asks of them: omega above the cusp's, cable drag above the least for "
        f"unique and for stable solutions.</p>{table}"
    )
