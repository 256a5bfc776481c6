"""What one parameter may be, and the check of a value against it."""

import array
import reprlib
from dataclasses import dataclass
from math import inf, isinf, isnan
from typing import Any

from ctcbs_ros.errors import InputError

_short = reprlib.Repr()
_short.maxstring = _short.maxother = 80


def shown(value: Any) -> str:
    """A value as errors show it: on one line, and no longer than one."""
    return _short.repr(value)


@dataclass(frozen=True, kw_only=True)
class ParameterSpec:
    """One parameter.

    Attributes
    ----------
    key : str
        Dotted name, as ROS has it: "cable.length".
    type : type
        float, int, bool, str, or list for the two ends of a range (two floats, the lower first).
    unit : str
        Unit, "" for a pure number or text.
    meaning : str
        One phrase.
    default : object
        Value where the user gives none; None stands for no value at all.
    required : bool
        Whether the user must give it.
    minimum, maximum : float
        Allowed range, both ends included; for a list, of each of its two numbers.
    infinite, missing : bool
        Whether inf, or nan for "not known", is allowed besides the range.
    choices : tuple of str
        The allowed texts; empty for any.
    runtime : bool
        Whether the running node accepts a change.
    """

    key: str
    type: type
    unit: str = ""
    meaning: str
    default: Any = None
    required: bool = False
    minimum: float = -inf
    maximum: float = inf
    infinite: bool = False
    missing: bool = False
    choices: tuple[str, ...] = ()
    runtime: bool = False

    @property
    def allowed(self) -> str:
        """What may stand here, in words: "a number from 0.01 to 50000 m"."""
        if self.type is bool:
            return "true or false"
        if self.type is str:
            return " or ".join(repr(choice) for choice in self.choices) or "text"
        kind = {float: "a number", int: "a whole number", list: "[min, max], two numbers"}
        text = f"{kind[self.type]} from {self.minimum:g} to {self.maximum:g} {self.unit}".rstrip()
        text += ", or .inf" if self.infinite else ""
        return text + (", or .nan" if self.missing else "")

    @property
    def description(self) -> str:
        """Meaning, unit and default in one line, for a parameter descriptor."""
        text = f"{self.meaning} [{self.unit}]" if self.unit else self.meaning
        if self.required:
            return f"{text}; required"
        return text if self.default is None else f"{text}; default {self.default!r}"

    def check(self, value: Any, source: str) -> Any:
        """Return `value` if it may stand here (a list as a tuple).

        Raises
        ------
        InputError
            Naming source, key, value and what is allowed.
        """
        items, kind = (value,), self.type
        if self.type is list:
            if not isinstance(value, list | tuple | array.array):
                raise self._refusal(value, source, f" (got {_kind(value)})")
            value = items = tuple(value)
            kind = float
            if len(value) != 2:
                raise self._refusal(value, source, f" (got {len(value)})")
        for item in items:
            if type(item) is not kind:
                whole = (kind, type(item)) == (float, int)
                hint = f"; write {item}.0" if whole and self._in_range(item) else ""
                raise self._refusal(value, source, f" (got {_kind(item)}{hint})")
            if kind in (float, int) and not self._in_range(item):
                raise self._refusal(value, source)
        if self.type is list and not value[0] < value[1]:
            raise self._refusal(value, source, ", the first below the second")
        if self.choices and value not in self.choices:
            raise self._refusal(value, source)
        return value

    def _in_range(self, number: float) -> bool:
        if isnan(number):
            return self.missing
        if isinf(number):
            return self.infinite and number > 0
        return self.minimum <= number <= self.maximum

    def _refusal(self, value: Any, source: str, remark: str = "") -> InputError:
        value = shown(list(value) if isinstance(value, tuple) else value)
        return InputError(f"{source}: {self.key} = {value}: must be {self.allowed}{remark}")


def _kind(value: Any) -> str:
    """The YAML name of a value's type."""
    names = {
        bool: "true/false", int: "a whole number", float: "a number", str: "text", list: "a list",
        dict: "a mapping", type(None): "no value",
    }  # fmt: skip
    return names.get(type(value), type(value).__name__)
