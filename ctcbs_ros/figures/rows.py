"""The rows of a figure as a CSV file: written with 12 digits, and read back for drawing."""

import csv
from collections.abc import Iterable, Sequence
from math import nan
from pathlib import Path

from ctcbs_ros import __version__
from ctcbs_ros.files import atomic_file

# One row: numbers, and text in the columns below.
Row = dict[str, float | str]
TEXT = ("kind", "curve", "stability", "event", "note")


def write_rows(path: str | Path, about: str, columns: Sequence[str], rows: Iterable[Row]) -> None:
    """Write rows under a comment line that says what they are and which version made them.

    Parameters
    ----------
    path : str or Path
    about : str
        One line.
    columns : sequence of str
        Those of the file; what a row does not have stays empty, as does nan.
    rows : iterable of dict

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    with atomic_file(path) as file:
        file.write(f"# ctcbs_ros {__version__}: {about}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow([_cell(row.get(name, "")) for name in columns])


def read_rows(path: str | Path) -> list[Row]:
    """Read what `write_rows` wrote; an empty number is nan."""
    with open(path, newline="", encoding="utf-8") as file:
        file.readline()
        return [
            {name: cell if name in TEXT else float(cell or nan) for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


def _cell(value) -> str:
    if isinstance(value, str):
        return value
    return "" if value is None or value != value else f"{value:.12g}"
