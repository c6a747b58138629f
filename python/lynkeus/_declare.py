"""What a model from functions declares: names with start values, ranges, units, descriptions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from numbers import Real
from typing import Any

import numpy as np

from . import modelica
from .errors import InputError

_RANGE = ("min", "max", "unit", "description")
_KEYS = {
    "states": ("start", "fixed", "nominal", *_RANGE, "size"),
    "inputs": ("start", "nominal", *_RANGE, "size"),
    "outputs": (*_RANGE, "size"),
    "params": ("value", *_RANGE),
}
#: What stands in parentheses behind a name.
_WRITTEN = ("start", "fixed", "nominal", "unit", "min", "max")
#: What a plain number beside a name is.
_VALUE = {"states": "start", "inputs": "start", "params": "value"}
_LONGEST_NAME = 250


@dataclass(frozen=True)
class Entry:
    """A variable or an array of them; ``shape`` is empty for a scalar."""

    role: str
    name: str
    shape: tuple[int, ...] = ()
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    def elements(self) -> list[str]:
        """The names of the elements, row by row, as Modelica writes them."""
        name = modelica.name(self.name)
        if not self.shape:
            return [name]
        return [f"{name}[{','.join(str(i + 1) for i in place)}]" for place in np.ndindex(self.shape)]

    def written(self, prefix: str, binding: str | None = None) -> str:
        """The declaration."""
        sizes = f"[{', '.join(map(str, self.shape))}]" if self.shape else ""
        given = self.attributes
        attributes = [self._attribute(key) for key in _WRITTEN if key in given]
        written = f"{prefix}Real {modelica.name(self.name)}{sizes}"
        if attributes:
            written += f"({', '.join(attributes)})"
        if binding is not None:
            written += f" = {binding}"
        if "description" in given:
            written += f" {modelica.text(given['description'])}"
        return f"  {written};"

    def _attribute(self, key: str) -> str:
        value = self.attributes[key]
        each = "each " if self.shape and not isinstance(value, np.ndarray) else ""
        return f"{each}{key} = {literal(value)}"


def literal(value: Any) -> str:
    """A number, a truth, a text or an array of numbers in Modelica."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return modelica.text(value)
    if isinstance(value, np.ndarray):
        return "{" + ", ".join(literal(part) for part in value) + "}"
    return modelica.number(float(value))


def entries(role: str, given: Any) -> list[Entry]:
    """The declarations of an argument ``states``, ``inputs``, ``outputs`` or ``params``: a list of names, or
    a dictionary of them with numbers, arrays, or dictionaries of attributes."""
    if isinstance(given, Mapping):
        return [_entry(role, name, said) for name, said in given.items()]
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"{role}: expected a list of names, or a dictionary of them, found {given!r}")
    if role == "params" and (names := list(given)):
        raise InputError(f"params: {names[0]!r} has no value: write {{{names[0]!r}: 1.0, …}}")
    return [_entry(role, name, None) for name in given]


def _entry(role: str, name: Any, said: Any) -> Entry:
    _check_name(role, name)
    where = f"{role}: `{name}`"
    if said is None:
        said = {}
    elif not isinstance(said, Mapping):
        if role not in _VALUE:
            raise InputError(f"{where}: expected a dictionary of {_list(_KEYS[role])}, found {said!r}")
        said = {_VALUE[role]: said}
    for key in said:
        if key not in _KEYS[role]:
            near = get_close_matches(str(key), _KEYS[role], n=1)
            hint = f"; did you mean `{near[0]}`?" if near else ""
            raise InputError(f"{where}: expected {_list(_KEYS[role])}, found `{key}`{hint}")
    return _sized(role, name, where, {k: v for k, v in said.items() if v is not None})


def _sized(role: str, name: str, where: str, said: dict[str, Any]) -> Entry:
    """An entry with the shape that its size, or its arrays, say."""
    attributes = {k: _checked(k, v, f"{where}.{k}") for k, v in said.items() if k != "size"}
    if role == "params" and "value" not in attributes:
        raise InputError(f'{where}: expected a value: write {{{name!r}: {{"value": 1.0}}}}')
    shape = _shape(said["size"], f"{where}.size") if "size" in said else None
    for key, value in attributes.items():
        if not isinstance(value, np.ndarray):
            continue
        if shape is not None and shape != value.shape:
            raise InputError(f"{where}.{key}: expected {_sizes(shape)} numbers, found {_sizes(value.shape)}")
        shape = value.shape
    _check_range(where, attributes)
    open_ends = {"min": -math.inf, "max": math.inf}
    kept = {k: v for k, v in attributes.items() if isinstance(v, np.ndarray) or v != open_ends.get(k)}
    return Entry(role, name, shape or (), kept)


def _check_range(where: str, attributes: Mapping[str, Any]) -> None:
    low, high = attributes.get("min", -math.inf), attributes.get("max", math.inf)
    if np.shape(low) in ((), np.shape(high)) or np.shape(high) == ():
        if np.any(np.asarray(low) > np.asarray(high)):
            raise InputError(f"{where}: expected min <= max, found min = {low} and max = {high}")


def _checked(key: str, value: Any, where: str) -> Any:
    if key in ("unit", "description"):
        if isinstance(value, str):
            return value
        raise InputError(f"{where}: expected a text, found {value!r}")
    if key == "fixed":
        if isinstance(value, (bool, np.bool_)):
            return bool(value)
        raise InputError(f"{where}: expected True or False, found {value!r}")
    return _numbers(value, where, open_ended=key in ("min", "max"))


def _numbers(value: Any, where: str, *, open_ended: bool) -> float | np.ndarray[Any, Any]:
    if isinstance(value, (Real, np.bool_)):
        number = float(value)
        if math.isfinite(number) or (open_ended and not math.isnan(number)):
            return number
        raise InputError(f"{where}: expected a finite number, found {number}")
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        array = np.asarray("")
    if array.dtype.kind not in "iufb":
        raise InputError(f"{where}: expected a number or an array of them, found {value!r}")
    if array.ndim == 0:
        return _numbers(array.item(), where, open_ended=open_ended)
    if array.size == 0 or not np.isfinite(array).all():
        raise InputError(f"{where}: expected finite numbers, found {value!r}")
    return array.astype(float)


def _shape(size: Any, where: str) -> tuple[int, ...]:
    sizes = size if isinstance(size, (tuple, list)) else (size,)
    if not sizes or any(isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 1 for n in sizes):
        raise InputError(f"{where}: expected a whole number, 1 or larger, or a tuple of them, found {size!r}")
    return tuple(int(n) for n in sizes)


def _check_name(role: str, name: Any) -> None:
    if not isinstance(name, str):
        raise InputError(f"{role}: expected names, found {name!r}")
    if not name or name != name.strip() or not name.isprintable() or set("'\\[]") & set(name):
        hint = "an array is declared by its name, with `size` or an array of start values"
        raise InputError(
            f"{role}: {name!r} is no name: expected letters, digits, blanks and signs other than"
            f" ' \\ [ ]; {hint}"
        )
    if name == "time":
        raise InputError(f"{role}: `time` is a word of the language: choose another name; f has it as `t`")
    if len(name.encode()) > _LONGEST_NAME:
        raise InputError(f"{role}: the name {name[:40]}… is longer than {_LONGEST_NAME} characters")


def check_distinct(declared: Iterable[Entry]) -> None:
    """Refuses a name that is declared twice."""
    seen: dict[str, Entry] = {}
    for entry in declared:
        if entry.name in seen:
            first = seen[entry.name].role
            message = f"`{entry.name}` is declared already, in {first}: choose another name"
            raise InputError(f"{entry.role}: {message}")
        seen[entry.name] = entry


def _sizes(shape: tuple[int, ...]) -> str:
    return "×".join(map(str, shape)) or "one"


def _list(keys: Iterable[str]) -> str:
    return ", ".join(f"`{key}`" for key in keys)
