"""Rows of the solver: one steady state, all of them, the margin, a branch, a cusp, settling."""

from importlib.util import find_spec
from math import exp, log

import numpy as np

from ctcbs_ros.bench import peer_bvp, peer_ivp
from ctcbs_ros.bench.peer_auto import AutoProblem
from ctcbs_ros.bench.row import Outcome, outcome_of
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.timing import duel
from ctcbs_ros.solver.branches import trace
from ctcbs_ros.solver.cusp import cusp
from ctcbs_ros.solver.family import ANGULAR_RATE, RADIUS_AT_SPEED
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.sensitivity import sensitivities
from ctcbs_ros.solver.stability import FUNCTIONS, stability, vibration_matrix
from ctcbs_ros.solver.steady_state import correct_state, steady_states
from ctcbs_ros.table.build import NODES

# Thesis Fig. 3.1 (f 1, l 3, m 50): a state at d_n 10, and the branch of d_n 4.8.
FIGURE_3_1 = Parameters(1.6, 3.0, 50.0, 10.0, 1.0)
BRANCH_START, BRANCH_OMEGA_MAX = Parameters(0.05, 3.0, 50.0, 4.8, 1.0), 3.0
CUSP = Parameters(1.0, 3.0, 50.0, 1.0, 1.0)
# Where MoorDyn is known to settle, docs/thesis.md; 350 s after it began to turn it is within 1 %.
SETTLED = Parameters(1.6, 3.0, 50.0, 10.0, 1.0, elasticity=600.0)
SETTLING_TIME, SEGMENTS = 400.0, 20

RELATIVE_ERROR = 1e-8
BRANCH_POINTS, _BRANCH_TOLERANCE = 80, 1e-9
_GUESSES = 25


def steady_figure(session: Session) -> Outcome:
    """A steady state of Fig. 3.1 from the table's guess."""
    return _steady(FIGURE_3_1, session)


def steady_design(session: Session) -> Outcome:
    """The steady state of the design example from the table's guess."""
    return _steady(session.design, session)


def table_guesses(p: Parameters, session: Session, count: int) -> list[float]:
    """End-mass radii as a table would guess them, the point at random within its grid cell.

    The grid is the default table's, and a guess the Taylor polynomial of the nearest node
    (`ctcbs_ros.table.Table.guesses`).
    """
    envelope = session.drone.envelope
    cell = [log(high / low) / (NODES - 1) for low, high in (envelope.radius, envelope.speed)]
    guesses = []
    for share in np.random.default_rng(1).uniform(-0.5, 0.5, (count, 2)):
        by_radius, by_speed = share * cell
        node = ANGULAR_RATE.at(RADIUS_AT_SPEED.at(p, by_radius), by_speed)
        state = steady_states(node).states[0]
        moves = sensitivities(state, (RADIUS_AT_SPEED, ANGULAR_RATE))[:, 0] / state.end_mass_radius
        guesses.append(state.end_mass_radius * exp(-moves[0] * by_radius - moves[1] * by_speed))
    return guesses


def _steady(p: Parameters, session: Session) -> Outcome:
    guesses = table_guesses(p, session, _GUESSES)
    starts = [peer_bvp.warm_start(p, guess) for guess in guesses]
    exact = peer_ivp.tight_state(p, guesses[0])

    def ours(number):
        return correct_state(p, guesses[number % _GUESSES])

    def peer(number):
        number %= _GUESSES
        return peer_bvp.steady_state(p, guesses[number], starts[number])

    timed = duel(ours, peer, session.rounds(60), calls=20)
    error = max(abs(ours(i).end_mass_radius / exact - 1.0) for i in range(_GUESSES))
    return outcome_of(
        timed, error <= RELATIVE_ERROR, relative_error=error,
        peer_relative_error=abs(peer(0) / exact - 1.0),
        guess_error=float(np.median(np.abs(np.array(guesses) / exact - 1.0))),
    )  # fmt: skip


def random_points(count: int, seed: int = 1) -> list[Parameters]:
    """Points of thesis Table 2.1, a third over its whole range of drag, every second elastic."""
    rng = np.random.default_rng(seed)

    def logarithmic(low, high):
        return float(np.exp(rng.uniform(log(low), log(high))))

    return [
        Parameters(
            omega=rng.uniform(0.05, 3.0), length=rng.uniform(1.5, 6.0),
            end_mass=logarithmic(3.5, 100.0),
            cable_drag=logarithmic(0.03, 2000.0 if i % 3 == 0 else 20.0),
            drag_ratio=logarithmic(0.1, 4.0), elasticity=600.0 if i % 2 else np.inf,
        )
        for i in range(count)
    ]  # fmt: skip


def all_states(session: Session) -> Outcome:
    """All steady states of random points, against a scan that also shows what was missed."""
    points = random_points(session.points)
    found, scanned = {}, {}

    def ours(number):
        states = steady_states(points[number]).states
        found[number] = [state.end_mass_radius for state in states]

    def peer(number):
        scanned[number] = peer_ivp.all_states(points[number])

    timed = duel(ours, peer, max(session.rounds(len(points)), min(len(points), 12)))
    missed = sum(
        not any(abs(ours / there - 1.0) < 1e-6 for ours in found[number])
        for number in scanned
        for there in scanned[number]
    )
    return outcome_of(
        timed, missed == 0, points=len(found), states=sum(map(len, found.values())),
        peer_states=sum(map(len, scanned.values())), missed=missed,
    )  # fmt: skip


def margin(session: Session) -> Outcome:
    """Steady state and converged margin of the design example, against LAPACK on the matrices."""
    p = session.design
    guesses = table_guesses(p, session, _GUESSES)
    state = correct_state(p, guesses[0])
    damping = stability(state)
    counts = [n for n in FUNCTIONS if n <= damping.functions]
    matrices = [vibration_matrix(state, n) for n in counts]

    def ours(number):
        return stability(correct_state(p, guesses[number % _GUESSES]))

    def peer(_number):
        return [np.linalg.eigvals(matrix) for matrix in matrices]

    timed = duel(ours, peer, session.rounds(60), calls=2)
    # Twice as many functions as were found enough tell what the margin is.
    values = np.linalg.eigvals(vibration_matrix(state, 2 * damping.functions))
    growth = values[np.abs(values.imag) <= damping.band].real.max()
    error = abs(damping.growth_rate / growth - 1.0)
    return outcome_of(timed, error <= 0.01, functions=damping.functions, margin_error=error)


def branch(session: Session) -> Outcome:
    """The branch of Fig. 3.1 at d_n 4.8, against AUTO-07p, which also checks it."""
    start = steady_states(BRANCH_START).states[0]
    reach = log(BRANCH_OMEGA_MAX / BRANCH_START.omega)

    def ours(_number=0):
        return trace(
            BRANCH_START, start.end_mass_radius, ANGULAR_RATE, 1, (-1e-6, reach),
            tolerance=_BRANCH_TOLERANCE,
        )

    try:
        problem = AutoProblem(
            session.folder, BRANCH_START, start.end_mass_radius, BRANCH_OMEGA_MAX
        )
        missing = ""
    except FileNotFoundError as error:
        problem, missing = None, str(error)
    timed = duel(ours, problem and (lambda _: problem.run()), session.rounds(30), calls=2)
    path = ours()
    error = _branch_error(path)
    facts = dict(points=path.tau.size, folds=len(path.folds), relative_error=error)
    if problem is not None:
        facts |= _against_auto(problem.branch(), path)
    good = path.tau.size >= BRANCH_POINTS and len(path.folds) == 2 and error <= RELATIVE_ERROR
    return outcome_of(timed, good, missing, **facts)


def _far_from_folds(path, omega) -> np.ndarray:
    """Where the radius at a given omega is well conditioned: more than 1 % from every fold."""
    folds = np.array([BRANCH_START.omega * exp(fold.tau) for fold in path.folds])
    return np.all(np.abs(np.asarray(omega)[:, None] / folds - 1.0) > 0.01, axis=1)


def _branch_error(path) -> float:
    """Largest relative error of the radius at 20 points, by tight integrations."""
    inside = np.flatnonzero(_far_from_folds(path, BRANCH_START.omega * np.exp(path.tau)))
    chosen = inside[np.linspace(0, inside.size - 1, 20).astype(int)]
    return max(
        abs(path.end_mass_radius[i] / peer_ivp.tight_state(
            ANGULAR_RATE.at(BRANCH_START, float(path.tau[i])), path.end_mass_radius[i]) - 1.0)
        for i in chosen
    )  # fmt: skip


def _against_auto(auto, path) -> dict:
    """Largest differences between our states and AUTO's points, and between the folds."""
    differences = []
    for omega, radius in zip(auto.omega, auto.end_mass_radius, strict=True):
        if _far_from_folds(path, [omega])[0]:
            there = ANGULAR_RATE.at(BRANCH_START, log(omega / BRANCH_START.omega))
            state = correct_state(there, radius, 0.01)
            found = np.inf if state is None else state.end_mass_radius
            differences.append(abs(found / radius - 1.0))
    folds = [
        abs(BRANCH_START.omega * exp(ours.tau) / theirs[0] - 1.0)
        for ours, theirs in zip(path.folds, auto.folds, strict=False)
    ]
    return dict(
        auto_points=auto.omega.size, auto_folds=len(auto.folds),
        largest_difference=float(max(differences)), largest_difference_of_folds=max(folds),
    )  # fmt: skip


def one_cusp(session: Session) -> Outcome:
    """The cusp of Fig. 3.1, found from nothing; the peer starts 1 % away from it."""
    found = cusp(CUSP)
    here = np.array([found.omega, found.cable_drag, found.end_mass_radius])
    near = here * np.array([1.01, 0.99, 1.01])

    timed = duel(
        lambda _: cusp(CUSP), lambda _: peer_ivp.cusp(CUSP, *near), session.rounds(12)
    )
    difference = float(np.abs(here / peer_ivp.cusp(CUSP, *near) - 1.0).max())
    return outcome_of(timed, difference < 1e-6, largest_difference=difference)


def settle(session: Session) -> Outcome:
    """The elastic steady state, against MoorDyn towing until it has settled."""
    if find_spec("moordyn") is None:
        timed = duel(lambda _: steady_states(SETTLED), None, session.rounds(20), calls=5)
        return outcome_of(timed, missing="MoorDyn is not installed (pip install moordyn)")
    from dataclasses import replace

    from ctcbs_ros.bench.peer_moordyn import DENSITY, tow

    p = replace(SETTLED, density=DENSITY)
    flights = []

    def peer(_number):
        flights.append(tow(session.folder, p, SEGMENTS, SETTLING_TIME))

    timed = duel(lambda _: steady_states(p), peer, session.rounds(8), calls=20)
    difference = abs(flights[-1].end[0] / steady_states(p).states[0].end_mass_radius - 1.0)
    return outcome_of(timed, difference < 0.02, difference=difference)
