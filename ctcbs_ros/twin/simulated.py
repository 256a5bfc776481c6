"""What the twin says after a sample: where the end mass is now, transients included."""

from dataclasses import dataclass
from enum import Enum
from math import nan

import numpy as np

from ctcbs_ros.twin.look_ahead import Settling


class TwinState(Enum):
    """What the twin's position is worth."""

    WAITING = "waiting"  # for an orbit or straight flight to begin on; there is no position
    SETTLING = "settling"  # what it began with, guessed, still shows
    SYNCHRONISED = "synchronised"


class Loss(Enum):
    """Why the twin had to begin anew; each is counted."""

    NEW_FLIGHT = "NEW_FLIGHT"  # a reboot, or the clock went back
    GAP = "GAP"
    JUMP = "JUMP"
    CABLE_CHANGED = "CABLE_CHANGED"
    OTHER_WIND = "OTHER_WIND"  # told for the first time, or by a better source
    NOT_FOLLOWED = "NOT_FOLLOWED"  # the integration failed


@dataclass(frozen=True)
class Simulated:
    """The twin after a sample, in SI units and the orbit's local frame.

    Attributes
    ----------
    time, stamp_ns : float, int
        Of the sample [s], [ns].
    state : TwinState
    since : float
        When it was begun [s]; nan while it waits.
    valid_from : float
        When a small error of what it began with has decayed to 5 % [s]; inf where it does not.
    begun_as : str
        "periodic motion", "steady state in still air" or "straight flight".
    position, velocity : (3,) ndarrays
        Of the end mass, east, north, up [m], [m/s]; nan while it waits.
    yaw : float
        ENU direction of its motion [rad].
    covariance : (6, 6) ndarray
        Of (east, north, up, roll, pitch, yaw) in SI units: the tow point's position; by two more
        cables in winds that are off by a standard deviation, the wind; what gaps in the telemetry
        have left; and what is left of where it began, which was predicted no better, after
        whatever was flown before. Gusts, drag
        coefficients, the length paid out and the number of segments are not in it.
    cable : (n + 1, 3) ndarray
        Nodes, the end mass first [m].
    tow_point : (3,) ndarray
        Where the smooth path has it [m].
    wind : (3,) ndarray
        That it flies in [m/s].
    wind_known : bool
        False where nobody has told the wind: it flies in still air, and the covariance has none.
    settling : Settling or None
        The newest look-ahead of the present orbit; None where there is none yet.
    losses : dict
        Number of times by `Loss`.
    """

    time: float
    stamp_ns: int
    state: TwinState
    since: float
    valid_from: float
    begun_as: str
    position: np.ndarray
    velocity: np.ndarray
    yaw: float
    covariance: np.ndarray
    cable: np.ndarray
    tow_point: np.ndarray
    wind: np.ndarray
    wind_known: bool
    settling: Settling | None
    losses: dict[Loss, int]

    @property
    def valid(self) -> bool:
        """Whether what it began with is forgotten."""
        return self.state is TwinState.SYNCHRONISED

    @property
    def settles_in(self) -> float:
        """Seconds until the end mass will have settled, 0 once it has; nan where not known."""
        if self.settling is None or np.isnan(self.settling.settles_at):
            return nan
        return max(0.0, self.settling.settles_at - self.time)

    @property
    def look_ahead_age(self) -> float:
        """Seconds since the state that the look-ahead went on from; nan without one."""
        return nan if self.settling is None else self.time - self.settling.begun
