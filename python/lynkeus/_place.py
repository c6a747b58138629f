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


def refusal(message: str, place: Place | None, hint: str | None = None) -> TraceError:
    """A message as those of the command: what is wrong, where, and what to do."""
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
    if file.startswith(_OURS) or file.startswith("<frozen"):
        return False
    return not file.startswith(_STDLIB) or "site-packages" in file
