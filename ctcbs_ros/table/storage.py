"""The table on disk: one npz file without pickle, written whole or not at all.

Whatever is not exactly a table of this version and of this configuration is refused, with the
command that rebuilds it.
"""

import io
import os
import tempfile
import zipfile
import zlib
from dataclasses import fields
from pathlib import Path

import numpy as np

from ctcbs_ros.configuration import Configuration, configuration_hash
from ctcbs_ros.errors import InputError
from ctcbs_ros.table.table import Table

FORMAT = "ctcbs_ros table"
FORMAT_VERSION = 1
_SCALARS = ("density", "cable_length", "end_mass")
_BROKEN = (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error, MemoryError)


def save_table(table: Table, configuration: Configuration, path: str | Path) -> None:
    """Write a table atomically: the file is complete or the old one stands.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        format=np.array(FORMAT),
        format_version=np.array(FORMAT_VERSION),
        configuration_hash=np.array(configuration_hash(configuration)),
        source=np.array(Path(configuration.source).name),
        **{field.name: np.asarray(getattr(table, field.name)) for field in fields(table)},
    )
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(buffer.getvalue())
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{path}: the table cannot be written: {error.strerror}") from None
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)


def writable(path: str | Path) -> None:
    """Refuse a path that cannot be written before anything long is computed."""
    path = Path(path)
    folder = path.parent
    while not folder.exists():
        folder = folder.parent
    if path.is_dir() or not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"{path}: cannot be written; name a file in a folder of yours")


def read_header(path: str | Path) -> dict:
    """Format version, configuration hash and source of a file that `load_table` takes."""
    load_table(path)
    with np.load(path, allow_pickle=False) as archive:
        return {
            "format_version": int(archive["format_version"]),
            "configuration_hash": str(archive["configuration_hash"]),
            "source": str(archive["source"]),
        }


def load_table(path: str | Path, configuration: Configuration | None = None) -> Table:
    """Read a table, and check that it is whole and belongs to the configuration.

    Parameters
    ----------
    path : str or Path
    configuration : Configuration, optional
        Whose table it must be; None takes any.

    Raises
    ------
    InputError
        If the file is absent, truncated, corrupt, of another format version or of another
        configuration; the message names the command that rebuilds it.
    """
    path = Path(path)
    config = configuration.source if configuration is not None else "CONFIG"
    rebuild = f"build it with: ctcbs table build {config} -o {path}"
    if not path.is_file():
        raise InputError(f"{path}: no such table; {rebuild}")
    try:
        with np.load(path, allow_pickle=False) as archive:
            content = {name: archive[name] for name in archive.files}
    except _BROKEN:
        raise InputError(f"{path}: the table is truncated or corrupt; {rebuild}") from None
    if str(content.get("format", "")) != FORMAT:
        raise InputError(f"{path}: this is not a table of ctcbs_ros; {rebuild}")
    version = content.get("format_version")
    if version is None or version.shape or int(version) != FORMAT_VERSION:
        raise InputError(
            f"{path}: the table has format version {version}, this program reads "
            f"{FORMAT_VERSION}; {rebuild}"
        )
    if configuration is not None and str(content.get("configuration_hash")) != configuration_hash(
        configuration
    ):
        raise InputError(f"{path}: the table belongs to another configuration; {rebuild}")
    try:
        return _table(content)
    except (KeyError, ValueError, TypeError):
        raise InputError(f"{path}: the table is incomplete; {rebuild}") from None


def _table(content: dict) -> Table:
    values = {}
    for field in fields(Table):
        value = content[field.name]
        values[field.name] = float(value) if field.name in _SCALARS else value
    table = Table(**values)
    grid = (table.radius.size, table.speed.size)
    states = (*grid, table.end_mass_radius.shape[-1])
    for field in fields(Table):
        value = values[field.name]
        if field.name in (*_SCALARS, "radius", "speed"):
            fits = np.all(np.isfinite(value)) and np.all(np.asarray(value) > 0.0)
        elif field.name == "count":
            fits = value.shape == grid and value.min() >= 0 and value.max() <= states[-1]
        else:
            fits = value.shape in (states, (*states, 2))
        if not fits:
            raise ValueError(field.name)
    return table
