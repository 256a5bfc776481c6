"""What is remembered from one orbit to the next: the state flown, its margin, its jumps.

A history ends where nothing is left of how the end mass moved before: after straight flight, in
the other sense of rotation, after a long silence. The next orbit is then a first acquisition.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction.branch import BranchTracker, Tracked
from ctcbs_ros.prediction.jumps import JumpFinder
from ctcbs_ros.prediction.margin import Margins
from ctcbs_ros.prediction.prediction import Jump
from ctcbs_ros.prediction.straight_flight import StraightFlight
from ctcbs_ros.prediction.time_on_orbit import TimeOnOrbit
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.stability import Stability


class History:
    """Follows the end mass from orbit to orbit, and knows when there is nothing to follow."""

    def __init__(self):
        self._tracker = BranchTracker()
        self._jumps = JumpFinder()
        self._margins = Margins()
        self._straight = StraightFlight()
        self._time_on_orbit = TimeOnOrbit()
        self._sense = 0

    def end(self) -> None:
        """Begin a new history: nothing is left of how the end mass moved before."""
        self._tracker.reset()
        self._jumps.reset()
        self._margins.reset()
        self._straight.reset()
        self._time_on_orbit.reset()
        self._sense = 0

    def flown_without_orbit(self, position, cable_length: float) -> None:
        """Take in a position (east, north, up [m]) off any orbit; straight flight ends it all."""
        if self._straight.add(position, cable_length):
            self.end()

    def flown_on_orbit(self, orbit: Orbit) -> float:
        """Take in an orbit; one in the other sense than before begins a new history.

        Returns
        -------
        float
            See `TimeOnOrbit.add`.
        """
        self._straight.reset()
        if orbit.sense == -self._sense:
            self.end()
        self._sense = orbit.sense
        return self._time_on_orbit.add(orbit)

    def disturb(self) -> None:
        """From now on the end mass has to settle anew: the cable or its load has changed."""
        self._time_on_orbit.disturb()

    def track(self, parameters: Parameters, guesses: Sequence[float] | None) -> Tracked:
        """The state flown at the present parameters; see `BranchTracker.update`."""
        tracked = self._tracker.update(parameters, guesses)
        if tracked.state is None or tracked.jumps:
            self._jumps.reset()
        return tracked

    def outlook(self, tracked: Tracked, may_end: bool) -> "Outlook":
        """How stable the tracked states are, and where the branch flown ends.

        Parameters
        ----------
        tracked : Tracked
            With a state.
        may_end : bool
            See `JumpFinder.update`.
        """
        jumps = self._jumps.update(tracked.state, may_end)
        flown, *others = self._margins.update((tracked.state, *tracked.others))
        return Outlook(flown, tuple(others), jumps["angular_rate"], jumps["radius"])


@dataclass(frozen=True)
class Outlook:
    """Stability and jumps of a tracked state.

    Attributes
    ----------
    stability : Stability
        Of the state flown.
    of_others : tuple of Stability
        Of the other states, in their order.
    in_angular_rate, in_radius : Jump or None
        Relative to the present flight, see `JumpFinder.update`.
    """

    stability: Stability
    of_others: tuple[Stability, ...]
    in_angular_rate: Jump | None
    in_radius: Jump | None
