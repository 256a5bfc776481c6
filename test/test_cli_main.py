"""The frame of the command line: help, version, exit codes, errors and signals."""

import os
import signal
import subprocess
import sys

import pytest
from processes import LIMIT

from ctcbs_ros import __version__
from ctcbs_ros.cli.main import main
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file, writable

STEADY = "steady --omega 1 --length 3 --end-mass 50 --cable-drag 10 --drag-ratio 1".split()


def run(*arguments, **options):
    """`python -m ctcbs_ros` in a process of its own."""
    command = [sys.executable, "-m", "ctcbs_ros", *arguments]
    return subprocess.run(command, capture_output=True, text=True, **options)


def exit_code(*arguments):
    """Code with which argparse ends `ctcbs`."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def test_version_is_that_of_the_package(capsys):
    assert exit_code("--version") == 0
    assert capsys.readouterr().out == f"ctcbs {__version__}\n"


def test_help_names_each_command(capsys):
    assert exit_code("--help") == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in ("steady", "table", "replay", "simulate"))


@pytest.mark.parametrize("command", ["steady", "table", "table build", "replay", "simulate"])
def test_each_command_has_help(capsys, command):
    assert exit_code(*command.split(), "--help") == 0
    assert capsys.readouterr().out.startswith(f"usage: ctcbs {command}")


def test_help_waits_for_no_compiler():
    code = (
        "import sys\nfrom ctcbs_ros.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print(sorted({'numba', 'scipy', 'matplotlib', 'pymavlink', 'rclpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "arguments", [[], ["fly"], ["steady", "--omega", "fast"], ["replay"], ["table"]]
)
def test_wrong_usage_is_one_line_and_ends_with_2(capsys, arguments):
    assert exit_code(*arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    program = " ".join(["ctcbs", *arguments[:1]]) if arguments != ["fly"] else "ctcbs"
    assert line.startswith(f"{program}: error: ")
    assert line.endswith(f"; see {program} --help")


def test_without_a_command_those_there_are_are_named(capsys):
    for given, named in (([], "steady, periodic, branch"), (["table"], "{build,info}")):
        assert exit_code(*given) == 2
        assert named in capsys.readouterr().err


@pytest.mark.parametrize("command", ["periodic", "cusp", "table build"])
def test_an_option_that_a_command_does_not_have_is_refused_with_that_commands_help(
    capsys, command
):
    needed = ["small_drone", "-o", "x"] if command == "table build" else []
    assert exit_code(*command.split(), *needed, "--there-is-none", "3") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"ctcbs {command}: error: unrecognized arguments: --there-is-none 3;")
    assert line.endswith(f"see ctcbs {command} --help")


@pytest.mark.parametrize("value", ["fast", "-1", "nan", "1001"])
def test_a_number_out_of_its_range_is_refused_with_the_range(capsys, value):
    assert exit_code("replay", "a.tlog", "--config", "small_drone", f"--rate={value}") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"argument --rate: '{value}': must be a number from 0 to 1000;" in line


@pytest.mark.parametrize(
    ("arguments", "refused"),
    [
        (["design", "small_drone", "--max-end-mass-radius", "-5%"], "'-5%' is not allowed"),
        (["steady", "--config", "small_drone", "--radius", "-6e1", "--speed", "20"], "-60 m"),
        (["steady", "--config", "small_drone", "--radius", "-.5", "--speed", "20"], "-0.5 m"),
    ],
)
def test_a_negative_value_is_refused_as_a_value_and_not_taken_for_an_option(
    capsys, arguments, refused
):
    assert main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert refused in line


def test_bad_input_is_one_line_on_stderr_and_ends_with_2(capsys):
    assert main(["steady", "--omega", "1"]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    (line,) = shown.err.splitlines()
    assert line.startswith("ctcbs: error: ")
    assert "--length" in line


NOT_DIMENSIONAL = "--length 3 --end-mass 50 --cable-drag 5 --drag-ratio 1".split()
BRANCH = ["branch", "--vary", "omega", "--from", "0.5", "--to", "1", *NOT_DIMENSIONAL]
WRITERS = {
    "table build": ["table", "build", "small_drone", "-o"],
    "branch --csv": [*BRANCH, "--csv"],
    "branch --plot": [*BRANCH, "--plot"],
    "design": ["design", "small_drone", "--report"],
    "bench": ["bench", "--out"],
    "bench --plot": ["bench", "--plot"],
}


@pytest.mark.parametrize("arguments", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize("where", ["new/file", "file/inside", "folder"])
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    arguments, where, tmp_path, capsys, monkeypatch
):
    # The work begins with one of these.
    monkeypatch.setattr("ctcbs_ros.worker_pool.worker_pool", None)
    monkeypatch.setattr("ctcbs_ros.solver.diagram.diagram", None)
    monkeypatch.setattr("ctcbs_ros.bench.run.measure", None)
    monkeypatch.setattr("ctcbs_ros.bench.cost.plot_costs", None)
    (tmp_path / "file").touch()
    where += ".html" if arguments[0] == "design" else ".png"
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "folder.html").mkdir()
    before = sorted(tmp_path.rglob("*"))
    assert main([*arguments, str(tmp_path / where)]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    (line,) = shown.err.splitlines()
    assert f"{tmp_path / where}: cannot be written" in line
    assert sorted(tmp_path.rglob("*")) == before


def test_a_report_of_another_kind_is_refused_before_the_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ctcbs_ros.worker_pool.worker_pool", None)
    assert main(["design", "small_drone", "--report", str(tmp_path / "report.pdf")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "report.pdf: a report is one .html file" in line
    assert not list(tmp_path.iterdir())


def test_a_device_is_not_replaced_by_a_file():
    with pytest.raises(InputError, match="no file"):
        writable("/dev/null")
    with pytest.raises(InputError, match="no file"), atomic_file("/dev/null") as file:
        file.write("")
    assert not os.path.isfile("/dev/null")


def test_reader_that_goes_away_is_no_error():
    command = [sys.executable, "-m", "ctcbs_ros", *STEADY, "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait(60) == 128 + signal.SIGPIPE
    assert errors == b""


@pytest.mark.parametrize("moment", ["amid its imports", "amid its work"])
def test_interrupted_command_ends_with_130_and_one_line(tmp_path, moment):
    root = os.path.abspath(os.path.dirname(os.path.dirname(__file__)))
    drone = os.path.join(root, "config", "small_drone.yaml")
    build = ["-m", "ctcbs_ros", "table", "build", drone, "-o", "table.npz"]
    imports = moment == "amid its imports"
    process = subprocess.Popen(
        # -v names each module on standard error as it is imported.
        [sys.executable, *(["-v"] if imports else []), *build],
        cwd=tmp_path, stderr=subprocess.PIPE, env=os.environ | {"PYTHONPATH": root},
    )  # fmt: skip
    awaited, seen = b"import 'scipy" if imports else b"table:", b""
    while awaited not in seen:
        more = process.stderr.read1()
        assert more, seen.decode()
        seen += more
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGINT)  # whoever is impatient loses nothing by it
    errors = process.communicate(timeout=LIMIT)[1].decode()
    assert process.returncode == 130
    said = [line for line in errors.splitlines() if not imports or "interrupted" in line]
    assert said[-1] == "ctcbs: interrupted"
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_command_called_from_python_leaves_the_signals_as_they_were(capsys):
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    for arguments, code in ((STEADY, 0), ("table build absent.yaml -o table.npz".split(), 2)):
        assert main(arguments) == code
        assert [signal.getsignal(number) for number in numbers] == before


def test_program_and_module_are_the_same_command():
    done = run("--version")
    assert (done.returncode, done.stdout) == (0, f"ctcbs {__version__}\n")
