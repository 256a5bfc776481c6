"""What may be changed of a design: each kind of change in its own words, and how far it may go."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite

from ctcbs_ros.configuration import Configuration


@dataclass(frozen=True)
class Change:
    """One thing that may be changed.

    Attributes
    ----------
    name : str
        In the words of a workshop: "longer cable".
    quantity : str
        What the value is, and how it is bounded: "cable length".
    unit : str
    apply : callable
        (configuration, value) -> dict of parameter keys and their new values.
    present : callable
        Configuration -> the value now.
    furthest : callable
        Configuration -> the last value tried.
    remark : str
        What else the change implies.
    """

    name: str
    quantity: str
    unit: str
    apply: Callable[[Configuration, float], dict]
    present: Callable[[Configuration], float]
    furthest: Callable[[Configuration], float]
    remark: str = ""


def _key(key: str) -> Callable[[Configuration, float], dict]:
    return lambda configuration, value: {key: value}


def _diameter(configuration: Configuration, value: float) -> dict:
    """Same material: the breaking tension goes with the section."""
    cable = configuration.cable
    changed = {"cable.diameter": value}
    if isfinite(cable.breaking_tension):
        changed["cable.breaking_tension"] = (
            cable.breaking_tension * (value / cable.diameter) ** 2
        )
    return changed


def _narrower(name: str, quantity: str, unit: str, range_name: str, end: int) -> Change:
    """A range of the envelope with one end (0 or 1) moved inwards, almost to the other."""
    def ends(configuration):
        return getattr(configuration.envelope, range_name)

    def apply(configuration, value):
        moved = list(ends(configuration))
        moved[end] = value
        return {f"envelope.{range_name}": tuple(moved)}

    def furthest(configuration):
        low, high = ends(configuration)
        return 1.001 * low if end else high / 1.001

    return Change(name, quantity, unit, apply, lambda c: ends(c)[end], furthest)


def _shifted(key: str) -> Callable[[Configuration, float], dict]:
    """A range of the envelope scaled as a whole, so that its lower end is the value."""
    def apply(configuration, value):
        low, high = getattr(configuration.envelope, key.split(".")[1])
        return {key: (value, high * value / low)}

    return apply


def _least_mass(configuration: Configuration) -> float:
    """A tenth, or a little more than the air it displaces."""
    lifted = configuration.air.density_at(0.0) * configuration.end_mass.displaced_volume
    return min(max(configuration.end_mass.mass / 10.0, 1.05 * lifted), configuration.end_mass.mass)


_LIKE = "all else, and the strength of the material, as they are"
STRONGER = "stronger cable"
# Changes that leave the envelope given, each with those that keep inside it.
OUTSIDE = {
    "tighter circles": ("smaller largest radius", "larger smallest radius"),
    "faster flight": ("lower top speed", "higher least speed"),
}
# The least area that a drag chute is tried from where there is none [m^2].
_SMALLEST_AREA = 1e-4

CHANGES = (
    Change(
        "longer cable", "cable length", "m", _key("cable.length"),
        lambda c: c.cable.length, lambda c: min(4.0 * c.cable.length, 50_000.0),
    ),
    Change(
        "shorter cable", "cable length", "m", _key("cable.length"),
        lambda c: c.cable.length, lambda c: max(c.cable.length / 4.0, 0.01),
    ),
    Change(
        "drag chute", "frontal area of the end mass", "m^2", _key("end_mass.frontal_area"),
        lambda c: max(c.end_mass.frontal_area, _SMALLEST_AREA),
        lambda c: min(100.0 * max(c.end_mass.frontal_area, _SMALLEST_AREA), 1000.0),
        "at the same drag coefficient and mass",
    ),
    Change(
        "thinner cable", "cable diameter", "m", _diameter,
        lambda c: c.cable.diameter, lambda c: max(c.cable.diameter / 4.0, 1e-6), _LIKE,
    ),
    Change(
        "thicker cable", "cable diameter", "m", _diameter,
        lambda c: c.cable.diameter, lambda c: min(4.0 * c.cable.diameter, 0.1), _LIKE,
    ),
    Change(
        "lighter end mass", "mass of the end mass", "kg", _key("end_mass.mass"),
        lambda c: c.end_mass.mass, _least_mass,
    ),
    Change(
        STRONGER, "breaking tension", "N", _key("cable.breaking_tension"),
        lambda c: c.cable.breaking_tension, lambda c: min(20.0 * c.cable.breaking_tension, 1e7),
        "at the same diameter, density and stiffness",
    ),
    _narrower("smaller largest radius", "tow radius", "m", "radius", 1),
    _narrower("larger smallest radius", "tow radius", "m", "radius", 0),
    _narrower("lower top speed", "speed", "m/s", "speed", 1),
    _narrower("higher least speed", "speed", "m/s", "speed", 0),
    Change(
        "tighter circles", "smallest tow radius", "m", _shifted("envelope.radius"),
        lambda c: c.envelope.radius[0], lambda c: c.envelope.radius[0] / 3.0,
        "the whole range of radii shifted; outside the envelope given",
    ),
    Change(
        "faster flight", "least speed", "m/s", _shifted("envelope.speed"),
        lambda c: c.envelope.speed[0], lambda c: 2.0 * c.envelope.speed[0],
        "the whole range of speeds shifted; outside the envelope given",
    ),
)  # fmt: skip


def change_named(name: str) -> Change:
    """The one of `CHANGES` that has a name."""
    return next(change for change in CHANGES if change.name == name)


def changed(configuration: Configuration, settings: dict) -> Configuration:
    """The configuration with some parameters changed.

    Parameters
    ----------
    configuration : Configuration
    settings : dict
        Dotted keys of cable, end_mass or envelope, and their values.
    """
    sections: dict[str, dict] = {}
    for key, value in settings.items():
        section, name = key.split(".")
        sections.setdefault(section, {})[name] = value
    return replace(
        configuration,
        **{
            section: replace(getattr(configuration, section), **values)
            for section, values in sections.items()
        },
    )
