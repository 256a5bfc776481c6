"""Simulated flight of the tow aircraft: straight entry, turns over a ground circle, straight exit.

The airspeed is constant. To stay on its circle in wind the aircraft changes heading and bank, and
its ground speed v along the tangent t is that of the wind triangle, |v t - wind| = airspeed.
"""

from dataclasses import dataclass
from math import isfinite, pi

import numpy as np
from scipy.integrate import solve_ivp

from ctcbs_ros.errors import InputError

GRAVITY = 9.80665  # m/s^2
LARGEST_BANK = np.radians(80.0)
STRAIGHT_TIME = 15.0  # s in still air, at entry and exit
RATES = (0.1, 100.0)  # Hz
MOST_TURNS = 10_000  # four days at one in half a minute


@dataclass(frozen=True)
class SimulatedFlight:
    """The true flight, sampled; n samples, in a frame with the circle's centre at home level.

    Attributes
    ----------
    time : (n,) ndarray
        Seconds from the first sample, whole milliseconds.
    position, velocity : (n, 3) ndarray
        East, north, up [m], over the ground [m/s].
    heading : (n,) ndarray
        ENU angle of the velocity through the air [rad].
    turn_rate : (n,) ndarray
        Rate of the heading [rad/s], positive anticlockwise.
    bank : (n,) ndarray
        Bank angle of the coordinated turn [rad], positive to the right.
    radius : (n,) ndarray
        Distance of the track from the centre that is flown [m]; nan on the straights.
    airspeed : float
        [m/s]
    wind : (2,) ndarray
        Velocity of the air towards east, north [m/s].
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    turn_rate: np.ndarray
    bank: np.ndarray
    radius: np.ndarray
    airspeed: float
    wind: np.ndarray


def simulate_flight(
    radius: float,
    speed: float,
    turns: float,
    *,
    sense: int = 1,
    height: float = 300.0,
    rate: float = 5.0,
    wind: tuple[float, float] = (0.0, 0.0),
    radius_change: tuple[float, float] | None = None,
) -> SimulatedFlight:
    """Fly turns about the origin, entered and left on tangents.

    Parameters
    ----------
    radius : float
        Radius of the ground circle [m].
    speed : float
        Airspeed [m/s].
    turns : float
        Turns about the centre in all.
    sense : int
        +1 anticlockwise, -1 clockwise, seen from above.
    height : float
        Height above home [m].
    rate : float
        Samples a second [Hz].
    wind : (float, float)
        Velocity of the air towards east, north [m/s].
    radius_change : (float, float), optional
        Another radius [m], and after how many turns the spiral to it begins. It takes a quarter
        turn, or as many quarters as it takes to bank little more than on the circles and never
        to the other side.

    Returns
    -------
    SimulatedFlight

    Raises
    ------
    InputError
        If an argument is not possible, the wind stronger than the airspeed, or the bank steeper
        than 80 degrees.
    """
    _require("radius", radius, "m", low=0.0)
    _require("speed", speed, "m/s", low=0.0)
    _require("turns", turns, "", low=0.0, high=MOST_TURNS)
    _require("height", height, "m", low=-500.0, high=20_000.0)
    _require("rate", rate, "Hz", *RATES)
    wind = np.array(wind, float)
    strength = float(np.hypot(*wind))
    if not strength < speed:
        raise InputError(f"wind {strength:g} m/s: must be less than the airspeed, {speed:g} m/s")
    track = _Track(radius, turns, sense, radius_change)
    _, bank = _turning(track, track.each_part_once(), speed, wind)
    steepest = np.abs(bank).max()
    if steepest > LARGEST_BANK:
        raise InputError(
            f"radius {min(radius, track.final_radius):g} m at speed {speed:g} m/s: needs a bank "
            f"of {np.degrees(steepest):.0f} deg; at most 80 deg are flown"
        )

    first = -speed * STRAIGHT_TIME / radius
    last = track.end + speed * STRAIGHT_TIME / track.final_radius

    def rate_of(_, u):
        _, slope, _ = track(u)
        return _ground_speed(slope, speed, wind)[0] / np.linalg.norm(slope, axis=-1)

    def at_end(_, u):
        return u[0] - last

    at_end.terminal = True
    slowest = (speed - strength) / (max(radius, track.final_radius) * 2)
    flown = solve_ivp(
        rate_of,
        (0.0, (last - first) / slowest),
        [first],
        method="DOP853",
        dense_output=True,
        events=at_end,
        rtol=1e-10,
        atol=1e-10,
    )
    # The vehicle's clock counts milliseconds; the truth is that of the very instants it can state.
    time = np.round(np.arange(0.0, flown.t[-1], 1 / rate), 3)
    u = flown.sol(time)[0]
    position, slope, _ = track(u)
    ground_speed, tangent = _ground_speed(slope, speed, wind)
    velocity = ground_speed[:, None] * tangent
    air_velocity = velocity - wind
    turn_rate, bank = _turning(track, u, speed, wind)
    on_circle = (u >= 0) & (u <= track.end)
    still = np.zeros(len(time))
    return SimulatedFlight(
        time=time,
        position=np.column_stack([position, still + height]),
        velocity=np.column_stack([velocity, still]),
        heading=np.arctan2(air_velocity[:, 1], air_velocity[:, 0]),
        turn_rate=turn_rate,
        bank=bank,
        radius=np.where(on_circle, np.linalg.norm(position, axis=1), np.nan),
        airspeed=speed,
        wind=wind,
    )


class _Track:
    """Path over the ground by the angle u turned through; straight tangents before 0 and past end.

    Calling it gives position and its first and second derivatives by u, each (n, 2).
    """

    def __init__(self, radius, turns, sense, radius_change):
        self.radius = self.final_radius = radius
        self.end = 2 * pi * turns
        self._sense = sense
        self._change_start, self._change_length = 0.0, pi / 2
        if radius_change:
            self.final_radius, after = radius_change
            _require("radius change", self.final_radius, "m", low=0.0)
            _require("radius change after", after, "turns", low=0.0, high=turns)
            self._change_start = 2 * pi * after
            self._lengthen_change()

    def __call__(self, u):
        u = np.asarray(u, float)
        turned = np.clip(u, 0.0, self.end)
        r, dr, ddr = self._radius(turned)
        s = self._sense
        outward = np.stack([np.cos(turned), s * np.sin(turned)], axis=-1)
        along = np.stack([-np.sin(turned), s * np.cos(turned)], axis=-1)
        slope = dr * outward + r * along
        position = r * outward + (u - turned)[..., None] * slope
        bend = (ddr - r) * outward + 2 * dr * along
        return position, slope, np.where((u == turned)[..., None], bend, 0.0)

    def each_part_once(self):
        """Angles over a whole turn of each circle and over the change between them."""
        change_end = self._change_start + self._change_length
        starts = np.array([0.0, self._change_start, self.end - 2 * pi])
        stops = np.array([2 * pi, change_end, self.end])
        return np.clip(np.linspace(starts, stops, 721).ravel(), 0.0, self.end)

    def _radius(self, turned):
        """Radius and its derivatives; a quintic in u takes it from one value to the other."""
        x = np.clip((turned - self._change_start) / self._change_length, 0.0, 1.0)[..., None]
        step = self.final_radius - self.radius
        slope, bend = step / self._change_length, step / self._change_length**2
        return (
            self.radius + step * x**3 * (10 - 15 * x + 6 * x**2),
            slope * 30 * x**2 * (1 - x) ** 2,
            bend * 60 * x * (1 - x) * (1 - 2 * x),
        )

    def _lengthen_change(self):
        sharpest = 1.25 / min(self.radius, self.final_radius)
        while self._change_start + self._change_length <= self.end + 1e-9:
            u = self._change_start + self._change_length * np.linspace(0, 1, 181)
            _, slope, bend = self(u)
            curvature = _cross(slope, bend) * self._sense / np.linalg.norm(slope, axis=1) ** 3
            if curvature.min() >= 0 and curvature.max() <= sharpest:
                return
            self._change_length += pi / 2
        raise InputError(
            f"radius change to {self.final_radius:g} m after {self._change_start / 2 / pi:g} "
            f"turns: the {self.end / 2 / pi:g} turns flown leave too little to spiral there"
        )


def _ground_speed(slope, airspeed, wind):
    """Speed along the track by the wind triangle, and the track's tangent."""
    tangent = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    return tangent @ wind + _air_along_track(tangent, airspeed, wind), tangent


def _air_along_track(tangent, airspeed, wind):
    return np.sqrt(airspeed**2 - _cross(tangent, wind) ** 2)


def _turning(track, u, airspeed, wind):
    """Rate of the heading [rad/s], anticlockwise, and the coordinated bank [rad], to the right."""
    _, slope, bend = track(u)
    ground_speed, tangent = _ground_speed(slope, airspeed, wind)
    curvature = _cross(slope, bend) / np.linalg.norm(slope, axis=-1) ** 3
    # The triangle's derivative: the heading turns faster than the track by this ratio of speeds.
    turn_rate = curvature * ground_speed**2 / _air_along_track(tangent, airspeed, wind)
    return turn_rate, -np.arctan(airspeed * turn_rate / GRAVITY)


def bank_of(radius: float, speed: float) -> float:
    """Bank of a coordinated turn [rad] by radius [m] and speed over the ground [m/s]."""
    return float(np.arctan(speed**2 / (radius * GRAVITY)))


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _require(name, value, unit, low, high=float("inf")):
    """Refuse a number not above `low`, or above `high`."""
    if not (isfinite(value) and low < value <= high):
        upper = f" and at most {high:g}" if isfinite(high) else ""
        raise InputError(f"{name} {value:g} {unit}".rstrip() + f": must be above {low:g}{upper}")
