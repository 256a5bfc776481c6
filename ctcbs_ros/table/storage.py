"""The table on disk: one npz file without pickle, written whole or not at all.

Whatever is not exactly a table of this version and of this configuration is refused, with the
command that builds one, into another file.
"""

import itertools
import os
import shlex
import struct
import zipfile
import zlib
from dataclasses import fields
from math import inf
from pathlib import Path

import numpy as np

from ctcbs_ros.configuration import Configuration, configuration_hash
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file
from ctcbs_ros.table.table import Table

FORMAT = "ctcbs_ros table"
FORMAT_VERSION = 2  # of what is stored and what it means
_SCALARS = ("density", "cable_length", "end_mass")
_AXES = ("radius", "speed")
_PAIRS = ("radius_slope", "fold_angular_rate", "fold_radius")
_HEADER = ("format", "format_version", "configuration_hash", "source")
# What numpy and zipfile raise on damaged bytes; RuntimeError where a flag says "encrypted" or a
# compression is named that does not exist.
_BROKEN = (
    OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error, struct.error,
    MemoryError, OverflowError, RuntimeError,
)  # fmt: skip


def save_table(table: Table, configuration: Configuration, path: str | Path) -> None:
    """Write a table atomically: the file is complete or the old one stands.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    with atomic_file(path, "wb") as file:
        np.savez_compressed(
            file,
            format=np.array(FORMAT),
            format_version=np.array(FORMAT_VERSION),
            configuration_hash=np.array(configuration_hash(configuration)),
            source=np.array(Path(configuration.source).name),
            **{field.name: np.asarray(getattr(table, field.name)) for field in fields(table)},
        )


def read_header(path: str | Path) -> dict:
    """Format version, configuration hash and source of a file that `load_table` takes."""
    content = _read(Path(path), "CONFIG")
    return {
        "format_version": int(content["format_version"]),
        "configuration_hash": str(content["configuration_hash"]),
        "source": str(content["source"]),
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
        configuration; the message names the command that builds one.
    """
    path = Path(path)
    config = "CONFIG"
    # A node's parameters have the node's name for a source, not a file's.
    if configuration is not None and os.path.isfile(configuration.source):
        config = configuration.source
    content = _read(path, config)
    if configuration is not None and str(content["configuration_hash"]) != configuration_hash(
        configuration
    ):
        raise InputError(
            f"{path}: the table belongs to another configuration; {_rebuild(path, config)}"
        )
    try:
        return _table(content)
    except (KeyError, ValueError, TypeError, AttributeError, IndexError):
        raise InputError(f"{path}: the table is incomplete; {_rebuild(path, config)}") from None


def _rebuild(path: Path, config: str) -> str:
    """The command that builds the table, into a file that is not there: what lies at `path` may be
    another aircraft's table, or no table at all, and is the user's.
    """
    new = path if path.suffix == ".npz" else path.with_suffix(".npz")
    for number in itertools.count(2):
        if not os.path.lexists(new):
            break
        new = path.with_name(f"{path.stem}_{number}.npz")
    return f"build one with: ctcbs table build {shlex.quote(config)} -o {shlex.quote(str(new))}"


def _read(path: Path, config: str) -> dict:
    """Every array of a file in the format of this version."""
    rebuild = _rebuild(path, config)
    if not os.path.isfile(path):
        raise InputError(f"{path}: no such table; {rebuild}")
    try:
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            content = {}
        else:
            with archive:
                content = {name: archive[name] for name in archive.files}
    except _BROKEN:
        raise InputError(f"{path}: no table, or a truncated or corrupt one; {rebuild}") from None
    if not all(isinstance(content.get(name), np.ndarray) for name in _HEADER) or (
        str(content["format"]) != FORMAT
    ):
        raise InputError(f"{path}: this is not a table of ctcbs_ros; {rebuild}")
    version = str(content["format_version"])
    if version != str(FORMAT_VERSION):
        raise InputError(
            f"{path}: the table has format version {version}, this program reads "
            f"{FORMAT_VERSION}; {rebuild}"
        )
    return content


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
        if field.name in _SCALARS:
            fits = 0.0 < value < inf
        elif field.name in _AXES:
            fits = value.ndim == 1 and value.size > 1 and value[0] > 0.0
            fits = fits and np.all(np.isfinite(value)) and np.all(np.diff(value) > 0.0)
        elif field.name == "count":
            fits = value.shape == grid and value.dtype.kind == "i"
            fits = fits and value.min() >= 0 and value.max() <= states[-1]
        else:
            shape = (*states, 2) if field.name in _PAIRS else states
            fits = value.shape == shape and value.dtype.kind == "f"
        if not fits:
            raise ValueError(field.name)
    present = np.arange(states[-1]) < table.count[..., None]
    if not np.all(table.end_mass_radius[present] > 0.0):
        raise ValueError("end_mass_radius")
    return table
