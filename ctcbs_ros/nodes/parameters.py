"""The table of parameters (`ctcbs_ros.schema`) as the parameters of a ROS node."""

from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from ctcbs_ros.parameter_spec import ParameterSpec
from ctcbs_ros.schema import PARAMETERS, checked_parameters

ROS_TYPES = {
    float: Parameter.Type.DOUBLE,
    int: Parameter.Type.INTEGER,
    bool: Parameter.Type.BOOL,
    str: Parameter.Type.STRING,
    list: Parameter.Type.DOUBLE_ARRAY,
}


def declare_parameters(node: Node) -> dict[str, Any]:
    """Declare every parameter of the table on a node, after checking what the user set.

    Parameters
    ----------
    node : Node
        Made with `automatically_declare_parameters_from_overrides=True`; otherwise a misspelt
        parameter would go unnoticed, as ROS drops what is not declared.

    Returns
    -------
    dict
        Value by dotted key, as `checked_parameters` gives it.

    Raises
    ------
    InputError
        If a parameter that was set is unknown or refused, or a required one is missing.
    """
    given = node.get_parameters_by_prefix("")
    values = checked_parameters(
        {key: parameter.value for key, parameter in given.items()},
        f"parameters of {node.get_fully_qualified_name()}",
    )
    for spec in PARAMETERS:
        if spec.key in given:  # declared from the override, with no descriptor
            node.undeclare_parameter(spec.key)
        node.declare_parameter(
            spec.key, values.get(spec.key, ROS_TYPES[spec.type]), describe(spec)
        )
    return values


def describe(spec: ParameterSpec) -> ParameterDescriptor:
    """Descriptor of one parameter: type, meaning, unit, default, range, and if it may change.

    There is no range where nan is allowed, which no range of ROS contains.
    """
    descriptor = ParameterDescriptor(
        name=spec.key,
        type=ROS_TYPES[spec.type].value,
        description=spec.description,
        additional_constraints=spec.allowed,
        read_only=not spec.runtime,
    )
    if spec.type is float and not spec.missing:
        highest = float("inf") if spec.infinite else spec.maximum
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=spec.minimum, to_value=highest)
        ]
    elif spec.type is int:
        descriptor.integer_range = [IntegerRange(from_value=spec.minimum, to_value=spec.maximum)]
    return descriptor
