"""Which samples are believed."""

from dataclasses import replace
from math import cos, inf, nan, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.screen import Screen
from ctcbs_ros.telemetry.skip_code import SkipCode

HOME = Datum(47.4, 8.5, 500.0, False)


def sample_at(time, east, north, up=100.0, velocity=None, **fields):
    latitude, longitude, altitude = to_geodetic(HOME, east, north, up)
    values = {
        "stamp_ns": round(time * 1e9), "altitude_amsl": altitude, "fix_type": 3,
        "horizontal_accuracy": 1.5,
    } | fields  # fmt: skip
    return Sample(
        time=time,
        latitude=float(latitude),
        longitude=float(longitude),
        velocity=velocity,
        **values,
    )


def circling(count, rate=5.0, radius=100.0, speed=25.0, **fields):
    """Samples of a circle flown anticlockwise."""
    angular_rate = speed / radius
    return [
        sample_at(
            i / rate,
            radius * cos(angular_rate * i / rate),
            radius * sin(angular_rate * i / rate),
            velocity=(
                -speed * sin(angular_rate * i / rate),
                speed * cos(angular_rate * i / rate),
                0.0,
            ),
            **fields,
        )
        for i in range(count)
    ]


def changed(number, **change):
    """Ten samples of a circle, one of them changed."""
    samples = circling(10)
    samples[number] = replace(samples[number], **change)
    return samples


def only(number, code):
    """The codes of ten samples of which one is skipped."""
    return [code if i == number else None for i in range(10)]


def codes(samples):
    screen = Screen()
    return [screen.check(sample) for sample in samples]


@pytest.mark.parametrize("rate", [1.0, 5.0, 50.0])
@pytest.mark.parametrize("speed", [15.0, 40.0])
def test_clean_circle_is_believed_whole(rate, speed):
    assert set(codes(circling(200, rate, speed=speed))) == {None}


@pytest.mark.parametrize("gap", [1, 6, 30, 300])
def test_gap_in_a_circle_costs_nothing(gap):
    samples = circling(40, 5.0)
    resumed = [s for s in circling(40 + 5 * gap, 5.0) if s.time >= 8.0 + gap]
    assert set(codes(samples + resumed)) == {None}


@pytest.mark.parametrize(
    "change",
    [
        {"time": nan},
        {"time": inf},
        {"latitude": nan},
        {"longitude": inf},
        {"altitude_amsl": nan},
        {"altitude_amsl": -inf},
        {"velocity": (nan, 0.0, 0.0)},
        {"velocity": (0.0, inf, 0.0)},
        {"latitude": nan, "local_position": (0.0, nan, 0.0)},
    ],
)
def test_what_is_no_number_is_not_finite(change):
    assert codes(changed(5, **change)) == only(5, SkipCode.NOT_FINITE)


@pytest.mark.parametrize(
    "change",
    [
        {"latitude": 91.0},
        {"longitude": -180.5},
        {"latitude": 474000000.0, "longitude": 85000000.0},  # 1e7 scaling left in
        {"altitude_amsl": 584130.0},  # millimetres
        {"height_above_home": 1e9},
        {"velocity": (300.0, 300.0, 0.0)},
        {"latitude": nan, "local_position": (0.0, 0.0, 1e9)},
    ],
)
def test_numbers_no_aircraft_has_are_out_of_range(change):
    assert codes(changed(5, **change)) == only(5, SkipCode.OUT_OF_RANGE)


@pytest.mark.parametrize(("latitude", "longitude"), [(0.0, 0.0), (3e-7, -2e-7), (-0.05, 0.05)])
def test_position_at_latitude_and_longitude_zero_is_a_zero_position(latitude, longitude):
    samples = changed(5, latitude=latitude, longitude=longitude)
    assert codes(samples) == only(5, SkipCode.ZERO_POSITION)


@pytest.mark.parametrize(
    "image",
    [
        lambda north, east: (-north, east),
        lambda north, east: (north, -east),
        lambda north, east: (-north, -east),
        lambda north, east: (east, north),
    ],
    ids=["latitude", "longitude", "both", "exchanged"],
)
def test_swapped_signs_and_coordinates_are_mirrored_however_long_they_last(image):
    samples = circling(100)
    for i in range(25, 70):
        latitude, longitude = image(samples[i].latitude, samples[i].longitude)
        samples[i] = replace(samples[i], latitude=latitude, longitude=longitude)
    expected = [SkipCode.MIRRORED if 25 <= i < 70 else None for i in range(100)]
    assert codes(samples) == expected


def test_true_positions_after_a_few_mirrored_ones_are_believed():
    samples = circling(40)
    for i in range(3):
        samples[i] = replace(samples[i], latitude=-samples[i].latitude)
    found = codes(samples)
    assert set(found[3:7]) <= {SkipCode.MIRRORED, SkipCode.JUMP}
    assert found[:3] + found[7:] == [None] * 36


@pytest.mark.parametrize(
    "change",
    [
        {"fix_type": 2},
        {"fix_type": 0},
        {"horizontal_accuracy": 26.0},
        {"horizontal_accuracy": inf},
        {"satellites": 3},
    ],
)
def test_position_without_a_good_fix_is_a_bad_fix(change):
    assert codes(changed(5, **change)) == only(5, SkipCode.BAD_FIX)


def test_one_of_the_three_heights_is_enough():
    heights = {"altitude_amsl": nan, "height_above_home": 40.0}
    assert set(codes(circling(10, **heights))) == {None}


def test_older_samples_are_out_of_order_and_equal_ones_duplicates():
    s = circling(10)
    late, same = SkipCode.OUT_OF_ORDER, SkipCode.DUPLICATE
    arriving = [s[0], s[1], s[3], s[2], s[3], s[4], s[4], s[5]]
    assert codes(arriving) == [None, None, None, late, same, None, same, None]


@pytest.mark.parametrize("rate", [1.0, 5.0])
@pytest.mark.parametrize("glitch", [0.001, 0.1, 90.0])  # deg of latitude, 111 m and more
def test_glitch_is_a_jump_and_the_circle_goes_on_after_it(rate, glitch):
    samples = circling(20, rate)
    for i in (7, 8, 9):
        samples[i] = replace(samples[i], latitude=samples[i].latitude - glitch)
    expected = [SkipCode.JUMP if i in (7, 8, 9) else None for i in range(20)]
    assert codes(samples) == expected


def test_height_step_is_a_jump_until_it_persists():
    samples = circling(20)
    stepped = [replace(s, altitude_amsl=s.altitude_amsl + 300.0) for s in samples[10:]]
    assert codes(samples[:10] + stepped) == [None] * 10 + [SkipCode.JUMP] * 4 + [None] * 6


def test_relocation_is_believed_at_the_fifth_sample_that_agrees():
    samples = circling(10)
    away = [replace(s, latitude=s.latitude + 0.05) for s in circling(30)[10:]]
    assert codes(samples + away) == [None] * 10 + [SkipCode.JUMP] * 4 + [None] * 16


def test_scattered_positions_never_become_the_place():
    samples = circling(40)
    for i in range(10, 40):
        samples[i] = replace(samples[i], latitude=samples[i].latitude + 0.01 * (i - 9))
    assert codes(samples) == [None] * 10 + [SkipCode.JUMP] * 30


def test_false_first_position_gives_way_to_the_true_ones():
    false = sample_at(0.0, 30_000.0, 0.0)
    rest = [replace(s, time=s.time + 0.2) for s in circling(20)]
    assert codes([false, *rest]) == [None] + [SkipCode.JUMP] * 4 + [None] * 16


def test_first_positions_without_evidence_of_a_fix_must_agree_before_they_are_believed():
    samples = circling(10, fix_type=None, horizontal_accuracy=nan)
    assert codes(samples) == [SkipCode.BAD_FIX] * 2 + [None] * 8
    stray = replace(samples[1], latitude=10.0)
    assert codes([samples[0], stray, *samples[2:]]) == [SkipCode.BAD_FIX] * 4 + [None] * 6


def test_frozen_position_is_skipped_once_the_velocity_has_led_away_from_it():
    samples = circling(20)
    frozen = [replace(samples[9], time=s.time, velocity=s.velocity) for s in samples[10:15]]
    # At 25 m/s it is 5 m off 0.2 s later.
    assert codes(samples[:10] + frozen + samples[15:]) == (
        [None] * 10 + [SkipCode.FROZEN] * 5 + [None] * 5
    )


def test_parked_and_hovering_aircraft_are_not_frozen():
    parked = [sample_at(i / 5, 0.0, 0.0, velocity=(0.1, 0.0, 0.0)) for i in range(100)]
    assert set(codes(parked)) == {None}


def test_new_flight_is_judged_afresh():
    samples = circling(10)
    later = [replace(s, flight=1, latitude=s.latitude + 1.0) for s in samples]
    assert set(codes(samples + later)) == {None}


def test_local_positions_are_screened_like_geodetic_ones():
    samples = [
        Sample(
            time=s.time,
            stamp_ns=s.stamp_ns,
            local_position=(100 * cos(s.time / 4), 100 * sin(s.time / 4), 50.0),
            velocity=s.velocity,
        )
        for s in circling(30)
    ]
    samples[10] = replace(samples[10], local_position=(400.0, 0.0, 50.0))
    samples[20] = replace(samples[20], time=samples[19].time)
    expected = [None] * 30
    expected[10], expected[20] = SkipCode.JUMP, SkipCode.DUPLICATE
    assert codes(samples) == expected


def test_positions_without_velocity_jump_only_beyond_any_speed():
    samples = [replace(s, velocity=None) for s in circling(20)]
    samples[10] = replace(samples[10], latitude=samples[10].latitude + 0.01)  # 1.1 km
    assert codes(samples) == [SkipCode.JUMP if i == 10 else None for i in range(20)]


numbers = st.floats() | st.sampled_from([0.0, 1e-7, 47.4, 8.5, 180.0, 1e308, -1e308])
vectors = st.none() | st.tuples(numbers, numbers, numbers)
any_sample = st.builds(
    Sample, time=numbers, stamp_ns=st.integers(), flight=st.integers(0, 1), latitude=numbers,
    longitude=numbers, altitude_amsl=numbers, altitude_ellipsoid=numbers,
    height_above_home=numbers, local_position=vectors, velocity=vectors,
    fix_type=st.none() | st.integers(), satellites=st.none() | st.integers(),
    horizontal_accuracy=numbers, speed_accuracy=numbers,
)  # fmt: skip


@settings(max_examples=500, deadline=None)
@given(st.lists(any_sample, max_size=12))
def test_no_sample_makes_it_raise(samples):
    for code in codes(samples):
        assert code is None or isinstance(code, SkipCode)


@settings(max_examples=200, deadline=None)
@given(st.lists(any_sample, max_size=8))
def test_no_sample_locks_the_truth_out(samples):
    screen = Screen()
    for sample in samples:
        screen.check(sample)
    after = [screen.check(replace(s, flight=2)) for s in circling(10)]
    assert set(after) == {None}


@pytest.mark.parametrize("ahead", [11.0, 1e3, 1e7])
def test_one_time_stamp_far_ahead_is_skipped_and_nothing_after_it(ahead):
    samples = circling(20)
    samples[10] = replace(samples[10], time=samples[10].time + ahead)
    assert codes(samples) == [SkipCode.AHEAD if i == 10 else None for i in range(20)]


def test_time_stamps_far_ahead_now_and_then_are_all_skipped():
    samples = circling(40)
    for i in range(5, 40, 5):
        samples[i] = replace(samples[i], time=samples[i].time + 500.0 + i)
    assert codes(samples) == [SkipCode.AHEAD if i % 5 == 0 and i else None for i in range(40)]


def test_after_a_long_gap_the_second_sample_is_used():
    samples = circling(30)
    samples = samples[:10] + [replace(s, time=s.time + 30.0) for s in samples[10:]]
    assert codes(samples) == [SkipCode.AHEAD if i == 10 else None for i in range(30)]


def test_a_copy_of_a_sample_far_ahead_confirms_nothing():
    samples = circling(20)
    samples[10] = samples[11] = replace(samples[10], time=samples[10].time + 600.0)
    assert codes(samples)[10:14] == [SkipCode.AHEAD, SkipCode.AHEAD, None, None]


def test_a_gap_of_ten_seconds_costs_no_sample():
    samples = circling(20)
    samples = samples[:10] + [replace(s, time=s.time + 9.7) for s in samples[10:]]
    assert set(codes(samples)) == {None}


@pytest.mark.parametrize("wrong", [2, 3, 5])
@pytest.mark.parametrize("ahead", [11.0, 600.0, 1e7])
def test_time_stamps_far_ahead_in_a_row_lock_nothing_out(wrong, ahead):
    samples = circling(40)
    for i in range(10, 10 + wrong):
        samples[i] = replace(samples[i], time=samples[i].time + ahead)
    found = codes(samples)
    assert found[10] is SkipCode.AHEAD
    # The fifth sample that goes on in the time before is used, and all after it.
    resumed = 10 + wrong
    assert found[resumed : resumed + 4] == [SkipCode.OUT_OF_ORDER] * 4
    assert set(found[resumed + 4 :]) == {None}


def test_first_time_stamp_far_ahead_locks_nothing_out():
    samples = circling(20)
    samples[0] = replace(samples[0], time=samples[0].time + 3600.0)
    assert codes(samples) == [None] + [SkipCode.OUT_OF_ORDER] * 4 + [None] * 15


def test_burst_of_late_samples_is_out_of_order_however_long():
    samples = circling(200, rate=50.0)
    arriving = samples[:110] + samples[160:] + samples[110:160]  # up to 1.8 s late
    assert codes(arriving) == [None] * 150 + [SkipCode.OUT_OF_ORDER] * 50
