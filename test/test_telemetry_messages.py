"""What each MAVLink message adds to samples: units, frames, "not known", and how long it holds.

The messages are pymavlink's own, the numbers of the atmosphere ICAO's (see test_atmosphere.py).
"""

from math import isnan, nan, pi

import pytest
from mavlink_bytes import START_US, Sender, gps_raw, heartbeat, position, stamped
from pymavlink.dialects.v20 import all as dialect

from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.mavlink import MavlinkDecoder

UNKNOWN_32 = 0x7FFFFFFF


def decode(*messages, send=None, **wanted):
    """Samples of some messages, after a heartbeat."""
    send = send or Sender()
    decoder = MavlinkDecoder(False, **wanted)
    data = b"".join(send(message) for message in (heartbeat(), *messages))
    return list(decoder.feed(data, last=True))


def attitude(boot_ms, yaw):
    return dialect.MAVLink_attitude_message(boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)


def vfr_hud(airspeed=20.0, climb=0.0):
    return dialect.MAVLink_vfr_hud_message(airspeed, 20.0, 0, 50, 500.0, climb)


def pressure(boot_ms, hectopascal, centidegrees):
    return dialect.MAVLink_scaled_pressure_message(boot_ms, hectopascal, 0.0, centidegrees)


def sensors(healthy):
    bit = dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    return dialect.MAVLink_sys_status_message(
        bit, bit, bit if healthy else 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def gps2_raw(fix_type=3, eph=90, **fields):
    values = {
        "time_usec": 0, "lat": 474000000, "lon": 85000000, "alt": 500_000, "epv": 120,
        "vel": 2000, "cog": 0, "satellites_visible": 9, "dgps_numch": 0, "dgps_age": 0,
    } | fields  # fmt: skip
    return dialect.MAVLink_gps2_raw_message(fix_type=fix_type, eph=eph, **values)


def local(boot_ms, x=10.0, y=20.0, z=-30.0, vx=1.0, vy=2.0, vz=3.0):
    return dialect.MAVLink_local_position_ned_message(boot_ms, x, y, z, vx, vy, vz)


def high_latency(boot_ms, **fields):
    values = {
        "type": dialect.MAV_TYPE_FIXED_WING, "autopilot": dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
        "custom_mode": 0, "latitude": 474000000, "longitude": 85000000, "altitude": 500,
        "target_altitude": 0, "heading": 45, "target_heading": 0, "target_distance": 0,
        "throttle": 0, "airspeed": 100, "airspeed_sp": 0, "groundspeed": 100, "windspeed": 35,
        "wind_heading": 105, "eph": 0, "epv": 0, "temperature_air": 15, "climb_rate": 0,
        "battery": 50, "wp_num": 0, "failure_flags": 0, "custom0": 0, "custom1": 0, "custom2": 0,
    } | fields  # fmt: skip
    return dialect.MAVLink_high_latency2_message(timestamp=boot_ms, **values)


# --- position ---------------------------------------------------------------------------------


def test_fields_of_a_position_that_are_not_known_are_not_numbers():
    (sample,) = decode(position(1000, alt=UNKNOWN_32, relative_alt=UNKNOWN_32, hdg=0xFFFF))
    assert isnan(sample.altitude_amsl)
    assert isnan(sample.height_above_home)
    assert isnan(sample.heading)
    lost = dialect.MAVLink_global_position_int_message(
        1000, UNKNOWN_32, UNKNOWN_32, 0, 0, 0, 0, 0, 0
    )
    (sample,) = decode(lost)
    assert isnan(sample.latitude)
    assert isnan(sample.longitude)


def test_receiver_with_the_better_fix_gives_the_evidence():
    samples = decode(
        gps_raw(fix_type=1, eph=0xFFFF), gps2_raw(fix_type=3, eph=70), position(1000),
        gps_raw(fix_type=3, eph=50), position(1200),
        gps2_raw(fix_type=6, eph=80), position(1400),
    )  # fmt: skip
    assert [s.fix_type for s in samples] == [3, 3, 6]
    assert [s.satellites for s in samples] == [9, 12, 9]
    assert [round(s.horizontal_accuracy, 3) for s in samples] == [2.1, 1.5, 2.4]


def test_receiver_that_lost_its_fix_and_fell_silent_has_none_for_good():
    samples = decode(gps_raw(fix_type=1), position(1000), position(60_000))
    assert [s.fix_type for s in samples] == [1, 1]


def test_local_positions_alone_are_taken_after_five_seconds_as_enu():
    samples = decode(*(local(1000 + 500 * i) for i in range(12)))
    assert [s.time for s in samples] == [6.0, 6.5]
    assert samples[0].local_position == (20.0, 10.0, 30.0)  # of NED 10, 20, -30
    assert samples[0].velocity == (2.0, 1.0, -3.0)
    assert isnan(samples[0].latitude)
    assert isnan(samples[0].altitude_amsl)


def test_local_positions_beside_any_receiver_or_estimate_are_not_taken():
    ticks = range(0, 20_000, 500)
    with_estimate = decode(position(900), *(local(1000 + t) for t in ticks))
    assert len(with_estimate) == 1
    assert decode(gps_raw(), *(local(1000 + t) for t in ticks)) == []


def test_geodetic_positions_after_local_ones_begin_a_flight():
    samples = decode(*(local(1000 + 500 * i) for i in range(12)), position(7000), local(7100))
    assert [s.flight for s in samples] == [0, 0, 1]


def test_high_latency_message_is_heartbeat_position_and_wind_in_one():
    send = Sender(3, 1)
    decoder = MavlinkDecoder(True)
    frames = [send(high_latency(5000)), send(high_latency(10_000, eph=25, failure_flags=1))]
    first, second = decoder.feed(stamped(frames), last=True)
    assert decoder.vehicle == Vehicle(3, 1, "fixed wing")
    assert (first.time, first.latitude, first.longitude) == (5.0, 47.4, 8.5)
    assert first.altitude_amsl == 500.0
    assert first.heading == 0.0  # 90 deg by compass is east
    assert first.velocity is None
    assert (first.fix_type, second.fix_type) == (None, 1)
    assert isnan(first.horizontal_accuracy)
    assert second.horizontal_accuracy == 2.5
    # 7 m/s from 210 deg: towards 30 deg
    assert first.wind == pytest.approx((3.5, 7.0 * 3**0.5 / 2, 0.0))


def test_high_latency_wind_of_px4_is_where_it_blows_to():
    px4 = {"autopilot": dialect.MAV_AUTOPILOT_PX4}
    (sample,) = decode(high_latency(5000, **px4))
    assert sample.wind == pytest.approx((-3.5, -7.0 * 3**0.5 / 2, 0.0))
    (sample,) = decode(high_latency(5000, autopilot=dialect.MAV_AUTOPILOT_GENERIC))
    assert sample.wind is None


def test_high_latency_positions_give_way_to_any_other():
    samples = decode(high_latency(1000), position(2000), high_latency(3000), position(4000))
    assert [s.time for s in samples] == [1.0, 2.0, 4.0]


def test_climb_of_receiver_positions_comes_from_the_vfr_hud():
    raw = [gps_raw(time_usec=60_000_000 + 200_000 * i) for i in range(12)]
    samples = decode(*raw[:11], vfr_hud(climb=-2.5), raw[11])
    assert [s.velocity[2] for s in samples] == [0.0, -2.5]
    (_, sample) = decode(*raw[:11], vfr_hud(climb=nan), raw[11])
    assert sample.velocity[2] == 0.0


# --- heading and airspeed ---------------------------------------------------------------------


def test_heading_is_an_enu_angle_of_the_newest_message_that_tells():
    samples = decode(
        position(1000, hdg=0), position(1200, hdg=27_000),
        attitude(1300, pi / 2), position(1400, hdg=0xFFFF), position(1600, hdg=0xFFFF),
    )  # fmt: skip
    assert [s.heading for s in samples[:2]] == [90.0, -180.0]
    assert samples[2].heading == pytest.approx(0.0, abs=1e-4)
    assert isnan(samples[3].heading)  # told once


def test_airspeed_is_told_only_where_a_sensor_measures_it():
    samples = decode(
        vfr_hud(20.0), position(1000),
        sensors(True), vfr_hud(20.0), position(1200, alt=0), position(1400, alt=0),
        sensors(False), vfr_hud(20.0), position(1600),
    )  # fmt: skip
    assert [isnan(s.airspeed) for s in samples] == [True, False, True, True]
    assert samples[1].airspeed == pytest.approx(20.0, abs=1e-3)  # at sea level


def test_indicated_airspeed_becomes_true_airspeed():
    # At 5000 m the standard density is 0.73643 kg/m^3, of 1.2250 at sea level (ICAO).
    (sample,) = decode(sensors(True), vfr_hud(20.0), position(1000, alt=5_000_000))
    assert sample.airspeed == pytest.approx(20.0 * (1.2250 / 0.73643) ** 0.5, rel=1e-3)
    # On a cold day the measured density counts: 900 hPa at -10 degC, by the gas law.
    density = 90_000 / (287.05287 * 263.15)
    (sample,) = decode(
        sensors(True), vfr_hud(20.0), pressure(900, 900.0, -1000), position(1000, alt=500_000)
    )
    assert sample.airspeed == pytest.approx(20.0 * (1.2250 / density) ** 0.5, rel=1e-4)


# --- air --------------------------------------------------------------------------------------


def test_density_is_by_the_gas_law():
    # U.S. Standard Atmosphere, 1976, Table I: at 2000 m 795.01 hPa, 275.154 K, 1.0066 kg/m^3
    (sample,) = decode(pressure(900, 795.01, 200), position(1000))
    assert sample.air_density == pytest.approx(1.0066, rel=1e-4)


@pytest.mark.parametrize("absurd", [8500, -9000, 32_767])
def test_temperature_beyond_any_weather_gives_way_to_the_standard_one(absurd):
    (sample,) = decode(pressure(900, 795.01, absurd), position(1000))
    assert sample.air_density == pytest.approx(1.0066, rel=1e-4)


@pytest.mark.parametrize("none", [nan, 0.0, -5.0, 2000.0])
def test_pressure_that_is_none_gives_no_density(none):
    (sample,) = decode(pressure(900, none, 200), position(1000))
    assert isnan(sample.air_density)


def test_density_holds_for_thirty_seconds():
    samples = decode(
        pressure(1000, 795.01, 200), position(1200), position(30_900), position(31_100)
    )
    assert [isnan(s.air_density) for s in samples] == [False, False, True]


# --- wind -------------------------------------------------------------------------------------


def test_wind_is_told_once_and_zero_wind_is_that_of_no_estimate():
    wind = dialect.MAVLink_wind_message(direction=270.0, speed=7.0, speed_z=0.5)
    calm = dialect.MAVLink_wind_message(direction=-180.0, speed=0.0, speed_z=0.0)
    samples = decode(wind, position(1000), position(1200), calm, position(1400))
    assert samples[0].wind == pytest.approx((7.0, 0.0, -0.5))
    assert isnan(samples[0].wind_accuracy)
    assert [s.wind for s in samples[1:]] == [None, None]


@pytest.mark.parametrize(
    ("accuracy", "variance", "expected"), [(0.8, 9.0, 0.8), (0.0, 0.5, 0.5), (0.0, 0.0, nan)]
)
def test_accuracy_of_wind_cov_is_stated_or_from_the_variances(accuracy, variance, expected):
    wind = dialect.MAVLink_wind_cov_message(
        0, 3.0, -2.0, 0.25, variance, 0.0, 100.0, accuracy, 0.0
    )
    (sample,) = decode(wind, position(1000))
    assert sample.wind == (-2.0, 3.0, -0.25)
    assert sample.wind_accuracy == pytest.approx(expected, nan_ok=True)


# --- time -------------------------------------------------------------------------------------


def test_clock_moves_on_with_every_message_that_has_it():
    # Evidence is 9 s old at the first position, and would count as new without the attitude.
    samples = decode(
        attitude(1000, 0.0), gps_raw(), attitude(9900, 0.0), position(10_000), position(11_100)
    )
    assert [s.fix_type for s in samples] == [3, None]


def test_receiver_in_unix_time_is_no_reboot_among_messages_in_boot_time():
    send = Sender()
    frames = [send(heartbeat())]
    for i in range(20):
        frames += [
            send(attitude(1000 + 200 * i, 0.0)),
            send(gps_raw(time_usec=START_US + 200_000 * i)),
        ]
    samples = list(MavlinkDecoder(True).feed(stamped(frames), last=True))
    assert len({s.flight for s in samples}) == 1
    assert samples[0].stamp_ns == (START_US + 2_000_000) * 1000
