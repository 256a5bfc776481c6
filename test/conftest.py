"""The small drone's table and a flight of it, made once for all tests that need them."""

import os
from pathlib import Path

import hypothesis
import pytest
import scipy.linalg  # noqa: F401, its BLAS is another than numpy's: limited once it is loaded
from threadpoolctl import threadpool_limits

from ctcbs_ros.replay import through_node

# The same examples in each run, however long each takes: what one run finds, all do.
hypothesis.settings.register_profile(
    "same on any machine", deadline=None, derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)  # fmt: skip
hypothesis.settings.load_profile("same on any machine")

DRONE = Path(__file__).parents[1] / "config" / "small_drone.yaml"


def pytest_sessionstart(session):
    """Where workers will run the tests, compile the kernels before any of them does.

    Each would compile all of them. And kernels compiled in another order may differ in the last
    digit: children of the workers must not find now the one's, now the other's in the cache.
    """
    if session.config.getoption("numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ:
        from ctcbs_ros.configuration import load_configuration
        from ctcbs_ros.prediction.warm_up import warm_up

        warm_up(load_configuration(DRONE))


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread():
    """Two threads that wait for each other on a busy core make an eig of 480 rows 50 times slower.

    Of the tests' own process alone: the commands and nodes that they start are as a user's.
    """
    with threadpool_limits(1, "blas"):
        yield


@pytest.fixture(scope="session", autouse=True)
def ros_log_folder(tmp_path_factory):
    """ROS's log files of all tests, which need no home folder for it."""
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))


@pytest.fixture(scope="session", autouse=True)
def domains_of_this_worker():
    """Tests that run beside others take other ROS domains: two nodes never hear each other.

    A domain counts as free until its node has started, which takes a second.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    if worker:
        workers = int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        with pytest.MonkeyPatch.context() as patch:
            domains = through_node.DOMAINS[int(worker) :: workers]
            patch.setattr(through_node, "DOMAINS", domains)
            yield
    else:
        yield


@pytest.fixture(scope="session")
def drone_table(tmp_path_factory):
    """File of a coarse table of config/small_drone.yaml."""
    from ctcbs_ros.configuration import load_configuration
    from ctcbs_ros.table.build import build_table
    from ctcbs_ros.table.storage import save_table

    configuration = load_configuration(DRONE)
    file = tmp_path_factory.mktemp("table") / "drone.npz"
    save_table(build_table(configuration, nodes=5, progress=False), configuration, file)
    return file


@pytest.fixture(scope="session")
def drone_log(tmp_path_factory):
    """Log of a simulated flight: 2.5 turns clockwise at 60 m and 20 m/s, a gap of 4 s in them."""
    from ctcbs_ros.cli.main import main

    file = tmp_path_factory.mktemp("log") / "flight.tlog"
    flight = "--radius 60 --speed 20 --turns 2.5 --sense cw --center=47.4,8.5"
    noise = "--position-noise 1 --velocity-noise 0.2 --gap 50,4 --seed 3"
    arguments = f"simulate --config {DRONE} {flight} {noise} -o {file}"
    assert main(arguments.split()) == 0
    return file


@pytest.fixture(scope="session")
def core_replay(drone_log, drone_table):
    """Records and summary of the log through the core; to be read only."""
    from replays import replayed

    return replayed(drone_log, drone_table)


@pytest.fixture(scope="session")
def log(tmp_path_factory):
    """Frames of the flight that the tests of faults put their faults into."""
    from faults_replay import flight

    return flight(tmp_path_factory.mktemp("faults"))


@pytest.fixture(scope="session")
def clean(log, tmp_path_factory):
    """What that flight comes to without faults; to be read only."""
    import faults_log
    from faults_replay import replay

    found = replay(log, tmp_path_factory.mktemp("clean"))
    assert found.skipped == {}
    assert found.summary["samples"] == faults_log.count(log)
    assert found.valid > 100
    return found


@pytest.fixture
def link():
    """Opens links and closes them after the test."""
    from ctcbs_ros.telemetry.mavlink import open_link

    opened = []

    def open_it(*args, **kwargs):
        opened.append(open_link(*args, **kwargs))
        return opened[-1]

    yield open_it
    for source in opened:
        source.close()
