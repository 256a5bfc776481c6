"""Geodetic coordinates to and from a local east, north, up frame about one datum (WGS 84)."""

from dataclasses import dataclass

import pymap3d


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
        latitude, longitude, altitude, datum.latitude, datum.longitude, datum.altitude
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
    return pymap3d.enu2geodetic(east, north, up, datum.latitude, datum.longitude, datum.altitude)
