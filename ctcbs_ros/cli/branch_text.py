"""A bifurcation diagram in words: a table of its branches, and one of the events on them."""

from collections.abc import Iterable, Iterator
from math import isfinite
from typing import Any

Row = dict[str, Any]

# Title and unit of each varied value.
VARIED = {
    "omega": ("omega", ""),
    "length": ("length", ""),
    "end_mass": ("end mass", ""),
    "cable_drag": ("cable drag", ""),
    "drag_ratio": ("drag ratio", ""),
    "radius_m": ("tow radius", "[m]"),
    "speed_m_s": ("speed", "[m/s]"),
    "cable_length_m": ("cable length", "[m]"),
}
_EVENTS = {
    "fold": "fold",
    "hopf": "Hopf point (flutter)",
    "divergence": "divergence",
    "band": "edge of the band",
}
_KINDS = {
    True: "main: leads to the one state at omega -> 0 when the aircraft slows down, through folds "
    "beyond the range if need be",
    False: "isolated: does not; the end mass comes onto it by a jump or a disturbance only",
}


def branch_lines(name: str, result: Row) -> Iterator[str]:
    """The whole of it.

    Parameters
    ----------
    name : str
        The varied value's name in the result.
    result : dict
        Of `ctcbs branch`.
    """
    branches = result["branches"]
    if not branches:
        return
    in_si = "end_mass_radius_m" in branches[0]["points"][0]
    yield from _aligned(_branches(name, branches, in_si))
    for main, meaning in _KINDS.items():
        if any(branch["connected_to_zero"] is main for branch in branches):
            yield f"  {meaning}"
    yield ""
    events = _events(result)
    if not result["folds"]:
        yield "no folds"
    if events:
        yield from _aligned(_event_rows(name, events, in_si))
    ratio = "the end-mass radius over the tow radius, on a main branch"
    if result["first_minimum"]:
        yield f"  first minimum: of {ratio}"
    else:
        yield f"no minimum of {ratio}"


def _branches(name: str, branches, in_si: bool) -> Iterator[tuple[str, ...]]:
    title, unit = VARIED[name]
    radius, growth = _keys(in_si)
    yield (
        "branch", "", title + unit, "end-mass radius" + ("[m]" if in_si else "/a"),
        "least margin" + ("[1/s]" if in_si else "[1/rad]"), "points", "unstable",
    )  # fmt: skip
    for number, branch in enumerate(branches, 1):
        points = branch["points"]
        rates = [p[growth] for p in points if isfinite(p[growth])]
        yield (
            str(number), "main" if branch["connected_to_zero"] else "isolated",
            _span(p[name] for p in points), _span(p[radius] for p in points),
            f"{-max(rates):.3g}" if rates else "-", str(len(points)),
            str(sum(isfinite(p[growth]) and not p["stable"] for p in points)),
        )  # fmt: skip


def _events(result: Row) -> list[tuple[str, Row]]:
    """Events with their titles, each once, along each branch in rising order."""
    changes = [(_EVENTS[event["kind"]], event) for event in result["stability_changes"]]
    found = [(_EVENTS["fold"], event) for event in result["folds"]]
    found += [(_EVENTS["hopf"], event) for event in result["hopf"]]
    found += [change for change in changes if change[1]["kind"] not in ("fold", "hopf")]
    if result["first_minimum"]:
        found.append(("first minimum", result["first_minimum"]))
    changed = {_place(event) for _, event in changes}
    rows = [(title, {**event, "changes": _place(event) in changed}) for title, event in found]
    return sorted(rows, key=lambda row: _place(row[1]))


def _event_rows(name: str, events, in_si: bool) -> Iterator[tuple[str, ...]]:
    title, unit = VARIED[name]
    radius, _ = _keys(in_si)
    frequency = "frequency_per_s" if in_si else "frequency"
    header = ["event", "branch", title + unit, "end-mass radius" + ("[m]" if in_si else "/a")]
    if in_si:
        header.append("over tow radius")
    yield (*header, "frequency" + ("[rad/s]" if in_si else "[1/rad]"), "stability")
    for event_title, event in events:
        cells = [event_title, str(event["branch"]), f"{event[name]:.7g}", f"{event[radius]:.6g}"]
        if in_si:
            cells.append(f"{event['end_mass_radius']:.6g}")
        cells.append(f"{event[frequency]:.4g}" if frequency in event else "")
        yield (*cells, "changes" if event["changes"] else "")


def _keys(in_si: bool) -> tuple[str, str]:
    if in_si:
        return "end_mass_radius_m", "growth_rate_per_s"
    return "end_mass_radius", "growth_rate"


def _place(event: Row) -> tuple[int, float, float]:
    return event["branch"], event["omega"], event["end_mass_radius"]


def _span(values: Iterable[float]) -> str:
    values = list(values)
    return f"{min(values):.5g} to {max(values):.5g}"


def _aligned(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Rows in columns, the first to the left and the others to the right."""
    rows = list(rows)
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row, widths, strict=True)]
        yield "  ".join([row[0].ljust(widths[0]), *cells[1:]]).rstrip()
