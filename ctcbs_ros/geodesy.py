"""Geodetic coordinates to and from a local east, north, up frame about one datum (WGS 84)."""

from dataclasses import dataclass
from functools import lru_cache
from math import cos, hypot, radians, tan

import pymap3d
import pymap3d.rcurve

_WGS84 = pymap3d.Ellipsoid.from_name("wgs84")
# A position on Earth has been found when it is off by no more than this [m].
_FOUND = 1e-7
_ITERATIONS = 6
# Change of the local frame's axes a metre, with a margin [rad/m].
_CURVED = 2.0 / 6.4e6


@dataclass(frozen=True)
class Datum:
    """Origin of the local frame.

    Attributes
    ----------
    latitude, longitude : float
        Geodetic position [deg].
    altitude : float
        Height of the origin [m].
    ellipsoidal : bool
        Whether that height, and with it every height given to or taken from the frame, is above
        the WGS 84 ellipsoid; otherwise it is above mean sea level. The two differ by the geoid's
        height, up to 100 m; taking one for the other consistently leaves the local coordinates
        right to 2e-5 of their length.
    """

    latitude: float
    longitude: float
    altitude: float
    ellipsoidal: bool


def to_enu(datum: Datum, latitude, longitude, altitude):
    """East, north, up of a geodetic position.

    Parameters
    ----------
    datum : Datum
    latitude, longitude : float or (n,) array_like
        [deg]
    altitude : float or (n,) array_like
        Height of the same kind as the datum's [m].

    Returns
    -------
    east, north, up : float or (n,) ndarray
        [m]
    """
    return pymap3d.geodetic2enu(
        latitude, longitude, altitude, datum.latitude, datum.longitude, datum.altitude, _WGS84
    )


def to_geodetic(datum: Datum, east, north, up):
    """Geodetic position of a point of the local frame; inverse of `to_enu`.

    Parameters
    ----------
    datum : Datum
    east, north, up : float or (n,) array_like
        [m]

    Returns
    -------
    latitude, longitude : float or (n,) ndarray
        [deg]
    altitude : float or (n,) ndarray
        Height of the same kind as the datum's [m].
    """
    return pymap3d.enu2geodetic(
        east, north, up, datum.latitude, datum.longitude, datum.altitude, _WGS84
    )


def point_to_geodetic(
    datum: Datum, east: float, north: float, up: float
) -> tuple[float, float, float]:
    """`to_geodetic` of a single point, six times as fast: by Newton's method on `to_enu`.

    Within hundreds of metres of the datum one step does; far away and at the poles `to_geodetic`.
    """
    of_north, of_east = _degrees_a_metre(datum.latitude)
    latitude = datum.latitude + of_north * north
    longitude, altitude = datum.longitude + of_east * east, datum.altitude + up
    # The derivatives are those at the datum's foot: what a step leaves is this part of it at most.
    away = hypot(east, north, up) + abs(datum.altitude)
    left = _CURVED * away * (1.0 + abs(tan(radians(datum.latitude))))
    for _ in range(_ITERATIONS):
        there = to_enu(datum, latitude, longitude, altitude)
        off = east - there[0], north - there[1], up - there[2]
        longitude += of_east * off[0]
        latitude += of_north * off[1]
        altitude += off[2]
        if left * max(map(abs, off)) < _FOUND and left < 1.0 and abs(latitude) <= 90.0:
            return float(latitude), float((longitude + 180.0) % 360.0 - 180.0), float(altitude)
    latitude, longitude, altitude = to_geodetic(datum, east, north, up)
    return float(latitude), float(longitude), float(altitude)


@lru_cache(maxsize=8)
def _degrees_a_metre(latitude: float) -> tuple[float, float]:
    """Degrees of latitude and of longitude a metre, on the ellipsoid."""
    to_north = radians(1.0) * float(pymap3d.rcurve.meridian(latitude))
    to_east = radians(1.0) * float(pymap3d.rcurve.transverse(latitude)) * cos(radians(latitude))
    return 1.0 / to_north, 1.0 / max(to_east, 1e-3)
