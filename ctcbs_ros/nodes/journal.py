"""What is worth a line in the node's log: changes of link, orbit and warnings, each told once.

Figures and counts are for /diagnostics; the log is read to learn what happened, and when. What
comes and goes quickly is told once: a warning is over, an orbit left, a link lost only after a
while. The flight's own clock tells the while, so that a flight replayed fast is told alike.
"""

import time
from collections.abc import Callable, Iterable
from math import atan2, degrees, hypot, isfinite, isnan

from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.record import sense_name
from ctcbs_ros.prediction.wind_choice import described
from ctcbs_ros.prediction.wind_reasons import STILL_SOLVED, kind_of_reason
from ctcbs_ros.replay.text import SENSES

# Time off any orbit until it counts as left, and without a warning until that is over [s].
LEFT = 2.0
OVER = 5.0
# Time for which trouble with a link has to last, and between two lines about it [s].
TROUBLE = 1.5
LINK_LINES = 5.0
_COMPASS = (
    "north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west",
)  # fmt: skip
# Told as events, which end by themselves; and NOT_ORBITING as the orbit that was left.
EVENTS = (WarningCode.JUMPED, WarningCode.STALE_TELEMETRY)
# Of what is flown: over, without saying so, where the orbit is left.
TELEMETRY = (WarningCode.BAD_FIX, WarningCode.STALE_TELEMETRY)


class Journal:
    """Writes the log of a node.

    Parameters
    ----------
    logger : rclpy logger
        Or anything with `info`, `warning` and `error`.
    clock : callable
        Seconds of a clock that does not jump.
    """

    def __init__(self, logger, clock: Callable[[], float] = time.monotonic):
        self._logger = logger
        self._clock = clock
        self._silent_since: float | None = None  # by the clock above
        # Vehicle clock of the newest orbit; None where there is none, or it was told to be left.
        self._orbit_at: float | None = None
        # Kind of the reason why the wind is not modelled; None where that does not stand.
        self._because: str | None = None
        # Whether it was told where the end mass is on it: in wind that takes a while.
        self._end_mass_told = False
        # Vehicle clock of each warning that stands: its first time and its newest.
        self._standing: dict[WarningCode, tuple[float, float]] = {}
        self._flight: int | None = None
        self._link = self._link_told = ""
        self._link_since = self._link_told_at = clock() - LINK_LINES
        self._others_told: set[int] = set()

    # --- predictions ----------------------------------------------------------------------------

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self._begin_flight(prediction)
        known = {WarningCode.NOT_ORBITING}
        if prediction.skip is None:
            if self._silent_since is not None:
                self._silent_since = None
                self._logger.info("positions come in")
                known.add(WarningCode.STALE_TELEMETRY)
            self._follow_orbit(prediction)
        for warning in prediction.warnings:
            if warning.code not in known:
                self._tell(warning, prediction.time)
        self._tell_reason(prediction)
        self._end_warnings(prediction.time)

    def _tell_reason(self, prediction: Prediction) -> None:
        """Tell that the search for the motion in the wind has come to nothing, or otherwise."""
        if WarningCode.WIND_UNMODELLED not in self._standing:
            self._because = None
            return
        because = "" if prediction.end_mass is None else prediction.end_mass.unmodelled_because
        kind = kind_of_reason(because)
        if self._because is None:  # told with the warning
            self._because = kind
        elif because not in ("", STILL_SOLVED) and kind != self._because:
            self._because = kind
            for warning in prediction.warnings:
                if warning.code is WarningCode.WIND_UNMODELLED:
                    self._logger.warning(f"{warning.code.value}: {warning.text}")

    def _begin_flight(self, prediction: Prediction) -> None:
        if self._flight not in (None, prediction.flight):
            told = ["a new flight: the vehicle's clock has begun anew", *self._lose_orbit()]
            self._logger.info("; ".join(told))
        self._flight = prediction.flight

    def _tell(self, warning: Warning, now: float) -> None:
        first, _ = self._standing.get(warning.code, (now, now))
        if warning.code not in self._standing:
            text = f"{warning.code.value}: {warning.text}"
            if warning.level is Level.ERROR:  # rclpy wants one severity for each line that logs
                self._logger.error(text)
            else:
                self._logger.warning(text)
        self._standing[warning.code] = first, now

    def _end_warnings(self, now: float) -> None:
        for code, (first, newest) in list(self._standing.items()):
            if now - newest > OVER or now < newest:
                del self._standing[code]
                if code not in EVENTS:
                    stood = newest - first
                    told = f"{stood:.0f} s" if stood >= 0.5 else "less than a second"
                    self._logger.info(f"{code.value} is over, after {told}")

    def _follow_orbit(self, prediction: Prediction) -> None:
        if prediction.orbit is not None:
            if self._orbit_at is None:
                self._logger.info(_orbit_told(prediction))
                self._end_mass_told = _is_known(prediction)
            elif not self._end_mass_told and _is_known(prediction):
                self._logger.info(_end_mass_told(prediction))
                self._end_mass_told = True
            self._orbit_at = prediction.time
        elif self._orbit_at is not None and prediction.time - self._orbit_at > LEFT:
            self._orbit_at = None
            reasons = [w.text for w in prediction.warnings if w.code is WarningCode.NOT_ORBITING]
            self._logger.info("; ".join(["orbit left", *reasons]))
            for code in [code for code in self._standing if code not in TELEMETRY]:
                del self._standing[code]

    def _lose_orbit(self) -> list[str]:
        """Forget orbit and warnings, of which nothing more is known; what that was."""
        told = [] if self._orbit_at is None else ["orbit lost"]
        codes = [code.value for code in self._standing if code not in EVENTS]
        if codes:
            told.append(f"no longer warned of {', '.join(codes)}")
        self._orbit_at = None
        self._standing.clear()
        return told

    # --- the source -----------------------------------------------------------------------------

    def silence(self, warning: Warning | None) -> None:
        """Take in whether positions fail to come; told when that begins, and what it ends."""
        if warning is None:
            return
        if self._silent_since is None:
            self._silent_since = self._clock()
            self._logger.warning(f"{warning.code.value}: {warning.text}")
        elif self._clock() - self._silent_since > OVER and (told := self._lose_orbit()):
            self._logger.info("; ".join(["as no position comes", *told]))

    def link(self, state: str) -> None:
        """Take in the state of a live link, see `LiveSource.state`."""
        kind, now = state.partition(" for ")[0], self._clock()
        if kind != self._link:
            self._link, self._link_since = kind, now
        if kind == self._link_told or now - self._link_told_at < LINK_LINES:
            return
        if kind.startswith("up: "):
            self._logger.info(f"link: {state}")
        elif now - self._link_since > TROUBLE:
            self._logger.warning(f"link: {state}")
        else:
            return
        self._link_told, self._link_told_at = kind, now

    def others(self, systems: Iterable[int], followed: int, with_beacon: bool) -> None:
        """Take in the MAVLink systems whose positions are not used, and that which is followed."""
        for system in sorted(set(systems) - self._others_told - {followed}):
            self._others_told.add(system)
            hint = "" if with_beacon else (
                f"; if it is the payload's beacon, set beacon.system_id: {system}"
            )
            self._logger.info(f"positions of system {system} come too, and are not used{hint}")


def _is_known(prediction: Prediction) -> bool:
    """Whether there is an end mass to tell of, in a wind or its absence that is known."""
    return prediction.pose_holds and prediction.wind is not None


def _orbit_told(prediction: Prediction) -> str:
    orbit = prediction.orbit
    text = (
        f"orbit: radius {orbit.radius:.1f} m, {orbit.speed:.1f} m/s over the ground, "
        f"{SENSES[sense_name(orbit.sense)]}"
    )
    if prediction.end_mass is None:
        return f"{text}; no prediction"
    return f"{text}; {_end_mass_told(prediction)}"


def _end_mass_told(prediction: Prediction) -> str:
    """Where the end mass goes: in wind about which place, otherwise on which circle."""
    end_mass, wind = prediction.end_mass, prediction.wind
    time = f"{end_mass.settling_time:.0f} s"
    if isnan(end_mass.settling_time):
        time = f"when is {end_mass.margin.of.value}"
    settled = f"once settled ({time})"
    circle = f"on a circle of {end_mass.state.radius:.1f} m, {end_mass.state.depth:.1f} m below"
    if not end_mass.holds:
        return f"end mass not predicted in this wind; in still air {circle}, {settled}"
    if wind is None:
        return f"end mass predicted for still air, the wind is not known: {circle}, {settled}"
    if end_mass.in_wind is None or not wind.speed > wind.sigma:
        return f"end mass predicted {circle}, {settled}"
    off = end_mass.circle_center - prediction.orbit.center
    lowest = end_mass.lowest_height_above_home
    return (
        f"end mass predicted in wind {described(wind)}, about a place "
        f"{hypot(off[0], off[1]):.1f} m {_bearing(off)} of the circle's centre and "
        f"{-off[2]:.1f} m below, up to {end_mass.excursion:.1f} m from there, "
        + (f"lowest {lowest:.1f} m above home or set ground, " if isfinite(lowest) else "")
        + settled
    )


def _bearing(off) -> str:
    """The point of the compass that an offset towards east and north is nearest to."""
    return _COMPASS[round(degrees(atan2(off[0], off[1])) / 45.0) % 8]
