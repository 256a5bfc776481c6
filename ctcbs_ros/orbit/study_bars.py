"""What the orbit estimator has to hold, each beside what the study found: printed one by one."""

from dataclasses import dataclass
from math import isfinite

from ctcbs_ros.orbit.study import most_taken
from ctcbs_ros.orbit.study_cases import NOISES
from ctcbs_ros.orbit.study_convergence import LEAST_COVERED


@dataclass(frozen=True)
class Bar:
    """A figure and its bounds.

    Attributes
    ----------
    what, unit : str
    found, least, most : float
        In the unit.
    """

    what: str
    unit: str
    found: float
    least: float
    most: float

    @property
    def holds(self) -> bool:
        """Whether it is within its bounds."""
        return self.least <= self.found <= self.most

    def line(self) -> str:
        """As it is printed."""
        bounds = f"{self.least:g} to {self.most:g}" if self.least > 0.0 else f"{self.most:g}"
        verdict = "holds" if self.holds else "MISSED"
        return f"{self.what:62}{self.found:8.2f} {self.unit:6} bar {bounds:10} {verdict}"


def bars(accuracies: dict, turns, shapes: dict, converging: dict) -> list[Bar]:
    """Of the figures of `study`, by their names; the bounds of a thousand runs."""
    found = []
    for name, accuracy in accuracies.items():
        bar = NOISES[name]
        most = 100.0 * bar.most_radius
        found.append(Bar(f"{name}: radius", "%", 100.0 * accuracy.radius, 0.0, most))
        if isfinite(bar.most_center):
            found.append(Bar(f"{name}: centre", "m", accuracy.center, 0.0, bar.most_center))
        least, most = (100.0 * share for share in bar.coverage)
        found += [
            Bar(f"{name}: {what} inside 95 %", "%", 100.0 * share, least, most)
            for what, share in accuracy.covered.items()
        ]
    found += [
        Bar("entry to first orbit, 95 % of the flights", "turns", turns.first[1], 0.0, 0.5),
        Bar("departure to NOT_ORBITING, at most", "turns", turns.left[2], 0.0, 0.25),
    ]
    found += [
        Bar(f"{shape}: taken for an orbit", "%", 100.0 * share, 0.0, 100.0 * most_taken(shape))
        for shape, share in shapes.items()
    ]
    found += [
        Bar(f"{case}: circle inside 95 %", "%", 100.0 * c.covered, 100.0 * LEAST_COVERED, 100.0)
        for case, c in converging.items()
    ]
    return found
