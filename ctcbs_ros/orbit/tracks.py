"""Simulated flights with known truth, from the curvature of the ground track.

A track is a list of pieces, each with a length and a curvature that runs linearly along it: none
for a straight leg, 1/radius for a circle. It is flown at constant airspeed, in wind if there is
any, and sampled with white noise.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

TURN = 2.0 * pi
_STEP = 0.2  # m along the track


@dataclass(frozen=True)
class Flight:
    """What a receiver would report, and the truth; n samples.

    Attributes
    ----------
    time : (n,) ndarray
        [s]
    position, velocity : (n, 3) ndarray
        With noise, east, north, up [m], [m/s].
    true_position : (n, 3) ndarray
        [m]
    piece : (n,) ndarray
        Index of the piece of the track that is flown.
    angle : (n,) ndarray
        Turn of the course [rad] since the piece began, positive.
    centers : list of (2,) ndarray or None
        Centre of curvature of each piece [m]; None where it has no constant one.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    true_position: np.ndarray
    piece: np.ndarray
    angle: np.ndarray
    centers: list


def straight(length):
    return (length, 0.0, 0.0)


def arc(radius, turns, sense=1):
    return (radius * turns * TURN, sense / radius, sense / radius)


def between(radius, next_radius, turns, sense=1):
    """From one radius to another; the curvature runs linearly over this angle."""
    mean = 0.5 * (1.0 / radius + 1.0 / next_radius)
    return (turns * TURN / mean, sense / radius, sense / next_radius)


def spiral(radius, growth, turns, sense=1):
    """A radius growing by a share a turn, in pieces of a sixteenth of a turn."""
    angles = np.arange(0.0, turns, 1.0 / 16.0)
    radii = radius * (1.0 + growth * np.append(angles, turns))
    return [between(a, b, 1.0 / 16.0, sense) for a, b in pairwise(radii)]


def racetrack(radius, leg, laps, sense=1):
    return [straight(leg), arc(radius, 0.5, sense)] * (2 * laps)


def figure_of_eight(radius, laps):
    """Loops of three quarters of a turn, joined by the crossing legs they are tangent to."""
    leg = straight(2.0 * radius)
    return [leg, arc(radius, 0.75, 1), leg, arc(radius, 0.75, -1)] * laps


def fly(
    track,
    speed,
    rng,
    *,
    rate=5.0,
    position_noise=1.5,
    velocity_noise=0.3,
    wind=(0.0, 0.0),
    loss=0.0,
    jitter=0.0,
    climb=0.0,
    course=0.0,
    lag=0.0,
    speed_change=0.0,
):
    """Fly a track.

    Parameters
    ----------
    track : list of (float, float, float)
        Length [m], curvature at its start and at its end [1/m], positive anticlockwise.
    speed : float
        Airspeed [m/s].
    rng : numpy.random.Generator
    rate : float
        Samples a second [Hz].
    position_noise, velocity_noise : float
        Standard deviation of one axis [m], [m/s].
    wind : (float, float)
        Velocity of the air towards east, north [m/s].
    loss : float
        Share of the samples that are lost.
    jitter : float
        Irregularity of the sample times, as a share of their interval.
    climb : float
        [m/s]
    course : float
        At the start, ENU angle [rad].
    lag : float
        The velocity is this late [s].
    speed_change : float
        Rise of the airspeed, as a share of it, from the start to the end of the flight.

    Returns
    -------
    Flight
    """
    steps = [max(2, round(length / _STEP)) for length, _, _ in track]
    ds = np.concatenate([np.full(n, p[0] / n) for n, p in zip(steps, track, strict=True)])
    curvature = np.concatenate(
        [
            p[1] + (p[2] - p[1]) * (np.arange(n) + 0.5) / n
            for n, p in zip(steps, track, strict=True)
        ]
    )
    heading = course + np.concatenate([[0.0], np.cumsum(curvature * ds)])
    middle = 0.5 * (heading[:-1] + heading[1:])
    sinc = np.sinc(0.5 * curvature * ds / pi)  # chord over arc
    east = np.concatenate([[0.0], np.cumsum(np.cos(middle) * ds * sinc)])
    north = np.concatenate([[0.0], np.cumsum(np.sin(middle) * ds * sinc)])
    # The wind triangle: ground speed v along the tangent t with |v t - wind| = airspeed.
    along = wind[0] * np.cos(heading) + wind[1] * np.sin(heading)
    across = -wind[0] * np.sin(heading) + wind[1] * np.cos(heading)
    airspeed = speed * (1.0 + speed_change * np.linspace(0.0, 1.0, len(heading)))
    ground = along + np.sqrt(airspeed**2 - across**2)
    pace = 0.5 * (1.0 / ground[:-1] + 1.0 / ground[1:])
    clock = np.concatenate([[0.0], np.cumsum(ds * pace)])

    time = np.arange(0.0, clock[-1], 1.0 / rate)
    time = time + jitter / rate * rng.uniform(-0.49, 0.49, len(time))
    time = np.clip(time[rng.random(len(time)) >= loss], 0.0, clock[-1])
    up = 100.0 + climb * time
    true = np.column_stack([np.interp(time, clock, east), np.interp(time, clock, north), up])
    late = np.maximum(time - lag, 0.0)
    v, psi = np.interp(late, clock, ground), np.interp(late, clock, heading)
    velocity = np.column_stack([v * np.cos(psi), v * np.sin(psi), np.full(len(time), climb)])

    starts = np.concatenate([[0], np.cumsum(steps)])
    piece = np.searchsorted(clock[starts[1:-1]], time, side="right")
    turned = np.concatenate([[0.0], np.cumsum(np.abs(curvature) * ds)])
    centers = [
        None
        if p[1] == 0.0 or p[1] != p[2]
        else np.array([east[i] - np.sin(heading[i]) / p[1], north[i] + np.cos(heading[i]) / p[1]])
        for i, p in zip(starts[:-1], track, strict=True)
    ]
    return Flight(
        time=time,
        position=true + position_noise * rng.standard_normal(true.shape),
        velocity=velocity + velocity_noise * rng.standard_normal(true.shape),
        true_position=true,
        piece=piece,
        angle=np.interp(time, clock, turned) - turned[starts[:-1]][piece],
        centers=centers,
    )


def correlated_noise(time, sigma, correlation_time, rng, axes):
    """First-order Gauss-Markov error at given times, (n, axes).

    Parameters
    ----------
    time : (n,) ndarray
        [s]
    sigma : float
        Standard deviation of one axis.
    correlation_time : float
        Time in which the correlation falls to 1/e [s].
    rng : numpy.random.Generator
    axes : int
    """
    noise = sigma * rng.standard_normal((len(time), axes))
    kept = np.exp(-np.diff(time) / correlation_time)
    for i, share in enumerate(kept, start=1):
        noise[i] = share * noise[i - 1] + np.sqrt(1.0 - share**2) * noise[i]
    return noise


def random_circle(rng):
    """Radius 40 to 300 m, speed 15 to 60 m/s, bank below 60 degrees, either sense."""
    radius = 40.0 * (300.0 / 40.0) ** rng.random()
    fastest = min(60.0, np.sqrt(9.81 * radius * np.tan(np.radians(60.0))))
    return radius, rng.uniform(15.0, fastest), rng.choice([-1, 1])


def estimate(estimator, flight, *, with_velocity=True, sigma=(np.nan, np.nan), keep=None):
    """Feed a flight to an estimator.

    Parameters
    ----------
    keep : (n,) ndarray of bool, optional
        The samples that arrive.

    Returns
    -------
    list of Orbit or None
        One for each sample, None where it does not arrive.
    """
    orbits = []
    for i, time in enumerate(flight.time):
        if keep is not None and not keep[i]:
            orbits.append(None)
            continue
        velocity = flight.velocity[i] if with_velocity else None
        orbits.append(estimator.add(time, flight.position[i], velocity, *sigma).orbit)
    return orbits
