"""Two callables timed in turn, so that the noise of the machine meets both alike.

What a person waits for is the clock on the wall; what is compared is processor time, which other
work on the machine hardly changes, round by round.
"""

import gc
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Measured:
    """Wall and processor time [s] that a callable has measured itself, as of another process."""

    wall: float
    cpu: float


@dataclass(frozen=True)
class Timing:
    """Times of n calls, each (n,), [s]."""

    wall: np.ndarray
    cpu: np.ndarray

    @property
    def median(self) -> float:
        """Median on the clock on the wall."""
        return float(np.median(self.wall))

    @property
    def p99(self) -> float:
        """99th percentile on the clock on the wall."""
        return float(np.percentile(self.wall, 99.0))

    @property
    def cpu_median(self) -> float:
        """Median of the processor time, which is what an idle machine would take."""
        return float(np.median(self.cpu))

    @property
    def cpu_p99(self) -> float:
        """99th percentile of the processor time."""
        return float(np.percentile(self.cpu, 99.0))


@dataclass(frozen=True)
class Duel:
    """Times of what is measured and of its peer, and the ratio of their processor times.

    Attributes
    ----------
    ours : Timing
    peer : Timing or None
    ratio : float or None
        Median over the rounds of ours over the peer's.
    yardstick : float
        The same against a fixed piece of linear algebra, for where there is no peer.
    """

    ours: Timing
    peer: Timing | None
    ratio: float | None
    yardstick: float


def processor_time() -> float:
    """Processor time [s] of this process and of those that it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def timed(call: Callable[[int], object], number: int = 0) -> Measured:
    """Call once; what returns `Measured` has timed itself."""
    cpu = processor_time()
    wall = time.perf_counter()
    result = call(number)
    wall = time.perf_counter() - wall
    cpu = processor_time() - cpu
    return result if isinstance(result, Measured) else Measured(wall, max(cpu, 1e-9))


def duel(
    ours: Callable[[int], object],
    peer: Callable[[int], object] | None = None,
    rounds: int = 20,
    calls: int = 1,
    warm_up: bool = True,
) -> Duel:
    """Time one against the other.

    Parameters
    ----------
    ours, peer : callable
        Called with the number of the call, of either; what returns `Measured` has timed itself.
    rounds : int
        Of `calls` calls of ours and one of the peer.
    calls : int
    warm_up : bool
        Call each once before, untimed.

    Returns
    -------
    Duel
    """
    if warm_up:
        ours(0)
        if peer is not None:
            peer(0)
    own, others, ratios, yardsticks = [], [], [], []
    # A collection falls on whoever happens to allocate.
    enabled = gc.isenabled()
    gc.collect()
    gc.freeze()  # so that the collections between rounds are short
    gc.disable()
    try:
        for number in range(rounds):
            block = [timed(ours, number * calls + k) for k in range(calls)]
            own += block
            cpu = float(np.median([m.cpu for m in block]))
            yardsticks.append(cpu / timed(_yardstick, number).cpu)
            if peer is not None:
                others.append(timed(peer, number))
                ratios.append(cpu / others[-1].cpu)
            gc.collect()
    finally:
        gc.unfreeze()
        if enabled:
            gc.enable()
    return Duel(
        _timing(own), _timing(others) if others else None,
        float(np.median(ratios)) if ratios else None, float(np.median(yardsticks)),
    )  # fmt: skip


_MATRIX = np.random.default_rng(0).normal(size=(40, 40))


def _yardstick(_number: int) -> None:
    np.linalg.eigvals(_MATRIX)


def _timing(measured: list[Measured]) -> Timing:
    return Timing(np.array([m.wall for m in measured]), np.array([m.cpu for m in measured]))
