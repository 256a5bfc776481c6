"""Numbers on the command line, refused with what is allowed."""

import argparse
from collections.abc import Callable


def number(kind: type, low: float, high: float) -> Callable[[str], float]:
    """Conversion for argparse: a number of a kind (int or float) from `low` to `high`."""
    name = "a whole number" if kind is int else "a number"

    def convert(text: str):
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: must be {name} from {low:g} to {high:g}")
        return value

    return convert
