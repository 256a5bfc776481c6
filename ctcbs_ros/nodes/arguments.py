"""The command line's parameters checked before ROS reads them.

Where a file gives a parameter and `-p` gives it in another type, ROS takes one of the two without
a word (rcl keeps the values of both types); and of a file that it cannot read it says little.
"""

from collections.abc import Sequence
from pathlib import Path

from ctcbs_ros.parameter_file import parameter_value, require_yaml
from ctcbs_ros.parameter_spec import ParameterSpec
from ctcbs_ros.schema import BY_KEY

_FILE = "--params-file"
_VALUE = ("-p", "--param")
_SIM_TIME = ParameterSpec(key="use_sim_time", type=bool, meaning="time from /clock")
FORM = "a parameter file holds '/**:', under it 'ros__parameters:', and under that the parameters"


def check_arguments(arguments: Sequence[str]) -> None:
    """Check files and values of parameters in a command line.

    Raises
    ------
    InputError
        Where a file is not there or not YAML, or a value is refused.
    """
    ros = False
    for argument, value in zip(arguments, [*arguments[1:], ""], strict=True):
        ros = argument == "--ros-args" or (ros and argument != "--")
        if ros and argument == _FILE:
            require_yaml(Path(value))
        elif ros and argument in _VALUE:
            _check_value(value)


def _check_value(assignment: str) -> None:
    """Check NAME:=VALUE or NODE:NAME:=VALUE."""
    name, assigned, text = assignment.partition(":=")
    key = name.rpartition(":")[2]
    spec = _SIM_TIME if key == _SIM_TIME.key else BY_KEY.get(key)
    if assigned and spec is not None:
        spec.check(parameter_value(text, f"-p {name}"), "command line, -p")
