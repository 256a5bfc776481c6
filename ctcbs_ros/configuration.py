"""The configuration: cable, end mass, air, envelope and limits of one operation, in SI units.

A parameter file or the node's parameters go in, a checked and frozen `Configuration` comes out.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import inf, isfinite, nan, pi
from pathlib import Path
from typing import Any

from ctcbs_ros.atmosphere import GRAVITY, standard_atmosphere_density
from ctcbs_ros.errors import InputError
from ctcbs_ros.parameter_file import read_parameter_file
from ctcbs_ros.parameter_spec import shown
from ctcbs_ros.schema import checked_parameters, with_settings

# By how much the density of the air strays from the standard one: 4 % of pressure, and 40 K.
WEATHER = 0.2
# A topic's name as ROS has it.
TOPIC = re.compile(r"[/~]?[A-Za-z_]\w*(/[A-Za-z_]\w*)*|~(/[A-Za-z_]\w*)+", re.ASCII)
PHYSICS = ("cable", "end_mass", "air", "envelope")


@dataclass(frozen=True)
class Cable:
    """The cable.

    Attributes
    ----------
    length : float
        Unstretched length paid out [m].
    diameter : float
        Diameter [m].
    density : float
        Mass over the volume of the section [kg/m^3].
    youngs_modulus : float
        On the full section [Pa]; inf for an inextensible cable.
    drag_coefficient : float
        In cross flow, C_Dn.
    axial_damping : float
        Tension over EA and rate of strain [s].
    breaking_tension : float
        Tension at which it breaks [N]; inf if not known.
    """

    length: float
    diameter: float
    density: float
    youngs_modulus: float
    drag_coefficient: float
    axial_damping: float = 0.0
    breaking_tension: float = inf

    @property
    def area(self) -> float:
        """Area of the section [m^2]."""
        return pi / 4 * self.diameter**2

    @property
    def mass_per_length(self) -> float:
        """Mass per unstretched length [kg/m]."""
        return self.density * self.area


@dataclass(frozen=True)
class EndMass:
    """The end mass: mass [kg], frontal area [m^2], drag coefficient, displaced volume [m^3]."""

    mass: float
    frontal_area: float
    drag_coefficient: float
    displaced_volume: float = 0.0


@dataclass(frozen=True)
class Air:
    """The air: model "constant" with its density [kg/m^3]; "standard_atmosphere" and "measured"
    without.
    """

    model: str
    density: float = nan

    def density_at(self, altitude_amsl: float, measured: float = nan) -> float:
        """Density [kg/m^3] at an altitude above mean sea level [m]; nan if outside the model.

        "measured" is the density that the vehicle measured, or where it did not, or strays from
        the standard atmosphere farther than any weather, that of the standard atmosphere.
        """
        if self.model == "constant":
            return self.density
        standard = standard_atmosphere_density(altitude_amsl)
        if self.model == "measured" and abs(measured / standard - 1) <= WEATHER:
            return measured
        return standard


@dataclass(frozen=True)
class SetWind:
    """The user's wind: speed [m/s] and where it blows from, clockwise from north [deg], both nan
    where it is not known; standard deviation along an axis [m/s]."""

    speed: float = nan
    from_direction: float = nan
    accuracy: float = 2.0


@dataclass(frozen=True)
class Envelope:
    """What is flown and covered by the table: tow radius [m] and speed [m/s], each (min, max)."""

    radius: tuple[float, float]
    speed: tuple[float, float]


@dataclass(frozen=True)
class WarningLimits:
    """Where warnings begin.

    Attributes
    ----------
    low_margin_per_s : float
        LOW_MARGIN below this decay rate [1/s].
    near_jump : float
        NEAR_JUMP below this relative change of angular rate to the fold.
    tension_fraction : float
        TENSION_LIMIT above this fraction of the breaking tension.
    minimum_height : float
        GROUND_PROXIMITY below this height of the end mass above the ground [m].
    stale_after : float
        STALE_TELEMETRY after this time without a sample [s].
    ground_level_amsl : float
        Height of the ground above mean sea level [m]; nan takes home as the ground.
    """

    low_margin_per_s: float
    near_jump: float
    tension_fraction: float
    minimum_height: float
    stale_after: float
    ground_level_amsl: float = nan


@dataclass(frozen=True)
class Receiver:
    """Errors of the aircraft's positions and velocities.

    Attributes
    ----------
    position_sigma, velocity_sigma : float
        Standard deviations of one axis where the source states none [m], [m/s].
    correlated_share : float
        Share of a position's standard deviation, stated or not, that is correlated in time.
    correlation_time : float
        Time in which that correlation falls to 1/e [s].
    """

    position_sigma: float = 2.0
    velocity_sigma: float = 0.4
    correlated_share: float = 0.97
    correlation_time: float = 45.0


@dataclass(frozen=True)
class Beacon:
    """The payload's own beacon: a MAVLink system and component (0 for none, any) or a topic.

    Attributes
    ----------
    system_id, component_id : int
    topic : str
    position_sigma : float
        Standard deviation of its position along an axis where it states none [m].
    height_sigma : float
        Of the difference of its height and the aircraft's [m]: two receivers, or two barometers.
    time_sigma : float
        Of its time on the aircraft's clock, beyond what the messages show [s].
    """

    system_id: int = 0
    component_id: int = 0
    topic: str = ""
    position_sigma: float = 2.0
    height_sigma: float = 5.0
    time_sigma: float = 0.1

    @property
    def present(self) -> bool:
        """Whether there is one."""
        return bool(self.system_id or self.topic)


@dataclass(frozen=True)
class Configuration:
    """One operation; `source` says where it was read from (a path, or a node's name)."""

    cable: Cable
    end_mass: EndMass
    air: Air
    envelope: Envelope
    limits: WarningLimits
    source: str
    wind: SetWind = SetWind()
    receiver: Receiver = field(default_factory=Receiver)
    beacon: Beacon = Beacon()


def load_configuration(path: str | Path, settings: Sequence[str] = ()) -> Configuration:
    """Read and check a ROS parameter file.

    Parameters
    ----------
    path : str or Path
        The file, or the bare name of a shipped one ("small_drone"), see `find_configuration`.
    settings : sequence of str
        "KEY=VALUE" each: other values for parameters of the file, written as in the file.

    Raises
    ------
    InputError
        If the file cannot be read or anything in it is refused.
    """
    file = find_configuration(path)
    values = read_parameter_file(file)
    if not settings:
        return configuration_from_mapping(values, str(file))
    source = f"{file} with {', '.join(settings)}"
    return configuration_from_mapping(with_settings(values, settings, source), source)


def find_configuration(path: str | Path) -> Path:
    """Path of a configuration: `path` itself, or where a shipped one of that bare name lies.

    Raises
    ------
    InputError
        If it is a bare name, and neither a file nor a shipped configuration has it.
    """
    path = Path(path)
    if os.path.exists(path) or path.name != str(path) or path.suffix not in ("", ".yaml"):
        return path
    package = Path(__file__).resolve().parent
    folders = [package.parent / "config"]  # a checkout
    folders += [prefix / "share/ctcbs_ros/config" for prefix in package.parents]  # pip, colcon
    found = (folder / f"{path.stem}.yaml" for folder in folders)
    file = next(filter(os.path.isfile, found), None)
    if file is not None or path.suffix:
        return file or path
    shipped = sorted({file.stem for folder in folders for file in folder.glob("*.yaml")})
    raise InputError(
        f"{path}: no such file, and none of the shipped configurations: {', '.join(shipped)}"
    )


def configuration_from_mapping(mapping: Mapping[str, Any], source: str) -> Configuration:
    """Check all parameters, alone and against each other.

    Parameters
    ----------
    mapping : mapping
        Parameters by dotted key or nested, those of the node included (see `ctcbs_ros.schema`).
    source : str
        Where they come from, for errors.

    Raises
    ------
    InputError
        If any is missing, unknown, of the wrong type, out of range or contradicts another.
    """
    values = checked_parameters(mapping, source)

    def section(name: str) -> dict[str, Any]:
        return {
            key.removeprefix(f"{name}."): value
            for key, value in values.items()
            if key.startswith(f"{name}.")
        }

    _refuse_wrong_air(values, source)
    _refuse_wrong_beacon(values, source)
    configuration = Configuration(
        cable=Cable(**section("cable")),
        end_mass=EndMass(**section("end_mass")),
        air=Air(**section("air")),
        envelope=Envelope(**section("envelope")),
        limits=WarningLimits(**section("limits"), ground_level_amsl=values["ground.level_amsl"]),
        source=source,
        wind=SetWind(**section("wind")),
        receiver=Receiver(**section("receiver")),
        beacon=Beacon(**section("beacon")),
    )
    _refuse_contradictions(configuration)
    return configuration


def configuration_hash(configuration: Configuration) -> str:
    """SHA-256 of all that changes the physics: cable, end mass, air and envelope.

    Limits and source do not count. Stable across runs and machines.
    """
    everything = asdict(configuration)
    physics = {name: everything[name] for name in PHYSICS}
    return hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()


def _refuse_wrong_air(values: dict[str, Any], source: str) -> None:
    constant = values["air.model"] == "constant"
    if constant and "air.density" not in values:
        raise InputError(
            f"{source}: air.density is missing: air.model constant needs it; "
            "give it in kg/m^3, or set air.model to standard_atmosphere or measured"
        )
    if not constant and "air.density" in values:
        raise InputError(
            f"{source}: air.density = {values['air.density']!r} contradicts air.model = "
            f"{values['air.model']!r}, which sets it by altitude: remove one of them"
        )


def _refuse_wrong_beacon(values: dict[str, Any], source: str) -> None:
    system = values["beacon.system_id"]
    if system and values["beacon.topic"]:
        raise InputError(
            f"{source}: beacon.system_id and beacon.topic: only one of them can be the beacon"
        )
    if system and system == values["mavlink.system"]:
        raise InputError(
            f"{source}: beacon.system_id = {system}: is the tow aircraft's, mavlink.system; "
            "must be another system"
        )
    topic = values["beacon.topic"]
    if topic and not TOPIC.fullmatch(topic):
        raise InputError(
            f"{source}: beacon.topic = {shown(topic)}: must be the name of a topic: letters, "
            "digits and _, in parts that / separates"
        )


def _refuse_contradictions(configuration: Configuration) -> None:
    """Raise InputError where values that are each in range cannot be true together."""
    source, cable, end_mass = configuration.source, configuration.cable, configuration.end_mass
    air_density = configuration.air.density_at(0.0)  # standard: sea level, where it is greatest

    wind = configuration.wind
    if isfinite(wind.speed) != isfinite(wind.from_direction):
        missing = "from_direction" if isfinite(wind.speed) else "speed"
        raise InputError(
            f"{source}: wind.{missing} is missing: wind.speed and wind.from_direction go together"
        )
    lifted = air_density * end_mass.displaced_volume
    if lifted >= end_mass.mass:
        raise InputError(
            f"{source}: end_mass.displaced_volume = {end_mass.displaced_volume!r}: displaces "
            f"{lifted:.6g} kg of air; must be less than end_mass.mass = {end_mass.mass!r} kg"
        )
    if cable.density <= air_density:
        raise InputError(
            f"{source}: cable.density = {cable.density!r}: must be greater than the density of "
            f"the air, {air_density:.6g} kg/m^3: the cable would float"
        )
    weight = GRAVITY * (end_mass.mass + cable.mass_per_length * cable.length)
    if cable.breaking_tension <= weight:
        raise InputError(
            f"{source}: cable.breaking_tension = {cable.breaking_tension!r}: must be greater than "
            f"the weight of end mass and cable, {weight:.6g} N"
        )
