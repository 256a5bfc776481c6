"""Differences between MoorDyn and the product, and whether they are small enough."""

from dataclasses import dataclass

import numpy as np

from ctcbs_ros.validation.cases import BARS, SEGMENTS
from ctcbs_ros.validation.runs import DecayRun, EntryRun, SteadyRun, WindRun

_FIGURES = ("radius", "depth", "lag")
_LAST = 20  # orbits of an oscillation that is compared by its extremes


@dataclass(frozen=True)
class Comparison:
    """One figure of a case.

    Attributes
    ----------
    case, what : str
    product, moordyn : float
        nan where a whole motion is compared.
    difference, bar : float
        In per cent of MoorDyn's figure, or of the tow radius.
    of : str
        What the per cent are of.
    note : str
    """

    case: str
    what: str
    product: float
    moordyn: float
    difference: float
    bar: float
    of: str
    note: str = ""

    @property
    def met(self) -> bool:
        """Whether the difference is within its bar; one that is not known is not."""
        return bool(self.difference <= self.bar)


def of_steady(run: SteadyRun) -> list[Comparison]:
    """The same nodes, and both limits of many segments."""
    coarse, fine = (run.moordyn[n] for n in (SEGMENTS // 2, SEGMENTS))
    pairs = (
        (f"settled {{}}, {SEGMENTS} segments", run.nodes[SEGMENTS], fine, "same segments"),
        ("settled {}, MoorDyn extrapolated", run.solver, fine + (fine - coarse) / 3.0, "limit"),
    )
    return [
        Comparison(run.case.name, what.format(name), float(ours), float(theirs),
                   float(100.0 * abs(ours / theirs - 1.0)), BARS[bar], "itself")
        for what, product, moordyn, bar in pairs
        for name, ours, theirs in zip(_FIGURES, product, moordyn, strict=True)
    ]  # fmt: skip


def of_entry(run: EntryRun) -> list[Comparison]:
    """The greatest difference from rest to the end."""
    ours, theirs = run.product, run.moordyn
    relative = 100.0 * np.abs(ours[:, :2] / theirs[:, :2] - 1.0).max(axis=0)
    angle = np.abs(np.exp(1j * ours[:, 2]) - np.exp(1j * theirs[:, 2])) * theirs[:, 0]
    found = [*zip(_FIGURES[:2], relative, ("itself",) * 2, strict=True),
             ("place along its circle", 100.0 * angle.max(), "a")]  # fmt: skip
    return [
        Comparison(run.case.name, f"{name} through the entry", np.nan, np.nan, float(size),
                   BARS["in time"], of) for name, size, of in found
    ]  # fmt: skip


def of_winch(run: EntryRun) -> list[Comparison]:
    """The greatest difference from when the winch begins, and where the end mass is at the end."""
    flown = 0.1 * np.arange(1, len(run.angles) + 1) >= run.case.winch[0]
    ours, theirs = run.product[flown], run.moordyn[flown]
    away = 100.0 * np.abs(ours[:, :2] - theirs[:, :2]).max(axis=0)
    return [
        Comparison(run.case.name, f"{name} from the winch on", float(ours[-1, k]),
                   float(theirs[-1, k]), float(away[k]), BARS["in time"], "a",
                   "figures at the end")
        for k, name in enumerate(_FIGURES[:2])
    ]  # fmt: skip


def of_decay(run: DecayRun) -> list[Comparison]:
    """Growth rate and frequency of the mode that is damped least."""
    pairs = (("growth rate, of the eigenvalue", run.solver.growth_rate, run.growth_rate, "decay"),
             ("frequency, of the eigenvalue", run.solver.frequency, run.frequency, "frequency"))
    return [
        Comparison(run.case.name, what, ours, theirs, 100.0 * abs(ours / theirs - 1.0), BARS[bar],
                   "itself") for what, ours, theirs, bar in pairs
    ]  # fmt: skip


def of_oscillation(run: EntryRun) -> list[Comparison]:
    """The extremes of the radius over the last orbits of an entry that does not settle."""
    late = run.angles > run.angles[-1] - _LAST * 2.0 * np.pi
    ours, theirs = run.product[late, 0], run.moordyn[late, 0]
    return [
        Comparison(run.case.name, f"{what} radius of {_LAST} orbits", float(extreme(ours)),
                   float(extreme(theirs)), float(100.0 * abs(extreme(ours) / extreme(theirs) - 1)),
                   BARS["oscillation"], "itself", "the motion itself is chaotic")
        for what, extreme in (("least", np.min), ("greatest", np.max))
    ]  # fmt: skip


def of_wind(run: WindRun) -> list[Comparison]:
    """The greatest distance round an orbit, and the mean position downwind and across."""

    def mean(positions, axis):
        return float(positions[:, axis].mean())

    def far(ours, theirs):
        return float(100.0 * np.linalg.norm(ours - theirs, axis=1).max())

    name = run.case.name
    rows = [
        Comparison(name, f"mean {where}, in time", mean(run.in_time, axis),
                   mean(run.moordyn, axis),
                   100.0 * abs(mean(run.in_time, axis) - mean(run.moordyn, axis)),
                   BARS["in time"], "a") for axis, where in enumerate(("downwind", "crosswind"))
    ]  # fmt: skip
    rows.append(Comparison(name, "whole orbit, in time", np.nan, np.nan,
                           far(run.in_time, run.moordyn), BARS["in time"], "a"))  # fmt: skip
    what = "whole orbit, periodic motion"
    if run.periodic is None:
        rows.append(Comparison(name, what, np.nan, np.nan, np.nan, BARS["periodic"], "a",
                               run.reason))  # fmt: skip
    else:
        rows.append(Comparison(name, what, np.nan, np.nan, far(run.periodic, run.limit),
                               BARS["periodic"], "a", "MoorDyn extrapolated"))  # fmt: skip
    return rows
