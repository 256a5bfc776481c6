"""The package as it is installed, by pip and by colcon, and what its modules may import."""

import ast
import configparser
import os
import re
import shutil
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from processes import LIMIT, wait_for

import ctcbs_ros
from ctcbs_ros.replay.through_node import free_domain

REPOSITORY = Path(__file__).parents[1]
PACKAGE = REPOSITORY / "ctcbs_ros"
DRONE = REPOSITORY / "config" / "small_drone.yaml"

# The two ends of the architecture: only these know ROS or MAVLink ...
EDGES = (
    "nodes/", "telemetry/mavlink.py", "telemetry/dataflash.py", "simulate.py",
    "replay/through_node.py", "bench/peer_mavlink.py", "bench/peer_node.py",
    "telemetry/ulog", "telemetry/rosbag", "telemetry/dataflash_text.py",
    "telemetry/mavlink_fields.py", "telemetry/vehicle_choice.py", "telemetry/vehicle_messages.py",
    "telemetry/own_messages.py", "telemetry/beacon_messages.py",
)
# ... with the libraries that read their logs ...
LOG_READERS = ("pyulog", "rosbags")
# ... and only these join them to the core.
JOINTS = ("cli/", "replay/", "telemetry/source.py", "__main__.py")
# The rooms of the core's picture, each with the rooms below it.
BELOW = {
    "kernels": set(),
    "telemetry": set(),
    "solver": {"kernels"},
    "orbit": {"kernels"},
    "table": {"kernels", "solver"},
    "dynamics": {"kernels", "solver"},
    "periodic": {"kernels", "solver"},
    "figures": {"kernels", "solver"},
    "design": {"kernels", "solver"},
    "twin": {"kernels", "solver", "orbit", "telemetry", "dynamics", "periodic"},
    "prediction": {
        "kernels", "solver", "dynamics", "periodic", "orbit", "table", "telemetry", "twin",
    },
    "beacon": {"telemetry", "orbit", "prediction", "twin"},
    "replay": {
        "kernels", "solver", "periodic", "orbit", "table", "telemetry", "prediction", "beacon",
        "twin",
    },
    "validation": {"kernels", "solver", "dynamics", "periodic", "bench"},
}


def modules(leave_out):
    """Path and dotted name of each module outside of some folders and files."""
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE).as_posix()
        if not inside.startswith(leave_out):
            name = path.relative_to(REPOSITORY).with_suffix("").as_posix().replace("/", ".")
            yield path, name.removesuffix(".__init__")


def is_foreign(name):
    """Whether a module's name is one of ROS or MAVLink."""
    root = name.split(".")[0]
    return root in ("rclpy", "pymavlink", *LOG_READERS) or root.endswith(("_msgs", "_interfaces"))


def imported_names(path):
    """Every module name that a file imports, at its top or inside a function."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module


# --- layers -------------------------------------------------------------------------------------


def test_only_the_two_ends_import_ros_or_mavlink():
    core = list(modules(leave_out=EDGES))
    assert len(core) > 20
    for path, _ in core:
        foreign = [name for name in imported_names(path) if is_foreign(name)]
        assert not foreign, f"{path} imports {foreign}"


def test_the_ends_that_may_import_ros_and_mavlink_do_so():
    edges = {path for path, _ in modules(())} - {path for path, _ in modules(EDGES)}
    roots = {name.split(".")[0] for path in edges for name in imported_names(path)}
    assert {"rclpy", "pymavlink"} <= roots


@pytest.mark.parametrize("room", BELOW)
def test_nothing_imports_what_is_above_it(room):
    rooms = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").is_file()}
    above = tuple(f"ctcbs_ros.{name}" for name in rooms - BELOW[room] - {room})
    files = list((PACKAGE / room).glob("*.py"))
    assert len(files) > 2
    for path in files:
        up = [name for name in imported_names(path) if name.startswith(above)]
        assert not up, f"{path} imports {up}"


def test_core_is_imported_where_neither_ros_nor_mavlink_is_installed():
    names = [name for _, name in modules(leave_out=EDGES + JOINTS)]
    code = f"""
import importlib, sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        root = name.split(".")[0]
        missing = ("rclpy", "pymavlink", *{LOG_READERS!r})
        if root in missing or root.endswith(("_msgs", "_interfaces")):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Missing())
for name in {names!r}:
    importlib.import_module(name)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


# --- metadata -----------------------------------------------------------------------------------


def setup_keywords():
    """Keyword arguments of setup() in setup.py, as source."""
    (call,) = (
        node
        for node in ast.walk(ast.parse((REPOSITORY / "setup.py").read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup"
    )
    return {keyword.arg: keyword.value for keyword in call.keywords}


def test_version_and_licence_agree_wherever_they_stand():
    manifest = ElementTree.parse(REPOSITORY / "package.xml").getroot()
    keywords = setup_keywords()
    assert manifest.get("format") == "3"
    assert manifest.findtext("name") == "ctcbs_ros"
    assert manifest.findtext("version") == ctcbs_ros.__version__
    assert ast.literal_eval(keywords["version"]) == ctcbs_ros.__version__
    assert manifest.findtext("license") == ast.literal_eval(keywords["license"]) == "Apache-2.0"
    assert "Apache License" in (REPOSITORY / "LICENSE").read_text()
    assert manifest.findtext("export/build_type") == "ament_python"


def test_package_xml_declares_each_ros_package_that_is_imported():
    manifest = ElementTree.parse(REPOSITORY / "package.xml").getroot()
    declared = {element.text for element in manifest.findall("exec_depend")}
    used = {
        name.split(".")[0] for path, _ in modules(()) for name in imported_names(path)
    }
    used |= {name.split(".")[0] for name in imported_names(*REPOSITORY.glob("launch/*.py"))}
    ros = {name for name in used if is_foreign(name) or name.startswith("launch")}
    assert ros - {"pymavlink", *LOG_READERS} <= declared


def test_setup_py_requires_each_python_package_that_is_imported():
    required = re.findall(r'"([\w-]+)>=', (REPOSITORY / "setup.py").read_text().lower())
    roots = {name.split(".")[0] for path, _ in modules(()) for name in imported_names(path)}
    third_party = {
        {"yaml": "pyyaml", "serial": "pyserial"}.get(root, root)
        for root in roots - sys.stdlib_module_names - {"ctcbs_ros"}
        if root in ("pymavlink", *LOG_READERS) or not is_foreign(root)
    }
    assert {"numpy", "pyyaml"} <= third_party <= set(required)


def test_setup_cfg_puts_programs_where_ros2_run_looks():
    parser = configparser.ConfigParser(interpolation=None)
    parser.read(REPOSITORY / "setup.cfg")
    assert parser["develop"]["script_dir"] == "$base/lib/ctcbs_ros"
    assert parser["install"]["install_scripts"] == "$base/lib/ctcbs_ros"


# --- installed ----------------------------------------------------------------------------------


def run(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy of what belongs to the package, so that builds leave the repository alone."""
    copy = tmp_path_factory.mktemp("source") / "ctcbs_ros"
    copy.mkdir()
    for name in ("ctcbs_ros", "resource", "config", "launch", "msg_examples"):
        shutil.copytree(
            REPOSITORY / name, copy / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    for name in ("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "LICENSE"):
        shutil.copy(REPOSITORY / name, copy)
    return copy


@pytest.fixture(scope="module")
def colcon_install(source):
    """Install folder of a real `colcon build`."""
    colcon = (sys.executable, "-m", "colcon")
    run(*colcon, "--log-base", "log", "build", "--base-paths", source, cwd=source.parent)
    return source.parent / "install"


def in_workspace(install, command, **options):
    """Run a command as a shell does that has sourced the workspace."""
    script = f'. "{install}/setup.sh" && exec "$@"'
    return ["sh", "-c", script, "sh", *map(str, command)], {"cwd": install.parent, **options}


def files_below(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def expected_share():
    share = {"package.xml"}
    for pattern in ("config/*.yaml", "launch/*.launch.py", "msg_examples/*.yaml"):
        share |= {path.relative_to(REPOSITORY).as_posix() for path in REPOSITORY.glob(pattern)}
    return share


def test_pip_installs_programs_in_bin_and_finds_the_configurations(source, tmp_path):
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--no-deps")
    run(*pip, "--no-build-isolation", "--ignore-installed", "--prefix", tmp_path, source)
    assert {path.name for path in (tmp_path / "bin").iterdir()} == {"ctcbs", "predictor"}
    assert expected_share() <= files_below(tmp_path / "share" / "ctcbs_ros")
    (library,) = tmp_path.glob("lib/python3.*/site-packages")
    code = "from ctcbs_ros.configuration import *; print(load_configuration('small_drone').source)"
    environment = os.environ | {"PYTHONPATH": str(library)}
    found = run(sys.executable, "-c", code, cwd=tmp_path, env=environment)
    assert found.strip() == str(tmp_path / "share/ctcbs_ros/config/small_drone.yaml")


def test_colcon_installs_programs_marker_and_data_where_ros_looks(colcon_install):
    prefix = colcon_install / "ctcbs_ros"
    assert files_below(prefix / "lib" / "ctcbs_ros") == {"ctcbs", "predictor"}
    assert (prefix / "share/ament_index/resource_index/packages/ctcbs_ros").is_file()
    assert expected_share() <= files_below(prefix / "share" / "ctcbs_ros")
    code = (
        "import ctcbs_ros; from ctcbs_ros.configuration import *; "
        "print(ctcbs_ros.__file__); print(load_configuration('small_drone').source)"
    )
    command, options = in_workspace(colcon_install, [sys.executable, "-c", code])
    module, configuration = run(*command, **options).splitlines()
    assert Path(module).is_relative_to(prefix)
    assert Path(configuration).is_relative_to(prefix)


def test_predictor_built_by_colcon_runs_and_ends_at_sigint_with_zero(
    colcon_install, tmp_path, monkeypatch
):
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    command, options = in_workspace(
        colcon_install,
        [
            colcon_install / "ctcbs_ros/lib/ctcbs_ros/predictor",
            "--ros-args", "--params-file", DRONE, "-r", "__node:=tow_predictor",
            # a small table, so that it is built soon
            "-p", "envelope.radius:=[60.0, 64.0]", "-p", "envelope.speed:=[18.0, 19.0]",
        ],
    )  # fmt: skip
    with open(tmp_path / "output", "w+") as output:
        predictor = subprocess.Popen(command, stdout=output, stderr=output, **options)
        context = Context()
        rclpy.init(context=context)
        observer = Node("observer", context=context)
        try:
            wait_for(
                lambda: "tow_predictor" in observer.get_node_names()
                or predictor.poll() is not None
            )
            predictor.send_signal(signal.SIGINT)
            code = predictor.wait(LIMIT)
            assert code == 0, (tmp_path / "output").read_text()[-2000:]
        finally:
            predictor.kill()
            observer.destroy_node()
            context.try_shutdown()
