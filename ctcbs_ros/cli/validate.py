"""`ctcbs validate`: the cable beside MoorDyn, settled, in entries, in wind, and oscillating."""

import json
import tempfile
from dataclasses import asdict
from importlib.util import find_spec
from math import isfinite
from pathlib import Path

from ctcbs_ros.cli.output import finite_or_null, print_json
from ctcbs_ros.errors import InputError


def add_parser(subparsers) -> None:
    """Add the subcommand's arguments."""
    parser = subparsers.add_parser(
        "validate",
        help="steady state, motion in time and in wind beside MoorDyn",
        description="Flies each case with MoorDyn (pip install moordyn) and with the product, and "
        "compares them: the same segments to 0.1 %, in wind the periodic motion to 0.5 % of the "
        "tow radius. A minute or two. Ends with 1 if a bar is missed.",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for table and pictures")
    parser.add_argument("--json", action="store_true", help="the comparisons as JSON on stdout")
    parser.set_defaults(run=run)


def run(args) -> int:
    """Fly all cases, compare, print."""
    if find_spec("moordyn") is None:
        raise InputError("MoorDyn is not installed (pip install moordyn): there is no comparison")
    from ctcbs_ros.replay.folder import complete_folder

    if args.out is None:
        rows = _validate(None)
    else:
        with complete_folder(args.out) as folder:
            rows = _validate(folder)
            (folder / "comparisons.md").write_text(_markdown(rows), encoding="utf-8")
            (folder / "comparisons.json").write_text(json.dumps(_plain(rows), indent=2) + "\n")
    if args.json:
        print_json(_plain(rows))
    else:
        print(_text(rows))
    return 0 if all(row.met for row in rows) else 1


def _validate(folder: Path | None) -> list:
    """All comparisons; pictures into a folder if there is one."""
    from tqdm import tqdm

    from ctcbs_ros.validation import cases, compare, draw, runs

    work = (
        ("steady", cases.STEADY, runs.fly_steady, compare.of_steady, draw.draw_steady),
        ("decay", (cases.DECAY,), runs.fly_decay, compare.of_decay, None),
        ("entries", cases.ENTRIES, runs.fly_entry, compare.of_entry, draw.draw_entries),
        ("winch", cases.WINCHES, runs.fly_entry, compare.of_winch, None),
        ("oscillation", (cases.ROUGH,), runs.fly_entry, compare.of_oscillation, None),
        ("wind", cases.WINDS, runs.fly_in_wind, compare.of_wind, draw.draw_winds),
    )
    rows = []
    with (
        tempfile.TemporaryDirectory() as scratch,
        tqdm(total=sum(len(w[1]) for w in work), desc="validate", unit="case") as bar,
    ):
        for name, chosen, fly, compared, drawn in work:
            flown = []
            for case in chosen:
                flown.append(fly(case, Path(scratch)))
                rows += compared(flown[-1])
                bar.update()
            if folder is not None and drawn is not None:
                drawn(flown, folder / f"{name}.png")
    return rows


def _plain(rows) -> dict:
    found = [finite_or_null(asdict(row)) | {"met": row.met} for row in rows]
    return {"comparisons": found, "met": all(row.met for row in rows)}


def _cells(row) -> list[str]:
    def told(value):
        return f"{value:.6g}" if isfinite(value) else "-"

    of = "" if row.of == "itself" else f" of {row.of}"
    off = f"{row.difference:.2g} %{of}" if isfinite(row.difference) else "-"
    return [row.case, row.what, told(row.product), told(row.moordyn), off, f"{row.bar:g} %",
            "yes" if row.met else "NO", row.note]  # fmt: skip


_HEADS = ["case", "figure", "here", "MoorDyn", "difference", "bar", "met", ""]


def _text(rows) -> str:
    table = [_HEADS, *map(_cells, rows)]
    widths = [max(len(line[k]) for line in table) for k in range(len(_HEADS))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip()
             for line in table]  # fmt: skip
    missed = sum(not row.met for row in rows)
    return "\n".join([*lines, "", f"{len(rows) - missed} of {len(rows)} bars met"])


def _markdown(rows) -> str:
    lines = ["| " + " | ".join(cells) + " |" for cells in [_HEADS, *map(_cells, rows)]]
    lines.insert(1, "|" + "---|" * len(_HEADS))
    return "\n".join(lines) + "\n"
