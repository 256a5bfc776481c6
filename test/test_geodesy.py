"""Geodetic coordinates and the local frame."""

import numpy as np
import pytest

from ctcbs_ros.geodesy import Datum, point_to_geodetic, to_enu, to_geodetic

# WGS 84: semi-major axis and flattening (NIMA TR8350.2, table 3.1).
SEMI_MAJOR, FLATTENING = 6_378_137.0, 1 / 298.257223563


@pytest.mark.parametrize("latitude", [-89.0, -35.4, 0.0, 47.4, 80.0])
@pytest.mark.parametrize("longitude", [-179.9999, 0.0, 179.9999])
def test_there_and_back_is_the_same_point_on_either_hemisphere(latitude, longitude):
    datum = Datum(latitude, longitude, 300.0, True)
    points = np.random.default_rng(1).uniform(-2000, 2000, (50, 3))
    back = np.column_stack(to_enu(datum, *to_geodetic(datum, *points.T)))
    np.testing.assert_allclose(back, points, atol=1e-6)


@pytest.mark.parametrize("latitude", [-35.4, 0.0, 60.0])
def test_small_steps_in_latitude_and_longitude_are_the_arcs_of_the_ellipsoid(latitude):
    # Radii of curvature of the ellipsoid in the meridian, M, and across it, N.
    squared_eccentricity = FLATTENING * (2 - FLATTENING)
    w = np.sqrt(1 - squared_eccentricity * np.sin(np.radians(latitude)) ** 2)
    meridian = SEMI_MAJOR * (1 - squared_eccentricity) / w**3
    across = SEMI_MAJOR / w * np.cos(np.radians(latitude))
    datum = Datum(latitude, 8.5, 0.0, True)
    step = 1e-5
    east, north, up = to_enu(datum, latitude + step, 8.5 + step, 7.0)
    assert north == pytest.approx(meridian * np.radians(step), abs=1e-5)
    assert east == pytest.approx(across * np.radians(step), abs=1e-5)
    assert up == pytest.approx(7.0, abs=1e-5)


def test_amsl_taken_for_ellipsoidal_height_barely_changes_local_coordinates():
    geoid_height = 100.0
    ellipsoidal = Datum(47.4, 8.5, 500.0 + geoid_height, True)
    amsl = Datum(47.4, 8.5, 500.0, False)
    one = to_enu(ellipsoidal, 47.41, 8.51, 800.0 + geoid_height)
    other = to_enu(amsl, 47.41, 8.51, 800.0)
    assert np.linalg.norm(np.subtract(one, other)) < 2e-5 * np.linalg.norm(one)


@pytest.mark.parametrize("latitude", [-90.0, -89.99999, -35.4, 0.0, 47.4, 89.999])
@pytest.mark.parametrize("longitude", [-180.0, 8.5, 179.9999])
@pytest.mark.parametrize("distance", [0.0, 1.0, 300.0, 2e4, 3e6])
def test_a_single_point_is_where_the_closed_form_has_it(latitude, longitude, distance):
    datum = Datum(latitude, longitude, 300.0, True)
    for angle in np.linspace(0.0, 6.0, 7):
        point = distance * np.cos(angle), distance * np.sin(angle), -50.0
        found = point_to_geodetic(datum, *point)
        assert all(type(value) is float for value in found)
        assert abs(found[0]) <= 90.0
        assert abs(found[1]) <= 180.0
        assert to_enu(datum, *found) == pytest.approx(
            point, abs=max(2e-6, 1e-9 * distance)
        )
        closed = to_geodetic(datum, *point)
        assert found[0] == pytest.approx(float(closed[0]), abs=1e-9)
        assert found[2] == pytest.approx(float(closed[2]), abs=1e-4)


def test_a_point_that_is_no_number_has_no_place():
    found = point_to_geodetic(Datum(47.4, 8.5, 0.0, True), np.nan, 0.0, 0.0)
    assert np.isnan(found).any()
