"""The table of a configuration: from a file, or built once into the user's cache."""

import os
import sys
from pathlib import Path

from ctcbs_ros.configuration import Configuration, configuration_hash
from ctcbs_ros.errors import InputError
from ctcbs_ros.table.build import build_table
from ctcbs_ros.table.storage import FORMAT_VERSION, load_table, save_table
from ctcbs_ros.table.table import Table


def cache_file(configuration: Configuration) -> Path:
    """Where the table of a configuration lies in the user's cache (XDG Base Directory)."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = f"table-{FORMAT_VERSION}-{configuration_hash(configuration)[:16]}.npz"
    return Path(base) / "ctcbs_ros" / name


def table_for(
    configuration: Configuration, path: str | Path | None = None, progress: bool = True
) -> Table:
    """The table of a configuration.

    Parameters
    ----------
    configuration : Configuration
    path : str or Path, optional
        A file built before; without one the table comes from the user's cache, where it is built
        the first time.
    progress : bool
        Show a progress bar on standard error while building.

    Raises
    ------
    InputError
        If `path` is given and is not a table of this configuration.
    """
    if path:
        return load_table(path, configuration)
    file = cache_file(configuration)
    if file.is_file():
        try:
            return load_table(file, configuration)
        except InputError as error:
            print(f"the cached table is not usable and is built again ({error})", file=sys.stderr)
    table = build_table(configuration, progress=progress)
    try:
        save_table(table, configuration, file)
    except InputError as error:
        # A read-only home costs the time of building, not the flight.
        print(f"the table could not be kept: {error}", file=sys.stderr)
    return table
