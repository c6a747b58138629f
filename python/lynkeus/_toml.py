"""Dictionaries as TOML, for studies that are made in Python."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any, SupportsFloat

from .errors import InputError

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def key(name: str) -> str:
    return name if _BARE.match(name) else text(name)


def text(value: str) -> str:
    valid(value)
    quoted = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04X}" for c in quoted) + '"'


def valid(value: str) -> str:
    """A text as it is, unless it is none for any other program."""
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InputError(
            f"expected a text in Unicode, found half of a character (a lone surrogate) at place {error.start} "
            f"of {value[max(0, error.start - 20) : error.start + 20]!r}"
        ) from None
    return value


def number(value: SupportsFloat) -> str:
    exact = float(value)
    if math.isnan(exact):
        return "nan"
    if math.isinf(exact):
        return "inf" if exact > 0 else "-inf"
    return repr(exact)


def inline(value: Any, where: str) -> str:
    """A value on one line; ``where`` names it in messages."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return number(value)
    if isinstance(value, str):
        return text(value)
    if hasattr(value, "tolist"):  # arrays and scalars of NumPy
        return inline(value.tolist(), where)
    if isinstance(value, Mapping):
        pairs = (f"{key(str(k))} = {inline(v, f'{where}.{k}')}" for k, v in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(inline(v, where) for v in value) + "]"
    raise InputError(
        f"{where}: expected a number, a text, a list or a dictionary, found {type(value).__name__}"
    )


def document(study: Mapping[str, Any]) -> str:
    """A study's text: keys first, then sections; what is ``None`` is left out."""
    try:
        return _document(study)
    except RecursionError:
        raise InputError("the study: a value contains itself, or lists in lists have no end") from None


def _document(study: Mapping[str, Any]) -> str:
    given = {k: v for k, v in study.items() if v is not None}
    plain = {k: v for k, v in given.items() if not isinstance(v, Mapping)}
    lines = [f"{key(k)} = {inline(v, k)}" for k, v in plain.items()]
    for name, section in given.items():
        if name in plain:
            continue
        lines += ["", f"[{key(name)}]"]
        lines += [f"{key(str(k))} = {inline(v, f'{name}.{k}')}" for k, v in section.items() if v is not None]
    return "\n".join(lines).strip() + "\n"
