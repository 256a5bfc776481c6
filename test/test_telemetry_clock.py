"""The vehicle's clock: wraps, late messages, reboots, jumps, and its tie to Unix time."""

import pytest

from ctcbs_ros.telemetry.clock import VehicleClock

WRAP = 2**32 * 1000
START = 1_700_000_000_000_000  # a receive stamp, 2023-11-14 [us]
SECOND = 1_000_000


def test_clock_goes_on_over_a_wrap_of_32_bit_milliseconds():
    clock = VehicleClock(WRAP)
    first = clock.advance(WRAP - 300_000)
    assert clock.advance(200_000) - first == 500_000
    assert clock.flight == 0


def test_late_message_gets_its_own_earlier_time():
    clock = VehicleClock(WRAP)
    clock.advance(10 * SECOND)
    assert clock.advance(int(8.5 * SECOND)) == 8.5 * SECOND
    assert clock.advance(int(10.2 * SECOND)) == 10.2 * SECOND
    assert clock.flight == 0


def test_late_message_across_the_wrap_is_no_reboot():
    clock = VehicleClock(WRAP)
    first = clock.advance(WRAP - 100_000)
    clock.advance(100_000)
    assert clock.advance(WRAP - 50_000) - first == 50_000
    assert clock.flight == 0


def test_reboot_begins_a_flight_and_time_goes_on_as_the_receive_stamps_say():
    clock = VehicleClock(WRAP)
    before = clock.advance(600 * SECOND, START)
    after = clock.advance(5 * SECOND, START + 30 * SECOND)
    assert clock.flight == 1
    assert after - before == 30 * SECOND
    assert clock.advance(6 * SECOND, START + 31 * SECOND) - after == SECOND


@pytest.mark.parametrize("receive", [None, START - 500 * SECOND, 2**64 - 1, 0])
def test_time_never_runs_backwards_at_a_reboot_whatever_the_receive_stamp(receive):
    clock = VehicleClock(WRAP)
    before = clock.advance(600 * SECOND, START)
    assert 0 < clock.advance(5 * SECOND, receive) - before < SECOND
    assert clock.flight == 1


def test_step_ahead_that_no_receive_stamp_supports_begins_a_flight():
    clock = VehicleClock(WRAP)
    before = clock.advance(100 * SECOND, START)
    after = clock.advance(4000 * SECOND, START + SECOND)
    assert clock.flight == 1
    assert after - before == SECOND


def test_step_of_more_than_a_day_that_no_receive_stamp_tells_of_takes_no_time_along():
    clock = VehicleClock()
    assert clock.advance(5_000_000) == 5_000_000
    # A gap of an hour may be one; a damaged counter of 64 bits is none.
    assert clock.advance(3_605_000_000) == 3_605_000_000
    assert clock.flight == 0
    times = [clock.advance(boot_us) for boot_us in (2**63, 3_605_200_000, 3_605_400_000)]
    assert times == sorted(times)
    assert times[-1] < 3_606_000_000
    assert clock.flight == 2


def test_first_counter_that_no_clock_has_begins_at_nought():
    clock = VehicleClock()
    assert clock.advance(2**63) == 0
    assert clock.advance(5_000_000) < 1_000_000
    assert clock.stamp_ns(clock.advance(5_200_000)) < 10**9


def test_gap_of_the_link_is_no_new_flight():
    clock = VehicleClock(WRAP)
    before = clock.advance(100 * SECOND, START)
    assert clock.advance(400 * SECOND, START + 299 * SECOND) - before == 300 * SECOND
    assert clock.advance(700 * SECOND) - before == 600 * SECOND
    assert clock.flight == 0


def test_stamps_advance_exactly_as_the_clock_does_whatever_the_link_delays():
    clock = VehicleClock(WRAP)
    stamps, times = [], []
    for i, delay in enumerate([0, 900_000, 20_000, 1_900_000, 5_000]):
        receive = START + i * SECOND + delay
        time = clock.advance(i * SECOND, receive)
        times.append(time)
        stamps.append(clock.stamp_ns(time, receive))
    assert stamps[0] == START * 1000
    assert [s - stamps[0] for s in stamps] == [(t - times[0]) * 1000 for t in times]


def test_unix_time_of_the_vehicle_goes_before_the_receive_stamp():
    clock = VehicleClock(WRAP)
    clock.set_unix(clock.advance(10 * SECOND, START), START - 7 * SECOND)
    time = clock.advance(12 * SECOND, START + 2 * SECOND)
    assert clock.stamp_ns(time, START + 2 * SECOND) == (START - 5 * SECOND) * 1000


@pytest.mark.parametrize("unset", [0, 45 * SECOND, 2**64 - 1])
def test_unset_or_damaged_unix_time_of_the_vehicle_is_not_used(unset):
    clock = VehicleClock(WRAP)
    time = clock.advance(10 * SECOND, START)
    clock.set_unix(time, unset)
    assert clock.stamp_ns(time, START) == START * 1000


def test_unix_time_that_comes_after_the_first_sample_leaves_the_stamps_alone():
    clock = VehicleClock(WRAP)
    time = clock.advance(10 * SECOND, START)
    first = clock.stamp_ns(time, START)
    clock.set_unix(time, START + 3600 * SECOND)
    assert clock.stamp_ns(time + SECOND, START + SECOND) == first + 10**9


def test_new_flight_is_tied_to_unix_time_anew():
    clock = VehicleClock(WRAP)
    clock.stamp_ns(clock.advance(600 * SECOND, START), START)
    later = START + 86_400 * SECOND
    assert clock.stamp_ns(clock.advance(SECOND, later), later) == later * 1000
