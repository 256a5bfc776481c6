"""What to change, and by how much: the least change of each kind that makes the verdict good.

Each remedy changes one thing. Its value is found by bisection of the criteria themselves on the
points and ways in that fail worst (the active set); then the whole of the changed design is
evaluated, what fails there joins the active set, and so on until all is good. Active circles are
kept as shares of the ranges of radius and speed, so that they move with an envelope that changes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite, log, nan

from ctcbs_ros.design.changes import CHANGES, OUTSIDE, STRONGER, Change, change_named, changed
from ctcbs_ros.design.envelope import envelope_row
from ctcbs_ros.design.evaluation import Evaluation, Grid, evaluate
from ctcbs_ros.design.limits import limits
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.requirements import Criterion
from ctcbs_ros.design.way_in import ENTRY, deploy, deployment_jumps, enter

# Neighbouring trial values are this far apart (a ratio): a shorter range of good values between
# them is passed over. The bisection ends at the second.
_STEP = 1.1
_PRECISION = 1.002
_MOST_ROUNDS = 8


@dataclass(frozen=True)
class Remedy:
    """A change and what became of it.

    Attributes
    ----------
    change : str
        Name of the `Change`.
    value : float
        The least change, rounded to the safe side; nan where none was found.
    present : float
        The value now.
    furthest : float
        The last value tried.
    missed : float
        The nearest value that is known not to be enough; nan if none was found.
    settings : dict
        Parameter keys and their new values.
    still : tuple of str
        Criteria that even the furthest value does not meet.
    """

    change: str
    value: float
    present: float
    furthest: float
    missed: float
    settings: dict
    still: tuple[str, ...] = ()

    @property
    def found(self) -> bool:
        """Whether the change makes the whole verdict good (evaluated anew)."""
        return isfinite(self.value)

    @property
    def bound(self) -> str:
        """Which side of the value is good: "at least" or "at most"."""
        return "at least" if self.furthest > self.present else "at most"


def find_remedies(
    evaluation: Evaluation, grid: Grid | None = None, run: Callable = map
) -> list[Remedy]:
    """All remedies of a design whose verdict is bad, those that were found first.

    Parameters
    ----------
    evaluation : Evaluation
    grid : Grid, optional
        For the evaluations of the changed designs.
    run : callable
        `map`, or one that spreads the work over processes or shows progress.
    """
    if evaluation.good:
        return []
    judged = isfinite(evaluation.configuration.cable.breaking_tension)
    overloaded = judged and any(
        limit.criterion is Criterion.TENSION_LIMIT and not limit.good
        for limit in limits(evaluation)
    )
    names = [c.name for c in CHANGES if overloaded or c.name != STRONGER]
    tried = []
    for batch in (
        [name for name in names if name not in OUTSIDE],
        # Outside the envelope only where nothing inside it helps.
        [name for name, inside in OUTSIDE.items()],
    ):
        helped = {remedy.change for remedy in tried if remedy.found}
        wanted = [n for n in batch if not helped & set(OUTSIDE.get(n, ()))]
        tried += run(run_remedy, [(evaluation, name, grid) for name in wanted])
    return sorted(tried, key=lambda remedy: not remedy.found)


def run_remedy(job: tuple) -> Remedy:
    """`find_remedy` of one argument, for a map."""
    return find_remedy(*job)


def find_remedy(evaluation: Evaluation, name: str, grid: Grid | None = None) -> Remedy:
    """The least change of one kind that makes the whole verdict good.

    Parameters
    ----------
    evaluation : Evaluation
        Of the design as it is, with its verdict bad.
    name : str
        Of one of `CHANGES`.
    grid : Grid, optional
        For the evaluations of the changed design.

    Returns
    -------
    Remedy
    """
    grid = grid or Grid()
    change = change_named(name)
    configuration = evaluation.configuration
    present, furthest = change.present(configuration), change.furthest(configuration)
    active = _active(evaluation)

    def failing(value: float) -> bool:
        there = _changed_evaluation(evaluation, change, value)
        for circle in active:
            if _violated(there, grid, circle, first_only=True):
                # What fails here most likely fails at the next trial value, too.
                active.remove(circle)
                active.insert(0, circle)
                return True
        return False

    start = present
    for _ in range(_MOST_ROUNDS):
        bracket = _bracket(failing, start, furthest)
        if bracket is None:
            there = _changed_evaluation(evaluation, change, furthest)
            still = {c for circle in active for c in _violated(there, grid, circle)}
            names = tuple(criterion.value for criterion in Criterion if criterion in still)
            return Remedy(name, nan, present, furthest, nan, {}, names)
        bad, good = _bisect(failing, *bracket)
        value = _rounded(good, present, furthest, failing)
        settings = change.apply(configuration, value)
        again = evaluate(
            changed(configuration, settings), evaluation.density, evaluation.requirements, grid
        )
        if again.good:
            return Remedy(name, value, present, furthest, bad, settings)
        # Other circles fail now: they count from here on.
        more = [circle for circle in _active(again) if circle not in active]
        if not more:
            break
        active += more
        start = value
    return Remedy(name, nan, present, furthest, nan, {})


@dataclass(frozen=True)
class _Active:
    """A failing circle, as shares of the ranges of radius and speed.

    `way_in` is that of the way in that fails, or "" where the circle itself does.
    """

    radius_share: float
    speed_share: float
    way_in: str


def _active(evaluation: Evaluation) -> list[_Active]:
    """The worst failing circle of each criterion, of the envelope and of the ways in."""
    envelope = evaluation.configuration.envelope
    (a, b), (v, w) = envelope.radius, envelope.speed
    worst: dict = {}

    def offer(criterion, badness, place, way_in):
        key = criterion, way_in
        if key not in worst or badness > worst[key][0]:
            shares = (place.radius - a) / (b - a), (place.speed - v) / (w - v)
            worst[key] = badness, _Active(*shares, way_in)

    for point in evaluation.points:
        for criterion in evaluation.violations(point):
            offer(criterion, _badness(criterion, point), point.flight, "")
    for way in evaluation.judged_ways_in:
        for criterion in evaluation.way_in_violations(way):
            badness = max(_badness(criterion, point) for point in way.points)
            offer(criterion, badness, way, way.kind)
    return list(dict.fromkeys(active for _, active in worst.values()))


def _badness(criterion: Criterion, point: DesignPoint) -> float:
    """Orders what fails by one criterion."""
    if point.state is None:
        return 0.0
    if criterion is Criterion.MULTIPLE_SOLUTIONS:
        return float(point.solutions)
    if criterion is Criterion.TENSION_LIMIT:
        return point.tension
    if criterion is Criterion.END_MASS_RADIUS:
        return point.end_mass_radius_share
    return -point.margin


def _changed_evaluation(evaluation: Evaluation, change: Change, value: float) -> Evaluation:
    """The evaluation with its configuration changed, to judge points of the changed one by."""
    settings = change.apply(evaluation.configuration, value)
    return replace(evaluation, configuration=changed(evaluation.configuration, settings))


def _violated(
    there: Evaluation, grid: Grid, circle: _Active, first_only: bool = False
) -> tuple[Criterion, ...]:
    """Criteria that one circle does not meet; only some of them if that is enough, and cheaper."""
    envelope = there.configuration.envelope
    (a, b), (v, w) = envelope.radius, envelope.speed
    radius, speed = a + circle.radius_share * (b - a), v + circle.speed_share * (w - v)
    there_is = there.configuration, there.density, radius, speed
    if not circle.way_in:
        (point,) = envelope_row(there.configuration, there.density, radius, (speed,))
        return there.violations(point)
    if circle.way_in == ENTRY:
        return there.way_in_violations(enter(*there_is, grid.steps))
    if first_only and deployment_jumps(*there_is):
        return (Criterion.JUMPED,)
    return there.way_in_violations(deploy(*there_is, grid.steps))


def _bracket(failing, start: float, furthest: float) -> tuple[float, float] | None:
    """Neighbouring trial values, the first not enough, the second enough."""
    span = log(furthest / start)
    if not isfinite(span) or span == 0.0:
        return None
    steps = max(int(abs(span) / log(_STEP)) + 1, 2)
    before = start
    if not failing(start):
        return None if start == furthest else (start, start)
    for k in range(1, steps + 1):
        value = start * (furthest / start) ** (k / steps)
        if not failing(value):
            return before, value
        before = value
    return None


def _bisect(failing, bad: float, good: float) -> tuple[float, float]:
    while abs(log(good / bad)) > log(_PRECISION):
        middle = (bad * good) ** 0.5
        if failing(middle):
            bad = middle
        else:
            good = middle
    return bad, good


def _rounded(value: float, present: float, furthest: float, failing) -> float:
    """A value of three or four digits on the safe side of one that is enough."""
    for digits in (3, 4, 5):
        rounded = _away(value, present, digits)
        within = abs(log(furthest / present)) >= abs(log(rounded / present))
        if within and not failing(rounded):
            return rounded
    return value


def _away(value: float, present: float, digits: int) -> float:
    """Rounded to significant digits, away from the present value."""
    nearest = float(f"{value:.{digits - 1}e}")
    unit = 10.0 ** (int(f"{value:e}".split("e")[1]) - digits + 1)
    if value > present and nearest < value:
        nearest += unit
    elif value < present and nearest > value:
        nearest -= unit
    return float(f"{nearest:.{digits - 1}e}")
