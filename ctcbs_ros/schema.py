"""Every parameter of the package in one table.

The YAML files, the command line and the node's parameter descriptors all follow from `PARAMETERS`.
"""

import difflib
from collections.abc import Mapping, Sequence
from math import inf, nan
from typing import Any

from ctcbs_ros.errors import InputError
from ctcbs_ros.parameter_file import parameter_value
from ctcbs_ros.parameter_spec import ParameterSpec, shown

# Parameters that ROS itself gives every node; a parameter file may set them, they are not ours.
ROS_PARAMETERS = ("use_sim_time", "start_type_description_service")
ROS_PREFIXES = ("qos_overrides.",)
# Likeness (difflib) from which another name may have been meant: cable.len is cable.length, but
# cable.foo is not table.file.
_NEAR = 0.75

PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        key="cable.length", type=float, unit="m", required=True, runtime=True,
        minimum=0.01, maximum=50_000.0, meaning="unstretched length of the cable paid out",
    ),
    ParameterSpec(
        key="cable.diameter", type=float, unit="m", required=True,
        minimum=1e-6, maximum=0.1, meaning="diameter of the cable, for its drag and its section",
    ),
    ParameterSpec(
        key="cable.density", type=float, unit="kg/m^3", required=True,
        minimum=100.0, maximum=25_000.0, meaning="mass of the cable over its volume",
    ),
    ParameterSpec(
        key="cable.youngs_modulus", type=float, unit="Pa", required=True,
        minimum=1e6, maximum=1e12, infinite=True,
        meaning="Young's modulus on the full section; .inf for an inextensible cable",
    ),
    ParameterSpec(
        key="cable.drag_coefficient", type=float, required=True,
        minimum=1e-3, maximum=5.0, meaning="drag coefficient of the cable in cross flow",
    ),
    ParameterSpec(
        key="cable.axial_damping", type=float, unit="s", default=0.0,
        minimum=0.0, maximum=100.0,
        meaning="damping of stretching: tension over EA and rate of strain",
    ),
    ParameterSpec(
        key="cable.breaking_tension", type=float, unit="N", default=inf,
        minimum=1e-3, maximum=1e7, infinite=True, meaning="tension at which the cable breaks",
    ),
    ParameterSpec(
        key="end_mass.mass", type=float, unit="kg", required=True, runtime=True,
        minimum=1e-6, maximum=1e5, meaning="mass of the end mass",
    ),
    ParameterSpec(
        key="end_mass.frontal_area", type=float, unit="m^2", required=True,
        minimum=0.0, maximum=1000.0, meaning="frontal area of the end mass, drogue included",
    ),
    ParameterSpec(
        key="end_mass.drag_coefficient", type=float, required=True,
        minimum=0.0, maximum=5.0, meaning="drag coefficient of the end mass",
    ),
    ParameterSpec(
        key="end_mass.displaced_volume", type=float, unit="m^3", default=0.0,
        minimum=0.0, maximum=1000.0, meaning="volume of air displaced by the end mass (buoyancy)",
    ),
    ParameterSpec(
        key="air.model", type=str, default="constant",
        choices=("constant", "standard_atmosphere", "measured"),
        meaning="air density: air.density, the ICAO standard atmosphere at the tow point, or by "
        "the vehicle's pressure and temperature (else the standard one)",
    ),
    ParameterSpec(
        key="air.density", type=float, unit="kg/m^3",
        minimum=1e-4, maximum=2000.0,
        meaning="density of the air; needed with air.model constant, and only there",
    ),
    ParameterSpec(
        key="wind.speed", type=float, unit="m/s", default=nan, missing=True,
        minimum=0.0, maximum=150.0,
        meaning="wind where neither autopilot nor flight tell; .nan for not known",
    ),
    ParameterSpec(
        key="wind.from_direction", type=float, unit="deg", default=nan, missing=True,
        minimum=0.0, maximum=360.0,
        meaning="where that wind blows from, clockwise from north",
    ),
    ParameterSpec(
        key="wind.accuracy", type=float, unit="m/s", default=2.0,
        minimum=0.01, maximum=100.0,
        meaning="standard deviation of that wind along an axis",
    ),
    ParameterSpec(
        key="envelope.radius", type=list, unit="m", required=True,
        minimum=0.01, maximum=20_000.0, meaning="range of tow radius flown, covered by the table",
    ),
    ParameterSpec(
        key="envelope.speed", type=list, unit="m/s", required=True,
        minimum=0.01, maximum=400.0, meaning="range of tow speed flown, covered by the table",
    ),
    ParameterSpec(
        key="limits.low_margin_per_s", type=float, unit="1/s", default=0.05, runtime=True,
        minimum=0.0, maximum=100.0,
        meaning="warn LOW_MARGIN below this decay rate of the least damped mode",
    ),
    ParameterSpec(
        key="limits.near_jump", type=float, default=0.1, runtime=True,
        minimum=0.0, maximum=10.0,
        meaning="warn NEAR_JUMP when a smaller relative change of angular rate leads to a jump",
    ),
    ParameterSpec(
        key="limits.tension_fraction", type=float, default=0.5, runtime=True,
        minimum=0.01, maximum=1.0,
        meaning="warn TENSION_LIMIT above this fraction of cable.breaking_tension",
    ),
    ParameterSpec(
        key="limits.minimum_height", type=float, unit="m", default=20.0, runtime=True,
        minimum=0.0, maximum=20_000.0,
        meaning="warn GROUND_PROXIMITY when the end mass is lower than this above the ground",
    ),
    ParameterSpec(
        key="limits.stale_after", type=float, unit="s", default=2.0, runtime=True,
        minimum=0.1, maximum=3600.0,
        meaning="warn STALE_TELEMETRY after this time without a sample",
    ),
    ParameterSpec(
        key="receiver.position_sigma", type=float, unit="m", default=2.0,
        minimum=0.01, maximum=1000.0,
        meaning="standard deviation of a position along one axis where the source states none",
    ),
    ParameterSpec(
        key="receiver.velocity_sigma", type=float, unit="m/s", default=0.4,
        minimum=0.001, maximum=100.0,
        meaning="standard deviation of a velocity along one axis where the source states none",
    ),
    ParameterSpec(
        key="receiver.correlated_share", type=float, default=0.97,
        minimum=0.0, maximum=1.0,
        meaning="share of a position's standard deviation that is correlated in time; 0 for none",
    ),
    ParameterSpec(
        key="receiver.correlation_time", type=float, unit="s", default=45.0,
        minimum=0.1, maximum=86_400.0,
        meaning="time in which the correlation of a position's error falls to 1/e",
    ),
    ParameterSpec(
        key="ground.level_amsl", type=float, unit="m", default=nan, missing=True,
        minimum=-500.0, maximum=9000.0,
        meaning="height of the ground above mean sea level; .nan takes home as the ground",
    ),
    ParameterSpec(
        key="twin.enabled", type=bool, default=True,
        meaning="whether the cable is simulated in time beside the telemetry",
    ),
    ParameterSpec(
        key="table.file", type=str, default="",
        meaning="file of the continuation table; empty for one in the user's cache",
    ),
    ParameterSpec(
        key="mavlink.url", type=str, default="",
        meaning="MAVLink source: udpin:, udpout:, tcp:, tcpin:, serial device or log; "
        "empty for ROS topics",
    ),
    ParameterSpec(
        key="mavlink.baud", type=int, unit="baud", default=57_600,
        minimum=300, maximum=4_000_000, meaning="rate of a serial MAVLink link",
    ),
    ParameterSpec(
        key="mavlink.system", type=int, default=0,
        minimum=0, maximum=255, meaning="MAVLink system id of the tow aircraft; 0 for the first",
    ),
    ParameterSpec(
        key="mavlink.component", type=int, default=0,
        minimum=0, maximum=255, meaning="MAVLink component id; 0 for the vehicle's autopilot",
    ),
    ParameterSpec(
        key="mavlink.heartbeat", type=bool, default=False,
        meaning="whether a heartbeat is sent each second (on udpout: it always is)",
    ),
    ParameterSpec(
        key="mavlink.request_rate", type=float, unit="1/s", default=0.0,
        minimum=0.0, maximum=50.0,
        meaning="rate of position messages to ask the vehicle for; 0 to ask for nothing",
    ),
    ParameterSpec(
        key="beacon.system_id", type=int, default=0,
        minimum=0, maximum=255,
        meaning="MAVLink system id of the beacon that the payload carries; 0 for none",
    ),
    ParameterSpec(
        key="beacon.component_id", type=int, default=0,
        minimum=0, maximum=255,
        meaning="its component id; 0 for the first of that system to send positions",
    ),
    ParameterSpec(
        key="beacon.topic", type=str, default="",
        meaning="topic of the payload's positions (NavSatFix); empty for none",
    ),
    ParameterSpec(
        key="beacon.position_sigma", type=float, unit="m", default=2.0,
        minimum=0.01, maximum=1000.0,
        meaning="standard deviation of its position along one axis where it states none",
    ),
    ParameterSpec(
        key="beacon.height_sigma", type=float, unit="m", default=5.0,
        minimum=0.01, maximum=1000.0,
        meaning="standard deviation of the difference of its height and the aircraft's",
    ),
    ParameterSpec(
        key="beacon.time_sigma", type=float, unit="s", default=0.1,
        minimum=0.0, maximum=10.0,
        meaning="standard deviation of its time by the aircraft's clock, beyond what shows",
    ),
    ParameterSpec(
        key="replay.rate", type=float, default=0.0,
        minimum=0.0, maximum=1000.0,
        meaning="speed of a log over its own clock; 0 for as fast as it goes",
    ),
    ParameterSpec(
        key="replay.wait_for_subscribers", type=float, unit="s", default=5.0,
        minimum=0.0, maximum=3600.0,
        meaning="how long a log waits at its start for a subscriber of the end mass's pose",
    ),
    ParameterSpec(
        key="replay.exit_at_end", type=bool, default=False,
        meaning="whether the node ends when its log does",
    ),
    ParameterSpec(
        key="frame_id", type=str, default="map", meaning="frame of what is published (ENU)",
    ),
    ParameterSpec(
        key="diagnostics.period", type=float, unit="s", default=1.0,
        minimum=0.05, maximum=60.0, meaning="time between two messages on /diagnostics",
    ),
    ParameterSpec(
        key="publish_cable", type=bool, default=True,
        meaning="whether the markers of cable and circles are published",
    ),
)  # fmt: skip

BY_KEY = {spec.key: spec for spec in PARAMETERS}


def checked_parameters(mapping: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Check each parameter alone and fill in the defaults.

    Parameters
    ----------
    mapping : mapping
        Parameters by dotted key, by nested mappings, or both mixed.
    source : str
        Where they come from, for the error: a file's path or a node's name.

    Returns
    -------
    dict
        A value for every key of `PARAMETERS` that was given or has a default.

    Raises
    ------
    InputError
        For an unknown or missing key, or a value that `ParameterSpec.check` refuses.
    """
    given = {
        key: value
        for key, value in _flattened(mapping, source, "").items()
        if key not in ROS_PARAMETERS and not key.startswith(ROS_PREFIXES)
    }
    unknown = next((key for key in given if key not in BY_KEY), None)
    if unknown is not None:
        raise InputError(f"{source}: {shown(unknown)}: {why_unknown(unknown)}")
    checked = {}
    for spec in PARAMETERS:
        if spec.key in given:
            checked[spec.key] = spec.check(given[spec.key], source)
        elif spec.required:
            raise InputError(f"{source}: {spec.key} is missing: must be {spec.allowed}")
        elif spec.default is not None:
            checked[spec.key] = spec.default
    return checked


def with_settings(
    mapping: Mapping[str, Any], settings: Sequence[str], source: str
) -> dict[str, Any]:
    """Parameters of a file with some replaced, by dotted key.

    Parameters
    ----------
    mapping : mapping
        As `checked_parameters` takes it.
    settings : sequence of str
        "KEY=VALUE", the value as a file would have it; a whole number may stand for any number.
    source : str
        Where the mapping comes from, for the error.

    Raises
    ------
    InputError
        For a setting that is not of that form, a key that is unknown or given twice.
    """
    values = _flattened(mapping, source, "")
    changed = set()
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not (key and equals):
            raise InputError(f"--set {shown(setting)}: must be KEY=VALUE, as cable.length=1200")
        if key not in BY_KEY:
            raise InputError(f"--set {shown(key)}: {why_unknown(key)}")
        if key in changed:
            raise InputError(f"--set {key}: given twice")
        changed.add(key)
        values[key] = _numbers(parameter_value(text, f"--set {key}"), BY_KEY[key].type)
    return values


def _numbers(value: Any, kind: type) -> Any:
    """A whole number where any number may stand, alone or in a range, as that number."""
    if kind is list and isinstance(value, list):
        return [_numbers(item, float) for item in value]
    return float(value) if kind is float and type(value) is int else value


def _flattened(mapping: Mapping[str, Any], source: str, prefix: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in mapping.items():
        key = f"{prefix}{name}"
        inner = (
            _flattened(value, source, f"{key}.")
            if isinstance(value, Mapping) and key not in BY_KEY
            else {key: value}
        )
        twice = flat.keys() & inner.keys()
        if twice:
            raise InputError(f"{source}: {shown(min(twice))} is given twice")
        flat.update(inner)
    return flat


def why_unknown(key: str) -> str:
    inside = [known for known in BY_KEY if known.startswith(f"{key}.")]
    if inside:
        return f"not a parameter but a group: must hold {', '.join(inside)}"
    near = difflib.get_close_matches(key, BY_KEY, n=1, cutoff=_NEAR)
    if near:
        return f"unknown parameter (did you mean {near[0]}?)"
    group = key.partition(".")[0] + "."
    known = [known for known in BY_KEY if known.startswith(group)] or BY_KEY
    return f"unknown parameter; known are {', '.join(known)}"
