"""Bifurcation diagrams: every branch in one varying parameter, and the events on it.

All branches of the range are those of `level_set`; folds and extrema on them are zeros of the
gradient (`events`), Hopf points and other losses of stability those of a mode's growth
(`crossings`).
"""

import itertools
from dataclasses import dataclass, replace
from math import exp, isfinite, log, nan

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels.search import MAX_STRAIN
from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.crossings import crossings, slow_modes
from ctcbs_ros.solver.events import EXTREMA, FOLDS, Line, zeros
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.level_set import curves
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import STABLE, stability
from ctcbs_ros.solver.steady_state import SteadyState, correct_state, describe

OK = "ok"
_SMALLEST_OMEGA = 0.02
# A branch is followed up to here on its way to the smallest omega.
_LARGEST_OMEGA = 60.0
# A real mode that crosses zero this near to a fold (in ln radius) is that fold.
_AT_FOLD = 1e-3
_REAL = 1e-6
# Most functions a coordinate that modes are followed with.
_LOOKOUT = 40
# A growth rate this near to zero can be of either sign with another number of functions.
_MARGINAL = 1e-4

VARIED = {
    "omega": Family("omega", omega=1.0),
    "length": Family("length", length=1.0),
    "end_mass": Family("end_mass", mass=1.0),
    "cable_drag": Family("cable_drag", cable_drag=1.0, end_mass_drag=1.0),
    "drag_ratio": Family("drag_ratio", end_mass_drag=1.0),
}


@dataclass(frozen=True)
class DiagramPoint:
    """A state on a branch.

    Attributes
    ----------
    value, omega, end_mass_radius : float
        The varied value, and the state there.
    growth_rate, frequency : float
        Of the least damped mode, per radian of orbit; nan where they were not asked for or not
        found.
    verdict : str
        "stable", "flutter" or "divergence"; empty where that is not known.
    status : str
        "ok", or in what respect the numbers are not to be trusted.
    """

    value: float
    omega: float
    end_mass_radius: float
    growth_rate: float
    frequency: float
    verdict: str = ""
    status: str = OK

    @property
    def stable(self) -> bool:
        """Whether every small disturbance in the band decays."""
        return self.verdict == STABLE


@dataclass(frozen=True)
class Event:
    """An event on a branch.

    Attributes
    ----------
    value, omega, end_mass_radius : float
    frequency : float
        Of the mode that crosses; 0 where none oscillates.
    kind : str
        "fold", "minimum", "maximum" (of the end-mass radius), "hopf", "divergence" (a real mode
        crosses zero though nothing folds, which is conceivable where the base does not stretch
        but the vibration does) or "band" (a growing mode enters or leaves the band).
    changes_stability : bool
        Whether the state is stable on one side and not on the other.
    """

    value: float
    omega: float
    end_mass_radius: float
    frequency: float = 0.0
    kind: str = ""
    changes_stability: bool = False


@dataclass(frozen=True)
class DiagramBranch:
    """A branch within the range.

    Attributes
    ----------
    points : tuple of DiagramPoint
        Along the branch.
    folds, hopf, divergences, minima, maxima : tuple of Event
        Minima and maxima are those of the end-mass radius against the varied value.
    stability_changes : tuple of Event
        Every place where stability is lost or gained, of whatever kind, along the branch.
    connected_to_zero : bool
        Whether the branch, followed in omega, leads to the state at omega -> 0.
    """

    points: tuple[DiagramPoint, ...]
    folds: tuple[Event, ...]
    hopf: tuple[Event, ...]
    minima: tuple[Event, ...]
    maxima: tuple[Event, ...]
    connected_to_zero: bool
    divergences: tuple[Event, ...] = ()
    stability_changes: tuple[Event, ...] = ()


def diagram(
    parameters: Parameters, family: Family, value: float, low: float, high: float,
    with_stability: bool = True,
) -> tuple[DiagramBranch, ...]:
    """All branches of a range of one parameter.

    Parameters
    ----------
    parameters : Parameters
        At `value` of the varied parameter.
    family : Family
        What varies.
    value, low, high : float
        The varied parameter: at `parameters`, and its range.
    with_stability : bool
        Growth rates and Hopf points are left out without it (nan).

    Returns
    -------
    tuple of DiagramBranch
        Those connected to omega -> 0 first.

    Raises
    ------
    InputError
        If the range is empty or not positive.
    """
    if not 0.0 < low < high < np.inf:
        raise InputError(f"range: {low:g} to {high:g} is not allowed, 0 < from < to is needed")
    tau_low, tau_high = log(low / value), log(high / value)
    traces = curves(parameters, family, tau_low, tau_high)
    branches = [
        _branch(_Problem(parameters, family, value, tau_low, tau_high), points, with_stability)
        for points in traces
    ]
    return tuple(sorted(branches, key=lambda b: not b.connected_to_zero))


def first_minimum(branches) -> Event | None:
    """The first minimum of the end-mass radius on the branches connected to omega -> 0."""
    minima = [e for b in branches if b.connected_to_zero for e in b.minima]
    return min(minima, key=lambda e: e.value, default=None)


@dataclass(frozen=True)
class _Problem:
    parameters: Parameters
    family: Family
    value: float
    tau_low: float
    tau_high: float

    def at(self, tau: float) -> Parameters:
        return self.family.at(self.parameters, float(tau))

    def inside(self, event: Event) -> bool:
        """Whether an event is in the range: one step of a trace may go out of it and back."""
        low, high = self.value * exp(self.tau_low), self.value * exp(self.tau_high)
        return low * (1.0 - 1e-12) <= event.value <= high * (1.0 + 1e-12)

    def event(self, tau, u, kind, frequency=0.0, changes_stability=False) -> Event:
        return Event(
            self.value * exp(tau), self.at(tau).omega, exp(u), frequency, kind, changes_stability
        )


def _branch(problem: _Problem, rows: np.ndarray, with_stability: bool) -> DiagramBranch:
    line = Line(problem.parameters, problem.family, rows)
    described = [_describe(problem, tau, u, with_stability) for tau, u in rows[:, :2]]
    points = [point for point, _ in described]
    for end in (0, -1):
        tau = rows[end, 0]
        closed = np.allclose(rows[0, :2], rows[-1, :2])
        at_edge = min(abs(tau - problem.tau_low), abs(tau - problem.tau_high)) < 1e-6
        if not closed and not at_edge and points[end].status == OK:
            points[end] = _with_status(points[end], "the branch is lost here")
    folds = [
        (place, problem.event(tau, u, "fold")) for place, tau, u, _ in zeros(line, FOLDS)
    ]
    minima, maxima = [], []
    for _, tau, u, least in zeros(line, EXTREMA):
        kind = "minimum" if least else "maximum"
        (minima if least else maxima).append(problem.event(tau, u, kind))
    hopf, divergences, changes = [], [], []
    if with_stability:
        used = [functions for _, functions in described]
        events = _losses(problem, line, folds, used)
        events = sorted(
            [*events, *_unexplained(problem, line, points, events)], key=lambda found: found[0]
        )
        hopf = [event for _, event in events if event.kind == "hopf"]
        divergences = [event for _, event in events if event.kind == "divergence"]
        folds = [(s, e) for s, e in events if e.kind == "fold"]
        changes = [(s, e) for s, e in events if e.changes_stability]
    listed = ([e for _, e in folds], hopf, minima, maxima, divergences, [e for _, e in changes])
    folds, hopf, minima, maxima, divergences, changes = (
        tuple(e for e in events if problem.inside(e)) for events in listed
    )
    return DiagramBranch(
        tuple(points), folds, hopf, minima, maxima, _connected(problem, rows), divergences, changes
    )


def _with_status(point: DiagramPoint, status: str) -> DiagramPoint:
    return replace(point, status=status)


def _describe(problem: _Problem, tau, u, with_stability) -> tuple[DiagramPoint, int]:
    """A point of the branch, and the functions its growth rate took (0 without one)."""
    here = problem.at(tau)
    # At a fold Newton's method in u alone stalls; the trace's own point stands.
    state = correct_state(here, exp(u), max_step=0.05) or describe(here, float(u))
    if state is None:
        point = DiagramPoint(
            problem.value * exp(tau), here.omega, exp(u), nan, nan,
            status="the cable cannot be integrated",
        )
        return point, 0
    status, growth, frequency, verdict, functions = _trust(state), nan, nan, "", 0
    if with_stability and isfinite(state.end_mass_radius):
        try:
            damping = stability(state)
        except (ArithmeticError, np.linalg.LinAlgError):
            status = "no eigenvalues" if status == OK else status
        else:
            growth, frequency = damping.growth_rate, damping.frequency
            verdict, functions = damping.verdict, damping.functions
            if not damping.converged and abs(growth) > _MARGINAL and status == OK:
                status = "the growth rate is not converged"
    point = DiagramPoint(
        problem.value * exp(tau), here.omega, state.end_mass_radius, growth, frequency, verdict,
        status,
    )
    return point, functions


def _trust(state: SteadyState) -> str:
    if state.least_tension <= 0.0:
        return "the cable is slack"
    if state.greatest_tension > MAX_STRAIN * state.parameters.elasticity:
        return f"stretched beyond a strain of {MAX_STRAIN:g}"
    # A fold's own residual is quadratic in its place, which is no better known.
    if not state.converged and state.residual > 1e-7:
        return f"residual {state.residual:.1e}"
    return OK


def _losses(problem: _Problem, line: Line, folds, used) -> list[tuple[float, Event]]:
    """Folds, Hopf points and divergences with their places, in the order of the branch."""
    if len(line.rows) < 2 or not any(used):
        return folds
    # As many as the growth rates took: with fewer, one about to be zero can have another sign.
    usual = int(np.median([n for n in used if n]))
    functions = [min(n or usual, _LOOKOUT) for n in used]

    def state_at(place):
        found = line.at(place)
        return None if found is None else describe(problem.at(found[0]), float(found[1]))

    events, at_folds = [], {}
    for crossing in crossings(state_at, range(len(line.rows)), functions):
        state = crossing.state
        u = log(state.end_mass_radius)
        tau = float(line.at(crossing.place)[0])
        values = slow_modes(state, crossing.functions)
        values = values[values.imag <= state.parameters.band]
        mode = np.argmin(np.abs(values - 1j * crossing.frequency))
        others_decay = bool(np.all(np.delete(values, mode).real < 0.0))
        # Beyond a fold the state diverges, and no other mode changes that.
        leading = others_decay and state.slope > 0.0
        if crossing.frequency > _REAL:
            event = problem.event(tau, u, "hopf", crossing.frequency, leading)
            events.append((crossing.place, event))
            continue
        near = [
            i for i, (_, fold) in enumerate(folds)
            if abs(log(fold.end_mass_radius) - u) < _AT_FOLD
            and abs(log(fold.value / problem.value) - tau) < _AT_FOLD
        ]
        if near:
            at_folds[near[0]] = others_decay
        elif state.slope > 0.0:
            events.append((crossing.place, problem.event(tau, u, "divergence", 0.0, leading)))
    for i, (place, fold) in enumerate(folds):
        tau, u = log(fold.value / problem.value), log(fold.end_mass_radius)
        changes = at_folds[i] if i in at_folds else _all_decay(problem, tau, u, usual)
        events.append((place, problem.event(tau, u, "fold", 0.0, changes)))
    return sorted(events, key=lambda found: found[0])


def _all_decay(problem: _Problem, tau: float, u: float, functions: int) -> bool:
    """Whether every mode in the band decays at a fold that the vibration does not show."""
    state = describe(problem.at(tau), u)
    if state is None:
        return False
    values = slow_modes(state, functions)
    return bool(np.all(values.real[values.imag <= state.parameters.band] < 0.0))


def _unexplained(problem: _Problem, line: Line, points, events) -> list[tuple[float, Event]]:
    """Changes of stability without a crossing that was followed: mostly at the edge of the band.

    There a growing mode enters or leaves it and the growth rate jumps. Where it goes through zero
    a mode has crossed that was not followed all the way.
    """
    found = []
    for i, (a, b) in enumerate(itertools.pairwise(points)):
        rates = abs(a.growth_rate), abs(b.growth_rate)
        if a.stable == b.stable or not min(rates) > _MARGINAL or not np.all(np.isfinite(rates)):
            continue
        if any(
            i - 0.1 <= place <= i + 1.1 and (event.changes_stability or event.kind != "fold")
            for place, event in events
        ):
            continue
        low, high, sides = float(i), i + 1.0, [a, b]
        while high - low > 1e-10:
            middle = 0.5 * (low + high)
            place = line.at(middle)
            state = None if place is None else describe(problem.at(place[0]), float(place[1]))
            if state is None:
                break
            damping = stability(state)
            if damping.stable == a.stable:
                low, sides[0] = middle, damping
            else:
                high, sides[1] = middle, damping
        else:
            at_zero = max(abs(side.growth_rate) for side in sides) < _MARGINAL
            frequency = sides[0].frequency if at_zero else 0.0
            kind = "band" if not at_zero else "hopf" if frequency > _REAL else "divergence"
            found.append((low, problem.event(place[0], place[1], kind, frequency, True)))
    return found


def _connected(problem: _Problem, rows: np.ndarray) -> bool:
    """Whether a branch, followed in omega through all folds, leads to omega -> 0."""
    omegas = [problem.at(tau).omega for tau in rows[:, 0]]
    # From its slowest state the way is the shortest.
    tau, u = rows[np.argmin(omegas), :2]
    state = correct_state(problem.at(tau), exp(u), max_step=0.05)
    if state is None:
        return False
    omega = state.parameters.omega
    down = log(_SMALLEST_OMEGA / omega)
    if down >= 0.0:
        return True
    # The branch itself may go further still.
    up = log(max(_LARGEST_OMEGA, 1.1 * max(omegas)) / omega)
    for direction in (-1, 1):
        path = trace(state.parameters, state.end_mass_radius, ANGULAR_RATE, direction, (down, up))
        if path.tau.size and path.tau[-1] < down:
            return True
    return False
