"""Figures computed on all cores; each is written, CSV then PNG, as soon as its rows are there."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import as_completed
from pathlib import Path

from tqdm import tqdm

from ctcbs_ros.errors import InputError
from ctcbs_ros.figures.figure import Figure
from ctcbs_ros.figures.rows import read_rows, write_rows
from ctcbs_ros.files import atomic_file, made_folder
from ctcbs_ros.worker_pool import worker_pool

_DPI = 130


def produce(
    folder: str | Path, figures: Iterable[Figure], progress: bool = True,
    announce: Callable[[Path], None] = lambda file: None,
) -> None:
    """Compute, write and draw figures.

    Parameters
    ----------
    folder : str or Path
        Made if it is not there.
    figures : iterable of Figure
    progress : bool
        Show one progress bar over all of them on standard error.
    announce : callable
        Called with each file when it is written.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    with made_folder(folder) as folder:
        if not os.access(folder, os.W_OK | os.X_OK):  # refused now, not after minutes of work
            raise InputError(f"{folder}: cannot be written: no permission")
        _produce(folder, list(figures), progress, announce)


def _produce(folder: Path, figures: list[Figure], progress: bool, announce) -> None:
    calls = [(figure, call) for figure in figures for call in figure.calls]
    parts: list = [None] * len(calls)
    left = {figure.number: len(figure.calls) for figure in figures}
    with (
        worker_pool() as pool,
        tqdm(total=len(calls), desc="figures", unit="curve", disable=not progress) as bar,
    ):
        jobs = {
            pool.submit(function, *arguments): i
            for i, (_, (function, arguments)) in enumerate(calls)
        }
        for job in as_completed(jobs):
            parts[jobs[job]] = job.result()
            bar.update()
            figure = calls[jobs[job]][0]
            left[figure.number] -= 1
            if left[figure.number] == 0:
                own = [part for (of, _), part in zip(calls, parts, strict=True) if of is figure]
                for file in _write(folder, figure, own):
                    # It may print: not into the bar's line.
                    with tqdm.external_write_mode():
                        announce(file)


def _write(folder: Path, figure: Figure, parts) -> tuple[Path, Path]:
    table, picture = (folder / f"fig_{figure.number}.{suffix}" for suffix in ("csv", "png"))
    rows = [row for part in (*parts, figure.given) for row in part]
    about = f"thesis Fig. {figure.number}: {figure.title}. {figure.note}".strip()
    write_rows(table, about, figure.columns, rows)
    drawing = figure.draw(f"Fig. {figure.number}: {figure.title}", read_rows(table))
    with atomic_file(picture, "wb") as file:
        drawing.savefig(file, format="png", dpi=_DPI)
    return table, picture
