"""The table of parameters on a real ROS node, and ROS's reading of the same files as ours."""

import os
from math import inf
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from ctcbs_ros.configuration import configuration_from_mapping, load_configuration
from ctcbs_ros.errors import InputError
from ctcbs_ros.nodes.parameters import declare_parameters
from ctcbs_ros.parameter_file import read_parameter_file
from ctcbs_ros.schema import PARAMETERS

CONFIG = Path(__file__).parents[1] / "config"


@pytest.fixture
def start(monkeypatch):
    """Function that starts a real node with ROS arguments."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    started = []

    def start_node(*arguments):
        context = Context()
        rclpy.init(
            args=["--ros-args", *arguments], context=context, domain_id=os.getpid() % 100 + 1
        )
        started.append(context)
        node = Node(
            "predictor",
            context=context,
            namespace="/tow",
            automatically_declare_parameters_from_overrides=True,
        )
        started.append(node)
        return node

    yield start_node
    for thing in reversed(started):
        (thing.destroy_node if isinstance(thing, Node) else thing.try_shutdown)()


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.stem)
def test_configuration_as_params_file_is_that_of_the_command_line(start, path):
    values = declare_parameters(start("--params-file", str(path)))
    of_node = configuration_from_mapping(values, "same")
    of_file = configuration_from_mapping(read_parameter_file(path), "same")
    assert repr(of_node) == repr(of_file)  # by repr, as nan differs from itself
    assert load_configuration(path).cable == of_node.cable


def test_every_parameter_has_a_described_type_unit_and_range(start):
    node = start("--params-file", str(CONFIG / "small_drone.yaml"))
    declare_parameters(node)
    for spec in PARAMETERS:
        descriptor = node.describe_parameter(spec.key)
        assert spec.meaning in descriptor.description
        assert f"[{spec.unit}]" in descriptor.description or not spec.unit
        assert descriptor.read_only != spec.runtime
        if spec.type is int or (spec.type is float and not spec.missing):
            (span,) = descriptor.floating_point_range or descriptor.integer_range
            assert span.from_value == spec.minimum
            assert span.to_value == (inf if spec.infinite else spec.maximum)


@pytest.mark.parametrize(
    ("right", "wrong", "reason"),
    [
        ("length: 150.0", "lenght: 150.0", "'cable.lenght': unknown parameter (did you mean"),
        ("length: 150.0", "length: 150", "cable.length = 150: must be a number"),
        ("length: 150.0", "length: -5.0", "cable.length = -5.0: must be a number from 0.01"),
        ("[40.0, 120.0]", "[40.0]", "envelope.radius = [40.0]: must be [min, max]"),
        ("exit_at_end: false", "exit_at_end: 1", "replay.exit_at_end = 1: must be true or false"),
        ("baud: 57600", "baud: 57600.0", "mavlink.baud = 57600.0: must be a whole number"),
    ],
)
def test_wrong_parameter_is_refused_by_the_node_with_the_reason(
    start, tmp_path, right, wrong, reason
):
    path = tmp_path / "drone.yaml"
    path.write_text((CONFIG / "small_drone.yaml").read_text().replace(right, wrong))
    with pytest.raises(InputError) as error:
        declare_parameters(start("--params-file", str(path)))
    assert str(error.value).startswith("parameters of /tow/predictor: ")
    assert reason in str(error.value)


def test_parameter_of_the_command_line_is_checked_too(start):
    with pytest.raises(InputError, match=r"'cable\.lenght': unknown"):
        declare_parameters(start("-p", "cable.lenght:=5.0"))
    with pytest.raises(InputError, match=r"cable\.length is missing"):
        declare_parameters(start())


def test_running_node_takes_cable_length_and_mass_in_range_and_nothing_read_only(start):
    node = start("--params-file", str(CONFIG / "small_drone.yaml"))
    declare_parameters(node)

    def accepted(key, value):
        return node.set_parameters([Parameter(key, value=value)])[0].successful

    assert accepted("cable.length", 120.0)
    assert accepted("end_mass.mass", 0.5)
    assert accepted("limits.minimum_height", 30.0)
    assert not accepted("cable.length", -1.0)
    assert not accepted("cable.length", 120)
    assert not accepted("cable.diameter", 0.001)
    assert node.get_parameter("cable.length").value == 120.0


# Scalars that YAML 1.1, YAML 1.2 and ROS read differently, with the plain ones among them.
SCALARS = """
    1.0 5. .5 5 -5 +5 2.0e9 2e9 2.0e+9 40.0e9 1e3 1E5 1e-3 1e e5 1.5.2 01.5
    0 00 010 08 -08 0x10 -0x10 0x 0o10 0b1 1_000 1:30 2001-01-01
    9223372036854775807 -9223372036854775808 99999999999999999999 0x8000000000000000 1e999 -1e999
    .inf -.inf +.INF .iNf inf -inf INF infinity .nan .NaN .Nan -.nan nan
    y Y n yes no on Off true True TRUE tRue false
    map 5m '5' "5.0" 'true' '' "" udpin:127.0.0.1:14550 /dev/ttyUSB0 a#b
""".split()


def test_each_scalar_is_read_as_ros_reads_it(start, tmp_path):
    path = tmp_path / "scalars.yaml"
    lines = [f"    k{number}: {text}\n" for number, text in enumerate(SCALARS)]
    path.write_text("/**:\n  ros__parameters:\n" + "".join(lines))
    ours = read_parameter_file(path)
    node = start("--params-file", str(path))
    for number, text in enumerate(SCALARS):
        read_by_ros = node.get_parameter(f"k{number}").value
        assert repr(ours[f"k{number}"]) == repr(read_by_ros), text
