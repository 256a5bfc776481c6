"""Reading a ROS parameter file, with or without ROS, to the same values.

The file is composed to YAML nodes only, nothing is constructed from tags; what a plain scalar
means is decided here as ROS's own parser (rcl_yaml_param_parser) decides it, which differs from
YAML 1.1: `2.0e9` is a number, `1:30` and `1_000` are text, `y` and `on` are true.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

import yaml

from ctcbs_ros.errors import InputError

SIZE_LIMIT = 1_000_000  # bytes; a real file has a few thousand

TRUE = {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
FALSE = {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
EMPTY = {"", "~", "null", "Null", "NULL"}
# C's strtol with base 0 and strtod, which ROS calls: 0x10 is 16, 010 is 8, 08 is 8.0.
INTEGER = re.compile(r"[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
NOT_FINITE = re.compile(r"[-+]?(\.inf|\.Inf|\.INF|(?i:inf|infinity|nan))|\.nan|\.NaN|\.NAN")


class _Composer(yaml.BaseLoader):
    """Composes nodes without resolving scalars, and refuses aliases (as ROS does) and tags."""

    def compose_node(self, parent: Any, index: Any) -> yaml.Node:
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise _error("aliases are not allowed", event)
        if event.tag is not None:
            raise _error("tags are not allowed", event)
        return super().compose_node(parent, index)


def _error(problem: str, place: yaml.Event | yaml.Node) -> yaml.MarkedYAMLError:
    return yaml.composer.ComposerError(None, None, problem, place.start_mark)


def read_parameter_file(path: str | Path) -> dict[str, Any]:
    """Read the parameters under `/**: ros__parameters:`.

    Returns
    -------
    dict
        The nested mapping as written: bool, int, float, str, None, lists and dicts; unchecked.

    Raises
    ------
    InputError
        If the file cannot be read, is over 1 MB, not UTF-8, not YAML, has a key twice, or has
        anything but `/**:` with `ros__parameters:` at its top.
    """
    document = _parse(_text_of(path), path)
    if document is None:
        raise InputError(f"{path}: empty: must hold '/**:', 'ros__parameters:' and parameters")
    for name in ("/**", "ros__parameters"):
        if not isinstance(document, dict) or list(document) != [name]:
            found = f", not {_listed(document)}" if isinstance(document, dict) else ""
            raise InputError(
                f"{path}: must hold '/**:' alone, under it 'ros__parameters:' alone, "
                f"and under that the parameters; '{name}:' was expected{found}"
            )
        document = document[name]
    if not isinstance(document, dict):
        raise InputError(f"{path}: no parameters under 'ros__parameters:'")
    return document


def require_yaml(path: str | Path) -> None:
    """Refuse a file that ROS cannot read, which tells less about it.

    It may hold the parameters of other nodes, too, and what is allowed there.

    Raises
    ------
    InputError
        If the file cannot be read, is over 1 MB, not UTF-8 or not YAML.
    """
    text = _text_of(path)
    with _told(path):
        yaml.compose(text, Loader=yaml.SafeLoader)


def parameter_value(text: str, source: str) -> Any:
    """One value, as a parameter file would have it behind a key.

    Raises
    ------
    InputError
        If it is not YAML; `source` says where it was given.
    """
    return _parse(text, source)


def _listed(names: dict[str, Any]) -> str:
    shown = ", ".join(repr(name[:40]) for name in list(names)[:3])
    return shown + (", ..." if len(names) > 3 else "")


def _text_of(path: str | Path) -> str:
    try:
        with open(path, "rb") as file:
            raw = file.read(SIZE_LIMIT + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(raw) > SIZE_LIMIT:
        raise InputError(f"{path}: larger than 1 MB: not a parameter file")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from None


def _parse(text: str, path: str | Path) -> Any:
    with _told(path):
        root = yaml.compose(text, Loader=_Composer)
        return None if root is None else _value(root)


@contextmanager
def _told(path: str | Path) -> Iterator[None]:
    """What is wrong with YAML as an InputError."""
    try:
        yield
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        raise InputError(
            f"{path}: line {mark.line + 1}, column {mark.column + 1}: not valid: {error.problem}"
        ) from None
    except yaml.reader.ReaderError as error:
        raise InputError(
            f"{path}: not text: character #x{error.character:04x} at {error.position}"
        ) from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply: not a parameter file") from None


def _value(node: yaml.Node) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_value(item) for item in node.value]
    if isinstance(node, yaml.ScalarNode):
        return _plain_scalar(node.value) if node.style is None else node.value
    mapping: dict[str, Any] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise _error("a key must be a name", key)
        if key.value in mapping:
            raise _error(f"{key.value[:40]!r} is given twice", key)
        mapping[key.value] = _value(value)
    return mapping


def _plain_scalar(text: str) -> bool | int | float | str | None:
    if text in EMPTY:
        return None
    if text in TRUE:
        return True
    if text in FALSE:
        return False
    if INTEGER.fullmatch(text) and len(text) < 64:
        digits = text.lstrip("+-").lower()
        base = 16 if digits.startswith("0x") else 8 if digits.startswith("0") else 10
        number = int(text, base)
        return number if -(2**63) <= number < 2**63 else float(number)
    if NOT_FINITE.fullmatch(text):
        return float(text.replace(".", ""))
    if FLOAT.fullmatch(text) and isfinite(float(text)):  # ROS too takes 1e999 for text
        return float(text)
    return text
