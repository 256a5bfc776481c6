"""A row of the benchmark, and what measuring it gives."""

from collections.abc import Callable
from dataclasses import dataclass, field

from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.timing import Duel


@dataclass(frozen=True)
class Outcome:
    """What a row has measured.

    Attributes
    ----------
    median : float
        Of the figure [s] or [bytes].
    p99 : float or None
        None where it was measured once.
    cpu_median, cpu_p99 : float or None
        The same by processor time, about what an idle machine would take; None where that is no
        measure of it, as of a process that also waits.
    samples : int
    peer_median, ratio, yardstick : float or None
        The peer's figure; ours over the peer's, and over the fixed yardstick, by processor time.
    missing : str
        Why there is no peer; empty where there is one.
    accurate : bool
        Whether the results were as exact and complete as they must be.
    facts : dict
        What else was found, by name.
    """

    median: float
    p99: float | None = None
    cpu_median: float | None = None
    cpu_p99: float | None = None
    samples: int = 1
    peer_median: float | None = None
    ratio: float | None = None
    yardstick: float | None = None
    missing: str = ""
    accurate: bool = True
    facts: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """A figure that is measured.

    Attributes
    ----------
    name, what : str
    target : float or None
        Largest median that is good enough [s] or [bytes].
    peer : str
    measure : callable
        From a `Session` to an `Outcome`.
    unit : str
        "s" or "B".
    judged : str
        What is held against the target: "median" or "p99".
    needed : float or None
        Largest ratio to the peer that is good enough.
    long : bool
        Left out of quick runs.
    """

    name: str
    what: str
    target: float | None
    peer: str
    measure: Callable[[Session], Outcome]
    unit: str = "s"
    judged: str = "median"
    needed: float | None = None
    long: bool = False

    def met(self, outcome: Outcome) -> str:
        """Whether the outcome is good enough, in every respect that was measured.

        Returns
        -------
        str
            "yes", "no", or "cpu": in processor time, but not by the clock on the wall, because the
            machine was busy with something else.
        """
        against = None in (self.needed, outcome.ratio) or outcome.ratio <= self.needed
        if not (against and outcome.accurate):
            return "no"
        if self.target is None:
            return "yes"
        wall, cpu = (
            (outcome.p99, outcome.cpu_p99) if self.judged == "p99"
            else (outcome.median, outcome.cpu_median)
        )  # fmt: skip
        if wall <= self.target:
            return "yes"
        return "cpu" if cpu is not None and cpu <= self.target else "no"


def outcome_of(duel: Duel, accurate: bool = True, missing: str = "", alone: bool = True,
               **facts) -> Outcome:  # fmt: skip
    """The outcome of a duel; `alone` where one busy process is all there is to wait for."""
    single = duel.ours.wall.size == 1
    return Outcome(
        median=duel.ours.median, p99=None if single else duel.ours.p99,
        cpu_median=duel.ours.cpu_median if alone else None,
        cpu_p99=duel.ours.cpu_p99 if alone and not single else None,
        samples=duel.ours.wall.size, peer_median=duel.peer and duel.peer.median,
        ratio=duel.ratio, yardstick=duel.yardstick, missing=missing, accurate=accurate,
        facts=facts,
    )  # fmt: skip
