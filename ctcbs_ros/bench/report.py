"""The report of a run: a document of plain values for JSON, and a table for people."""

import os
import platform
from datetime import datetime, timezone
from importlib import metadata
from math import isfinite
from pathlib import Path

import numpy as np

from ctcbs_ros import __version__
from ctcbs_ros.bench.peer_auto import version as auto_version
from ctcbs_ros.bench.row import Outcome, Row

FORMAT = "ctcbs_ros bench"
FORMAT_VERSION = 1
_PACKAGES = ("numpy", "scipy", "numba", "pymavlink", "moordyn", "rclpy")


def document(results: list[tuple[Row, Outcome]], quick: bool) -> dict:
    """Everything of a run, as plain values; times in s, sizes in bytes."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "quick": quick,
        "machine": machine(),
        "versions": versions(),
        "rows": [row_document(row, outcome) for row, outcome in results],
    }


def row_document(row: Row, outcome: Outcome) -> dict:
    """One row."""
    values = {
        "row": row.name,
        "what": row.what,
        "unit": row.unit,
        "median": outcome.median,
        "p99": outcome.p99,
        "cpu_median": outcome.cpu_median,
        "cpu_p99": outcome.cpu_p99,
        "samples": outcome.samples,
        "target": row.target,
        "judged": row.judged,
        "met": row.met(outcome) if measured(outcome) else None,
        "accurate": outcome.accurate,
        "peer": row.peer,
        "peer_missing": outcome.missing or None,
        "peer_median": outcome.peer_median,
        "ratio": outcome.ratio,
        "ratio_target": row.needed,
        "yardstick": outcome.yardstick,
        "facts": {name: _plain(value) for name, value in outcome.facts.items()},
    }
    return {name: _plain(value) for name, value in values.items()}


def _plain(value):
    """The value as Python's own type; null for a number that is none."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not isfinite(value) else value


def measured(outcome: Outcome) -> bool:
    """Whether there is a figure at all: without ROS the node's rows have none."""
    return isfinite(outcome.median)


def machine() -> dict:
    """The machine that this runs on."""
    model = platform.processor()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    except OSError:
        pass
    return {
        "cpu": model,
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def versions() -> dict:
    """Versions of this package and of the peers; null where one is not installed."""
    found = {"ctcbs_ros": __version__}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = None
    return found | {"auto-07p": auto_version() or None}


def figure(value: float | None, unit: str) -> str:
    """A time or a size for people."""
    if value is None or not isfinite(value):
        return "-"
    steps = (
        ((1e6, "MB"), (1e3, "kB"), (1.0, "B")) if unit == "B"
        else ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))
    )  # fmt: skip
    scale, name = next((s for s in steps if value >= s[0]), steps[-1])
    return f"{value / scale:.3g} {name}"


_HEAD = (
    "row", "median", "cpu", "p99", "target", "met", "peer", "its median", "ratio", "target"
)  # fmt: skip
_LEFT = (0, 6)  # columns of words


def text(report: dict) -> str:
    """The report as an aligned table, with what else was found below."""
    lines = [_HEAD, *(_cells(row) for row in report["rows"])]
    widths = [max(len(line[k]) for line in lines) for k in range(len(_HEAD))]
    table = [
        "  ".join(
            cell.ljust(width) if k in _LEFT else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    table.insert(1, "  ".join("-" * width for width in widths))
    notes = [
        f"{row['row']}: {row['what']}" + "".join(f"; {_fact(*f)}" for f in row["facts"].items())
        for row in report["rows"]
    ]
    about = report["machine"]
    used = ", ".join(f"{k} {v}" for k, v in report["versions"].items() if v)
    return "\n".join(
        [*table, "", *notes, "", f"{about['cpu']}, {about['cores']} cores, Python "
         f"{about['python']}; {used}",
         "Medians and p99 by the clock on the wall, cpu by processor time, as on an idle machine;",
         "ratios, ours over the peer's, by processor time, call by call in turn; met \"cpu\": by "
         "processor time only."]
    )  # fmt: skip


def _cells(row: dict) -> tuple[str, ...]:
    unit = row["unit"]
    target = figure(row["target"], unit)
    if row["judged"] == "p99":
        target = f"p99 {target}"
    met = {"no": "NO", None: "-"}.get(row["met"], row["met"])
    peer = f"not installed ({row['peer'].split()[0]})" if row["peer_missing"] else row["peer"]
    return (
        row["row"], figure(row["median"], unit), figure(row["cpu_median"], unit),
        figure(row["p99"], unit), target, met, peer, figure(row["peer_median"], unit),
        _ratio(row["ratio"]), _ratio(row["ratio_target"]),
    )  # fmt: skip


def _ratio(value: float | None) -> str:
    if value is None:
        return "-"
    return f"1/{1.0 / value:.3g}" if value < 0.5 else f"{value:.3g}"


def _fact(name: str, value) -> str:
    shown = f"{value:.2g}" if isinstance(value, float) and value < 100.0 else f"{value:.0f}"
    return f"{name.replace('_', ' ')} {shown}"
