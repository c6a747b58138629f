"""Answers that travel: what an answer of the engine tells, without the engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _lynkeus
from ._optional import needed
from .errors import LynkeusError

Column = NDArray[np.float64]


@dataclass(frozen=True)
class Kept:
    """What :class:`_lynkeus.Answer` is asked, answered beforehand."""

    told: str
    page: str
    summary: str
    named: tuple[tuple[str, Column], ...]
    picture: str | LynkeusError | None
    drawn: tuple[str, list[tuple[str, str]]] | LynkeusError | None
    corrected: tuple[list[str], list[str], list[tuple[str, Column]]] | None
    zero: tuple[int, bool, float] | None
    refused: LynkeusError | None
    warned: tuple[str, ...]
    seen: tuple[tuple[str, Column], ...] | LynkeusError

    @classmethod
    def of(cls, core: Any) -> Kept:
        """Of an answer, which may be one of these."""
        if isinstance(core, cls):
            return core
        headers = core.headers()
        return cls(
            core.text(),
            core.html(),
            core.json(),
            tuple((name, core.column(place)) for place, name in enumerate(headers)),
            _tried(core.svg),
            _tried(core.panels),
            core.corrections(),
            core.origin(),
            core.refusal(),
            tuple(core.warnings()),
            _tried(lambda: tuple(core.log())),
        )

    def text(self) -> str:
        return self.told

    def html(self) -> str:
        return self.page

    def json(self) -> str:
        return self.summary

    def headers(self) -> list[str]:
        return [name for name, _ in self.named]

    def rows(self) -> int:
        return len(self.named[0][1]) if self.named else 0

    def column(self, place: int) -> Column | None:
        return self.named[place][1].copy() if place < len(self.named) else None

    def arrow_schema(self) -> object:
        return self._arrow().schema.__arrow_c_schema__()

    def arrow_stream(self) -> object:
        return self._arrow().__arrow_c_stream__()

    def _arrow(self) -> Any:
        arrow = needed("pyarrow", "an answer that was pickled")
        columns = {name: arrow.array(values, from_pandas=True) for name, values in self.named}
        return arrow.table(columns)

    def svg(self) -> str | None:
        found: str | None = _given(self.picture)
        return found

    def panels(self) -> tuple[str, list[tuple[str, str]]] | None:
        found: tuple[str, list[tuple[str, str]]] | None = _given(self.drawn)
        return found

    def corrections(self) -> tuple[list[str], list[str], list[tuple[str, Column]]] | None:
        return self.corrected

    def origin(self) -> tuple[int, bool, float] | None:
        return self.zero

    def refusal(self) -> LynkeusError | None:
        return self.refused

    def warnings(self) -> list[str]:
        return list(self.warned)

    def log(self) -> list[tuple[str, Column]]:
        return list(_given(self.seen))


def _tried(question: Any) -> Any:
    try:
        return question()
    except LynkeusError as error:
        return error


def _given(answer: Any) -> Any:
    if isinstance(answer, LynkeusError):
        raise answer
    return answer


def log_again(columns: list[tuple[str, Any]]) -> _lynkeus.Log:
    """A log of the columns that travelled."""
    return _lynkeus.Log.from_columns(columns)
