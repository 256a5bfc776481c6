"""What the node's command line says of parameters is checked before ROS reads it."""

import pytest

from ctcbs_ros.errors import InputError
from ctcbs_ros.nodes.arguments import check_arguments


@pytest.mark.parametrize(
    "arguments",
    [
        ["-p", "cable.length:=abc"],
        ["-p", "predictor:publish_cable:=1"],
        ["--param", "limits.near_jump:=-5.0"],
        ["--params-file", "absent.yaml"],
    ],
)
def test_only_what_is_meant_for_ros_is_checked(arguments):
    with pytest.raises(InputError):
        check_arguments(["predictor", "--ros-args", *arguments])
    check_arguments(["predictor", *arguments])
    check_arguments(["predictor", "--ros-args", "-r", "a:=b", "--", *arguments])


def test_what_ros_takes_is_let_through(tmp_path):
    file = tmp_path / "of_two_nodes.yaml"
    file.write_text(
        "/other:\n  ros__parameters: {rate: 5}\n"
        "/**:\n  ros__parameters: {cable: {length: 150.0}}\n"
    )
    check_arguments(
        ["predictor", "--ros-args", "--params-file", str(file), "-p", "cable.length:=1.5e2",
         "-p", "mavlink.url:=udpin:127.0.0.1:14550", "-p", "use_sim_time:=true",
         "-p", "qos_overrides./clock.depth:=3", "-r", "__ns:=/tow", "-p"]
    )  # fmt: skip
