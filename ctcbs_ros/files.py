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
        In a folder that is there.
    mode : str
        "w" for text (UTF-8), "wb" for bytes.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
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
