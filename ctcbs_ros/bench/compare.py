"""A run against an earlier one: which rows have become slower.

A row is judged by its ratio to the peer, so that the speed of another machine or of a busy hour
cancels; where one of the runs had no peer, by the ratio to a fixed yardstick; a size by itself.
What looks slower is measured again, and only what stays slower is told: noise does not repeat
itself.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite, sqrt
from pathlib import Path

from ctcbs_ros.bench.report import FORMAT, FORMAT_VERSION
from ctcbs_ros.errors import InputError

SLOWER = 1.3
# Alarm half-way (in its logarithm) between no change and what must be seen.
ALARM = sqrt(SLOWER)
REPEATS = 2


@dataclass(frozen=True)
class Change:
    """How a row has changed: cost now over cost then, judged by "peer", "yardstick" or "size".

    `measured` tells how often; what looked slower is measured again, and the least is taken, which
    is then not the figure of the report.
    """

    row: str
    factor: float
    by: str
    measured: int = 1

    @property
    def slower(self) -> bool:
        """Whether it counts as slower."""
        return self.factor >= ALARM


def read_report(path: str | Path) -> dict:
    """Rows of a report written by `ctcbs bench --out`, by name.

    Raises
    ------
    InputError
        If the file is not one.
    """
    try:
        report = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise InputError(f"{path}: this is no report of ctcbs bench (not JSON)") from None
    if not isinstance(report, dict) or report.get("format") != FORMAT:
        raise InputError(f"{path}: this is no report of ctcbs bench")
    if report.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{path}: format version {report.get('format_version')!r} is not known, "
            f"{FORMAT_VERSION} is; write it anew with: ctcbs bench --out {path}"
        )
    try:
        rows = {row["row"]: row for row in report["rows"]}
        for row in rows.values():
            for key in ("median", "ratio", "yardstick"):
                if row[key] is not None and not 0.0 < row[key] < float("inf"):
                    raise ValueError(key)
            row["peer"], row["unit"]
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: the report is incomplete; write it anew") from None
    return rows


def change(now: dict, then: dict) -> Change | None:
    """The change of a row; None where the two runs have nothing in common to judge it by."""
    if now["unit"] == "B":
        pair, by = (now["median"], then["median"]), "size"
    elif now["peer"] == then["peer"] and None not in (now["ratio"], then["ratio"]):
        pair, by = (now["ratio"], then["ratio"]), "peer"
    else:
        pair, by = (now["yardstick"], then["yardstick"]), "yardstick"
    if None in pair or not all(isfinite(value) for value in pair):
        return None
    return Change(now["row"], pair[0] / pair[1], by)


def changes(report: dict, before: dict, again: Callable[[str], dict]) -> list[Change]:
    """Changes of all rows that both runs have.

    Parameters
    ----------
    report : dict
        Of this run.
    before : dict
        Rows of the earlier run, by name.
    again : callable
        Measures the row of a name once more.
    """
    found = []
    for row in report["rows"]:
        if row["row"] not in before:
            continue
        best = change(row, before[row["row"]])
        measured = 1
        while best is not None and best.slower and measured <= REPEATS:
            measured += 1
            repeated = change(again(row["row"]), before[row["row"]])
            if repeated is not None and repeated.factor < best.factor:
                best = repeated
        if best is not None:
            found.append(replace(best, measured=measured))
    return found
