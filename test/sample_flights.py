"""Telemetry samples of simulated flights, without MAVLink."""

from dataclasses import replace
from math import hypot, nan

import numpy as np

from ctcbs_ros.geodesy import Datum, to_geodetic
from ctcbs_ros.simulated_flight import simulate_flight
from ctcbs_ros.telemetry.sample import Sample

PLACES = {
    "north": (47.4, 8.5),
    "south": (-33.9, 18.4),
    "across 180": (-17.5, 179.9999),
    "across -180": (65.2, -179.9998),
    "across the equator": (0.0004, 30.0),
}


def samples_of(
    flight, place="north", home=100.0, geoid=47.0, heights=("amsl", "ellipsoid", "home"),
    velocities=True, local=False, number=0, start=0.0, wind=None,
):  # fmt: skip
    """Samples of a simulated flight about a place.

    `heights` are those that the source tells; where a `wind` (east, north) is given, an airspeed
    is measured.
    """
    latitude, longitude = PLACES[place]
    lat, lon, ellipsoidal = to_geodetic(
        Datum(latitude, longitude, home + geoid, True), *flight.position.T
    )
    found = []
    for i, t in enumerate(flight.time):
        time = start + float(t)
        fields = {
            "time": time,
            "stamp_ns": int(time * 1e9),
            "flight": number,
            "velocity": tuple(map(float, flight.velocity[i])) if velocities else None,
        }
        if wind is not None:
            fields["airspeed"] = float(hypot(*(flight.velocity[i, :2] - wind)))
        if local:
            fields["local_position"] = tuple(map(float, flight.position[i]))
        else:
            up = float(ellipsoidal[i])
            fields |= {
                "latitude": float(lat[i]),
                "longitude": float(lon[i]),
                "altitude_amsl": up - geoid if "amsl" in heights else nan,
                "altitude_ellipsoid": up if "ellipsoid" in heights else nan,
                "height_above_home": up - geoid - home if "home" in heights else nan,
                "fix_type": 3,
            }
        found.append(Sample(**fields, horizontal_accuracy=0.3, speed_accuracy=0.1))
    return found


def noisy(samples, speed_noise, seed=0):
    """The same samples with noise on the velocities [m/s]."""
    random = np.random.default_rng(seed)
    return [
        replace(s, velocity=tuple(np.array(s.velocity) + random.normal(0.0, speed_noise, 3)))
        for s in samples
    ]


def orbiting(radius=80.0, speed=20.0, turns=1.5, **others):
    """A simulated flight with its orbit."""
    return simulate_flight(radius, speed, turns, **others)
