"""The tow point on a circle over the ground in a wind: when it is where, and how fast.

In the circle's own units: lengths in its radius, times in 1/Omega, Omega the mean angular rate, so
that a turn takes 2 pi. The tow point is on the x axis at time 0 and goes anticlockwise; the air
moves towards +x.
"""

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc

from ctcbs_ros.errors import InputError

GROUND_SPEED, AIRSPEED = "ground-speed", "airspeed"
PATHS = (GROUND_SPEED, AIRSPEED)


@dataclass(frozen=True)
class TowPath:
    """A flown circle.

    Attributes
    ----------
    kind : str
        "ground-speed" is at constant angular rate, "airspeed" at constant speed through the air.
    wind : float
        Speed of the air over that of the tow point, by the ground or through the air as the kind
        has it: at least 0, below 1.

    Raises
    ------
    InputError
    """

    kind: str
    wind: float

    def __post_init__(self):
        """Refuse what no aircraft flies."""
        if self.kind not in PATHS:
            allowed = " or ".join(PATHS)
            raise InputError(f"path: {self.kind!r} is not allowed, it must be {allowed}")
        if not 0.0 <= self.wind < 1.0:
            raise InputError(
                f"wind: {self.wind:g} of the tow speed is not allowed, it must be at least 0 and "
                "below 1: an aircraft slower than the wind flies no circle over the ground"
            )

    @classmethod
    def of_air_velocity(cls, kind: str, air_velocity: float) -> "TowPath":
        """The path on which the air moves at a speed in a Omega."""
        if kind != AIRSPEED or not 0.0 <= air_velocity < inf:
            return cls(kind, air_velocity)

        def miss(wind):
            return 2.0 / pi * wind * ellipe(wind**2) - air_velocity * (1.0 - wind**2)

        # Every wind has its airspeed: the aircraft makes up downwind for what it loses upwind.
        return cls(kind, float(brentq(miss, 0.0, 1.0, xtol=1e-15)))

    @property
    def air_velocity(self) -> float:
        """Speed of the air, in a Omega.

        At constant airspeed V a turn takes the integral of 1/theta' = (w sin(theta) +
        sqrt(1 - w^2 cos^2(theta))) / (V (1 - w^2)), a complete elliptic integral.
        """
        if self.kind == GROUND_SPEED:
            return self.wind
        return self.wind * self._airspeed

    @property
    def _airspeed(self) -> float:
        return 2.0 / pi * float(ellipe(self.wind**2)) / (1.0 - self.wind**2)

    def angles(self, times) -> np.ndarray:
        """Angles of the tow point at times, of the same shape [rad]."""
        times = np.asarray(times, float)
        if self.kind == GROUND_SPEED or self.wind == 0.0:
            return times
        # Kepler's kind of problem: the time at an angle is known in closed form, and its slope is
        # 1/theta' > 0. Newton's method from a start that both ends of the turn agree with.
        angle = times.copy()
        for _ in range(50):
            step = (self.times(angle) - times) * self._rate(angle)
            angle -= np.clip(step, -0.5, 0.5)
            if np.abs(step).max(initial=0.0) < 1e-14 * (1.0 + np.abs(times).max(initial=0.0)):
                return angle
        raise ArithmeticError(f"no angle at a wind of {self.wind:g}")

    def _rate(self, angle) -> np.ndarray:
        w = self.wind
        return self._airspeed * (np.sqrt(1.0 - (w * np.cos(angle)) ** 2) - w * np.sin(angle))

    def times(self, angles) -> np.ndarray:
        """Times at which the tow point is at angles, of the same shape: `angles` the other way."""
        angle, w = np.asarray(angles, float), self.wind
        if self.kind == GROUND_SPEED or w == 0.0:
            return angle
        # The integral of sqrt(1 - w^2 cos^2) from 0 is E(angle - pi/2) + E.
        arc = ellipeinc(angle - 0.5 * pi, w * w) + ellipe(w * w)
        return (w * (1.0 - np.cos(angle)) + arc) / (self._airspeed * (1.0 - w * w))

    def motion(self, times) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity and acceleration of the tow point at k times, (k, 3) each."""
        angle = self.angles(times)
        cosine, sine, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
        outward = np.stack([cosine, sine, zero], axis=-1)
        along = np.stack([-sine, cosine, zero], axis=-1)
        if self.kind == GROUND_SPEED:
            return outward, along, -outward
        rate = self._rate(angle)[..., None]
        w, root = self.wind, np.sqrt(1.0 - (self.wind * cosine) ** 2)
        slope = self._airspeed * (w * w * cosine * sine / root - w * cosine)[..., None]
        return outward, rate * along, rate * slope * along - rate**2 * outward
