"""The orbit: what the estimator makes of the samples and the predictor takes in."""

from dataclasses import dataclass, field

import numpy as np

# Order of the rows and columns of `Orbit.covariance`.
ORBIT_STATE = (
    "east", "north", "up", "radius", "angular_rate", "phase", "climb_rate", "drift_east",
    "drift_north",
)  # fmt: skip


@dataclass(frozen=True)
class Orbit:
    """A circle over the ground flown by the tow aircraft, in the local ENU frame.

    Attributes
    ----------
    time : float
        Vehicle clock [s] of the newest sample in the fit.
    start_time : float
        Vehicle clock [s] of the oldest sample in the fit.
    center : (3,) ndarray
        East, north, up of the circle's centre at `time` [m]; up is the tow point's height.
    radius : float
        Tow radius a [m].
    angular_rate : float
        Mean angular rate Omega about the centre [rad/s], positive; `sense` carries the direction.
    sense : int
        +1 anticlockwise seen from above (ENU angle rising), -1 clockwise.
    phase : float
        ENU angle [rad] of the tow point about the centre at `time` (0 is east, pi/2 north).
    climb_rate : float
        Rate of the height [m/s].
    rms_residual : float
        Root mean square distance of the samples from the circle [m].
    arc : float
        Angle covered by the samples of the fit [rad], positive.
    samples : int
        Number of samples in the fit.
    covariance : (9, 9) ndarray
        Covariance of what `ORBIT_STATE` names, in SI units. Of a centre that was not seen to
        drift, that of its drift is how well the samples tell, infinite where they do not.
    drift : (2,) ndarray
        Velocity of the centre over the ground, east, north [m/s]: nought unless it was seen to
        drift, as it does with the air at constant bank.
    """

    time: float
    start_time: float
    center: np.ndarray
    radius: float
    angular_rate: float
    sense: int
    phase: float
    climb_rate: float
    rms_residual: float
    arc: float
    samples: int
    covariance: np.ndarray
    drift: np.ndarray = field(default_factory=lambda: np.zeros(2))

    @property
    def speed(self) -> float:
        """Mean speed along the circle [m/s]: over the ground, but for a drift of the centre."""
        return self.radius * self.angular_rate
