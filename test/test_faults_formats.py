"""Damaged bytes in logs whose formats have no checksums: nothing valid is predicted from them.

Of a MAVLink log a message that was hit is lost; in these its numbers come through, and only what
is believed of a sample stands between them and a prediction.
"""

from functools import cache

import numpy as np
import pytest
import test_telemetry_formats as formats
from bags import write_bag
from faults_log import as_bytes
from faults_replay import DRONE, assert_numbers, distance, turn

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.source import open_log

SHARE = 1e-3  # of the bytes
HEAD = 4096  # bytes of a stream that are left whole, with the declarations of what follows
STAMPS = 2**31 * 10**9  # ns; a ROS stamp has so many seconds, either sign


def damage(random, head=0):
    """Function that overwrites a share of some bytes at random."""

    def damaged(data):
        found = np.frombuffer(data, np.uint8).copy()
        hit = random.random(len(found)) < SHARE
        hit[:head] = False
        found[hit] = random.integers(256, size=hit.sum())
        return found.tobytes()

    return damaged


def flown(path):
    """Samples of a log and their predictions, and the log's counts."""
    source, predictor = open_log(path), Predictor(load_configuration(DRONE))
    return [(sample, predictor.update(sample)) for sample in source], source.link


def written(kind, samples, path, random=None):
    """Write the samples as a log of a format, damaged where there is a random generator.

    Of a bag only messages are damaged: what a damaged page or chunk costs is another matter.
    """
    if kind in ("db3", "mcap"):
        altered = damage(random) if random else bytes
        return write_bag(path, formats.bag_messages(samples), kind, altered=altered)
    data = {"ulg": formats.ulog_of, "BIN": formats.dataflash_of}[kind](samples)
    path.write_bytes(damage(random, HEAD)(data) if random else data)
    return path


@pytest.fixture(scope="module")
def samples(log, tmp_path_factory):
    """Samples of the flight without faults."""
    path = tmp_path_factory.mktemp("formats") / "clean.tlog"
    path.write_bytes(as_bytes(log))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(formats, "AIR", (0.0, 0.0, 0.0))  # as in the flight
        yield list(open_log(path))


@pytest.fixture(scope="module")
def clean(samples, tmp_path_factory):
    """What the flight comes to without faults, by format."""
    folder = tmp_path_factory.mktemp("clean")
    return cache(lambda kind: flown(written(kind, samples, folder / kind))[0])


def distances(found, clean):
    """Of each valid prediction to that of the whole log, over its 95 % region.

    A sample is told by its position; one whose position was hit is that after the sample before.
    Where the whole log has none within a quarter of a turn it is inf, as in `faults_replay`.
    """
    places = {(s.latitude, s.longitude): number for number, (s, _) in enumerate(clean)}
    at, result = -1, []
    for sample, prediction in found:
        at = min(places.get((sample.latitude, sample.longitude), at + 1), len(clean) - 1)
        if prediction.valid and clean[at][1].valid:
            result.append(distance(prediction, clean[at][1]))
        elif prediction.valid:
            near = [p for s, p in clean if abs(s.time - clean[at][0].time) < turn(prediction) / 4]
            result += [] if any(p.valid for p in near) else [np.inf]
    return np.array(result)


@pytest.mark.parametrize(
    ("kind", "seed"), [("ulg", 3), ("ulg", 7), ("BIN", 3), ("BIN", 5), ("db3", 0), ("mcap", 1)]
)
def test_no_prediction_is_wrong_that_damaged_bytes_leave_valid(
    kind, seed, samples, clean, tmp_path
):
    random = np.random.default_rng(seed)
    found, _ = flown(written(kind, samples, tmp_path / "damaged", random))
    assert len(samples) >= len(found) > 0.9 * len(samples)
    assert {p.skip for _, p in found} > {None}
    assert {p.skip for _, p in found} <= {None, *SkipCode}
    for sample, prediction in found:
        assert_numbers(prediction)
        assert abs(sample.stamp_ns) < STAMPS
    apart = distances(found, clean(kind))
    assert len(apart) > 20
    assert apart.max() <= 1.0
