"""Where in the user's code something happened."""

from __future__ import annotations

import linecache
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import CodeType, FrameType, TracebackType
from typing import Any

import numpy as np

from .errors import TraceError

_STDLIB = sysconfig.get_path("stdlib") + os.sep
_OURS = tuple(os.path.dirname(str(file)) + os.sep for file in (__file__, np.__file__))
#: a library that calls back: the line that is told is the one that called it
_SCIPY = os.sep + os.path.join("site-packages", "scipy", "")
_TABLES = (
    "write `lynkeus.interp(x, points, values)` in place of SciPy's interpolation; a smooth curve is a"
    " polynomial written out"
)


@dataclass(frozen=True)
class Place:
    """A line of a file."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"

    @property
    def source(self) -> str:
        """The line, empty where the file cannot be read."""
        return linecache.getline(self.file, self.line).strip()


def here() -> Place | None:
    """The line of the user's code that is being carried out."""
    return _innermost(_frames(sys._getframe(1)))


def raised(error: BaseException) -> Place | None:
    """The line of the user's code that raised an error."""
    return _innermost(_behind(error.__traceback__))


def defined(function: Callable[..., Any]) -> Place | None:
    """The line on which a function begins."""
    code = getattr(function, "__code__", None) or getattr(
        getattr(type(function), "__call__", None), "__code__", None
    )
    return Place(code.co_filename, code.co_firstlineno) if isinstance(code, CodeType) else None


def tables(error: BaseException) -> str | None:
    """What to do about an error that SciPy's interpolation raised."""
    return _TABLES if any(_is_table(place) for place in _behind(error.__traceback__)) else None


def _is_table(place: Place) -> bool:
    return os.path.join(_SCIPY, "interpolate", "") in place.file


def refusal(message: str, place: Place | None, hint: str | None = None) -> TraceError:
    """A message as those of the command: what is wrong, where, and what to do."""
    if any(_is_table(frame) for frame in _frames(sys._getframe(1))):
        hint = _TABLES
    lines = [message]
    if place is not None:
        lines.append(f" --> {place}")
        if place.source:
            lines += ["  |", f"  | {place.source}", "  |"]
    if hint is not None:
        lines.append(f"help: {hint}")
    return TraceError("\n".join(lines), message, None if place is None else str(place), hint)


def _frames(frame: FrameType | None) -> Iterator[Place]:
    while frame is not None:
        yield Place(frame.f_code.co_filename, frame.f_lineno)
        frame = frame.f_back


def _behind(trace: TracebackType | None) -> list[Place]:
    steps = [Place(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(trace)]
    return steps[::-1]


def _innermost(places: Iterator[Place] | list[Place]) -> Place | None:
    return next((place for place in places if _is_users(place.file)), None)


def _is_users(file: str) -> bool:
    if file.startswith(_OURS) or file.startswith("<frozen") or _SCIPY in file:
        return False
    return not file.startswith(_STDLIB) or "site-packages" in file
