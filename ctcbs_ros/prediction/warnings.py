"""When each warning is due, and what it says: one line an engineer can act on."""

from math import hypot, inf, isfinite, nan

from ctcbs_ros.configuration import Cable, Envelope, WarningLimits
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import CLIMATE, Wind, WindSource
from ctcbs_ros.prediction.branch import Tracked
from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.prediction import EndMass, EndMassState, Jump, Margin, MarginOf
from ctcbs_ros.prediction.wind_choice import described
from ctcbs_ros.telemetry.skip_code import SKIPS, SkipCode

GROUND_NOT_JUDGED = "nor are its stability and its height above the ground judged"
WIND_NOT_KNOWN = (
    "wind is not known; the position is that of still air, its covariance has winds of "
    f"{CLIMATE:g} m/s along each axis"
)
# Share of the tow radius that such winds leave of a position's use, one standard deviation.
_OF_LITTLE_USE = 0.5
MARGIN_NOT_KNOWN = (
    "whether the motion in this wind is stable is not known, nor how soon it settles"
)
# Speed of the air past the circle, over that along it, from which the prediction for still air is
# not to be used, and the wind's standard deviation from which one cannot tell. An end mass hangs
# up to a dozen times that share of the tow radius downwind.
_WINDY = 0.005
_UNSURE = 0.03
# Standard deviations of the orbit to a fold below which it may have been passed.
_SURELY_BEFORE = 3.0

_SOURCES = {
    WindSource.AUTOPILOT: "the autopilot",
    WindSource.FLIGHT: "the flight",
    WindSource.PARAMETER: "parameters",
}
_OF_TIME = (SkipCode.DUPLICATE, SkipCode.OUT_OF_ORDER, SkipCode.AHEAD)


def _warn(code: WarningCode, text: str) -> Warning:
    return Warning(code, Level.WARN, text)


def _error(code: WarningCode, text: str) -> Warning:
    return Warning(code, Level.ERROR, text)


def skip_warnings(skip: SkipCode) -> tuple[Warning, ...]:
    """BAD_FIX where a sample was skipped for what it says, not for when it came."""
    if skip in _OF_TIME:
        return ()
    text = f"position not believed ({skip.value}: {SKIPS[skip]})"
    return (_warn(WarningCode.BAD_FIX, text),)


def track_broken() -> Warning:
    """BAD_FIX where position, velocity and time have ceased to fit those of the samples before."""
    return _warn(
        WarningCode.BAD_FIX,
        "the position stepped against the velocity: the orbit is estimated anew",
    )


def stale_telemetry(seconds: float, limits: WarningLimits, over: bool) -> Warning | None:
    """STALE_TELEMETRY after a time without a sample [s], be it over now or not."""
    if seconds <= limits.stale_after:
        return None
    words = "a gap without positions, of" if over else "no position for"
    return _error(
        WarningCode.STALE_TELEMETRY, f"{words} {seconds:.1f} s (limit {limits.stale_after:g} s)"
    )


def not_orbiting(reason: str) -> Warning:
    """NOT_ORBITING, with the estimator's reason."""
    return _warn(WarningCode.NOT_ORBITING, reason)


def envelope_warnings(radius: float, speed: float, envelope: Envelope) -> list[Warning]:
    """OUTSIDE_ENVELOPE for each of tow radius [m] and speed [m/s] outside what was planned."""
    found = []
    for name, value, (low, high), unit in (
        ("tow radius", radius, envelope.radius, "m"),
        ("speed", speed, envelope.speed, "m/s"),
    ):
        if not low <= value <= high:
            found.append(
                _warn(
                    WarningCode.OUTSIDE_ENVELOPE,
                    f"{name} {value:.1f} {unit} is outside {low:g} to {high:g} {unit}",
                )
            )
    return found


def is_windy(wind: Wind | None, orbit: Orbit) -> bool:
    """Whether the air is known to move past the circle, or may well do by what is known of it."""
    if wind is None:
        return False
    past = hypot(*(wind.velocity - orbit.drift))
    return past > _WINDY * orbit.speed or wind.sigma > _UNSURE * orbit.speed


def is_told_from_none(wind: Wind, orbit: Orbit) -> bool:
    """Whether the air is known to move past the circle: by more than it is known to."""
    return hypot(*(wind.velocity - orbit.drift)) > max(wind.sigma, _WINDY * orbit.speed)


def wind_warnings(
    wind: Wind | None, orbit: Orbit, reason: str = "", spread: float = 0.0
) -> list[Warning]:
    """WIND_UNMODELLED where the air moves past the circle, or nobody knows whether it does.

    For predictions in still air, with the reason why they are, if there is one, and by how much a
    wind that nobody knows spreads the end mass [m].

    A circle that drifts with the air is one in still air to the aircraft and what it tows.
    """
    if wind is None:
        text = WIND_NOT_KNOWN
        if spread > _OF_LITTLE_USE * orbit.radius:
            text += ", more than half the tow radius: of little use until the wind is known"
        return [_warn(WarningCode.WIND_UNMODELLED, text)]
    if is_windy(wind, orbit):
        past = hypot(*(wind.velocity - orbit.drift))
        by = f"by {_SOURCES[wind.source]}" + (f": {wind.note}" if wind.note else "")
        circle = f", {past:.1f} m/s past a drifting circle" if orbit.drift.any() else ""
        text = (
            f"wind {described(wind)}, +- {wind.sigma:.1f} m/s ({by}){circle}; "
            + (f"{reason}; " if reason else "")
            + f"the position holds in still air only: do not use it, {GROUND_NOT_JUDGED}"
        )
        return [_warn(WarningCode.WIND_UNMODELLED, text)]
    return []


def no_solution(reason: str) -> Warning:
    """NO_SOLUTION, with the reason."""
    return _error(WarningCode.NO_SOLUTION, reason)


def tracking_warnings(tracked: Tracked, tow_radius: float) -> list[Warning]:
    """NO_SOLUTION and JUMPED; the tow radius in metres."""
    if tracked.state is None:
        return [no_solution(tracked.reason or "no steady state at this orbit")]
    if tracked.jumps:
        radius = tow_radius * tracked.state.end_mass_radius
        text = f"the branch flown has ended: the end mass jumps to a circle of {radius:.1f} m"
        return [_error(WarningCode.JUMPED, text)]
    return []


def end_mass_warnings(end_mass: EndMass, cable: Cable, limits: WarningLimits) -> list[Warning]:
    """All that is to be said of the end mass itself, from MULTIPLE_SOLUTIONS on."""
    found = []
    if end_mass.others:
        found.append(_warn(WarningCode.MULTIPLE_SOLUTIONS, _states_told(end_mass)))
    if end_mass.holds:
        found += stability_warnings(end_mass.margin, limits)
    found += jump_warnings(
        end_mass.jump_in_speed, end_mass.jump_in_radius, limits, end_mass.fold_distance,
        in_a_wind=end_mass.in_wind is not None or not end_mass.holds,
    )
    found += tension_warnings(end_mass.state.greatest_tension, cable, limits)
    return found + ground_warnings(end_mass.lowest_height_above_home, limits)


def stability_warnings(margin: Margin, limits: WarningLimits) -> list[Warning]:
    """UNSTABLE, or else LOW_MARGIN; MARGIN_UNKNOWN where that cannot be told.

    None while the margin is still being computed, some seconds; nor in a wind the motion in which
    is not known, which WIND_UNMODELLED tells.
    """
    if margin.of is MarginOf.NOT_KNOWN:
        because = f": {margin.because}" if margin.because else ""
        return [_warn(WarningCode.MARGIN_UNKNOWN, MARGIN_NOT_KNOWN + because)]
    if not margin.known:
        return []
    where = " in this wind" if margin.of is MarginOf.WIND else ""
    if not margin.stable:
        text = f"{margin.nearest_loss}{where}: disturbances grow at {-margin.per_second:.3g} 1/s"
        return [_error(WarningCode.UNSTABLE, text)]
    if margin.per_second < limits.low_margin_per_s:
        text = (
            f"disturbances decay at only {margin.per_second:.3g} 1/s{where} "
            f"(limit {limits.low_margin_per_s:g} 1/s)"
        )
        if margin.nearest_loss is not None:
            text += f"; nearest loss: {margin.nearest_loss}"
        return [_warn(WarningCode.LOW_MARGIN, text)]
    return []


def jump_warnings(
    in_speed: Jump | None, in_radius: Jump | None, limits: WarningLimits,
    fold_distance: float = inf, in_a_wind: bool = False,
) -> list[Warning]:
    """NEAR_JUMP, of the nearer of two jumps; the distance is in the orbit's deviations.

    The jumps are those of still air, which is told `in_a_wind`.
    """
    # Both are ways of changing the angular rate: by speed at this radius, by radius at this speed.
    jumps = [
        (abs(jump.relative), text.format(jump.at, jump.relative), jump.landing_radius)
        for jump, text in (
            (in_speed, "a speed of {:.1f} m/s ({:+.1%})"),
            (in_radius, "a tow radius of {:.1f} m ({:+.1%})"),
        )
        if jump is not None
    ]
    distance, where, landing = min(jumps, default=(inf, "", nan))
    if not (distance < limits.near_jump or (jumps and fold_distance < _SURELY_BEFORE)):
        return []
    onto = f"a circle of {landing:.0f} m" if isfinite(landing) else "no stable state"
    text = f"at {where} the end mass jumps to {onto}"
    if fold_distance < _SURELY_BEFORE:
        text += (
            f"; only {fold_distance:.1f} standard deviations of the orbit away, it may have "
            "happened"
        )
    if in_a_wind:
        text += "; so it is in still air, in this wind it is not known"
    return [_warn(WarningCode.NEAR_JUMP, text)]


def tension_warnings(tension: float, cable: Cable, limits: WarningLimits) -> list[Warning]:
    """TENSION_LIMIT, by the greatest tension in the cable [N]."""
    if tension <= limits.tension_fraction * cable.breaking_tension:
        return []
    breaking = f"the breaking tension {cable.breaking_tension:g} N"
    if tension <= cable.breaking_tension:
        breaking = f"{100.0 * limits.tension_fraction:.0f} % of {breaking}"
    text = f"tension {tension:.1f} N is above {breaking}"
    return [_error(WarningCode.TENSION_LIMIT, text)]


def ground_warnings(height: float, limits: WarningLimits) -> list[Warning]:
    """GROUND_PROXIMITY, by the height above home or the set ground [m]; none where it is nan."""
    if not height < limits.minimum_height:
        return []
    ground = "home" if not isfinite(limits.ground_level_amsl) else "the ground"
    text = (
        f"end mass {abs(height):.0f} m {'above' if height >= 0.0 else 'BELOW'} {ground} "
        f"(limit {limits.minimum_height:g} m above)"
    )
    return [_error(WarningCode.GROUND_PROXIMITY, text)]


def _states_told(end_mass: EndMass) -> str:
    """Radius and stability of the state flown and of the others."""
    others = ", ".join(_state_told(other) for other in end_mass.others)
    return (
        f"on branch '{end_mass.branch}', circle of {_state_told(end_mass.state)}; other steady "
        f"states of this orbit: {others}"
    )


def _state_told(state: EndMassState) -> str:
    return f"{state.radius:.1f} m ({'stable' if state.stable else 'unstable'})"
