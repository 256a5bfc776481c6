"""Rows of the flight: the predictor's update, replay, the table, the node's start and memory."""

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ctcbs_ros.bench import peer_bvp
from ctcbs_ros.bench.row import Outcome, outcome_of
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.timing import Duel, Measured, Timing, duel, timed
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import FUNCTIONS, stability, vibration_matrix
from ctcbs_ros.solver.steady_state import steady_states
from ctcbs_ros.table.build import build_table
from ctcbs_ros.table.storage import load_table

_SAMPLES_A_PEER = 20
_NODES_OF_PEER = 12
_START_LIMIT = 60.0  # s


def update(session: Session) -> Outcome:
    """Sample in, prediction out; the peer solves the same orbit's state and margin with scipy."""
    return _update(session, with_twin=False)


def update_with_twin(session: Session) -> Outcome:
    """The same with the twin, as the node has it by default."""
    return _update(session, with_twin=True)


def _update(session: Session, with_twin: bool) -> Outcome:
    from ctcbs_ros.telemetry.source import open_log

    samples = list(open_log(str(session.log)))
    warm = Predictor(session.drone, session.table, with_twin)
    for sample in samples[:300]:  # until every kernel that a flight needs is compiled
        warm.update(sample)
    predictor = Predictor(session.drone, session.table, with_twin)
    predictions = []

    def ours(number):
        predictions.append(predictor.update(samples[number]))

    def peer(_number):
        with_orbit = [p for p in predictions if p.end_mass is not None]
        if not with_orbit:
            return Measured(np.nan, np.nan)
        return scipy_prediction(session, with_orbit[-1])

    rounds = len(samples) // _SAMPLES_A_PEER
    whole = duel(ours, peer, rounds, _SAMPLES_A_PEER, warm_up=False)
    predicted = np.array([p.end_mass is not None for p in predictions])
    return _only_predicted(whole, predicted)


def _only_predicted(whole: Duel, predicted: np.ndarray) -> Outcome:
    """The outcome of the samples that gave a prediction, and of the rounds made of them."""
    ours = Timing(whole.ours.wall[predicted], whole.ours.cpu[predicted])
    full = predicted.reshape(-1, _SAMPLES_A_PEER).all(axis=1)
    blocks = np.median(whole.ours.cpu.reshape(-1, _SAMPLES_A_PEER)[full], axis=1)
    peer = Timing(whole.peer.wall[full], whole.peer.cpu[full])
    ratio = float(np.median(blocks / peer.cpu))
    return outcome_of(
        Duel(ours, peer, ratio, whole.yardstick), predicted=int(predicted.sum()),
        samples=predicted.size,
    )  # fmt: skip


def scipy_prediction(session: Session, prediction) -> Measured:
    """Time solve_bvp and numpy's eigenvalues for the state that a prediction tells."""
    orbit = prediction.orbit
    p = flight_point(
        session.drone, orbit.radius, orbit.speed, prediction.air_density
    ).parameters
    return _scipy_state(p, prediction.end_mass.state.radius / orbit.radius)


def _scipy_state(p, end_mass_radius) -> Measured:
    """Time one state and its margin with scipy and numpy, the functions as many as converge."""
    state = min(
        steady_states(p).states, key=lambda s: abs(s.end_mass_radius - end_mass_radius)
    )
    matrices = [vibration_matrix(state, n) for n in FUNCTIONS if n <= stability(state).functions]
    start = peer_bvp.warm_start(p, end_mass_radius)

    def solve(_number):
        peer_bvp.steady_state(p, end_mass_radius, start)
        for matrix in matrices:
            np.linalg.eigvals(matrix)

    return timed(solve)


def replay(session: Session) -> Outcome:
    """A sample of a log replayed through the core, reading included; against reading it alone."""
    return _replay(session, with_twin=False)


def replay_with_twin(session: Session) -> Outcome:
    """The same with the twin, as `ctcbs replay` does by default."""
    return _replay(session, with_twin=True)


def _replay(session: Session, with_twin: bool) -> Outcome:
    from ctcbs_ros.bench.peer_mavlink import read_positions
    from ctcbs_ros.replay.core import replay_through_core
    from ctcbs_ros.telemetry.source import open_log

    log = str(session.log)
    count = sum(1 for _ in open_log(log))

    def ours(_number):
        predictor = Predictor(session.drone, session.table, with_twin)
        replay_through_core(open_log(log), predictor, 0.0, lambda record, progress: None)

    whole = duel(ours, lambda _: read_positions(log), session.rounds(5))
    return outcome_of(
        Duel(_shared(whole.ours, count), _shared(whole.peer, count), whole.ratio, whole.yardstick),
        samples=count, samples_per_second=count / whole.ours.median,
    )  # fmt: skip


def _shared(timing: Timing, count: int) -> Timing:
    return Timing(timing.wall / count, timing.cpu / count)


def table_build(session: Session) -> Outcome:
    """The default envelope's table on every core; of the peer a few nodes stand for all."""
    built = []

    def ours(_number):
        built.append(build_table(session.drone, progress=False))

    def peer(_number):
        table = built[-1]
        chosen = np.random.default_rng(1).integers(0, table.count.shape, (_NODES_OF_PEER, 2))
        nodes = [_scipy_state(*_node(session, table, i, j)) for i, j in chosen]
        share = _NODES_OF_PEER / table.count.size
        wall, cpu = (sum(getattr(n, clock) for n in nodes) / share for clock in ("wall", "cpu"))
        return Measured(wall / _cores(), cpu)

    whole = duel(ours, peer, rounds=1, warm_up=False)
    session.table = built[-1]
    # On an idle machine every core has its share.
    ours = Timing(whole.ours.wall, whole.ours.cpu / _cores())
    return outcome_of(replace(whole, ours=ours), states=int(built[-1].count.sum()))


def _cores() -> int:
    return len(os.sched_getaffinity(0))


def _node(session, table, i, j):
    """Parameters and end-mass radius of the first state of a node."""
    p = flight_point(
        session.drone, float(table.radius[i]), float(table.speed[j]), table.density
    ).parameters
    return p, float(table.end_mass_radius[i, j, 0])


def table_size(session: Session) -> Outcome:
    """Bytes of the default envelope's table, against the same arrays uncompressed."""
    size = session.table_file.stat().st_size
    uncompressed = session.table.summary()["size_bytes"]
    return Outcome(size, peer_median=uncompressed, ratio=size / uncompressed)


def table_load(session: Session) -> Outcome:
    """Reading and checking the table, against numpy reading the same arrays."""
    file = session.table_file

    def peer(_number):
        with np.load(file) as archive:
            return [archive[name] for name in archive.files]

    return outcome_of(
        duel(lambda _: load_table(file, session.drone), peer, session.rounds(20), calls=5)
    )


@dataclass(frozen=True)
class _Started:
    """A node that has said "ready": time until then, and its resident memory [bytes]."""

    time: Measured
    memory: int


def node_start(session: Session) -> Outcome:
    """Start of the node with its table until it says "ready", against an empty rclpy node."""
    return _nodes(session, lambda started: started.time)


def node_memory(session: Session) -> Outcome:
    """Resident memory of the node when it is ready, against an empty rclpy node's."""
    def memory(started):
        return Measured(float(started.memory), float(started.memory))

    return _nodes(session, memory)


def _nodes(session: Session, figure) -> Outcome:
    if find_spec("rclpy") is None:
        return Outcome(np.nan, missing="ROS 2 (rclpy) is not installed")
    if not session.starts:
        from ctcbs_ros.configuration import find_configuration

        predictor = [
            "ctcbs_ros.nodes.predictor", "--ros-args", "--params-file",
            str(find_configuration(session.drone.source)),
            "-p", f"table.file:={session.table_file}",
        ]  # fmt: skip
        empty = ["ctcbs_ros.bench.peer_node"]
        _start(predictor), _start(empty)  # files cached, kernels compiled
        for _ in range(session.rounds(4)):
            session.starts.append((_start(predictor), _start(empty)))
    ours, peer = ([figure(s) for s in side] for side in zip(*session.starts, strict=True))
    ratio = float(np.median([a.cpu / b.cpu for a, b in zip(ours, peer, strict=True)]))
    sides = (
        Timing(np.array([m.wall for m in side]), np.array([m.cpu for m in side]))
        for side in (ours, peer)
    )
    return outcome_of(Duel(*sides, ratio, None), alone=False)


def _start(arguments: list[str]) -> _Started:
    """Start a module as a node, wait until it is ready, and end it."""
    from ctcbs_ros.replay.through_node import free_domain

    environment = os.environ | {
        "ROS_DOMAIN_ID": str(free_domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }  # fmt: skip
    started = time.perf_counter()
    node = subprocess.Popen(
        [sys.executable, "-m", *arguments], env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    # Ends a node that never gets ready, and with it the wait for its output.
    watch = threading.Timer(_START_LIMIT, node.kill)
    watch.start()
    try:
        said = ""
        for line in node.stdout:
            said += line
            if "ready" in line:
                break
        else:
            raise ArithmeticError(f"{arguments[0]} did not get ready: {said[-500:]}")
        wall = time.perf_counter() - started
        process = Path("/proc") / str(node.pid)
        # Fields 14 and 15 of proc(5), counted behind the name in brackets.
        ticks = process.joinpath("stat").read_text().rpartition(")")[2].split()[11:13]
        cpu = sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
        pages = int(process.joinpath("statm").read_text().split()[1])
        return _Started(Measured(wall, cpu), pages * os.sysconf("SC_PAGE_SIZE"))
    finally:
        watch.cancel()
        node.send_signal(signal.SIGINT)
        try:
            node.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            node.kill()
            node.communicate()
