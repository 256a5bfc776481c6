"""A beacon's reports read apart from the aircraft's, from every source that can carry both."""

from dataclasses import replace
from math import isnan, nan
from threading import Event

import bags
import numpy as np
import pytest
from beacon_flight import DRONE
from links import collect, free_port
from mavlink_bytes import START_US, Sender, gps_raw, heartbeat, position, stamped, system_time
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.cli.main import main
from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted, CommonTime, beacon_wanted
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.source import open_log

SYSTEM = 42
AIRCRAFT_BOOT, BEACON_BOOT = 60_000, 9_000_000  # ms
UNIX = START_US - 40_000


def two_systems(count=30, beacon_type=dialect.MAV_TYPE_GENERIC, unix=True, beacon_first=True):
    """A log of both, five positions a second, as (receive time, frame)."""
    aircraft, beacon = Sender(1), Sender(SYSTEM)
    autopilot = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA

    def of(sender, boot, mav_type, at):
        messages = [heartbeat(mav_type, autopilot)] if at % 1000 == 0 else []
        if unix and at % 1000 == 0:
            messages.append(system_time(UNIX + at * 1000, boot + at))
        messages += [gps_raw(), position(boot + at, lat=47.4 + 2e-7 * at * (sender is aircraft))]
        return [(START_US + at * 1000, sender(message)) for message in messages]

    frames = []
    for i in range(count):
        both = [
            of(beacon, BEACON_BOOT, beacon_type, 200 * i),
            of(aircraft, AIRCRAFT_BOOT, dialect.MAV_TYPE_FIXED_WING, 200 * i),
        ]
        for one in both if beacon_first else both[::-1]:
            frames += one
    return frames


def opened(tmp_path, frames, **wanted):
    path = tmp_path / "both.tlog"
    path.write_bytes(frames if isinstance(frames, bytes) else stamped(frames))
    return open_log(path, beacon=BeaconWanted(SYSTEM, **wanted))


def parted(source):
    samples = list(source)
    reports = [sample for sample in samples if isinstance(sample, BeaconSample)]
    return [sample for sample in samples if isinstance(sample, Sample)], reports


# --- whose it is --------------------------------------------------------------------------------


@pytest.mark.parametrize("stamps", [True, False], ids=["tlog", "raw"])
def test_a_beacon_that_claims_to_be_an_aircraft_is_never_followed(tmp_path, stamps):
    frames = two_systems(beacon_type=dialect.MAV_TYPE_FIXED_WING)
    source = opened(tmp_path, frames if stamps else b"".join(frame for _, frame in frames))
    aircraft, reports = parted(source)
    assert (source.vehicle.system, source.beacon.system) == (1, SYSTEM)
    assert (len(aircraft), len(reports)) == (30, 30)
    assert len({sample.latitude for sample in aircraft}) == 30
    assert {report.sample.latitude for report in reports} == {47.4}
    assert source.link.other_positions == 0
    # without naming the beacon the first of them would be followed: here the beacon
    assert open_log(tmp_path / "both.tlog").vehicle.system == SYSTEM


def test_the_aircraft_is_read_as_if_there_were_no_beacon(tmp_path):
    frames = two_systems()
    aircraft, _ = parted(opened(tmp_path, frames))
    alone = tmp_path / "alone.tlog"
    alone.write_bytes(stamped([one for one in frames if one[1][5] == 1]))
    assert repr(list(open_log(alone))) == repr(aircraft)  # nan is not equal to nan


def test_what_happens_to_the_beacons_clock_is_counted_for_the_beacon_alone(tmp_path):
    frames = two_systems()
    beacon = Sender(SYSTEM)
    frames += [
        (START_US + 6_000_000 + 200_000 * i, beacon(position(1000 + 200 * i))) for i in range(5)
    ]
    source = opened(tmp_path, frames)
    aircraft, reports = parted(source)
    assert source.beacon_link.time_steps["reboot"] == 1
    assert source.link.time_steps.total() == 0
    assert {sample.flight for sample in aircraft} == {0}
    assert {report.sample.flight for report in reports} == {0, 1}


def test_the_component_asked_for_is_followed_and_by_default_the_first_with_positions(tmp_path):
    camera, beacon, aircraft = Sender(SYSTEM, 100), Sender(SYSTEM, 7), Sender(1)
    frames = [aircraft(heartbeat()), camera(heartbeat(dialect.MAV_TYPE_CAMERA))]
    for i in range(6):
        frames += [aircraft(position(1000 + 200 * i)), beacon(position(5000 + 200 * i))]
    source = opened(tmp_path, frames)
    parted(source)
    assert source.beacon.component == 7
    _, reports = parted(opened(tmp_path, frames, component=100))
    assert reports == []


def test_a_log_of_the_beacon_alone_is_refused_as_it_may_be_the_aircraft(tmp_path):
    sender = Sender(SYSTEM)
    frames = [sender(heartbeat()), *(sender(position(200 * i)) for i in range(30))]
    with pytest.raises(InputError, match=r"system 42 .*beacon\.system_id.* not be the aircraft"):
        opened(tmp_path, frames)


# --- the time that both have --------------------------------------------------------------------


def test_unix_time_ties_clocks_hours_apart_to_the_millisecond(tmp_path):
    _, reports = parted(opened(tmp_path, two_systems(beacon_first=False)))
    for i, report in enumerate(reports[5:], 5):
        assert report.time_by == "Unix time"
        assert report.time == pytest.approx((AIRCRAFT_BOOT + 200 * i) / 1000, abs=1e-6)
    assert all(isnan(report.time) for report in reports[:5] if not report.time_by)


def test_receive_times_tie_them_where_one_tells_no_unix_time(tmp_path):
    _, reports = parted(opened(tmp_path, two_systems(unix=False)))
    assert all(isnan(report.time) for report in reports[:4])
    for i, report in enumerate(reports[6:], 6):
        assert report.time_by == "receive times"
        assert report.time == pytest.approx((AIRCRAFT_BOOT + 200 * i) / 1000, abs=1e-6)
        assert report.time_sigma == 0.0  # no delay varies


def sample(time, flight=0):
    return Sample(time, int(time * 1e9), flight)


def test_the_least_delays_tie_the_clocks_and_their_number_says_how_well():
    random = np.random.default_rng(3)
    common, found = CommonTime(), []
    for i in range(200):
        t = 0.2 * i
        common.hear_aircraft(sample(10.0 + t), t + random.exponential(0.3), None)
        found.append(common.tie(sample(7000.0 + t), t + random.exponential(0.3), None))
    off = np.array([report.time - 10.0 - 0.2 * i for i, report in enumerate(found)])
    sigma = np.array([report.time_sigma for report in found])
    assert np.isnan(off[:4]).all()
    assert abs(off[-1]) < 0.01
    # one standard deviation as stated, within the scatter of so few independent ones
    assert 0.3 < np.sqrt(np.mean((off[5:] / sigma[5:]) ** 2)) < 3.0
    assert sigma[-1] < 0.01 < sigma[5]


def test_unix_times_that_contradict_the_link_are_doubted_or_disregarded():
    def tied(off):
        common = CommonTime()
        for i in range(10):
            common.hear_aircraft(sample(float(i)), float(i), 1e9)
            report = common.tie(sample(100.0 + i), float(i), 1e9 - 100.0 + off)
        return report

    assert tied(0.5).time_by == "Unix time"
    assert tied(0.5).time == pytest.approx(9.5)
    doubted, unset = tied(-4.0), tied(18.0)  # without leap seconds
    assert (doubted.time_by, unset.time_by) == ("receive times", "receive times")
    assert doubted.time == unset.time == pytest.approx(9.0)
    assert (doubted.time_sigma, unset.time_sigma) == (pytest.approx(4.0), 0.0)


def test_a_reboot_of_either_unties_what_was_tied_by_receive_times():
    common = CommonTime()
    for i in range(10):
        common.hear_aircraft(sample(float(i)), float(i), None)
        report = common.tie(sample(100.0 + i), float(i), None)
    assert not isnan(report.time)
    assert isnan(common.tie(sample(500.0, flight=1), 10.0, None).time)
    common.hear_aircraft(sample(3000.0, flight=1), 11.0, None)
    assert isnan(common.tie(sample(111.0), 11.0, None).time)


# --- heights ------------------------------------------------------------------------------------


def at(height, kind="altitude_amsl", **others):
    return Sample(0.0, 0, latitude=47.4, longitude=8.5, **{kind: height}, **others)


def test_heights_of_two_kinds_are_only_compared_where_the_geoid_is_known():
    frame = LocalFrame()
    assert frame.place(at(500.0)) is None  # no frame yet
    frame.localize(at(500.0))
    assert frame.place(at(450.0))[2] == pytest.approx(-50.0)
    assert frame.place(at(497.0, "altitude_ellipsoid")) is None
    assert frame.place(at(50.0, "height_above_home")) is None
    frame.localize(at(500.0, altitude_ellipsoid=547.0))
    assert frame.place(at(497.0, "altitude_ellipsoid"))[2] == pytest.approx(-50.0)
    # a frame of ellipsoidal heights alone
    frame = LocalFrame()
    frame.localize(at(547.0, "altitude_ellipsoid"))
    assert frame.place(at(450.0)) is None
    assert frame.place(at(497.0, "altitude_ellipsoid"))[2] == pytest.approx(-50.0)
    assert frame.place(Sample(0.0, 0, local_position=(0.0, 0.0, 0.0))) is None


def test_placing_the_beacon_tells_the_frame_nothing():
    frame = LocalFrame()
    frame.localize(at(500.0))
    before = frame.datum, frame.up_of_amsl(0.0)
    frame.place(at(450.0, altitude_ellipsoid=400.0))
    assert (frame.datum, frame.up_of_amsl(0.0)) == before


# --- a slower screen ----------------------------------------------------------------------------


def test_a_payload_that_moves_slowly_and_stands_still_is_frozen_too():
    def judged(screen, velocity, seconds=12):
        fixed = replace(at(450.0), fix_type=3, velocity=velocity)
        return [screen.check(replace(fixed, time=float(i))) for i in range(seconds)]

    slow = (0.5, 0.0, 0.0)
    assert judged(Screen(), slow) == [None] * 12  # an aircraft at that speed is parked
    found = judged(Screen(moving=0.3, longest_still=5.0), slow)
    assert found == [None] * 3 + [SkipCode.FROZEN] * 9
    found = judged(Screen(moving=0.3, longest_still=5.0), None)
    assert found == [None] * 6 + [SkipCode.FROZEN] * 6


# --- other sources ------------------------------------------------------------------------------


def bag_of_both(tmp_path, beacon="/payload/fix", stamps_off=0):
    start = 1_700_000_000_000_000_000
    messages = []
    for i in range(20):
        stamp = start + 200_000_000 * i
        messages.append((beacon, bags.fix(stamp + 70_000_000 + stamps_off, altitude=497.0)))
        messages.append((bags.FIX, bags.fix(stamp + 100_000_000, 47.4 + 1e-5 * i)))
    return bags.write_bag(tmp_path / "bag", messages)


def test_a_bags_topic_is_the_beacon_by_its_header_stamps(tmp_path):
    bag = bag_of_both(tmp_path)
    source = open_log(bag, beacon=BeaconWanted(topic="payload/fix"))
    aircraft, reports = parted(source)
    assert len(aircraft) == len(reports) == 20
    assert {report.time_by for report in reports[1:]} == {"header stamps"}
    for sample_before, report in zip(aircraft, reports[1:], strict=False):
        assert report.time - sample_before.time == pytest.approx(0.17, abs=1e-6)
        assert report.sample.altitude_ellipsoid == 497.0
    assert len(parted(open_log(bag))[1]) == 0


def test_a_bag_without_that_topic_or_with_a_system_is_refused(tmp_path):
    bag = bag_of_both(tmp_path)
    with pytest.raises(InputError, match=r"no NavSatFix /other in it; it has: .*fix"):
        open_log(bag, beacon=BeaconWanted(topic="/other"))
    with pytest.raises(InputError, match=r"beacon\.system_id: a bag .*use beacon\.topic"):
        open_log(bag, beacon=BeaconWanted(SYSTEM))
    # the aircraft's own is none: then nothing is left that tells where the aircraft is
    with pytest.raises(InputError, match="no topic tells the aircraft's position"):
        open_log(bag_of_both(tmp_path / "two", bags.FIX), beacon=BeaconWanted(topic=bags.FIX))


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"\xa3\x95\x80\x80", "an ArduPilot DataFlash log"),
        (b"ULog\x01\x12\x35\x01", "a PX4 log"),
    ],
)
@pytest.mark.parametrize("wanted", [BeaconWanted(SYSTEM), BeaconWanted(topic="/fix")])
def test_a_log_of_one_vehicle_refuses_a_beacon_and_says_which_can(tmp_path, head, kind, wanted):
    log = tmp_path / "log"
    log.write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=rf"{kind} cannot have it; allowed: a \.tlog.*rosbag2"):
        open_log(log, beacon=wanted)


def test_a_mavlink_log_has_no_topic(tmp_path):
    path = tmp_path / "both.tlog"
    path.write_bytes(stamped(two_systems()))
    with pytest.raises(InputError, match=r"a MAVLink log cannot have it; use beacon\.system_id"):
        open_log(path, beacon=BeaconWanted(topic="/fix"))


def test_a_live_link_brings_both_and_asks_nothing_of_the_beacon(link):
    from socket import AF_INET, SOCK_DGRAM, socket

    port = free_port()
    source = link(f"udpin:127.0.0.1:{port}", beacon=BeaconWanted(SYSTEM), heartbeat=True)
    with socket(AF_INET, SOCK_DGRAM) as sender:
        for _, frame in two_systems(count=10, beacon_type=dialect.MAV_TYPE_FIXED_WING):
            sender.sendto(frame, ("127.0.0.1", port))
        samples = collect(source, 20)
    assert sum(isinstance(sample, BeaconSample) for sample in samples) == 10
    assert (source.vehicle.system, source.beacon.system) == (1, SYSTEM)
    assert source.link.other_positions == 0


def test_a_beacon_that_floods_the_link_drops_its_own_reports_and_none_of_the_aircraft():
    class Bytes:
        """A transport that brings everything at once."""

        trouble, connections = None, 1

        def __init__(self, data):
            self._data = [data]

        def read(self):
            if not self._data:
                read.set()
                return b""
            return self._data.pop()

        def close(self):
            pass

    read, beacon, aircraft = Event(), Sender(SYSTEM), Sender(1)
    frames = [aircraft(heartbeat())]
    for i in range(10):
        frames.append(aircraft(position(1000 + 200 * i)))
        frames += [beacon(position(9000 + 200 * i + j)) for j in range(100)]
    decoder = MavlinkDecoder(False, beacon=BeaconWanted(SYSTEM))
    source = LiveSource(Bytes(b"".join(frames)), decoder, capacity=100)
    assert read.wait(60.0)
    source.close()
    samples = source.poll()
    reports = [one.sample.time for one in samples if isinstance(one, BeaconSample)]
    assert (len(reports), source.reports_dropped, source.dropped) == (20, 980, 0)
    assert reports == sorted(reports)
    assert [one.time for one in samples if isinstance(one, Sample)] == [
        (1000 + 200 * i) / 1000 for i in range(10)
    ]
    assert isinstance(samples[0], Sample)
    assert isinstance(samples[-1], BeaconSample)


# --- parameters ---------------------------------------------------------------------------------


def test_no_beacon_is_wanted_unless_it_is_named():
    assert beacon_wanted(0, 5, "") is None
    assert beacon_wanted(SYSTEM, 0, "") == BeaconWanted(SYSTEM)
    assert not load_configuration(DRONE).beacon.present
    assert load_configuration(DRONE, ["beacon.system_id=42"]).beacon.present


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (["beacon.system_id=7", "mavlink.system=7"], "must be another system"),
        (["beacon.system_id=7", "beacon.topic=/fix"], "only one of them"),
        (["beacon.topic='a topic'"], "must be the name of a topic"),
        (["beacon.system_id=256"], "a whole number from 0 to 255"),
        (["beacon.time_sigma=-1.0"], "a number from 0 to 10 s"),
        ([f"beacon.position_sigma={nan}"], "beacon.position_sigma"),
    ],
)
def test_a_beacon_that_cannot_be_is_refused_in_one_line(tmp_path, capsys, settings, told):
    with pytest.raises(InputError, match=told):
        load_configuration(DRONE, settings)
    file = tmp_path / "drone.yaml"
    text = DRONE.read_text()
    for setting in settings:
        key, _, value = setting.partition("=")
        group, name = key.split(".")
        at_group = text.index(f"    {group}:\n")
        at_key = text.index(f"      {name}:", at_group)
        text = text[:at_key] + f"      {name}: {value}" + text[text.index("\n", at_key) :]
    file.write_text(text)
    code = main(["steady", "--config", str(file), "--radius", "60", "--speed", "20"])
    error = capsys.readouterr().err
    assert code == 2
    assert error.count("\n") == 1
    assert told in error
