"""The table's file: whole or not at all, and refused with the command that builds one."""

import json
import os
import pickle
import shlex
import signal
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from folding_flight import folding_configuration, folding_mapping
from processes import LIMIT, children, command_line, wait_for

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.table import provide, storage
from ctcbs_ros.table.build import build_table
from ctcbs_ros.table.storage import load_table, read_header, save_table

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def configuration(tmp_path_factory):
    file = tmp_path_factory.mktemp("configuration") / "folding.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": folding_mapping()}}))
    return load_configuration(file)


@pytest.fixture(scope="module")
def table(configuration):
    return build_table(configuration, nodes=3, progress=False)


@pytest.fixture
def file(table, configuration, tmp_path):
    path = tmp_path / "table.npz"
    save_table(table, configuration, path)
    return path


def equal(one, other):
    return all(
        np.array_equal(getattr(one, f.name), getattr(other, f.name), equal_nan=True)
        for f in fields(one)
    )


def refused(path, configuration, *words):
    """The message of the refusal: one line that names the file, and the command to build another.

    What is there is the user's: following the advice never writes over it.
    """
    with pytest.raises(InputError) as error:
        load_table(path, configuration)
    message = str(error.value)
    assert "\n" not in message
    assert str(path) in message
    (advised,) = shlex.split(
        message.partition(f"ctcbs table build {configuration.source} -o ")[2]
    )
    assert advised.endswith(".npz")
    assert not os.path.lexists(advised)
    assert Path(advised).parent == path.parent
    for word in words:
        assert word in message
    return message


def rewrite(file, **changed):
    """The same file with arrays replaced, or left out where None."""
    with np.load(file) as archive:
        content = {name: archive[name] for name in archive.files}
    content |= changed
    np.savez_compressed(file, **{k: v for k, v in content.items() if v is not None})


def test_a_table_read_back_is_the_table_written(table, configuration, file):
    assert equal(load_table(file, configuration), table)
    assert equal(load_table(file), table)
    header = read_header(file)
    assert header["format_version"] == storage.FORMAT_VERSION
    assert header["source"] == "folding.yaml"
    assert oct(file.stat().st_mode)[-3:] == "644"


def test_another_format_version_is_refused(configuration, file):
    rewrite(file, format_version=np.array(storage.FORMAT_VERSION + 1))
    refused(file, configuration, f"format version {storage.FORMAT_VERSION + 1}")
    rewrite(file, format_version=np.array("new"))
    refused(file, configuration, "format version new")
    rewrite(file, format_version=np.array([1, 2]))
    refused(file, configuration, "format version")


def test_the_table_of_another_configuration_is_refused(configuration, file):
    changed = folding_configuration(configuration.source, d_n=5.0)
    refused(file, changed, "another configuration")


def test_the_message_names_a_placeholder_where_the_source_is_no_file(file):
    with pytest.raises(InputError, match="ctcbs table build CONFIG -o"):
        load_table(file, folding_configuration("/predictor", d_n=5.0))


def test_other_limits_leave_the_table_good(table, configuration, file):
    mapping = {**folding_mapping(), "limits": {"minimum_height": 99.0}}
    file_of_limits = file.with_name("limits.yaml")
    file_of_limits.write_text(yaml.safe_dump({"/**": {"ros__parameters": mapping}}))
    assert equal(load_table(file, load_configuration(file_of_limits)), table)


def test_a_file_truncated_at_any_byte_is_refused(configuration, file):
    data = file.read_bytes()
    for n in range(0, len(data), 7):
        file.write_bytes(data[:n])
        refused(file, configuration)


def test_a_flipped_byte_is_refused_or_without_effect(table, configuration, file):
    data = file.read_bytes()
    rng = np.random.default_rng(3)
    refusals = 0
    places = np.unique(np.concatenate([rng.integers(0, len(data), 600), np.arange(120)]))
    for i in places:
        damaged = bytearray(data)
        damaged[i] ^= int(rng.integers(1, 256))
        file.write_bytes(damaged)
        try:
            loaded = load_table(file, configuration)
        except InputError as error:
            refusals += 1
            assert "ctcbs table build" in str(error)  # noqa: PT017
        else:
            assert equal(loaded, table)
    assert refusals > 0.7 * places.size


class Trap:
    """A pickle that would create a file."""

    def __reduce__(self):
        return os.mkdir, ("trapped",)


def test_what_is_no_table_is_refused(configuration, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "no.npz"
    refused(path, configuration, "no such table")
    path.write_bytes(b"")
    refused(path, configuration)
    path.write_text("radius, speed\n1, 2\n")
    refused(path, configuration)
    path.write_bytes(pickle.dumps(Trap()))
    refused(path, configuration)
    with open(path, "wb") as out:
        np.savez(out, format=np.array([Trap()], dtype=object))
    refused(path, configuration)
    assert not (tmp_path / "trapped").exists()
    with open(path, "wb") as out:
        np.save(out, np.arange(5.0))
    refused(path, configuration, "not a table")
    with open(path, "wb") as out:
        np.savez(out, radius=np.arange(5.0))
    refused(path, configuration, "not a table")
    refused(tmp_path, configuration, "no such table")
    refused(tmp_path / ("n" * 300), configuration, "no such table")


def test_a_table_with_a_part_missing_or_misshapen_is_refused(table, configuration, file):
    whole = file.read_bytes()
    radius, end_mass_radius = table.radius, table.end_mass_radius
    wrong = {
        "radius": [None, radius[::-1], radius[:1], np.array(5.0), radius * np.nan],
        "count": [None, table.count.astype(float), table.count + 5, table.count[:2]],
        "end_mass_radius": [None, -end_mass_radius, end_mass_radius[0], np.array("a")],
        "fold_radius": [None, table.fold_radius[..., 0]],
        "depth": [table.fold_radius],
        "density": [None, np.array(-1.0), np.array([1.0, 2.0]), np.array("thin")],
        "configuration_hash": [None],
        "source": [None],
    }
    for name, values in wrong.items():
        for value in values:
            file.write_bytes(whole)
            rewrite(file, **{name: value})
            refused(file, configuration)
            if name == "source":
                with pytest.raises(InputError):
                    read_header(file)


def test_a_failing_write_leaves_the_old_file_and_nothing_else(
    table, configuration, file, monkeypatch
):
    old = file.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    for step in ("fsync", "replace"):
        with monkeypatch.context() as patch:
            patch.setattr(os, step, full)
            with pytest.raises(InputError, match=r"table\.npz.*No space left"):
                save_table(table, configuration, file)
    assert file.read_bytes() == old
    assert [p.name for p in file.parent.iterdir()] == [file.name]


def test_the_advised_file_is_another_where_one_is_there(tmp_path, configuration):
    absent = tmp_path / "absent.npz"
    assert refused(absent, configuration).endswith(f" -o {absent}")
    log = tmp_path / "my flight.tlog"
    log.write_bytes(b"a log")
    assert refused(log, configuration).endswith(f" -o '{tmp_path / 'my flight.npz'}'")
    (tmp_path / "my flight.npz").write_bytes(b"another")
    assert refused(log, configuration).endswith(f" -o '{tmp_path / 'my flight_2.npz'}'")


def test_the_cache_keeps_a_table_and_builds_a_damaged_one_again(
    table, configuration, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    built = []

    def build(configuration, progress):
        built.append(configuration)
        return table

    monkeypatch.setattr(provide, "build_table", build)  # only its cost is spared
    first = provide.table_for(configuration, progress=False)
    kept = list((tmp_path / "cache" / "ctcbs_ros").iterdir())
    assert kept == [provide.cache_file(configuration)]
    second = provide.table_for(configuration, progress=False)
    assert len(built) == 1
    assert equal(first, second)
    kept[0].write_bytes(kept[0].read_bytes()[:-100])
    capsys.readouterr()
    assert equal(provide.table_for(configuration, progress=False), table)
    assert len(built) == 2
    assert "built again" in capsys.readouterr().err
    assert equal(load_table(kept[0], configuration), table)
    other = folding_configuration(d_n=5.0)
    assert provide.cache_file(other) != provide.cache_file(configuration)


def test_a_cache_that_cannot_be_written_costs_only_the_cache(
    table, configuration, tmp_path, monkeypatch, capsys
):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(provide, "build_table", lambda *_, **__: table)
    assert provide.table_for(configuration, progress=False) is table
    assert "could not be kept" in capsys.readouterr().err


def test_a_table_given_by_path_is_never_built_silently(configuration, tmp_path):
    with pytest.raises(InputError, match="no such table"):
        provide.table_for(configuration, tmp_path / "absent.npz")


def ctcbs(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "ctcbs_ros", *map(str, arguments)],
        cwd=REPOSITORY, capture_output=True, text=True, timeout=LIMIT, **options,
    )  # fmt: skip


def test_the_command_describes_a_table_and_refuses_a_damaged_one(file):
    shown = ctcbs("table", "info", file, "--json")
    assert shown.returncode == 0
    summary = json.loads(shown.stdout)
    assert summary["nodes"] == [3, 3]
    assert summary["source"] == "folding.yaml"
    file.write_bytes(file.read_bytes()[:-1])
    shown = ctcbs("table", "info", file)
    assert shown.returncode == 2
    assert shown.stderr.count("\n") == 1
    assert "ctcbs table build" in shown.stderr


@pytest.mark.slow
def test_the_command_builds_a_table(configuration, tmp_path):
    path = tmp_path / "table.npz"
    built = ctcbs("table", "build", configuration.source, "-o", path)
    assert built.returncode == 0, built.stderr
    assert load_table(path, configuration).count.shape == (33, 33)


WORKER = "spawn_main"  # in the command of a worker process


def test_a_build_that_is_killed_leaves_no_file_and_no_process(configuration, file):
    old = file.read_bytes()
    building = subprocess.Popen(
        [sys.executable, "-m", "ctcbs_ros", "table", "build", configuration.source, "-o", file],
        cwd=REPOSITORY, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        workers = wait_for(lambda: children(building.pid, WORKER))
    finally:
        building.send_signal(signal.SIGKILL)
        building.wait()
    wait_for(lambda: not any(WORKER in command_line(pid) for pid in workers))
    assert file.read_bytes() == old
    assert [p.name for p in file.parent.iterdir()] == [file.name]
