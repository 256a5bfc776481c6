"""The summary of a flight in words."""

from collections.abc import Iterator
from math import hypot
from typing import Any

from ctcbs_ros.beacon.comparison import Standing, Unmatched
from ctcbs_ros.beacon.reach import LENGTH_HINT, share_out_of_reach
from ctcbs_ros.orbit.segments import LEAST_TURNS
from ctcbs_ros.prediction.codes import WarningCode
from ctcbs_ros.prediction.prediction import MarginOf
from ctcbs_ros.prediction.warnings import skip_warnings
from ctcbs_ros.replay.motion_kind import IN_WIND, STILL_AIR, UNKNOWN, UNMODELLED
from ctcbs_ros.telemetry.skip_code import SKIPS, SkipCode
from ctcbs_ros.twin.look_ahead import Ending

# Of the tow radius: a place so near to the circle's centre is told as that.
_AT_CENTRE = 0.02
WARNINGS = {
    WarningCode.NOT_ORBITING: "no circle is being flown, so nothing is predicted",
    WarningCode.STALE_TELEMETRY: "a gap in the telemetry",
    WarningCode.BAD_FIX: "a position was not believed",
    WarningCode.OUTSIDE_ENVELOPE: "radius or speed outside the configuration's envelope",
    WarningCode.NO_SOLUTION: "the orbit has no steady state of the cable",
    WarningCode.MULTIPLE_SOLUTIONS: "the orbit has several steady states",
    WarningCode.NEAR_JUMP: "a small change of the orbit makes the end mass jump",
    WarningCode.JUMPED: "the end mass has jumped to another steady state",
    WarningCode.UNSTABLE: "the steady state is unstable",
    WarningCode.LOW_MARGIN: "disturbances decay slowly",
    WarningCode.MARGIN_UNKNOWN: "how stable the motion in the wind is is not known",
    WarningCode.TENSION_LIMIT: "tension above the allowed share of the breaking tension",
    WarningCode.GROUND_PROXIMITY: "the end mass is below the least height allowed",
    WarningCode.WIND_UNMODELLED: "the prediction is for still air",
}
UNMATCHED = {
    Unmatched.NO_COMMON_TIME: "nothing ties its clock to the aircraft's yet",
    Unmatched.NO_COMMON_HEIGHT: "no position with a height of the aircraft's kind",
    Unmatched.NO_AIRCRAFT: "no positions of the aircraft before and after it within 2 s",
    Unmatched.LATE: "it came more than 10 s late",
    Unmatched.OUT_OF_REACH: "farther from the aircraft than the cable is long",
    Unmatched.NO_PREDICTION: "nothing was predicted then",
}
STANDINGS = {
    "predicted": {
        Standing.SETTLED: "predicted, settled",
        Standing.UNCONFIRMED: "predicted, unconfirmed",
        Standing.SETTLING: "predicted, still settling",
        Standing.UNMODELLED: "predicted, wind unmodelled",
    },
    "simulated": {
        Standing.SETTLED: "simulated, synchronised",
        Standing.SETTLING: "simulated, from a guess",
        Standing.UNMODELLED: "simulated, wind not known",
    },
}
# Reports of the beacon from which their share in the stated 95 % tells something.
_ENOUGH = 20
SENSES = {"cw": "clockwise", "ccw": "anticlockwise"}


def summary_text(summary: dict[str, Any]) -> str:
    """Orbits, warnings and skips of a summary, for reading."""
    return "\n".join(_lines(summary))


def _lines(summary: dict[str, Any]) -> Iterator[str]:
    skipped = sum(summary["skipped"].values())
    vehicle = summary["vehicle"]
    if vehicle:
        yield (
            f"Vehicle: {vehicle['type']}, system {vehicle['system']}, "
            f"component {vehicle['component']}"
        )
    yield (
        f"{_counted(summary['samples'], 'sample')}, {skipped} of them skipped; "
        f"{_counted(summary['predictions'], 'prediction')}; replayed in {summary['wall_s']:.1f} s"
    )
    yield from _link_lines(summary)
    if summary["start"]["vehicle_time_s"] is not None:
        yield (
            "Seconds below are from the first believed sample, at "
            f"{summary['start']['vehicle_time_s']:.1f} s of the vehicle's clock."
        )
    yield ""
    yield from _orbit_lines(summary["orbits"], summary["predictions"])
    outside = summary["predictions_outside_orbits"]
    if summary["orbits"] and outside:
        first, last = summary["outside_orbits_s"]
        yield (
            f"Some {_counted(outside, 'prediction')} are of arcs elsewhere in the flight, from "
            f"{first:.0f} s to {last:.0f} s, too short for an orbit of the table."
        )
    rejected = summary["autopilot_wind_rejected"]
    if rejected["samples"]:
        yield (
            f"The autopilot's wind was rejected at {_counted(rejected['samples'], 'sample')}, as "
            f"the flight shows another; at last it was {rejected['newest']}."
        )
    texts = {code.value: text for code, text in WARNINGS.items()}
    texts[WarningCode.BAD_FIX.value] = _bad_fix(summary)
    wind = WarningCode.WIND_UNMODELLED
    seen, all_told = summary["wind_seen"], summary["warnings"].get(wind.value, 0)
    texts[wind.value] = f"{_wind(seen, all_told - seen)}; {WARNINGS[wind]}"
    yield from _count_lines("Warnings (samples with each)", summary["warnings"], texts)
    if summary["wind_unmodelled_because"]:
        yield ""
        yield "Wind without the motion in it, so no pose and no ground judged (predictions):"
        for because, count in summary["wind_unmodelled_because"].items():
            yield f"{count:8}  {because}"
    yield from _count_lines(
        "Skipped samples",
        summary["skipped"],
        {code.value: text for code, text in SKIPS.items()},
    )
    if summary.get("beacon"):
        yield from _beacon_lines(summary["beacon"])


def _link_lines(summary: dict[str, Any]) -> Iterator[str]:
    link = summary["link"]
    facts = [
        (link["lost"], "message", " lost"),
        (link["repeated"], "message", " received again"),
        (link["bad_bytes"], "damaged byte", f" in {_counted(link['bad_runs'], 'place')}"),
        (link["other_positions"], "position", _of_others(summary)),
        (link["time_steps"].get("wrap"), "wrap", " of the vehicle's clock"),
        (link["time_steps"].get("reboot"), "reboot", ""),
        (link["time_steps"].get("jump"), "jump", " of the vehicle's clock"),
    ]
    told = [_counted(count, noun) + more for count, noun, more in facts if count]
    if told:
        yield f"Link: {_counted(link['messages'], 'message')}; " + ", ".join(told)


def _of_others(summary: dict[str, Any]) -> str:
    """Whose positions were not used; where one might be the payload's beacon, how to say so."""
    systems = summary["link"]["other_systems"]
    told = f" of other vehicles (system {', '.join(systems)}"
    if summary["vehicle"] is not None:
        others = [name for name in systems if int(name) != summary["vehicle"]["system"]]
        if others and summary.get("beacon") is None:
            told += f"; if it is the payload's beacon, set beacon.system_id: {others[0]}"
    return f"{told})"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _bad_fix(summary: dict[str, Any]) -> str:
    """What BAD_FIX was for: samples skipped, and samples that were used after a break."""
    skipped = sum(n for code, n in summary["skipped"].items() if skip_warnings(SkipCode(code)))
    stepped = summary["warnings"].get(WarningCode.BAD_FIX.value, 0) - skipped
    if not stepped:
        return WARNINGS[WarningCode.BAD_FIX]
    used = f"used after a step, with the orbit begun anew ({stepped})"
    return f"{WARNINGS[WarningCode.BAD_FIX]} ({skipped}), or {used}" if skipped else (
        f"a position was {used}"
    )


def _wind(seen: int, unknown: int) -> str:
    if seen and unknown:
        return f"there is wind, or may be ({seen}), or it is not known ({unknown})"
    return "there is wind, or may be" if seen else "wind is not known"


def _orbit_lines(orbits: list[dict[str, Any]], predictions: int) -> Iterator[str]:
    if not orbits:
        shorter = "; the predictions are of shorter arcs" if predictions else ""
        yield f"No orbit of {LEAST_TURNS:g} turns or more was flown{shorter}."
        return
    yield (
        "                                          ground speed                 "
        "end mass, once settled"
    )
    yield (
        "orbit   from s     to s  turns  radius m           m/s  sense          "
        "radius m   depth m  margin 1/s  settles in s"
    )
    for number, orbit in enumerate(orbits, 1):
        yield (
            f"{number:5}  {orbit['start_s']:7.1f}  {orbit['end_s']:7.1f}  {orbit['turns']:5.2f}  "
            f"{orbit['radius_m']:8.2f}  {orbit['speed_m_s']:12.2f}  {SENSES[orbit['sense']]:13}  "
            f"{_end_mass(orbit)}"
        )
    yield (
        "From, to: where the track came onto the circle and left it, as seen afterwards; "
        "predictions begin when half a turn has shown it, and may end a quarter of a turn late."
    )
    left = [number for number, orbit in enumerate(orbits, 1) if not _settled(orbit)]
    if left:
        yield (
            f"Left or changed before the end mass counted as settled: {_orbits(left)}. It need "
            "not have been where it is predicted then."
        )
    for number, orbit in enumerate(orbits, 1):
        if orbit["wind_source"] is not None:
            direction = orbit["wind_from_deg"]
            origin = "" if direction is None else f" from {round(direction) % 360} deg"
            yield (
                f"Wind at the end of orbit {number}: {orbit['wind_speed_m_s']:.1f} +- "
                f"{orbit['wind_std_m_s']:.1f} m/s{origin}, by the {orbit['wind_source']}"
                + (", not told from none" if orbit["end_mass_motion"] == STILL_AIR else "")
            )
        if orbit["end_mass_motion"] == IN_WIND:
            yield f"In it, once settled: end mass of orbit {number} {_in_wind(orbit)}"
        elif orbit["end_mass_horizontal_std_m"] is not None:
            told = f"{_spread(orbit)}, {_spread_of(orbit)}"
            yield f"End mass of orbit {number}, once settled: {told}"
    yield from _motion_lines(orbits)
    for number, orbit in enumerate(orbits, 1):
        if orbit["simulated_moments"]:
            settled = "both settled" if orbit["simulated_settled"] else "not both settled yet"
            yield (
                f"Simulated beside predicted end mass on orbit {number}, {settled}: "
                f"{orbit['simulated_apart_m']:.1f} m apart, "
                f"{orbit['simulated_apart_greatest_m']:.1f} m at most, at "
                f"{_counted(orbit['simulated_moments'], 'moment')}; {_expected_apart(orbit)}"
            )
        if orbit["ahead_ending"] is not None:
            at = f"{orbit['ahead_told_at_s']:.0f} s, on orbit {number} as it was then"
            yield f"The simulation looks ahead, at {at}: {_ahead(orbit)}"


def _expected_apart(orbit: dict[str, Any]) -> str:
    if orbit["simulated_apart_std"] is None:
        return "a wind that nobody knows moves both alike"
    expected = orbit["simulated_apart_m"] / max(orbit["simulated_apart_std"], 1e-9)
    return f"about {expected:.1f} m are to be expected of their stated errors"


def _ahead(orbit: dict[str, Any]) -> str:
    """When the simulation has the end mass settled, beside when the margin has."""
    if orbit["ahead_settles_at_s"] is None:
        return {
            Ending.OSCILLATES.value: "the end mass keeps oscillating",
            Ending.UNDECIDED.value: "it is not decided where the end mass settles",
        }.get(orbit["ahead_ending"], "not known")
    at = orbit["ahead_settles_at_s"]
    told = (
        f"within 5 % of the tow radius of where it settles from {at:.0f} s on"
        + (" (had the circle been flown on)" if at > orbit["end_s"] else "")
        + f", {orbit['ahead_radius_m']:.0f} m around {_place_ahead(orbit)}, "
        f"{orbit['ahead_depth_m']:.0f} m below the circle"
    )
    if orbit["settled_at_s"] is None:
        return f"{told}; by the margin it never counted as settled"
    return f"{told}; by the margin it counted as settled from {orbit['settled_at_s']:.0f} s on"


def _place_ahead(orbit: dict[str, Any]) -> str:
    east, north = orbit["ahead_east_m"], orbit["ahead_north_m"]
    if hypot(east, north) < _AT_CENTRE * orbit["radius_m"]:
        return "the circle's centre"
    return _place((east, "east", "west"), (north, "north", "south"))


def _place(*offsets: tuple[float, str, str], seen: str = "") -> str:
    """A place beside the circle's centre; what rounds to no metre is left out."""
    told = [_toward(*offset) for offset in offsets if round(abs(offset[0])) > 0]
    return f"a place {' and '.join(told)}{seen} of the circle's centre" if told else (
        "the circle's centre"
    )


def _end_mass(orbit: dict[str, Any]) -> str:
    """The columns of the end mass; in brackets where they do not hold."""
    margin, settling = orbit["margin_per_s"], orbit["settling_time_s"]
    there = orbit["end_mass_radius_m"] is not None
    unknown = "not known" if there else "none"
    cells = [
        (orbit["end_mass_radius_m"], 8, 2, "none"),
        (orbit["end_mass_depth_m"], 8, 2, "none"),
        (margin, 10, 4, unknown),
        (settling, 12, 0, unknown if margin is None else "never"),
    ]
    brackets = orbit["end_mass_motion"] == UNMODELLED
    told = [_number(*cell, brackets=brackets) for cell in cells]
    if orbit["end_mass_motion"] == IN_WIND:
        told[:2] = ["in wind, see below"]
    return "  ".join(told)


def _in_wind(orbit: dict[str, Any]) -> str:
    """Where the end mass of an orbit is in its wind."""
    if orbit["end_mass_downwind_m"] is not None:
        place = _place(
            (orbit["end_mass_downwind_m"], "downwind", "upwind"),
            (orbit["end_mass_crosswind_m"], "to the left", "to the right"),
            seen=" (as one looks downwind)",
        )
    else:
        place = _place(
            (orbit["end_mass_east_m"], "east", "west"),
            (orbit["end_mass_north_m"], "north", "south"),
        )
    lowest = orbit["end_mass_lowest_above_home_m"]
    return (
        f"about {place}, up to {orbit['end_mass_excursion_m']:.0f} m from there, "
        f"{_depths(orbit)} m below the circle"
        + ("" if lowest is None else f", lowest {_height(lowest)} home or set ground")
        + f"; {_spread(orbit)}"
    )


def _spread_of(orbit: dict[str, Any]) -> str:
    if orbit["end_mass_motion"] == UNKNOWN:
        return "most of it by the wind that nobody knows"
    return "by the orbit's and the wind's errors"


def _depths(orbit: dict[str, Any]) -> str:
    least = f"{orbit['end_mass_least_depth_m']:.0f}"
    greatest = f"{orbit['end_mass_greatest_depth_m']:.0f}"
    return least if least == greatest else f"{least} to {greatest}"


def _spread(orbit: dict[str, Any]) -> str:
    """How well the end mass's place is known, whatever its motion is of."""
    sigma = orbit["end_mass_horizontal_std_m"]
    return f"+- {sigma:.0f} m (1 sigma, along the worse horizontal axis)"


def _toward(distance: float, positive: str, negative: str) -> str:
    return f"{abs(distance):.0f} m {positive if distance >= 0.0 else negative}"


def _height(height: float) -> str:
    return _toward(height, "above", "BELOW")


def _motion_lines(orbits: list[dict[str, Any]]) -> Iterator[str]:
    """What holds of the end masses' figures, and what does not."""
    windy = [n for n, orbit in enumerate(orbits, 1) if orbit["end_mass_motion"] == IN_WIND]
    known = [n for n in windy if orbits[n - 1]["margin_of"] == MarginOf.WIND.value]
    if known:
        yield f"Margin and settling time on {_orbits(known)} are those of the motion in the wind."
    yet = [n for n in windy if orbits[n - 1]["margin_of"] == MarginOf.NOT_YET.value]
    if yet:
        yield (
            f"How stable the motion in the wind is on {_orbits(yet)} was not known yet when "
            "it was left."
        )
    others = [n for n in windy if n not in known and n not in yet]
    if others:
        yield f"How stable the motion in the wind is on {_orbits(others)} is not known."
    bad = [n for n, orbit in enumerate(orbits, 1) if orbit["end_mass_motion"] == UNMODELLED]
    if bad:
        yield (
            f"In brackets: figures of still air, which do not hold on {_orbits(bad)}: there is "
            "wind, and the motion in it is not known."
        )
    unknown = [n for n, orbit in enumerate(orbits, 1) if orbit["end_mass_motion"] == UNKNOWN]
    if unknown:
        yield (
            f"Nobody knew the wind on {_orbits(unknown)}: the end mass's figures hold if there "
            "was none."
        )
    for number, orbit in enumerate(orbits, 1):
        share = orbit["wind_unmodelled_share"] or 0.0
        if share >= 0.01 and orbit["end_mass_motion"] != UNMODELLED:
            yield (
                f"In {100.0 * share:.0f} % of the predictions on orbit {number} the motion in its "
                "wind was not known, or not yet."
            )


def _settled(orbit: dict[str, Any]) -> bool:
    """Whether the end mass counted as settled on an orbit; True where it has no state."""
    return orbit["end_mass_radius_m"] is None or orbit["settled_at_s"] is not None


def _orbits(numbers: list[int]) -> str:
    return f"orbit{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"


def _number(
    value: float | None, width: int, decimals: int, without: str, brackets: bool = False
) -> str:
    """A column, with other words where there is no value."""
    told = without if value is None else f"{value:.{decimals}f}"
    return (f"({told})" if brackets and value is not None else told).rjust(width)


def _beacon_lines(beacon: dict[str, Any]) -> Iterator[str]:
    vehicle, tied = beacon["vehicle"], ", ".join(beacon["times_by"])
    name = f" (system {vehicle['system']}, component {vehicle['component']})" if vehicle else ""
    skipped, apart = sum(beacon["skipped"].values()), sum(beacon["not_compared"].values())
    yield ""
    yield (
        f"Beacon of the payload{name}: {_counted(beacon['reports'], 'report')}, {skipped} of them "
        f"skipped, {apart} not compared with the prediction"
        + (f"; its clock is tied by {tied}" if tied else "")
    )
    share = share_out_of_reach(_outcomes(beacon))
    if share is not None:
        yield (
            f"{100 * share:.0f} % of them are farther from the aircraft than the cable is long: "
            f"{LENGTH_HINT}."
        )
    figures = {
        text: beacon[f"measured_minus_{candidate}"][standing.value]
        for candidate, texts in STANDINGS.items()
        for standing, text in texts.items()
    }
    figures = {text: found for text, found in figures.items() if found["count"]}
    if figures:
        yield (
            "Measured minus                    mean m                +- (1 sigma) m"
            "           rms m   95 % within m   in stated"
        )
        yield (
            "                            count    east   north      up   east  north     up"
            "  horiz.    up  horiz.    up   95 %"
        )
    for text, found in figures.items():
        mean = "".join(f"{value:8.2f}" for value in found["mean_m"])
        mean += "".join(f"{value:7.2f}" for value in found["mean_std_m"])
        yield (
            f"  {text:26}{found['count']:5}{mean}{found['rms_horizontal_m']:8.2f}"
            f"{found['rms_up_m']:6.2f}{found['horizontal_95_m']:8.2f}{found['vertical_95_m']:6.2f}"
            f"{100 * found['share_inside_95']:7.1f} %"
        )
    settled = beacon["measured_minus_predicted"][Standing.SETTLED.value]
    if settled["count"]:
        yield (
            "What is settled is the prediction's error, with the beacon's own and what is left of "
            "the entry; the rest is not."
        )
        yield (
            "+-: stated of the mean, with what is left of the entry: a cable's length that decays "
            "by the margin."
        )
    if settled["count"] >= _ENOUGH and settled["share_inside_95"] < 0.5:
        yield (
            "Of what is settled most is outside of where the stated errors put it: check "
            "cable.length, end mass, drag, wind and the beacon itself."
        )
    if figures:
        yield (
            "In stated 95 %: inside the ellipsoid of all three errors together. Of a wind not "
            "well known it is long one way and"
        )
        yield (
            "narrow across: a place within the bands of beacon.png, which tell each axis alone, "
            "can lie far outside of it."
        )
    texts = {code.value: text for code, text in (SKIPS | UNMATCHED).items()}
    counts = beacon["skipped"] | beacon["not_compared"]
    yield from _count_lines("Reports of the beacon not compared", counts, texts)


def _outcomes(beacon: dict[str, Any]) -> dict[Standing | Unmatched, int]:
    """Counts of the reports that were believed, by what they came to."""
    compared = beacon["measured_minus_predicted"]
    counts = {standing: compared[standing.value]["count"] for standing in Standing}
    return counts | {code: beacon["not_compared"].get(code.value, 0) for code in Unmatched}


def _count_lines(title: str, counts: dict[str, int], texts: dict[str, str]) -> Iterator[str]:
    if not counts:
        return
    yield ""
    yield f"{title}:"
    for code, count in sorted(counts.items(), key=lambda item: -item[1]):
        yield f"{count:8}  {code:18}  {texts[code]}"
