"""Configurations: what is read, and what is refused with a message that helps."""

import array
import re
import subprocess
import sys
from math import inf, isnan, nan
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from ctcbs_ros.configuration import (
    Air,
    configuration_from_mapping,
    configuration_hash,
    find_configuration,
    load_configuration,
)
from ctcbs_ros.errors import InputError
from ctcbs_ros.parameter_file import read_parameter_file
from ctcbs_ros.schema import PARAMETERS, checked_parameters, why_unknown

CONFIG = Path(__file__).parents[1] / "config"
SHIPPED = sorted(CONFIG.glob("*.yaml"))
NUMBERS = [spec for spec in PARAMETERS if spec.type in (float, int)]
BY_KEY = {spec.key: spec for spec in PARAMETERS}


@pytest.fixture
def parameters():
    """All parameters of the small drone, by dotted key."""
    return checked_parameters(read_parameter_file(CONFIG / "small_drone.yaml"), "file")


def refusal(parameters, **changes):
    """Message of the refusal of `parameters` with `changes` (dots written as __; None drops)."""
    mapping = dict(parameters)
    for key, value in changes.items():
        mapping[key.replace("__", ".")] = value
    mapping = {key: value for key, value in mapping.items() if value is not None}
    with pytest.raises(InputError) as error:
        configuration_from_mapping(mapping, "drone.yaml")
    message = str(error.value)
    assert message.startswith("drone.yaml: ")
    assert "\n" not in message
    return message


def file_refusal(tmp_path, content):
    """Message of the refusal of a file with this content."""
    path = tmp_path / "drone.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as error:
        load_configuration(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


# --- the files that are shipped -----------------------------------------------------------------


def test_design_example_is_table_5_1_of_the_thesis():
    configuration = load_configuration(CONFIG / "design_example.yaml")
    cable, end_mass = configuration.cable, configuration.end_mass
    assert (cable.length, cable.diameter, cable.density) == (1000.0, 0.00048, 1100.0)
    assert (cable.youngs_modulus, cable.drag_coefficient) == (2e9, 0.6)
    assert (end_mass.mass, end_mass.frontal_area, end_mass.drag_coefficient) == (1.0, 0.045, 1.6)
    assert configuration.envelope.radius == (100.0, 250.0)
    assert configuration.envelope.speed == (45.0, 55.0)
    # d_n = 213.41 at a = 250 m is what the thesis gives in chapter 5
    d_n = 0.5 * configuration.air.density * cable.diameter * cable.drag_coefficient * 250.0
    assert d_n / cable.mass_per_length == pytest.approx(213.41, abs=0.01)


def test_small_drone_covers_40_to_120_m_and_12_to_28_m_per_s():
    envelope = load_configuration(CONFIG / "small_drone.yaml").envelope
    assert (envelope.radius, envelope.speed) == ((40.0, 120.0), (12.0, 28.0))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_file_explains_each_parameter_with_unit_and_default(path):
    lines = path.read_text().splitlines()
    written = read_parameter_file(path)
    for spec in PARAMETERS:
        *groups, name = spec.key.split(".")
        value = written
        for group in groups:
            value = value[group]
        assert name in value, f"{spec.key} is not in {path}"
        start = lines.index(f"    {groups[0]}:") if groups else 0
        line = next(
            number
            for number, text in enumerate(lines)
            if number > start and text.strip().startswith(f"{name}:")
        )
        comment = ""
        while lines[line - 1].strip().startswith("#"):
            line -= 1
            comment = lines[line].strip("# ") + " " + comment
        assert f"[{spec.unit}]" in comment or not spec.unit, f"{spec.key}: unit in {comment!r}"
        if spec.required:
            assert "Required." in comment, f"{spec.key}: {comment!r}"
        elif spec.default is not None:
            shown = re.search(r"Default (\S+?)\.?(?: |$)", comment)
            assert shown, f"{spec.key}: no default in {comment!r}"
            default = {".inf": inf, ".nan": nan}.get(shown[1]) or yaml.safe_load(shown[1])
            assert repr(default) == repr(spec.default), f"{spec.key}: {comment!r}"


def test_shipped_configuration_is_found_by_its_bare_name(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert find_configuration("small_drone").samefile(CONFIG / "small_drone.yaml")
    assert find_configuration("small_drone.yaml").samefile(CONFIG / "small_drone.yaml")
    with pytest.raises(InputError, match=r"nope: no such file.*: design_example, small_drone"):
        find_configuration("nope")
    assert find_configuration("there/small_drone.yaml") == Path("there/small_drone.yaml")


def test_file_in_the_working_folder_comes_before_a_shipped_one(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("small_drone.yaml").write_text("mine")
    assert find_configuration("small_drone.yaml") == Path("small_drone.yaml")


# --- values -------------------------------------------------------------------------------------


def test_defaults_fill_in_what_may_be_left_out(parameters):
    required = {key: parameters[key] for key in parameters if BY_KEY[key].required}
    configuration = configuration_from_mapping(required | {"air.density": 1.2}, "file")
    assert configuration.cable.axial_damping == 0.0
    assert configuration.cable.breaking_tension == inf
    assert configuration.end_mass.displaced_volume == 0.0
    assert configuration.limits.near_jump == 0.1
    assert configuration.limits.tension_fraction == 0.5
    assert configuration.limits.stale_after == 2.0
    assert isnan(configuration.limits.ground_level_amsl)


def test_nested_and_dotted_keys_give_the_same_configuration(parameters):
    nested = read_parameter_file(CONFIG / "small_drone.yaml")
    one = configuration_from_mapping(nested, "file")
    assert configuration_hash(one) == configuration_hash(
        configuration_from_mapping(parameters, "file")
    )


def test_what_was_checked_passes_the_check_again(parameters):
    assert repr(checked_parameters(parameters, "file")) == repr(parameters)


def test_array_of_doubles_as_ros_delivers_it_is_a_range(parameters):
    parameters["envelope.radius"] = array.array("d", [30.0, 60.0])
    assert configuration_from_mapping(parameters, "node").envelope.radius == (30.0, 60.0)


def test_inextensible_cable_has_an_infinite_youngs_modulus(parameters):
    parameters["cable.youngs_modulus"] = inf
    assert configuration_from_mapping(parameters, "file").cable.youngs_modulus == inf


def test_ground_level_reaches_the_limits(parameters):
    parameters["ground.level_amsl"] = 431.0
    assert configuration_from_mapping(parameters, "file").limits.ground_level_amsl == 431.0


def test_water_is_allowed_as_the_fluid(parameters):
    changes = {"air.density": 1000.0, "cable.density": 1400.0}
    assert configuration_from_mapping(parameters | changes, "file").air.density == 1000.0


def test_parameters_that_ros_gives_every_node_are_let_through(parameters):
    parameters |= {"use_sim_time": True, "qos_overrides./clock.subscription.depth": 5}
    configuration_from_mapping(parameters, "file")


def test_standard_atmosphere_sets_the_density_by_altitude(parameters):
    del parameters["air.density"]
    parameters["air.model"] = "standard_atmosphere"
    air = configuration_from_mapping(parameters, "file").air
    # U.S. Standard Atmosphere 1976, Table I
    assert air.density_at(1000.0) == pytest.approx(1.1117, rel=5e-5)
    assert Air("constant", 1.18).density_at(1000.0) == 1.18


def test_measured_density_counts_where_it_is_asked_for_and_can_be():
    measured = Air("measured")
    assert measured.density_at(1000.0, 1.05) == 1.05
    for none in (nan, 0.0, 0.8, 1.5):  # the standard one is 1.1117 kg/m^3
        assert measured.density_at(1000.0, none) == pytest.approx(1.1117, rel=5e-5)
    assert Air("standard_atmosphere").density_at(1000.0, 1.05) == pytest.approx(1.1117, rel=5e-5)
    assert Air("constant", 1.18).density_at(1000.0, 1.05) == 1.18


# --- hash ---------------------------------------------------------------------------------------


def test_hash_is_the_same_in_another_process():
    path = CONFIG / "small_drone.yaml"
    code = (
        "from ctcbs_ros.configuration import configuration_hash, load_configuration\n"
        f"print(configuration_hash(load_configuration({str(path)!r})))"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=CONFIG.parent
    )
    assert other.stdout.strip() == configuration_hash(load_configuration(path))


def test_a_wind_needs_its_direction_and_a_direction_its_wind(parameters):
    for key in ("wind.speed", "wind.from_direction"):
        with pytest.raises(InputError, match="go together"):
            configuration_from_mapping(parameters | {key: 5.0}, "file")


@pytest.mark.parametrize("spec", NUMBERS, ids=lambda spec: spec.key)
def test_hash_follows_the_physics_and_nothing_else(parameters, spec):
    before = configuration_hash(configuration_from_mapping(parameters, "file"))
    value = parameters[spec.key]
    changed = {0: 0.001, inf: 500.0}.get(value, 1.0 if value != value else value * 1.1)
    if spec.key in ("wind.speed", "wind.from_direction"):
        parameters |= {"wind.speed": 1.0, "wind.from_direction": 1.0}  # only together
    parameters[spec.key] = spec.type(min(changed + (spec.type is int), spec.maximum))
    after = configuration_hash(configuration_from_mapping(parameters, "elsewhere"))
    physics = spec.key.split(".")[0] in ("cable", "end_mass", "air", "envelope")
    assert (before != after) == physics


def test_hash_follows_the_envelope_and_the_model_of_the_air(parameters):
    hashes = {configuration_hash(configuration_from_mapping(parameters, "file"))}
    for change in (
        {"envelope.radius": (40.0, 121.0)},
        {"envelope.speed": (11.0, 28.0)},
        {"air.model": "standard_atmosphere", "air.density": None},
    ):
        mapping = {k: v for k, v in (parameters | change).items() if v is not None}
        hashes.add(configuration_hash(configuration_from_mapping(mapping, "file")))
    assert len(hashes) == 4


# --- refused values -----------------------------------------------------------------------------


@pytest.mark.parametrize("key", [spec.key for spec in PARAMETERS if spec.required])
def test_missing_required_parameter_is_named_with_what_is_allowed(parameters, key):
    message = refusal(parameters, **{key: None})
    assert f"{key} is missing" in message
    assert BY_KEY[key].allowed in message


@pytest.mark.parametrize("spec", PARAMETERS, ids=lambda spec: spec.key)
def test_value_of_another_type_is_refused(parameters, spec):
    wrong = {
        float: (True, "5.0", [1.0], {"a": 1.0}),
        int: (True, 5.0, "5", [1]),
        bool: (1, 0.0, "true", []),
        str: (5, 1.0, True, ["a"]),
        list: (5.0, "a", [1.0, True], [1.0, "2.0"], [5.0], [], [1.0, 2.0, 3.0], {"a": 1.0}),
    }
    for value in wrong[spec.type]:
        message = refusal(parameters, **{spec.key: value})
        assert f"{spec.key} = {value!r}: must be {spec.allowed} (got " in message


@pytest.mark.parametrize("spec", NUMBERS, ids=lambda spec: spec.key)
def test_number_out_of_its_range_is_refused(parameters, spec):
    for value in (spec.minimum - 1, spec.maximum * 2, *(() if spec.type is int else (nan, inf))):
        if (isnan(value) and spec.missing) or (value == inf and spec.infinite):
            continue
        message = refusal(parameters, **{spec.key: spec.type(value)})
        assert f"{spec.key} = {value!r}: must be {spec.allowed}" in message
    if spec.type is float:
        assert f"{spec.key} = -inf" in refusal(parameters, **{spec.key: -inf})


@pytest.mark.parametrize("spec", NUMBERS, ids=lambda spec: spec.key)
def test_both_ends_of_a_range_are_allowed(spec):
    for value in (spec.minimum, spec.maximum):
        assert spec.check(spec.type(value), "file") == value


@pytest.mark.parametrize("pair", [[0.0, 120.0], [-40.0, 120.0], [40.0, 1e6], [40.0, inf]])
def test_envelope_out_of_range_or_not_finite_is_refused(parameters, pair):
    assert f"envelope.radius = {pair!r}" in refusal(parameters, envelope__radius=pair)
    assert "envelope.speed" in refusal(parameters, envelope__speed=[12.0, nan])


def test_whole_number_for_a_decimal_one_is_refused_with_how_to_write_it(parameters):
    assert "write 5.0" in refusal(parameters, cable__length=5)
    assert "write" not in refusal(parameters, cable__length=-5)
    assert "write 120.0" in refusal(parameters, envelope__radius=[40.0, 120])


def test_no_value_is_refused(parameters, tmp_path):
    assert "cable.length" in file_refusal(tmp_path, "/**: {ros__parameters: {cable: {length: }}}")


def test_misspelt_parameter_is_refused_with_the_nearest_one(parameters):
    assert "'cable.lenght': unknown parameter (did you mean cable.length?)" in refusal(
        parameters, cable__lenght=5.0
    )
    assert "known are cable.length" in refusal(parameters, xyzzy=5.0)


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("cable.len", " (did you mean cable.length?)"),
        ("cabel.diameter", " (did you mean cable.diameter?)"),
        ("limits.ground_level_amsl", " (did you mean ground.level_amsl?)"),
        ("table.foo", "; known are table.file"),
    ],
)
def test_another_name_is_suggested_only_where_it_is_near(key, told):
    assert why_unknown(key) == f"unknown parameter{told}"


def test_of_a_known_group_its_parameters_are_told():
    known = why_unknown("cable.foo").partition("known are ")[2].split(", ")
    assert known == [key for key in BY_KEY if key.startswith("cable.")]


def test_value_in_place_of_a_group_is_refused_with_what_the_group_holds(parameters):
    assert "group: must hold limits.low_margin_per_s" in refusal(parameters, limits=5.0)


def test_parameter_given_nested_and_dotted_is_refused(parameters):
    assert "'cable.length' is given twice" in refusal(parameters, cable={"length": 5.0})


def test_unknown_model_of_the_air_is_refused(parameters):
    message = refusal(parameters, air__model="vacuum")
    allowed = "'constant' or 'standard_atmosphere' or 'measured'"
    assert f"air.model = 'vacuum': must be {allowed}" in message


# --- contradictions -----------------------------------------------------------------------------


@pytest.mark.parametrize("pair", [[120.0, 40.0], [80.0, 80.0]])
def test_envelope_must_rise(parameters, pair):
    assert "the first below the second" in refusal(parameters, envelope__radius=pair)


def test_constant_air_needs_a_density(parameters):
    assert "air.density is missing" in refusal(parameters, air__density=None)


def test_standard_atmosphere_with_a_density_is_refused(parameters):
    message = refusal(parameters, air__model="standard_atmosphere")
    assert "air.density = 1.225 contradicts air.model" in message


def test_end_mass_lighter_than_the_air_it_displaces_is_refused(parameters):
    # 0.4 kg over 1.225 kg/m^3 is 0.3265 m^3
    message = refusal(parameters, end_mass__displaced_volume=0.327)
    assert "end_mass.displaced_volume = 0.327" in message
    parameters["end_mass.displaced_volume"] = 0.326
    configuration_from_mapping(parameters, "file")


def test_end_mass_is_weighed_against_air_at_sea_level_in_the_standard_atmosphere(parameters):
    changes = {"air__density": None, "air__model": "standard_atmosphere"}
    assert "displaces" in refusal(parameters, end_mass__displaced_volume=0.327, **changes)


def test_cable_lighter_than_the_fluid_is_refused(parameters):
    assert "cable.density = 970.0" in refusal(parameters, air__density=1000.0)


def test_breaking_tension_below_the_hanging_weight_is_refused(parameters):
    # 9.80665 (0.4 + 970 pi/4 0.0006^2 150) = 4.326 N
    assert "cable.breaking_tension = 4.3" in refusal(parameters, cable__breaking_tension=4.3)
    parameters["cable.breaking_tension"] = 4.4
    configuration_from_mapping(parameters, "file")


# --- refused files ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "empty"),
        ("# only a comment\n", "empty"),
        ("- a\n- b\n", "'/**:' was expected"),
        ("5.0\n", "'/**:' was expected"),
        ("cable: {length: 5.0}\n", "'/**:' was expected, not 'cable'"),
        ("predictor: {ros__parameters: {}}\n", "'/**:' was expected, not 'predictor'"),
        ("/**: {ros__parameters: {}}\nother: {}\n", "'/**:' was expected, not '/**', 'other'"),
        ("/**: {parameters: {}}\n", "'ros__parameters:' was expected, not 'parameters'"),
        ("/**:\n", "'ros__parameters:' was expected"),
        ("/**:\n  ros__parameters:\n", "no parameters"),
        ("/**: {ros__parameters: [1.0]}\n", "no parameters"),
        ("/**: {ros__parameters: {}}\n", "cable.length is missing"),
        ("/**: [\n", "line 2, column 1: not valid"),
        ("a: b: c\n", "line 1, column 5: not valid"),
        ("\tx: 1\n", "line 1, column 1: not valid"),
        ("/**: {ros__parameters: {a: 1}}\n---\nx: 1\n", "line 2, column 1: not valid"),
        ("/**:\n  ros__parameters:\n    a: 1\n    a: 2\n", "line 4, column 5: not valid: 'a' is"),
        ("? [1, 2]\n: x\n", "line 1, column 3: not valid: a key must be a name"),
        ("/**: &a {ros__parameters: *a}\n", "aliases are not allowed"),
        ("x: !!python/object/apply:os.system ['true']\n", "tags are not allowed"),
        ("x: !!float 5\n", "tags are not allowed"),
        ("x: \x07\n", "character #x0007"),
        (b"\xff\xfe\x00", "not UTF-8"),
        ("[" * 100_000, "nested too deeply"),
        (b"#" * 1_000_001, "larger than 1 MB"),
    ],
)
def test_file_that_is_no_parameter_file_is_refused_with_one_line(tmp_path, content, reason):
    assert reason in file_refusal(tmp_path, content)


def test_missing_file_and_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml: no such file"):
        load_configuration(tmp_path / "nowhere.yaml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        load_configuration(tmp_path)
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        load_configuration("x" * 5000 + ".yaml")


def test_refusal_of_a_file_names_file_key_value_and_range(tmp_path):
    text = (CONFIG / "small_drone.yaml").read_text()
    message = file_refusal(tmp_path, text.replace("diameter: 0.0006", "diameter: 0.6"))
    assert message == (
        f"{tmp_path}/drone.yaml: cable.diameter = 0.6: must be a number from 1e-06 to 0.1 m"
    )


def test_byte_order_mark_is_no_obstacle(tmp_path):
    path = tmp_path / "drone.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + (CONFIG / "small_drone.yaml").read_bytes())
    assert load_configuration(path).cable.length == 150.0


@settings(max_examples=300)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(alphabet="/*:ros_params{}[]-?!&*#|>'\"% \n\t1.e9", max_size=80).map(str.encode),
        st.tuples(st.integers(0, 6000), st.binary(min_size=1, max_size=3)),
    )
)
def test_no_damage_to_a_file_raises_anything_but_a_refusal(tmp_path_factory, damage):
    content = bytearray((CONFIG / "small_drone.yaml").read_bytes())
    if isinstance(damage, tuple):
        content[damage[0] : damage[0] + len(damage[1])] = damage[1]
    else:
        content = damage
    path = tmp_path_factory.getbasetemp() / "damaged.yaml"
    path.write_bytes(content)
    try:
        load_configuration(path)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017 - either outcome is right
