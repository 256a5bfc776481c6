"""A cable simulated piece by piece: with a progress bar, and so that Ctrl-C is heard."""

from dataclasses import replace

import numpy as np
from tqdm import tqdm

from ctcbs_ros.dynamics.cable import CableState, Drive, Motion, simulate
from ctcbs_ros.dynamics.line import Line

# States given in a piece; kernels hear nothing while they run.
_PIECE = 64


def simulate_showing(
    line: Line, driven: Drive, state: CableState, times: np.ndarray, tolerance: float
) -> Motion:
    """What `simulate` gives, shown on stderr where it takes longer than a second."""
    pieces = []
    with progress("cable") as bar:
        for first in range(0, len(times), _PIECE):
            piece = simulate(line, driven, state, times[first : first + _PIECE], tolerance)
            state = piece.end
            pieces.append(piece)
            bar.update((first + len(piece.times)) / len(times) - bar.n)
    return replace(
        pieces[-1],
        times=times,
        positions=np.concatenate([p.positions for p in pieces]),
        velocities=np.concatenate([p.velocities for p in pieces]),
        steps=sum(p.steps for p in pieces),
        rejected=sum(p.rejected for p in pieces),
    )


def progress(name: str):
    """A bar from 0 to 1 that is only seen of what takes longer than a second."""
    shown = "{desc}: {percentage:.0f}%|{bar}| {elapsed}"
    return tqdm(total=1.0, desc=name, bar_format=shown, leave=False, delay=1.0)
