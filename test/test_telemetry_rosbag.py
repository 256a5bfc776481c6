"""ROS 2 bags: written with rosbags in every storage, damaged, and truncated."""

import random
from math import inf, isnan, nan

import pytest
from bags import FIX, ODOM, POSE, TWIST, WIND, fix, odometry, pose, twist, wind, write_bag
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from rosbags.rosbag2.storage_mcap import McapReader

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.source import open_log

START_NS = 1_767_268_800_000_000_000
ZSTD_CHUNKS = (CompressionMode.STORAGE, CompressionFormat.ZSTD)


def flight(count=20):
    for i in range(count):
        stamp = START_NS + 200_000_000 * i
        yield ODOM, odometry(stamp)
        yield FIX, fix(stamp, longitude=8.5 + 1e-5 * i)
        if i % 5 == 0:
            yield WIND, wind(stamp, (4.0, -3.0, 0.0))


def the_file(folder):
    (file,) = (path for path in folder.iterdir() if path.suffix in (".db3", ".mcap"))
    return file


def samples_of(tmp_path, messages, name="bag", **options):
    source = open_log(write_bag(tmp_path / name, messages, **options))
    return list(source), source


# --- what a sample is made of -------------------------------------------------------------------


def test_fix_and_odometry_become_a_sample_at_the_header_stamp(tmp_path):
    samples, source = samples_of(tmp_path, flight(3), delay_ns=700_000_000)
    sample = samples[1]
    assert sample.stamp_ns == START_NS + 200_000_000
    assert sample.time == (START_NS + 200_000_000) / 1e9
    assert (sample.latitude, sample.longitude) == (47.4, 8.5 + 1e-5)
    assert sample.altitude_ellipsoid == 547.0
    assert isnan(sample.altitude_amsl)
    assert sample.velocity == (4.0, 3.0, 2.0)
    assert (sample.horizontal_accuracy, sample.speed_accuracy) == (1.5, 0.25)
    assert sample.fix_type == 3
    assert len(samples) == 3
    assert source.vehicle is None
    assert source.link.messages == 7
    assert source.link.bad_bytes == 0


def test_wind_is_where_the_air_goes(tmp_path):
    messages = [(WIND, wind(START_NS, (4.0, -3.0, 0.5))), *flight(1)]
    source = open_log(write_bag(tmp_path / "first", messages))
    sample = next(iter(source))
    assert source.wind == sample.wind == (4.0, -3.0, 0.5)
    assert isnan(sample.wind_accuracy)
    samples, _ = samples_of(tmp_path, flight(7), name="later")
    assert [i for i, s in enumerate(samples) if s.wind is not None] == [1, 6]  # told once


def test_velocity_of_a_receiver_is_not_taken_for_wind(tmp_path):
    messages = [("/gps/vel", wind(START_NS, (20.0, 0.0, 0.0))), *flight(2)]
    messages = [(topic, m) for topic, m in messages if topic != WIND]
    assert samples_of(tmp_path, messages)[1].wind is None


def test_pose_with_twist_gives_local_samples_and_a_body_twist_does_not(tmp_path):
    messages = [(TWIST, twist(START_NS)), (POSE, pose(START_NS))]
    (sample,), _ = samples_of(tmp_path, messages)
    assert sample.local_position == (7.0, 0.0, 0.0)
    assert sample.velocity == (4.0, 3.0, 2.0)
    messages[0] = (TWIST, twist(START_NS, frame="base_link"))
    (sample,), _ = samples_of(tmp_path, messages, "body")
    assert sample.velocity is None


def test_best_positions_are_used_from_the_start(tmp_path):
    stamps = [START_NS + 200_000_000 * i for i in range(4)]
    messages = [
        (POSE, pose(stamps[0])), (ODOM, odometry(stamps[1])), (POSE, pose(stamps[1])),
        (FIX, fix(stamps[2])), (ODOM, odometry(stamps[3])), (FIX, fix(stamps[3])),
    ]  # fmt: skip
    samples, _ = samples_of(tmp_path, messages)
    assert [(s.stamp_ns, s.flight) for s in samples] == [(stamps[2], 0), (stamps[3], 0)]
    samples, _ = samples_of(tmp_path, messages[:3], "local")
    assert [(s.stamp_ns, s.flight) for s in samples] == [(stamps[1], 0)]


def test_only_topic_of_a_type_is_used_whatever_its_name(tmp_path):
    samples, _ = samples_of(tmp_path, [("/uav/gnss", fix(START_NS))])
    assert len(samples) == 1


def test_of_several_topics_the_one_by_mavros_name_is_used(tmp_path):
    messages = [("/predictor/end_mass/fix", fix(START_NS, latitude=1.0)), (FIX, fix(START_NS))]
    samples, _ = samples_of(tmp_path, messages)
    assert [s.latitude for s in samples] == [47.4]


def test_topics_that_leave_a_choice_are_refused_by_name(tmp_path):
    bag = write_bag(tmp_path / "two", [("/a", fix(START_NS)), ("/b", fix(START_NS))])
    with pytest.raises(InputError, match=r"two.*no topic tells.*/a \(sensor_msgs/msg/NavSatFix\)"):
        open_log(bag)


def test_stamps_that_begin_again_begin_a_flight(tmp_path):
    messages = [(FIX, fix(5_000 * 10**9)), (FIX, fix(100 * 10**9))]
    samples, source = samples_of(tmp_path, messages)
    assert [s.flight for s in samples] == [0, 1]
    assert source.link.time_steps == {"reboot": 1}


def test_values_that_are_not_numbers_are_screened(tmp_path):
    bad = [{"latitude": nan}, {"longitude": inf}, {"altitude": nan}, {"latitude": -inf}]
    messages = [(FIX, fix(START_NS + i, **values)) for i, values in enumerate(bad)]
    messages += [(ODOM, odometry(START_NS + 8, velocity=(nan, 0, 0))), (FIX, fix(START_NS + 9))]
    screen = Screen()
    skips = [screen.check(s).value for s in samples_of(tmp_path, messages)[0]]
    assert skips == ["NOT_FINITE"] * 5


# --- storages -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        ("db3", None),
        ("mcap", None),
        ("db3", CompressionMode.MESSAGE),
        ("db3", CompressionMode.FILE),
        ("mcap", CompressionMode.STORAGE),
    ],
)
def test_folder_of_every_storage_gives_the_same_samples(tmp_path, kind, mode):
    expected, _ = samples_of(tmp_path, flight(), "plain")
    compression = (mode, CompressionFormat.ZSTD) if mode else None
    samples, source = samples_of(tmp_path, flight(), "bag", kind=kind, compression=compression)
    assert str(samples) == str(expected)
    assert source.wind == (4.0, -3.0, 0.0)
    assert source.progress == 1.0
    assert str(list(source)) == str(samples)  # read again
    assert source.link.messages == 44


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_file_alone_is_told_by_content(tmp_path, kind):
    folder = write_bag(tmp_path / "bag", flight(), kind)
    file = the_file(folder).rename(tmp_path / "50%3f #1.tlog")  # a name that SQLite would unquote
    assert len(list(open_log(file))) == 20


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_folder_without_usable_metadata_is_read_by_its_files(tmp_path, kind):
    folder = write_bag(tmp_path / "bag", flight(), kind)
    for metadata in (b"", b"\xff\xfe", b"rosbag2_bagfile_information: {version: 9}", b"- !!x [1"):
        (folder / "metadata.yaml").write_bytes(metadata)
        assert len(list(open_log(folder))) == 20
    (folder / "metadata.yaml").unlink()
    assert len(list(open_log(folder))) == 20


def test_files_of_a_split_bag_follow_each_other_by_number(tmp_path):
    whole = list(flight(12))
    folder = tmp_path / "split"
    folder.mkdir()
    for i in range(12):
        part = write_bag(tmp_path / f"part{i}", whole[i * 2 : i * 2 + 2], "mcap")
        the_file(part).rename(folder / f"split_{i}.mcap")
    times = [s.time for s in open_log(folder)]
    assert len(times) > 5
    assert times == sorted(times)


def test_metadata_cannot_lead_out_of_the_folder(tmp_path):
    outside = write_bag(tmp_path / "outside", flight())
    folder = write_bag(tmp_path / "bag", flight(2))
    text = (folder / "metadata.yaml").read_text()
    name = the_file(folder).name
    (folder / "metadata.yaml").write_text(text.replace(name, str(the_file(outside))))
    assert len(list(open_log(folder))) == 2


# --- damage -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_truncated_anywhere_it_gives_what_can_be_read(tmp_path, kind):
    log = the_file(write_bag(tmp_path / "bag", flight(150), kind))
    whole = list(open_log(log))
    data = log.read_bytes()
    cut = tmp_path / f"cut.{kind}"
    counts = []
    for part in range(1, 30):
        cut.write_bytes(data[: len(data) * part // 30])
        try:
            source = open_log(cut)
        except InputError as error:
            assert str(cut) in str(error)  # noqa: PT017, either is right
            counts.append(0)
            continue
        samples = list(source)
        if samples[0].local_position is None:  # what is left of it has a fix
            assert str(samples) == str(whole[: len(samples)])
        assert source.link.bad_bytes > 0 or len(samples) == 150
        counts.append(len(samples))
    assert counts == sorted(counts)
    assert 0 < sum(counts) / len(counts) <= 150
    if kind == "db3":
        assert any(0 < count < 150 for count in counts)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_random_damage_raises_nothing_but_input_errors(tmp_path, kind):
    log = the_file(write_bag(tmp_path / "bag", flight(60), kind))
    data = log.read_bytes()
    broken = tmp_path / "broken"
    read = 0
    for seed in range(50):
        chance = random.Random(seed)
        damaged = bytearray(data)
        length = chance.choice([1, 8, 200, 3000])
        start = chance.randrange(20, len(data) - length)
        damaged[start : start + length] = chance.randbytes(length)
        broken.write_bytes(damaged)
        try:
            samples = list(open_log(broken))
        except InputError:
            continue
        screen = Screen()
        for sample in samples:
            screen.check(sample)
        read += len(samples) > 0
    assert read > 15


def test_damaged_chunk_costs_no_other(tmp_path):
    log = the_file(write_bag(tmp_path / "bag", flight(8000), "mcap", compression=ZSTD_CHUNKS))
    whole = list(open_log(log))
    data = bytearray(log.read_bytes())
    reader = McapReader(log)
    reader.open()
    chunk = reader.chunks[3].chunk_start_offset + 1000
    reader.close()
    data[chunk : chunk + 50] = bytes(50)
    log.write_bytes(data)
    source = open_log(log)
    samples = list(source)
    assert len(samples) < len(whole)
    assert samples[-1].stamp_ns == whole[-1].stamp_ns
    assert len(samples) > 0.8 * len(whole)


@pytest.mark.parametrize(
    "content", [b"SQLite format 3\0", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(3000)]
)
def test_file_that_only_begins_like_a_bag_is_refused_by_name(tmp_path, content):
    path = tmp_path / "no_bag.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"no_bag\.mcap"):
        open_log(path)


def test_wrong_header_is_refused_by_name(tmp_path):
    log = the_file(write_bag(tmp_path / "bag", flight(), "mcap"))
    log.write_bytes(b"\x88" + log.read_bytes()[1:])
    with pytest.raises(InputError, match=log.name):
        open_log(log)


def test_folder_without_a_bag_is_refused_by_name(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match=str(tmp_path)):
        open_log(tmp_path)
