"""How long the present orbit has been flown: the end mass takes its time to settle on it."""

from math import nan

from ctcbs_ros.orbit.orbit import Orbit

# Change of radius or speed, over what it was, that makes another orbit to the end mass: as much as
# is left of a disturbance when it counts as settled.
_ANOTHER = 0.05


class TimeOnOrbit:
    """Remembers since when the aircraft has flown the orbit it is on."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """Forget the orbit: the next one is new."""
        self._begun: Orbit | None = None
        self._disturbed = False
        self._since = nan
        self._last_time = nan

    def disturb(self) -> None:
        """From now on the end mass has to settle anew: the cable or its load has changed."""
        self._disturbed = True

    def add(self, orbit: Orbit) -> float:
        """Take in the newest estimate of the orbit.

        Returns
        -------
        float
            Seconds since the orbit now flown began, as far back as its first estimate reaches.
        """
        begun = self._begun
        if begun is None or orbit.start_time > self._last_time:  # reaches no earlier orbit
            self._begun, self._since = orbit, orbit.start_time
        elif (
            self._disturbed
            or _differs(orbit.radius, begun.radius)
            or _differs(orbit.speed, begun.speed)
        ):
            self._begun, self._since = orbit, orbit.time
        self._disturbed = False
        self._last_time = orbit.time
        return orbit.time - self._since


def _differs(value: float, before: float) -> bool:
    return abs(value - before) > _ANOTHER * before
