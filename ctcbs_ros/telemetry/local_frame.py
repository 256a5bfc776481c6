"""The local ENU frame (`map`) of a flight: its datum, and the heights that sources mix up.

How high the geoid and home are is the median of what five samples told: of a height beside the
one that positions go by no screen says that it is wrong.
"""

from collections import deque
from dataclasses import dataclass
from math import isfinite, nan
from statistics import median

import numpy as np

from ctcbs_ros.geodesy import Datum, to_enu
from ctcbs_ros.telemetry.sample import Sample


@dataclass(frozen=True)
class LocalSample:
    """A believed sample in the local frame.

    Attributes
    ----------
    position : (3,) ndarray
        East, north, up [m].
    altitude_amsl : float
        Best known height above mean sea level [m], for the air's density; nan if unknown.
    home_up : float
        Up coordinate of home [m]; nan if unknown.
    """

    position: np.ndarray
    altitude_amsl: float
    home_up: float


SAMPLES = 5  # that geoid and home are the median of


class LocalFrame:
    """Turns believed samples into local coordinates; the first geodetic one becomes the datum.

    Up is the difference of heights of one kind. The geoid's height, once both kinds have been
    seen, only turns the datum from AMSL into ellipsoidal and leaves local coordinates alone.
    """

    def __init__(self):
        self._origin: Datum | None = None
        self._geoid_heights: deque[float] = deque(maxlen=SAMPLES)
        self._geoid_height = nan
        self.new_flight()

    def new_flight(self) -> None:
        """Forget where home and sea level are: another flight may know neither."""
        self._homes_up: deque[float] = deque(maxlen=SAMPLES)
        self._home_up = nan
        self._sea_level_up = nan

    @property
    def datum(self) -> Datum | None:
        """Origin of the frame, its altitude ellipsoidal as soon as the difference is known."""
        origin = self._origin
        if origin is None or origin.ellipsoidal or not isfinite(self._geoid_height):
            return origin
        altitude = origin.altitude + self._geoid_height
        return Datum(origin.latitude, origin.longitude, altitude, True)

    def up_of_amsl(self, altitude_amsl: float) -> float:
        """Up coordinate of a height above mean sea level [m]; nan where it cannot be told.

        Right at the newest sample: the frame's plane leaves the curved Earth, by 8 m in 10 km.
        """
        return altitude_amsl + self._sea_level_up

    def localize(self, sample: Sample) -> LocalSample | None:
        """Local coordinates of a believed sample.

        None if it carries no usable height, or comes from another local frame than this one.
        """
        geoid_height = sample.altitude_ellipsoid - sample.altitude_amsl
        if isfinite(geoid_height):
            self._geoid_heights.append(geoid_height)
            self._geoid_height = median(self._geoid_heights)
        if isfinite(sample.latitude):
            position = self._from_geodetic(sample)
        elif self._origin is not None:
            return None
        else:
            position = np.array(sample.local_position, float)
            # A local frame's own origin is the nearest thing to home that it knows.
            self._home_up = 0.0
        if position is None:
            return None
        if isfinite(sample.height_above_home):
            self._homes_up.append(position[2] - sample.height_above_home)
            self._home_up = median(self._homes_up)
        amsl = sample.altitude_amsl
        if not isfinite(amsl):
            amsl = sample.altitude_ellipsoid - self._geoid_height
        if isfinite(amsl):
            self._sea_level_up = position[2] - amsl
        else:
            amsl = sample.altitude_ellipsoid
        return LocalSample(position, amsl, self._home_up)

    def place(self, sample: Sample) -> np.ndarray | None:
        """East, north, up of another's sample [m], which tells the frame nothing.

        None without a geodetic position, before the frame has an origin, or where no height of the
        frame's kind is known; the geoid's height is that which the frame's own samples told.
        """
        if self._origin is None or not isfinite(sample.latitude):
            return None
        return self._from_geodetic(sample)

    def _from_geodetic(self, sample: Sample) -> np.ndarray | None:
        if self._origin is None:
            ellipsoidal = not isfinite(sample.altitude_amsl)
            altitude = sample.altitude_ellipsoid if ellipsoidal else sample.altitude_amsl
            if not isfinite(altitude):
                return None
            self._origin = Datum(sample.latitude, sample.longitude, altitude, ellipsoidal)
        altitude = sample.altitude_amsl
        if self._origin.ellipsoidal:
            altitude = sample.altitude_ellipsoid
            if not isfinite(altitude):
                altitude = sample.altitude_amsl + self._geoid_height
        elif not isfinite(altitude):
            altitude = sample.altitude_ellipsoid - self._geoid_height
        if not isfinite(altitude):
            return None
        return np.array(to_enu(self._origin, sample.latitude, sample.longitude, altitude), float)
