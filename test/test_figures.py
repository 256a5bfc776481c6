"""The thesis's figures: numbers found in other ways, the files, and how the command ends."""

import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from processes import LIMIT, read_until, wait_for

from ctcbs_ros import __version__
from ctcbs_ros.cli.main import main
from ctcbs_ros.figures.catalogue import FIGURES
from ctcbs_ros.figures.rows import read_rows
from ctcbs_ros.files import made_folder
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import stability
from ctcbs_ros.solver.steady_state import steady_states

REPOSITORY = Path(__file__).parents[1]
ALL = ["3.1", "3.2", "3.3", "3.4", "4.1", "4.2", "5.2", "5.3", "D.1"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with Figs. 3.1, 3.2 and 4.1, and what the command printed."""
    folder = tmp_path_factory.mktemp("figures") / "new"
    done = ctcbs("figures", str(folder), "--only", "4.1,3.1,3.2")
    assert done.returncode == 0, done.stderr
    return folder, done


def ctcbs(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", *arguments], capture_output=True, text=True,
        timeout=LIMIT,
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


def test_fold_paths_of_figure_3_2_meet_the_folds_of_figure_3_1(made):
    # The bisected folds of d_n 4.8 and 2.7 again; of the cusp: test_fold_curve.py.
    paths = [row for row in rows_of(made[0], "3.2") if row["kind"] == "fold path"]
    for drag, fold, omega in ((4.8, "F1", 1.09818), (4.8, "F2", 0.93235), (2.7, "F2", 0.94708)):
        part = sorted((r["cable_drag"], r["omega"]) for r in paths if r["curve"] == fold)
        assert np.interp(drag, *zip(*part, strict=True)) == pytest.approx(omega, abs=2e-3)
    ends = {(row["cable_drag"], row["omega"]) for row in paths if row["event"] == "cusp"}
    ((drag, omega),) = ends
    assert drag == pytest.approx(6.1577, abs=1e-3)
    assert omega == pytest.approx(0.9113, abs=1e-3)
    assert max(row["cable_drag"] for row in paths) == pytest.approx(drag, rel=1e-9)


def test_stability_changes_only_in_events_and_middle_states_diverge(made):
    rows = [row for row in rows_of(made[0], "3.1") if row["curve"] == "d_n 4.8"]
    looks = [row["stability"] or row["event"] for row in rows if row["kind"] == "branch"]
    runs = [look for look, before in zip(looks, [None, *looks], strict=False) if look != before]
    assert runs == ["stable", "fold", "divergence", "fold", "stable", "Hopf point", "flutter"]


def radii_at(row, omega):
    """Radii of all steady states with the parameters of a row."""
    point = Parameters(
        omega, row["length"], row["end_mass"], row["cable_drag"], row["drag_ratio"]
    )
    return np.array([state.end_mass_radius for state in steady_states(point).states])


def test_points_of_the_branches_are_steady_states_and_so_are_the_lines_between(made):
    for number in ("3.1", "4.1"):
        rows = [row for row in rows_of(made[0], number) if row["kind"] == "branch"]
        for row in rows[:: len(rows) // 12]:
            # A fold's own radius is only as sharp as the square root of its omega.
            assert np.abs(radii_at(row, row["omega"]) - row["end_mass_radius"]).min() < 1e-5
        chords = [
            (a, b) for a, b in pairwise(rows)
            if (a["curve"], a["branch"]) == (b["curve"], b["branch"])
            and abs(b["omega"] - a["omega"]) > 0.02
        ]  # fmt: skip
        for a, b in chords[:: len(chords) // 20]:
            omega, radius = ((a[name] + b[name]) / 2 for name in ("omega", "end_mass_radius"))
            assert np.abs(radii_at(a, omega) - radius).min() < 2e-3


# --- files --------------------------------------------------------------------------------------


def test_each_figure_is_a_csv_and_a_png_and_each_file_is_printed(made):
    folder, done = made
    names = [f"fig_{n}.{suffix}" for n in ("3.1", "3.2", "4.1") for suffix in ("csv", "png")]
    assert sorted(file.name for file in folder.iterdir()) == names
    assert sorted(done.stdout.split()) == [str(folder / name) for name in names]
    assert done.stderr.count("figures:") >= 1
    assert "100%" in done.stderr
    for number in ("3.1", "3.2", "4.1"):
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


def test_figures_are_the_thesis_s_and_drawings_name_number_parameters_and_units(made):
    assert list(FIGURES) == [figure.number for figure in FIGURES.values()] == ALL
    for number in ("3.1", "3.2", "4.1"):
        title = f"Fig. {number}: {FIGURES[number].title}"
        drawing = FIGURES[number].draw(title, rows_of(made[0], number))
        assert title in [text.get_text() for text in drawing.texts]
        assert "(l = 3, m = " in title
        axes = drawing.axes[0]
        assert axes.get_xlabel().endswith("[-]")
        assert axes.get_ylabel().endswith("[-]")
        assert axes.get_legend() is not None


@pytest.mark.slow
def test_all_figures_show_what_the_thesis_says_of_them(tmp_path):
    assert main(["figures", str(tmp_path)]) == 0
    assert len(list(tmp_path.iterdir())) == 2 * len(ALL)

    def least(number, length, mass, ratio, place=0):
        # Of Fig. 4.2 the first is that at the first minimum, the second that up to omega 3.
        drags = [
            row["cable_drag"] for row in rows_of(tmp_path, number)
            if (row["length"], row["end_mass"], row["drag_ratio"]) == (length, mass, ratio)
        ]  # fmt: skip
        assert len(drags) == (1 if number == "3.3" or length % 0.5 else 2)
        return drags[place]

    # Falls with length and drag ratio, rises with end mass.
    for number in ("3.3", "4.2"):
        for ratio in (1.0, 2.0):
            for mass in (20.0, 50.0, 100.0):
                drags = [least(number, length, mass, ratio) for length in (2.5, 3.0, 3.5, 4.0)]
                assert drags == sorted(drags, reverse=True)
            for length in (2.5, 3.0, 3.5, 4.0):
                drags = [least(number, length, mass, ratio) for mass in (20.0, 50.0, 100.0)]
                assert drags == sorted(drags)
        assert least(number, 3.0, 50.0, 2.0) < least(number, 3.0, 50.0, 1.0)
    # More than one state below the least drag, one above it.
    drag = least("3.3", 4.0, 20.0, 2.0)
    for share, most in ((0.98, 3), (1.01, 1)):
        counts = {
            len(steady_states(Parameters(omega, 4.0, 20.0, share * drag, 2.0)).states)
            for omega in np.linspace(0.5, 3.0, 500)
        }
        assert max(counts) == most
    # Some state up to omega 3 flutters just below the drag for which none does, none just above.
    drag = least("4.2", 3.0, 20.0, 1.0, place=1)
    for share, some in ((0.98, True), (1.02, False)):
        rates = []
        for omega in np.linspace(0.5, 3.0, 60):
            (state,) = steady_states(Parameters(omega, 3.0, 20.0, share * drag, 1.0)).states
            rates.append(stability(state).growth_rate)
        assert (max(rates) > 0.0) == some
    # omega 1.0 falls short of the cusp at l 2 and exceeds it at l 4; 1.6 is right at l 5.
    cusps = {
        row["length"]: row["omega"]
        for row in rows_of(tmp_path, "3.4") if row["kind"] == "cusp" and row["end_mass"] == 50.0
    }  # fmt: skip
    assert cusps[2.0] > 1.0 > cusps[4.0]
    assert cusps[5.0] < 1.6
    # Stable for every tow radius and deployed length; 0.15, 0.08 and 8.43e-3.
    for number in ("5.2", "5.3"):
        branches = [row for row in rows_of(tmp_path, number) if row["kind"] == "branch"]
        assert {row["stability"] for row in branches} == {"stable"}
        assert len({(row["curve"], row["branch"]) for row in branches}) == 4
    ends = {
        (row["frontal_area_m2"], row["tow_radius_m"]): row["end_mass_radius"]
        for row in rows_of(tmp_path, "5.2")
        if row["elasticity"] == np.inf and round(row["tow_radius_m"], 6) in (100.0, 250.0)
    }
    assert sorted(ends.values()) == pytest.approx([8.48e-3, 8.51e-3, 0.0832, 0.1484], rel=2e-3)
    # More drag on the end mass, less radius, at the lower angular velocities.
    rows = [row for row in rows_of(tmp_path, "D.1") if row["kind"] == "branch"]
    radii = []
    for ratio in (0.5, 1.0, 2.0, 4.0):
        part = sorted((r["omega"], r["end_mass_radius"]) for r in rows if r["drag_ratio"] == ratio)
        radii.append(np.interp(0.7, *zip(*part, strict=True)))
    assert radii == sorted(radii, reverse=True)


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
    folder = tmp_path / "made" / "for this"
    command = [sys.executable, "-m", "ctcbs_ros", "figures", str(folder), "--only", "3.1,4.1"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    # The bar shows when the workers are being started: the hardest moment to end cleanly.
    read_until(process.stderr, "figures:")
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=LIMIT)
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "ctcbs: interrupted"
    assert "Traceback" not in errors
    wait_for(lambda: not living(process.pid), "the end of every worker")
    assert {file.suffix for file in tmp_path.rglob("*.*")} <= {".csv", ".png"}
    assert not list(tmp_path.iterdir()) or list(folder.iterdir())
    assert ctcbs("figures", str(folder), "--only", "3.2").returncode == 0
    assert read_rows(folder / "fig_3.2.csv")


@pytest.mark.parametrize("keep", [False, True])
def test_a_folder_made_for_what_fails_is_left_only_with_something_in_it(tmp_path, keep):
    def fail(folder):
        assert folder.is_dir()
        if keep:
            (folder / "file").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), made_folder(tmp_path / "a" / "b") as folder:
        fail(folder)
    assert (tmp_path / "a").exists() is keep
    with pytest.raises(KeyboardInterrupt), made_folder(tmp_path) as folder:
        fail(folder)
    assert tmp_path.exists()
