"""MAVLink messages to samples: units, frames, evidence, wind, and whose messages they are."""

from math import isnan, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mavlink_bytes import START_US, Sender, gps_raw, heartbeat, position, stamped, system_time
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder

GCS = (dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID)


def decode(frames, decoder=None, **wanted):
    """Samples of some frames, and the decoder after them."""
    decoder = decoder or MavlinkDecoder(True, **wanted)
    return list(decoder.feed(stamped(frames), last=True)), decoder


def messages(*sent, send=None):
    send = send or Sender()
    return [send(message) for message in sent]


# --- units and frames ---------------------------------------------------------------------------


def test_position_message_becomes_si_degrees_and_enu():
    message = dialect.MAVLink_global_position_int_message(
        61_200, -353_632_621, 1_491_652_374, 584_130, 45_670, 1234, -567, -89, 0
    )
    (sample,), _ = decode(messages(heartbeat(), message))
    assert sample.time == 61.2
    assert (sample.latitude, sample.longitude) == (-35.3632621, 149.1652374)
    assert (sample.altitude_amsl, sample.height_above_home) == (584.13, 45.67)
    assert sample.velocity == (-5.67, 12.34, 0.89)  # of NED 12.34, -5.67, -0.89
    assert isnan(sample.altitude_ellipsoid)
    assert (sample.fix_type, sample.satellites) == (None, None)
    assert sample.local_position is None


def test_evidence_is_that_of_the_newest_gps_message():
    raw = gps_raw(fix_type=4, alt_ellipsoid=547_500, h_acc=1800, vel_acc=250)
    samples, _ = decode(
        messages(heartbeat(), raw, position(1000), gps_raw(fix_type=2), position(1200))
    )
    assert (samples[0].fix_type, samples[0].satellites) == (4, 12)
    assert (samples[0].horizontal_accuracy, samples[0].speed_accuracy) == (1.8, 0.25)
    assert samples[0].altitude_ellipsoid == 547.5
    assert samples[1].fix_type == 2
    # eph 90 is a dilution of 0.9, times 3 m; MAVLink 1 has no accuracy of the velocity.
    assert samples[1].horizontal_accuracy == pytest.approx(2.7)
    assert isnan(samples[1].speed_accuracy)
    # The geoid does not move: its height holds on when a message lacks it.
    assert samples[1].altitude_ellipsoid == 547.5


@pytest.mark.parametrize("eph", [0xFFFF, 0])
def test_accuracy_that_the_receiver_does_not_know_is_not_known(eph):
    raw = gps_raw(eph=eph, satellites_visible=255)
    (sample,), _ = decode(messages(heartbeat(), raw, position(1000)))
    assert isnan(sample.horizontal_accuracy)
    assert sample.satellites is None


def test_evidence_of_a_receiver_silent_for_ten_seconds_is_none():
    boots = [1000, 10_900, 11_100]
    sent = messages(heartbeat(), gps_raw(), *(position(boot) for boot in boots))
    received = [START_US + 1000 * ms for ms in (1000, 1000, *boots)]
    samples, _ = decode(list(zip(received, sent, strict=True)))
    assert [sample.fix_type for sample in samples] == [3, 3, None]


def test_evidence_from_before_a_reboot_is_none():
    samples, _ = decode(messages(heartbeat(), gps_raw(), position(500_000), position(4000)))
    assert [(s.flight, s.fix_type) for s in samples] == [(0, 3), (1, None)]


def test_height_of_an_estimate_without_its_origin_is_no_fix():
    sent = messages(heartbeat(), gps_raw(), position(1000, alt=300), position(1200))
    samples, _ = decode(sent)
    assert [sample.fix_type for sample in samples] == [1, 3]


def test_vehicle_without_position_estimate_gives_its_gps_positions():
    raw = [
        gps_raw(time_usec=60_000_000 + 200_000 * i, alt_ellipsoid=547_000, vel=1500, cog=9000)
        for i in range(15)
    ]
    samples, _ = decode(messages(heartbeat(), *raw))
    assert len(samples) == 5  # the first ten wait for a GLOBAL_POSITION_INT
    assert samples[0].time == 62.0
    assert samples[0].velocity == pytest.approx((15.0, 0.0, 0.0))
    assert (samples[0].latitude, samples[0].altitude_amsl) == (47.4, 500.0)
    assert samples[0].altitude_ellipsoid == 547.0
    assert samples[0].fix_type == 3
    assert samples[0].stamp_ns == (START_US + 11 * 200_000) * 1000


def test_gps_positions_end_where_estimates_begin():
    raw = [gps_raw(time_usec=60_000_000 + 200_000 * i) for i in range(12)]
    samples, _ = decode(messages(heartbeat(), *raw, position(63_000), *raw))
    assert len(samples) == 3


def test_gps_time_in_unix_time_is_taken_as_such():
    raw = [gps_raw(time_usec=START_US - 10**8 + 200_000 * i) for i in range(12)]
    samples, _ = decode(messages(heartbeat(), *raw))
    assert samples[0].stamp_ns == (START_US - 10**8 + 2_000_000) * 1000
    assert samples[1].time - samples[0].time == pytest.approx(0.2)


# --- time ---------------------------------------------------------------------------------------


def test_stamps_follow_the_vehicle_not_the_link():
    frames = messages(
        heartbeat(), system_time(START_US - 5_000_000, 1000), position(1200), position(1400)
    )
    delays = [0, 0, 700_000, 701_000]
    samples, _ = decode([(START_US + d, f) for d, f in zip(delays, frames, strict=True)])
    assert samples[0].stamp_ns == (START_US - 4_800_000) * 1000
    assert samples[1].stamp_ns - samples[0].stamp_ns == 200_000_000


def test_clock_wrap_in_real_bytes_keeps_time_and_flight():
    sent = messages(heartbeat(), *(position(2**32 - 500 + 200 * i) for i in range(6)))
    samples, decoder = decode(sent)
    assert [round(s.time - samples[0].time, 3) for s in samples] == [0, 0.2, 0.4, 0.6, 0.8, 1.0]
    assert {s.flight for s in samples} == {0}
    assert decoder.link.time_steps == {"wrap": 1}


def test_reboot_in_real_bytes_begins_a_flight():
    boots = [400_000, 400_200, 3_000, 3_200]
    receive = [0, 200_000, 20_200_000, 20_400_000]
    frames = messages(*(position(boot) for boot in boots))
    samples, decoder = decode(
        [(START_US + r, f) for r, f in zip(receive, frames, strict=True)], system=1, component=1
    )
    assert [s.flight for s in samples] == [0, 0, 1, 1]
    assert [round(s.time, 3) for s in samples] == [400.0, 400.2, 420.2, 420.4]
    assert decoder.link.time_steps == {"reboot": 1}


def test_reboot_first_seen_in_another_message_does_not_mix_the_unix_times():
    frames = messages(
        heartbeat(), system_time(START_US, 400_000), position(400_000),
        system_time(START_US + 60_000_000, 3_000), position(3_200),
    )  # fmt: skip
    samples, _ = decode(frames)
    assert [s.stamp_ns // 1000 - START_US for s in samples] == [0, 60_200_000]


# --- wind ---------------------------------------------------------------------------------------


def test_wind_blows_from_where_the_wind_message_says():
    wind = dialect.MAVLink_wind_message(direction=270.0, speed=7.0, speed_z=0.5)
    _, decoder = decode(messages(heartbeat(), wind))
    assert decoder.wind == pytest.approx((7.0, 0.0, -0.5))  # from the west, towards the east
    south = dialect.MAVLink_wind_message(direction=-180.0, speed=4.0, speed_z=0.0)
    _, decoder = decode(messages(heartbeat(), south))
    assert decoder.wind == pytest.approx((0.0, 4.0, 0.0), abs=1e-6)


def wind_cov(north, east, down):
    return dialect.MAVLink_wind_cov_message(0, north, east, down, 1.0, 1.0, 100.0, 0.5, 0.5)


def test_wind_cov_is_a_ned_velocity():
    _, decoder = decode(messages(heartbeat(), wind_cov(3.0, -2.0, 0.25)))
    assert decoder.wind == (-2.0, 3.0, -0.25)


def test_wind_that_is_not_known_leaves_the_last_one():
    _, decoder = decode(messages(heartbeat(), wind_cov(3.0, -2.0, nan), wind_cov(nan, 1.0, 0.0)))
    assert decoder.wind == (-2.0, 3.0, 0.0)


# --- whose messages -----------------------------------------------------------------------------


def test_first_aircraft_is_followed_and_others_are_counted():
    station, radio = Sender(255, 190), Sender(51, 68)
    tracker, plane, copter = Sender(2, 1), Sender(7, 1), Sender(8, 1)
    frames = [
        station(heartbeat(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA)),
        radio(heartbeat(*GCS)),
        tracker(heartbeat(dialect.MAV_TYPE_ANTENNA_TRACKER)),
        plane(heartbeat(dialect.MAV_TYPE_FIXED_WING, dialect.MAV_AUTOPILOT_INVALID)),
        plane(heartbeat(dialect.MAV_TYPE_VTOL_TILTROTOR)),
        copter(heartbeat(dialect.MAV_TYPE_QUADROTOR)),
        plane(position(1000)),
        copter(position(99_000, lat=10.0)),
        tracker(position(77_000, lat=20.0)),
    ]
    samples, decoder = decode(frames)
    assert decoder.vehicle == Vehicle(7, 1, "vtol tiltrotor")
    assert [s.latitude for s in samples] == [47.4]
    assert decoder.link.other_positions == 2


@pytest.mark.parametrize("wanted", [{"system": 8}, {"system": 8, "component": 1}])
def test_vehicle_asked_for_is_followed(wanted):
    plane, copter = Sender(7, 1), Sender(8, 1)
    frames = [
        plane(heartbeat()),
        copter(heartbeat(dialect.MAV_TYPE_QUADROTOR)),
        plane(position(1000)),
        copter(position(99_000, lat=10.0)),
    ]
    samples, decoder = decode(frames, **wanted)
    assert decoder.vehicle == Vehicle(8, 1, "quadrotor")
    assert [s.latitude for s in samples] == [10.0]


def test_positions_without_heartbeat_choose_their_sender_in_the_end():
    send = Sender(5, 1)
    samples, decoder = decode([send(position(1000 + 200 * i)) for i in range(25)])
    assert decoder.vehicle == Vehicle(5, 1, "unknown type")
    assert len(samples) == 6  # the twentieth chooses


def test_ground_station_that_sends_positions_is_not_followed():
    station = Sender(255, 190)
    frames = [station(heartbeat(*GCS))] + [station(position(200 * i)) for i in range(40)]
    samples, decoder = decode(frames)
    assert (samples, decoder.vehicle) == ([], None)


def test_sender_of_many_positions_is_followed_before_one_of_few():
    few, many = Sender(3, 1), Sender(4, 1)
    frames = [few(position(1000))] + [many(position(1000 + 200 * i)) for i in range(25)]
    _, decoder = decode(frames)
    assert decoder.vehicle == Vehicle(4, 1, "unknown type")


def test_interleaved_vehicles_are_told_apart():
    one, other = Sender(1, 1), Sender(2, 1)
    frames = [one(heartbeat()), other(heartbeat())]
    for i in range(50):
        frames += [one(position(1000 + 200 * i)), other(position(900_000 + 200 * i, lat=10.0))]
    samples, decoder = decode(frames)
    assert {s.latitude for s in samples} == {47.4}
    assert len(samples) == decoder.link.other_positions == 50
    assert {s.flight for s in samples} == {0}


# --- whatever comes -----------------------------------------------------------------------------

KINDS = [
    dialect.MAVLink_heartbeat_message,
    dialect.MAVLink_global_position_int_message,
    dialect.MAVLink_gps_raw_int_message,
    dialect.MAVLink_system_time_message,
    dialect.MAVLink_wind_message,
    dialect.MAVLink_wind_cov_message,
]


@settings(max_examples=300)
@given(st.data())
def test_no_contents_of_messages_make_it_raise(data):
    decoder = MavlinkDecoder(True)
    frames = [Sender()(heartbeat())]
    for _ in range(data.draw(st.integers(1, 15))):
        kind = data.draw(st.sampled_from(KINDS))
        size = kind.unpacker.size
        payload = data.draw(st.binary(min_size=size, max_size=size))
        fields = kind.unpacker.unpack(payload)
        message = kind(*(fields[i] for i in kind.orders))
        frames.append((data.draw(st.integers(0, 2**64 - 1)), Sender()(message)))
    for sample in decoder.feed(stamped(frames), last=True):
        assert isinstance(sample.stamp_ns, int)
        assert abs(sample.stamp_ns) < 2**31 * 10**9 + 50 * 86_400 * 10**9
