"""What the subcommands share: a result as JSON without infinities."""

import json
import sys
from math import isfinite


def finite_or_null(value):
    """The same value with every number that JSON has no word for (inf, nan) replaced by None."""
    if isinstance(value, dict):
        return {key: finite_or_null(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite_or_null(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def print_json(result: dict) -> None:
    """Print a result as one JSON document on standard output."""
    json.dump(finite_or_null(result), sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")
