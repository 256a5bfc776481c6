"""A run of the benchmark: which rows, and measuring them with one BLAS thread for all."""

from collections.abc import Sequence

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from ctcbs_ros.bench.row import Outcome, Row
from ctcbs_ros.bench.rows import ROWS
from ctcbs_ros.bench.session import Session
from ctcbs_ros.errors import InputError


def chosen_rows(only: str | None, quick: bool) -> list[Row]:
    """Rows by their names, separated by commas; all where none are named.

    Raises
    ------
    InputError
        If a name is not that of a row.
    """
    if only is None:
        return [row for row in ROWS if not (quick and row.long)]
    names = [name.strip() for name in only.split(",")]
    known = [row.name for row in ROWS]
    for name in names:
        if name not in known:
            raise InputError(f"--only {name}: no such row, there are {', '.join(known)}")
    return [row for row in ROWS if row.name in names]


def measure(rows: Sequence[Row], quick: bool = False, points: int = 40
            ) -> list[tuple[Row, Outcome]]:  # fmt: skip
    """Measure rows in their order."""
    results = []
    with (
        threadpool_limits(1),
        Session(quick, points) as session,
        tqdm(rows, desc="bench", unit="row") as bar,
    ):
        for row in bar:
            bar.set_postfix_str(row.name)
            results.append((row, row.measure(session)))
    return results
