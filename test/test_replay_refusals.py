"""Replays that cannot be: refused in one line, before anything is built or written."""

import pytest
from replays import DRONE

from ctcbs_ros.cli.main import main


@pytest.fixture
def refused(tmp_path, capsys, monkeypatch):
    """Function that runs `ctcbs replay` and returns its one line on standard error."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def refusal(*arguments):
        assert main(["replay", *map(str, arguments)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("ctcbs: error: ")
        assert not (tmp_path / "cache").exists(), "a table was built first"
        return line

    return refusal


def test_absent_log_is_refused_before_a_table_is_built(refused, tmp_path):
    assert "absent.tlog" in refused(tmp_path / "absent.tlog", "--config", DRONE)


@pytest.mark.parametrize("content", [b"", b"no message in here\n" * 500, bytes(10_000)])
def test_log_without_a_message_is_refused_before_a_table_is_built(refused, tmp_path, content):
    (tmp_path / "noise.tlog").write_bytes(content)
    assert "noise.tlog" in refused(tmp_path / "noise.tlog", "--config", DRONE)


def test_absent_configuration_is_refused(refused, drone_log, tmp_path):
    assert "absent.yaml" in refused(drone_log, "--config", tmp_path / "absent.yaml")


def test_table_of_another_configuration_is_refused(refused, drone_log, drone_table, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(DRONE.read_text().replace("length: 150.0", "length: 140.0"))
    line = refused(drone_log, "--config", other, "--table", drone_table)
    assert str(drone_table) in line


def test_folder_that_cannot_be_made_is_refused(refused, drone_log, drone_table, tmp_path):
    (tmp_path / "file").write_text("in the way")
    line = refused(
        drone_log, "--config", DRONE, "--table", drone_table, "--out", tmp_path / "file" / "out"
    )
    assert str(tmp_path / "file" / "out") in line


@pytest.mark.parametrize("rate", ["-1", "nan", "inf", "fast"])
def test_rate_that_is_none_is_refused(capsys, drone_log, rate):
    with pytest.raises(SystemExit) as error:
        main(["replay", str(drone_log), "--config", str(DRONE), f"--rate={rate}"])
    assert error.value.code == 2
    assert "--rate" in capsys.readouterr().err
