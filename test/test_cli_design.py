"""`ctcbs design`: its options, its files, how it ends."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from processes import LIMIT

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration

ROOT = Path(__file__).resolve().parents[1]
NARROW = ("envelope.radius=[90, 120]", "envelope.speed=[20, 28]")


def command(*arguments):
    """`ctcbs design` as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "ctcbs_ros", "design", *arguments],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def test_the_command_prints_json_and_writes_its_report_with_settings_applied(tmp_path):
    file = tmp_path / "r.html"
    running = command(
        "small_drone", "--grid=2", "--safety-factor=4", "--json", "--report", str(file),
        "--set", NARROW[0], "--set", NARROW[1], "--max-end-mass-radius=90%",
    )  # fmt: skip
    out, err = running.communicate(timeout=LIMIT)
    assert running.returncode == 0, err
    assert b"design: 100%" in err
    assert b"0part" not in err
    result = json.loads(out)
    assert result["verdict"] == "OK"
    assert result["source"].endswith(f"small_drone.yaml with {NARROW[0]}, {NARROW[1]}")
    assert result["requirements"] == {
        "end_mass_radius_m": None, "end_mass_radius_share": 0.9, "margin_per_s": 0.0,
        "tension_share": 0.25, "way_in": "deployment",
    }  # fmt: skip
    assert result["limits"][2]["limit"] == 100.0
    assert [column["radius_m"] for column in result["chart"]] == [90.0, 120.0]
    assert "OK: one stable steady state" in file.read_text()


def test_a_report_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["design", "small_drone", "--report", str(tmp_path / "file" / "r.html")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "cannot be written" in err


def test_an_interrupted_design_ends_with_130_and_leaves_no_file(tmp_path):
    running = command("design_example", "--report", str(tmp_path / "r.html"))
    try:
        # The bar shows when the work has begun.
        assert running.stderr.read(7) == b"\rdesign"
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=LIMIT)
    finally:
        running.kill()
    assert running.returncode == 130
    assert out == b""
    assert err.splitlines()[-1] == b"ctcbs: interrupted"
    assert b"Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["no/such.yaml"], "no/such.yaml"),
        (["design_example", "--set", "cable.length"], "KEY=VALUE"),
        (["design_example", "--set", "cable.lenght=5"], "did you mean cable.length?"),
        (["design_example", "--set", "cable.length=long"], "cable.length"),
        (["design_example", "--set", "cable.length=-5"], "cable.length"),
        (["design_example", "--set=cable.length=5", "--set=cable.length=6"], "given twice"),
        (["design_example", "--set", "envelope.radius=[5, 4]"], "envelope.radius"),
        (["design_example", "--set", "envelope.radius=[5, 4"], "envelope.radius"),
        (["design_example", "--max-end-mass-radius", "wide"], "--max-end-mass-radius"),
        (["design_example", "--max-end-mass-radius", "0%"], "--max-end-mass-radius"),
        (["design_example", "--min-margin", "nan"], "--min-margin"),
        (["design_example", "--safety-factor", "2"], "cable.breaking_tension"),
        (["small_drone", "--safety-factor", "0.5"], "--safety-factor"),
        (["small_drone", "--grid", "1"], "--grid"),
        (["small_drone", "--altitude", "500"], "--altitude"),
    ],
)
def test_bad_input_ends_with_2_and_one_line_that_names_it(capsys, arguments, named):
    assert main(["design", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert named in err


def test_a_whole_number_may_be_set_for_any_number():
    configuration = load_configuration(
        "design_example", ["cable.length=500", "envelope.radius=[100, 200]", "air.density=1"]
    )
    assert configuration.cable.length == 500.0
    assert configuration.envelope.radius == (100.0, 200.0)
    assert configuration.source.endswith(
        "with cable.length=500, envelope.radius=[100, 200], air.density=1"
    )
    assert np.isfinite(configuration.air.density)
