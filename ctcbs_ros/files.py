"""Files that are written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ctcbs_ros.errors import InputError


def writable(path: str | Path) -> None:
    """Refuse a file that cannot be written, before anything long is computed.

    Parameters
    ----------
    path : str or Path
        In a folder that is there; where it is something already, a plain file.

    Raises
    ------
    InputError
        If the folder is not there or lets nothing be written, or `path` is no plain file.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written: there is no folder {path.parent}")
    _refuse_device(path)
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _refuse_device(path: Path) -> None:
    """A folder cannot be replaced by a file, and a device must not be."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: cannot be written: it is no file")


@contextmanager
def made_folder(path: str | Path) -> Iterator[Path]:
    """A folder, made if need be; gone again where the block fails and has left nothing in it.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """
    path = Path(path)
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be made: {error.strerror or error}") from None
        yield path
    except BaseException:
        with suppress(OSError):  # not empty, or not made
            for folder in made:
                folder.rmdir()
        raise


@contextmanager
def atomic_file(path: str | Path, mode: str = "w") -> Iterator[IO]:
    """Open a file for writing that replaces `path` when the block ends well, and else is gone.

    Parameters
    ----------
    path : str or Path
        In a folder that is there.
    mode : str
        "w" for text (UTF-8), "wb" for bytes.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    _refuse_device(path)
    name = None
    text = {} if "b" in mode else {"encoding": "utf-8", "newline": ""}
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, mode, **text) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        if name is not None and os.path.exists(name):
            os.unlink(name)
