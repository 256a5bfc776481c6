"""What the orbit estimator has to hold, each beside what the study found: printed one by one."""

from dataclasses import dataclass
from math import isfinite

from ctcbs_ros.orbit.coverage import coverage_bounds
from ctcbs_ros.orbit.study import Accuracy, Turns, most_taken
from ctcbs_ros.orbit.study_cases import NOISES
from ctcbs_ros.orbit.study_convergence import LEAST_COVERED, LEAST_INTERVAL, Convergence


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
        bounds = f"{self.least:.3g} to {self.most:.3g}" if self.least > 0.0 else f"{self.most:g}"
        verdict = "holds" if self.holds else "MISSED"
        return f"{self.what:62}{self.found:8.2f} {self.unit:6} bar {bounds:12} {verdict}"


def bars(
    accuracies: dict[str, Accuracy], turns: Turns | None, shapes: dict[str, float],
    converging: dict[str, Convergence],
) -> list[Bar]:
    """Of the figures of `study` and `study_convergence`, by their names.

    The bounds of coverage are wider where fewer than a thousand flights were flown.
    """  # fmt: skip
    found = []
    for name, accuracy in accuracies.items():
        found += _of_accuracy(name, accuracy)
    if turns is not None:
        found += [
            Bar("entry to first orbit, 95 % of the flights", "turns", turns.first[1], 0.0, 0.5),
            Bar("departure to NOT_ORBITING, at most", "turns", turns.left[2], 0.0, 0.25),
            Bar("flights with an orbit on the straight leg", "%", 100.0 * turns.early, 0.0, 0.0),
        ]
    found += [
        Bar(f"{shape}: taken for an orbit", "%", 100.0 * share, 0.0, 100.0 * most_taken(shape))
        for shape, share in shapes.items()
    ]
    for case, c in converging.items():
        found += [
            Bar(f"{case}: {what}", "%", 100.0 * share, 100.0 * least, 100.0)
            for what, share, least in (
                ("radius inside 95 %", c.interval, LEAST_INTERVAL),
                ("circle inside 95 %", c.covered, LEAST_COVERED),
            )
        ]
    return found


def _of_accuracy(name: str, accuracy: Accuracy) -> list[Bar]:
    noise = NOISES[name]
    least, most = coverage_bounds(accuracy.runs, noise.coverage)
    lost = max(noise.most_lost * accuracy.runs, 1)
    return [
        Bar(f"{name}: radius", "%", 100.0 * accuracy.radius, 0.0, 100.0 * noise.most_radius),
        *(
            [Bar(f"{name}: centre", "m", accuracy.center, 0.0, noise.most_center)]
            if isfinite(noise.most_center)
            else []
        ),
        *(
            Bar(f"{name}: {what} inside 95 %", "%", 100.0 * share, 100.0 * least, 100.0 * most)
            for what, share in accuracy.covered.items()
        ),
        Bar(f"{name}: without an orbit", "", accuracy.lost, 0.0, lost),
    ]


def missed(found: list[Bar]) -> list[str]:
    """The bars that do not hold, as they are printed."""
    return [bar.line() for bar in found if not bar.holds]
