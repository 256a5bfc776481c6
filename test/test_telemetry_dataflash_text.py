"""DataFlash logs as text: the same samples as the binary log, damaged, and truncated."""

import random
from math import isnan

import pytest
import test_telemetry_dataflash as binary
from pymavlink.DFReader import DFReader_binary, DFReader_text
from test_telemetry_source import flight_log

from ctcbs_ros.telemetry.dataflash import WANTED, DataflashDecoder
from ctcbs_ros.telemetry.dataflash_text import LineSplitter
from ctcbs_ros.telemetry.source import open_log

NAMES = tuple(WANTED)


def text_of(name, **fields):
    columns = binary.LAYOUTS[name][2].split(",")
    return f"{name}, {', '.join(str(fields.get(column, 0)) for column in columns)}\n".encode()


def declarations():
    lines = "".join(
        f"FMT, {kind}, 89, {name}, {layout}, {columns}\n"
        for name, (kind, layout, columns) in binary.LAYOUTS.items()
    )
    return b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n" + lines.encode()


def gps(time_us, **fields):
    values = {"I": 0, "Status": 3, "NSats": 9, "HDop": 1.2, "Lat": -35.3632621,
              "Lng": 149.1652374, "Alt": 584.09, "Spd": 20.0, "GCrs": 90.0, "VZ": -2.0, "U": 1,
              "GWk": binary.WEEK, "GMS": binary.WEEK_MS + time_us // 1000}  # fmt: skip
    return text_of("GPS", TimeUS=time_us, **values | fields)


def decode(log):
    decoder = DataflashDecoder(splitter=LineSplitter)
    return list(decoder.feed(log, last=True)), decoder


def test_lines_become_si_degrees_and_enu():
    log = declarations() + text_of("MSG", Message="ArduPlane V4.5.0, with a comma")
    log += text_of("POS", RelHomeAlt=61.5) + text_of("XKF2", VWN=1.0, VWE=2.0)
    (sample,), decoder = decode(log + gps(25_000_000))
    assert sample.time == 25.0
    assert (sample.latitude, sample.longitude) == (-35.3632621, 149.1652374)
    assert (sample.altitude_amsl, sample.height_above_home) == (584.09, 61.5)
    assert sample.velocity == pytest.approx((20.0, 0.0, 2.0))
    assert sample.horizontal_accuracy == pytest.approx(3.6)
    assert isnan(sample.altitude_ellipsoid)
    assert decoder.wind == (2.0, 1.0, 0.0)
    assert decoder.vehicle.type == "ArduPlane"
    assert decoder.link.bad_bytes == 0


def test_recorded_flight_as_text_gives_the_samples_of_the_binary_log(tmp_path):
    source = flight_log("plane_sitl_guided_loiter.BIN")
    reader = DFReader_binary(str(source.path))
    path = tmp_path / "flight.tlog"  # told by content
    with open(path, "w") as log:
        for name in ("FMT", *NAMES):
            fmt = next((f for f in reader.formats.values() if f.name == name), None)
            if fmt is not None:
                columns = ",".join(fmt.columns)
                log.write(f"FMT, {fmt.type}, {fmt.len}, {name}, {fmt.format}, {columns}\n")
        while (message := reader.recv_match(type=list(NAMES))) is not None:
            if message.get_type() in NAMES:
                values = [str(getattr(message, name)) for name in message.get_fieldnames()]
                log.write(", ".join([message.get_type(), *values]) + "\n")
    samples, expected = list(open_log(path)), list(source)
    assert str(samples) == str(expected)
    peer = DFReader_text(str(path))
    for sample in samples:
        assert sample.latitude == peer.recv_match(type="GPS", strict=True).Lat


def test_cut_anywhere_it_gives_the_whole_lines():
    log = declarations() + b"".join(gps(200_000 * i) for i in range(5))
    whole = decode(log)[0]
    for length in range(len(declarations()), len(log)):
        samples, decoder = decode(log[:length])
        lines = log[:length].count(b"\n")
        assert len(samples) == lines - declarations().count(b"\n")
        assert decoder.link.messages == lines
        assert decoder.link.bad_bytes == length - log[:length].rfind(b"\n") - 1
        assert str(samples) == str(whole[: len(samples)])


@pytest.mark.parametrize("value", ["nan", "inf", "9" * 400, "x", "", "-1"])
def test_values_that_no_message_has_raise_nothing(value):
    for column in binary.LAYOUTS["GPS"][2].split(","):
        fields = {column: value}
        time_us = fields.pop("TimeUS", 1_000_000)
        line = gps(1_000_000, **fields) if column != "TimeUS" else gps(1).replace(b"1", b"", 1)
        samples, decoder = decode(declarations() + line + f"GPS, {time_us}\n".encode())
        assert len(samples) <= 1
        assert decoder.link.bad_bytes > 0


def test_random_damage_raises_nothing_and_is_counted():
    log = declarations() + b"".join(gps(200_000 * i) for i in range(30))
    for seed in range(200):
        chance = random.Random(seed)
        damaged = bytearray(log)
        start = chance.randrange(len(log) - 60)
        damaged[start : start + 60] = chance.randbytes(chance.choice([0, 10, 60, 5000]))
        samples, decoder = decode(bytes(damaged))
        assert decoder.link.messages + decoder.link.bad_runs > 0
        assert len(samples) <= 30
