"""What arguments of the package's functions are to be; another is refused by name."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, TypeVar

import numpy as np

from .errors import ArgumentError

_Given = ParamSpec("_Given")
_Found = TypeVar("_Found")
#: an argument as it is meant, from its name and what was given
Check = Callable[[str, Any], Any]


def takes(**checks: Check) -> Callable[[Callable[_Given, _Found]], Callable[_Given, _Found]]:
    """A function whose arguments go through these checks first; what is left out does not."""

    def decorated(function: Callable[_Given, _Found]) -> Callable[_Given, _Found]:
        shape = signature(function)

        @wraps(function)
        def checked(*args: _Given.args, **kwargs: _Given.kwargs) -> _Found:
            try:
                given = shape.bind(*args, **kwargs)
            except TypeError:
                return function(*args, **kwargs)  # which says so with its name
            for name in given.arguments.keys() & checks.keys():
                given.arguments[name] = checks[name](name, given.arguments[name])
            return function(*given.args, **given.kwargs)

        return checked

    return decorated


def optional(check: Check) -> Check:
    """The same, or ``None``."""
    return lambda name, value: None if value is None else check(name, value)


def real(expected: str = "a number") -> Check:
    """A number, whoever made it; no text."""

    def check(name: str, value: Any) -> float:
        if not isinstance(value, (str, bytes)):
            try:
                return float(value)
            except (TypeError, ValueError, OverflowError):
                pass
        raise ArgumentError.of(name, expected, value)

    return check


def whole(name: str, value: Any) -> int:
    """A whole number that the engine can hold."""
    if not isinstance(value, (bool, np.ndarray)):
        try:
            found = operator.index(value)
        except TypeError:
            pass
        else:
            if abs(found) < 2**63:
                return found
    raise ArgumentError.of(name, "a whole number of 64 bits", value)


def flag(name: str, value: Any) -> bool:
    """True or false."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise ArgumentError.of(name, "True or False", value)


def word(name: str, value: Any) -> str:
    """A text."""
    if isinstance(value, str):
        return value
    raise ArgumentError.of(name, "a text", value)


def words(name: str, value: Any) -> list[str]:
    """Texts; a single one is a list of one."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, Iterable) and not isinstance(value, (bytes, Mapping)):
        return [word(f"{name}[{place}]", item) for place, item in enumerate(value)]
    raise ArgumentError.of(name, "a text or a list of texts", value)


def path(name: str, value: Any) -> str:
    """The path of a file or a folder."""
    if isinstance(value, (str, os.PathLike)):
        found = os.fspath(value)
        if isinstance(found, str):
            return found
    raise ArgumentError.of(name, "a path", value)


def section(name: str, value: Any) -> Mapping[Any, Any]:
    """Keys and values."""
    if isinstance(value, Mapping):
        return value
    raise ArgumentError.of(name, "a dictionary", value)


def several(expected: str) -> Check:
    """What can be walked through."""

    def check(name: str, value: Any) -> Any:
        is_one = isinstance(value, (str, bytes)) or (isinstance(value, np.ndarray) and value.ndim == 0)
        if isinstance(value, Iterable) and not is_one:
            return value
        raise ArgumentError.of(name, expected, value)

    return check


def function(name: str, value: Any) -> Any:
    """What can be called."""
    if callable(value):
        return value
    raise ArgumentError.of(name, "a function", value)


def progress(name: str, value: Any) -> Any:
    """Whether progress is shown, or a function that is told it."""
    if callable(value):
        return value
    if value is None or isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise ArgumentError.of(name, "True, False or a function of the fraction done", value)


def instance(kind: type, expected: str) -> Check:
    """An object of that kind."""

    def check(name: str, value: Any) -> Any:
        if isinstance(value, kind):
            return value
        raise ArgumentError.of(name, expected, value)

    return check


#: what a call may take: seconds, MiB
LIMITS = {"time_limit": optional(real("seconds >= 0")), "memory_limit": real("MiB >= 0")}
