"""The thesis's figures: numbers found in other ways, the files, and how the command ends."""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from ctcbs_ros import __version__
from ctcbs_ros.cli.main import main
from ctcbs_ros.figures.catalogue import FIGURES
from ctcbs_ros.figures.rows import read_rows
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import steady_states

REPOSITORY = Path(__file__).parents[1]
ALL = ["3.1", "4.1"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with Figs. 3.1 and 4.1, and what the command printed."""
    folder = tmp_path_factory.mktemp("figures") / "new"
    done = ctcbs("figures", str(folder), "--only", "3.1,4.1")
    assert done.returncode == 0, done.stderr
    return folder, done


def ctcbs(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", *arguments], capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip


def rows_of(folder, number):
    return read_rows(folder / f"fig_{number}.csv")


def events(rows, curve, event):
    return [
        (row["omega"], row["end_mass_radius"])
        for row in rows if row["curve"] == curve and row["event"] == event
    ]  # fmt: skip


# --- numbers ------------------------------------------------------------------------------------


def test_folds_of_figure_3_1_are_those_of_a_bisection_on_the_number_of_states(made):
    # Bisected to 1e-9; test_diagram.py does the same again.
    rows = rows_of(made[0], "3.1")
    np.testing.assert_allclose(
        events(rows, "d_n 4.8", "fold"), [(1.09818108, 2.24745), (0.93234841, 1.21659)], atol=1e-5
    )
    ((omega, _),) = events(rows, "d_n 2.7", "fold")
    assert omega == pytest.approx(0.947078, abs=1e-6)
    assert events(rows, "d_n 6.2", "fold") == events(rows, "d_n 10", "fold") == []


def test_jumps_of_figure_3_1_are_the_thesis_s(made):
    # Thesis, text of Fig. 3.1: 2.3 -> 0.5 near omega 1.1 rising, 1.3 -> 2.5 falling.
    jumps = [
        row["end_mass_radius"]
        for row in rows_of(made[0], "3.1") if row["kind"] == "jump" and row["curve"] == "d_n 4.8"
    ]  # fmt: skip
    np.testing.assert_allclose(jumps, [2.3, 0.5, 1.3, 2.5], atol=0.1)


def test_hopf_points_and_minima_of_figure_4_1_are_those_of_bisection(made):
    # Growth rates bisected, radii minimised (test_diagram.py); thesis: 1.8 to 2.2, 2.8 to 4.
    rows = rows_of(made[0], "4.1")
    hopf = [omega for omega, _ in events(rows, "d_n 1.33", "Hopf point")]
    np.testing.assert_allclose(hopf, [1.88565, 2.12006, 2.85304], atol=3e-3)
    ((omega, _),) = events(rows, "d_n 2", "Hopf point")
    assert omega == pytest.approx(3.3910, abs=3e-3)
    minima = [events(rows, f"d_n {d}", "first minimum") for d in ("1.33", "2", "3")]
    np.testing.assert_allclose([m[0][0] for m in minima], [2.2467, 2.1904, 2.1320], atol=1e-4)
    assert minima[0][0][1] == pytest.approx(0.31785, abs=1e-5)
    assert {row["stability"] for row in rows if row["curve"] == "d_n 3"} == {"stable"}


def test_stability_changes_only_in_events_and_middle_states_diverge(made):
    rows = [row for row in rows_of(made[0], "3.1") if row["curve"] == "d_n 4.8"]
    looks = [row["stability"] or row["event"] for row in rows if row["kind"] == "branch"]
    runs = [look for look, before in zip(looks, [None, *looks], strict=False) if look != before]
    assert runs == ["stable", "fold", "divergence", "fold", "stable", "Hopf point", "flutter"]


def test_points_of_the_branches_are_steady_states_close_enough_for_a_smooth_line(made):
    for number, width in (("3.1", 3.0), ("4.1", 4.0)):
        rows = [row for row in rows_of(made[0], number) if row["kind"] == "branch"]
        for row in rows[:: len(rows) // 12]:
            point = Parameters(
                row["omega"], row["length"], row["end_mass"], row["cable_drag"], row["drag_ratio"]
            )
            radii = np.array([s.end_mass_radius for s in steady_states(point).states])
            # A fold's own radius is only as sharp as the square root of its omega.
            assert np.abs(radii - row["end_mass_radius"]).min() < 1e-5
        for a, b in pairwise(rows):
            if (a["curve"], a["branch"]) == (b["curve"], b["branch"]):
                assert abs(b["omega"] - a["omega"]) < 0.02 * width


# --- files --------------------------------------------------------------------------------------


def test_each_figure_is_a_csv_and_a_png_and_each_file_is_printed(made):
    folder, done = made
    names = ["fig_3.1.csv", "fig_3.1.png", "fig_4.1.csv", "fig_4.1.png"]
    assert sorted(file.name for file in folder.iterdir()) == names
    assert sorted(done.stdout.split()) == [str(folder / name) for name in names]
    assert done.stderr.count("figures:") >= 1
    assert "100%" in done.stderr
    for number in ("3.1", "4.1"):
        first, header, *_ = (folder / f"fig_{number}.csv").read_text().splitlines()
        assert first.startswith(f"# ctcbs_ros {__version__}: thesis Fig. {number}: ")
        assert header.split(",") == list(FIGURES[number].columns)
        picture = imread(folder / f"fig_{number}.png")
        assert min(picture.shape[:2]) > 600
        assert picture[..., :3].std() > 0.05


def test_drawn_lines_are_the_csv_s_points(made):
    rows = rows_of(made[0], "4.1")
    axes = FIGURES["4.1"].draw("title", rows).axes[0]
    drawn = {tuple(point) for line in axes.lines for point in line.get_xydata()}
    points = {
        (row["omega"], row["end_mass_radius"]) for row in rows if row["kind"] == "branch"
    }
    assert points <= drawn
    # Moved rows are drawn where they are moved to.
    moved = [{**row, "end_mass_radius": row["end_mass_radius"] + 0.5} for row in rows]
    axes = FIGURES["4.1"].draw("title", moved).axes[0]
    drawn = {tuple(point) for line in axes.lines for point in line.get_xydata()}
    assert {(x, y + 0.5) for x, y in points} <= drawn


def test_every_drawing_names_figure_parameters_and_axes():
    assert list(FIGURES) == ALL
    for number, figure in FIGURES.items():
        assert figure.number == number
        assert "=" in figure.title


# --- how the command ends -----------------------------------------------------------------------


@pytest.mark.parametrize("only", ["9.9", "3.1,", "3.1,x"])
def test_unknown_figure_is_refused_naming_those_there_are(tmp_path, capsys, only):
    assert main(["figures", str(tmp_path / "f"), "--only", only]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("ctcbs: error: --only: ")
    assert line.endswith("allowed are " + ", ".join(ALL))
    assert not (tmp_path / "f").exists()


def test_folder_that_cannot_be_made_or_written_is_refused_in_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        assert main(["figures", str(folder), "--only", "3.1"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"ctcbs: error: {folder}: cannot be ")


def living(group):
    """Processes of a group, but for those that have ended and wait to be seen off."""
    found = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, of, *_ = file.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(of) == group and state != "Z":
            found.append(file.parent.name)
    return found


def test_interrupt_of_the_whole_group_leaves_no_half_file_nor_worker_and_is_repeatable(tmp_path):
    command = [sys.executable, "-m", "ctcbs_ros", "figures", str(tmp_path), "--only", "3.1,4.1"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    # The bar shows when the workers are being started: the hardest moment to end cleanly.
    while "figures:" not in (shown := os.read(process.stderr.fileno(), 4096).decode()):
        assert shown, "ended by itself"
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "ctcbs: interrupted"
    assert "Traceback" not in errors
    end = time.monotonic() + 20.0
    while living(process.pid):
        assert time.monotonic() < end, "a worker is left"
        time.sleep(0.1)
    assert {file.suffix for file in tmp_path.iterdir()} <= {".csv", ".png"}
    assert ctcbs("figures", str(tmp_path), "--only", "4.1").returncode == 0
    assert read_rows(tmp_path / "fig_4.1.csv")
