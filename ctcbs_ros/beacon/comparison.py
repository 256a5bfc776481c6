"""What a report of the beacon comes to: skipped, not comparable, measured minus candidates."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ctcbs_ros.beacon.difference import Difference
from ctcbs_ros.telemetry.skip_code import SkipCode


class Unmatched(Enum):
    """Why a believed report of the beacon is not compared with anything."""

    NO_COMMON_TIME = "NO_COMMON_TIME"  # nothing ties the beacon's clock to the aircraft's yet
    NO_COMMON_HEIGHT = "NO_COMMON_HEIGHT"  # no position on Earth with a height as the aircraft's
    NO_AIRCRAFT = "NO_AIRCRAFT"  # no position of the aircraft's on both sides, 2 s apart or less
    LATE = "LATE"  # from before what is remembered of the aircraft
    OUT_OF_REACH = "OUT_OF_REACH"  # farther from the aircraft than the cable is long
    NO_PREDICTION = "NO_PREDICTION"  # the aircraft was there, but nothing was predicted


class Standing(Enum):
    """What a prediction was worth at the time of a report."""

    SETTLED = "settled"  # where the end mass is: what differs is an error
    # So it seemed, but within a quarter of a turn the circle was left, or the log was over.
    UNCONFIRMED = "unconfirmed"
    SETTLING = "settling"  # where it will be: what differs is also the way there
    UNMODELLED = "unmodelled"  # a warning says that the position does not hold
    # Of a simulation alike: nothing is left of what it began with; something is; in a wind that
    # nobody knows.


STANDINGS = tuple(standing.value for standing in Standing)  # from best to worst


@dataclass(frozen=True)
class Comparison:
    """One report of the beacon.

    Attributes
    ----------
    stamp_ns : int
        When it was measured, on the aircraft's clock as far as that is known, else by the beacon's
        own: nanoseconds since the Unix epoch.
    time : float
        The same on the aircraft's clock [s]; nan where not known.
    flight : int
        Of the aircraft; -1 where not known.
    time_by : str
        What tied the clocks, see `BeaconSample`.
    time_sigma : float
        Of `time` [s]; nan where not known.
    outcome : SkipCode, Unmatched or Standing
        Why it was not believed, why not compared, or what the prediction was worth.
    measured : (3,) ndarray or None
        East, north, up in the local frame [m].
    predicted, simulated : Difference or None
        Measured minus the prediction's position, and minus the simulation's.
    simulated_standing : Standing or None
        What the simulation was worth.
    """

    stamp_ns: int
    time: float
    flight: int
    time_by: str
    time_sigma: float
    outcome: SkipCode | Unmatched | Standing
    measured: np.ndarray | None = None
    predicted: Difference | None = None
    simulated: Difference | None = None
    simulated_standing: Standing | None = None

    @property
    def settled(self) -> bool:
        """Whether the difference from the prediction counts as the prediction's error."""
        return self.outcome is Standing.SETTLED

    @property
    def simulated_settled(self) -> bool:
        """Whether the difference from the simulation counts as the simulation's error."""
        return self.simulated_standing is Standing.SETTLED
