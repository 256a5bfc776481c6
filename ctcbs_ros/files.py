"""Files that are written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from ctcbs_ros.errors import InputError


@contextmanager
def atomic_file(path: str | Path, mode: str = "w") -> Iterator[IO]:
    """Open a file for writing that replaces `path` when the block ends well, and else is gone.

    Parameters
    ----------
    path : str or Path
    mode : str
        "w" for text (UTF-8), "wb" for bytes.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    text = {} if "b" in mode else {"encoding": "utf-8", "newline": ""}
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        with os.fdopen(handle, mode, **text) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except IsADirectoryError:
        raise InputError(f"{path}: cannot be written: it is a folder") from None
    finally:
        if os.path.exists(name):
            os.unlink(name)
