"""The local frame: the heights that sources mix up are kept apart."""

from dataclasses import replace
from math import isnan, nan

import numpy as np
import pymap3d
import pytest

from ctcbs_ros.telemetry.local_frame import LocalFrame
from ctcbs_ros.telemetry.sample import Sample

# Home 100 m AMSL, geoid 47 m above the ellipsoid, the aircraft 300 m above home.
FULL = Sample(
    time=1.0, stamp_ns=0, latitude=47.4, longitude=8.5, altitude_amsl=400.0,
    altitude_ellipsoid=447.0, height_above_home=300.0,
)  # fmt: skip


def at(east, north, up, sample=FULL, **others):
    latitude, longitude, altitude = pymap3d.enu2geodetic(east, north, up, 47.4, 8.5, 447.0)
    return replace(
        sample, latitude=latitude, longitude=longitude, altitude_amsl=altitude - 47.0,
        altitude_ellipsoid=altitude, height_above_home=altitude - 147.0, **others,
    )  # fmt: skip


@pytest.mark.parametrize("place", [(47.4, 8.5), (-33.0, 151.0), (-17.0, 179.9999), (65.0, -180.0)])
def test_positions_are_east_north_up_of_the_first_sample(place):
    frame = LocalFrame()
    frame.localize(replace(FULL, latitude=place[0], longitude=place[1]))
    offset = (120.0, -350.0, 25.0)
    latitude, longitude, altitude = pymap3d.enu2geodetic(*offset, *place, 400.0)
    there = frame.localize(
        replace(FULL, latitude=latitude, longitude=longitude, altitude_amsl=altitude)
    )
    assert there.position == pytest.approx(offset, abs=1e-3)


def test_the_datum_is_ellipsoidal_where_both_altitudes_are_told():
    frame = LocalFrame()
    assert frame.datum is None
    local = frame.localize(FULL)
    assert (frame.datum.altitude, frame.datum.ellipsoidal) == (447.0, True)
    assert local.altitude_amsl == 400.0
    assert local.position == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize("wrong", [-30_000.0, 500.0, 460.0])
def test_one_wrong_height_beside_the_one_used_moves_neither_geoid_nor_home(wrong):
    frame = LocalFrame()
    for number in range(10):
        sample = at(20.0 * number, 0.0, 5.0)
        if number in (4, 8):
            sample = replace(sample, altitude_ellipsoid=wrong, height_above_home=wrong)
        local = frame.localize(sample)
        assert frame.datum.altitude == pytest.approx(452.0, abs=1e-6)
        assert local.home_up == pytest.approx(-305.0, abs=0.1)


def test_a_height_of_geoid_and_home_that_lasts_is_taken_over_at_its_third_sample():
    frame = LocalFrame()
    for _ in range(10):
        frame.localize(FULL)
    other = replace(FULL, altitude_ellipsoid=450.0, height_above_home=280.0)
    told = [(frame.localize(other).home_up, frame.datum.altitude) for _ in range(3)]
    expected = [(-300.0, 447.0), (-300.0, 447.0), (-280.0, 450.0)]
    assert np.array(told) == pytest.approx(np.array(expected))


def test_the_datum_is_above_sea_level_until_the_difference_is_told():
    frame = LocalFrame()
    frame.localize(replace(FULL, altitude_ellipsoid=nan))
    assert (frame.datum.altitude, frame.datum.ellipsoidal) == (400.0, False)
    later = frame.localize(at(0.0, 0.0, 10.0))
    assert (frame.datum.altitude, frame.datum.ellipsoidal) == (447.0, True)
    # What was told later turned no local coordinate.
    assert later.position[2] == pytest.approx(10.0, abs=1e-6)


def test_a_source_of_ellipsoidal_altitudes_alone_says_nothing_of_sea_level():
    frame = LocalFrame()
    only = replace(FULL, altitude_amsl=nan, height_above_home=nan)
    local = frame.localize(only)
    assert frame.datum.ellipsoidal
    assert isnan(frame.up_of_amsl(50.0))
    assert isnan(local.home_up)
    assert local.altitude_amsl == 447.0  # near enough for the air's density
    frame.localize(replace(only, altitude_amsl=400.0))
    assert frame.up_of_amsl(400.0) == pytest.approx(0.0, abs=1e-6)
    # And alone again, with the difference known.
    assert frame.localize(only).altitude_amsl == pytest.approx(400.0)


def test_a_sample_with_one_altitude_alone_fits_into_the_frame_of_the_other():
    frame = LocalFrame()
    frame.localize(FULL)
    one = frame.localize(replace(at(5.0, 6.0, 7.0), altitude_ellipsoid=nan))
    other = frame.localize(replace(at(5.0, 6.0, 7.0), altitude_amsl=nan))
    assert one.position == pytest.approx([5.0, 6.0, 7.0], abs=1e-3)
    assert other.position == pytest.approx(one.position, abs=1e-9)


def test_a_sample_whose_only_height_cannot_be_placed_is_not_placed():
    frame = LocalFrame()
    assert frame.localize(replace(FULL, altitude_amsl=nan, altitude_ellipsoid=nan)) is None
    assert frame.datum is None
    frame.localize(replace(FULL, altitude_ellipsoid=nan))
    assert frame.localize(replace(FULL, altitude_amsl=nan)) is None


def test_home_is_as_far_below_as_the_source_says():
    frame = LocalFrame()
    assert frame.localize(FULL).home_up == pytest.approx(-300.0)
    assert frame.localize(at(50.0, 0.0, 30.0)).home_up == pytest.approx(-300.0, abs=1e-3)
    # Kept where a sample does not say.
    assert frame.localize(replace(FULL, height_above_home=nan)).home_up == pytest.approx(-300.0)


def test_sea_level_is_right_far_from_the_datum_where_the_earth_has_curved_away():
    frame = LocalFrame()
    frame.localize(FULL)
    assert frame.up_of_amsl(100.0) == pytest.approx(-300.0)
    latitude, longitude, altitude = pymap3d.enu2geodetic(20e3, 0.0, 0.0, 47.4, 8.5, 447.0)
    there = replace(
        FULL, latitude=latitude, longitude=longitude, altitude_amsl=altitude - 47.0,
        altitude_ellipsoid=altitude,
    )  # fmt: skip
    local = frame.localize(there)
    assert altitude - 447.0 == pytest.approx(20e3**2 / (2 * 6.37e6), rel=0.02)
    assert local.position[2] - frame.up_of_amsl(100.0) == pytest.approx(altitude - 147.0)


def test_another_flight_knows_neither_home_nor_sea_level_of_the_one_before():
    frame = LocalFrame()
    frame.localize(FULL)
    frame.new_flight()
    local = frame.localize(replace(FULL, altitude_amsl=nan, height_above_home=nan))
    assert isnan(local.home_up)
    assert frame.datum.latitude == FULL.latitude  # the frame goes on


def test_a_local_source_has_its_origin_for_home_and_no_datum():
    frame = LocalFrame()
    local = frame.localize(
        Sample(time=1.0, stamp_ns=0, local_position=(10.0, 20.0, 300.0))
    )
    assert local.position == pytest.approx([10.0, 20.0, 300.0])
    assert local.home_up == 0.0
    assert isnan(local.altitude_amsl)
    assert frame.datum is None


def test_positions_of_another_local_frame_are_not_placed_in_a_geodetic_one():
    frame = LocalFrame()
    frame.localize(FULL)
    assert frame.localize(Sample(time=2.0, stamp_ns=0, local_position=(1.0, 2.0, 3.0))) is None
