"""A folder of results that appear all together, when they are complete, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ctcbs_ros.errors import InputError


@contextmanager
def complete_folder(folder: str | Path) -> Iterator[Path]:
    """Folder to write into; when the block ends well, its files move to `folder`.

    Parameters
    ----------
    folder : str or Path
        Made if it is not there; other files in it are left alone.

    Yields
    ------
    Path
        A hidden folder inside of it, which is gone afterwards in any case.

    Raises
    ------
    InputError
        If the folder cannot be made or written.
    """
    folder = Path(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=".ctcbs-", dir=folder))
    except OSError as error:
        why = error.strerror or error
        if isinstance(error, FileExistsError | NotADirectoryError):
            why = "a folder is needed, and there is a file of that name"
        raise InputError(f"--out {folder}: cannot be written: {why}") from error
    try:
        try:
            yield draft
        except KeyboardInterrupt as error:
            error.args = (f"nothing was written to {folder}",)
            raise
        for file in sorted(draft.iterdir()):
            os.replace(file, folder / file.name)
        made = []
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        for path in made:
            path.rmdir()
