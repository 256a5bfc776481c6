"""What makes a figure: its number, what it is, the calls that compute its rows, its drawing."""

from collections.abc import Callable
from dataclasses import dataclass

from ctcbs_ros.figures.rows import Row

Call = tuple[Callable, tuple]


@dataclass(frozen=True)
class Figure:
    """A figure of the thesis.

    Attributes
    ----------
    number : str
        Of the thesis.
    title : str
        What it shows, and the fixed parameters.
    note : str
        What was chosen where the thesis does not say; for the CSV's first line.
    columns : tuple of str
        Of the CSV.
    calls : tuple of (function, arguments)
        Each returns a list of rows; all of them together are the figure's.
    given : tuple of dict
        Rows of kind "thesis": numbers that its text states, to compare with.
    draw : callable
        Of the title and the rows, as read from the CSV; returns a matplotlib Figure.
    """

    number: str
    title: str
    note: str
    columns: tuple[str, ...]
    calls: tuple[Call, ...]
    given: tuple[Row, ...]
    draw: Callable
