"""The folder that a replay writes: tables, summary and pictures, whole or not at all."""

import csv
import json
import signal
import sys

import numpy as np
import pytest
from processes import LIMIT, read_to_end, read_until, start_on_terminal
from replays import DRONE, ctcbs

from ctcbs_ros.cli.replay import _progress_bar
from ctcbs_ros.replay.folder import complete_folder
from ctcbs_ros.replay.tables import (
    PREDICTION_COLUMNS,
    SAMPLE_COLUMNS,
)

PLOTS = {"track.png", "margin.png", "end_mass.png"}


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def out(drone_log, drone_table, tmp_path_factory):
    """Folder of results of the command, and what it printed."""
    folder = tmp_path_factory.mktemp("replay") / "made" / "out"
    command = ["replay", drone_log, "--config", DRONE, "--table", drone_table, "--out", folder]
    done = ctcbs(*command)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_results_are_the_tables_summary_and_plots_and_nothing_else(out):
    folder, done = out
    names = {path.name for path in folder.iterdir()}
    assert names == {"predictions.csv", "samples.csv", "summary.json"} | PLOTS
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    assert str(folder) in done.stderr


def test_tables_hold_every_prediction_and_every_sample(out, core_replay):
    folder, records = out[0], core_replay[0]
    predictions, samples = rows(folder / "predictions.csv"), rows(folder / "samples.csv")
    assert tuple(predictions[0]) == PREDICTION_COLUMNS
    assert tuple(samples[0]) == SAMPLE_COLUMNS
    assert len(samples) == len(records)
    valid = [record for record in records if record["valid"]]
    assert [int(row["stamp_ns"]) for row in predictions] == [r["stamp_ns"] for r in valid]
    for row, record in zip(predictions, valid, strict=True):
        # Two processes: where one of them compiled its kernels anew, the last digit may differ.
        for name in ("end_mass_east_m", "end_mass_latitude_deg", "margin_per_s"):
            assert float(row[name]) == pytest.approx(record[name], rel=1e-11)
    assert float(predictions[0]["time_s"]) == pytest.approx(
        valid[0]["vehicle_time_s"] - records[0]["vehicle_time_s"]
    )


def test_every_figure_of_a_record_has_its_column(core_replay):
    valid = next(record for record in core_replay[0] if record["valid"])
    assert set(valid) - set(PREDICTION_COLUMNS) == {"skip", "valid", "other_solutions"}
    added = {"time_s", "other_end_mass_radii_m"}
    assert set(PREDICTION_COLUMNS) - set(valid) == added


def test_the_bar_tells_how_much_of_the_log_has_been_read_and_nothing_of_none(capsys):
    with _progress_bar(lambda record: None) as take:
        for part, time in ((0.1, None), (0.2, 5.0), (0.6, 5.0), (1.0, 65.0)):
            take({"vehicle_time_s": time}, part)
    told = capsys.readouterr().err
    assert "log 60 s" in told
    assert "log 0 s" not in told


def test_plots_are_drawn(out):
    from matplotlib.image import imread

    for name in PLOTS:
        image = imread(out[0] / name)
        assert min(image.shape[:2]) > 500
        assert np.ptp(image[..., :3]) > 0.5  # something is on it
        for edge in (image[:5], image[-5:], image[:, :5], image[:, -5:]):
            assert (edge == 1.0).all()  # and nothing is cut


def test_summary_file_is_the_summary(out, core_replay):
    summary = json.loads((out[0] / "summary.json").read_text())
    assert summary.pop("wall_s") > 0.0
    assert summary == json.loads(json.dumps(core_replay[1]))


def test_folder_is_left_as_it_was_where_the_work_fails(tmp_path):
    folder = tmp_path / "new" / "out"

    def fail(draft):
        (draft / "predictions.csv").write_text("half a")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), complete_folder(folder) as draft:
        fail(draft)
    assert list(tmp_path.iterdir()) == []

    folder.mkdir(parents=True)
    (folder / "predictions.csv").write_text("old")
    with pytest.raises(KeyboardInterrupt), complete_folder(folder) as draft:
        fail(draft)
    assert [path.read_text() for path in folder.iterdir()] == ["old"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_replay_leaves_no_files_and_no_traceback(
    tmp_path, drone_log, drone_table, number
):
    command = [sys.executable, "-m", "ctcbs_ros", "replay", drone_log, "--config", DRONE]
    command += ["--table", drone_table, "--rate", "1", "--out", tmp_path / "out"]
    process, terminal = start_on_terminal(command)
    read_until(terminal, r"replay: +[1-9]\d* %")
    assert list(tmp_path.glob("out/.*/samples.csv"))
    process.send_signal(number)
    errors = read_to_end(terminal)
    assert process.wait(LIMIT) == 128 + number
    said = f"interrupted, nothing was written to {tmp_path / 'out'}"
    if number == signal.SIGTERM:
        said = "terminated (SIGTERM)"
    assert errors.splitlines()[-1] == f"ctcbs: {said}"
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []
