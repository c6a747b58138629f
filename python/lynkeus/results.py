"""What commands answer."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _lynkeus
from .errors import LynkeusError

if TYPE_CHECKING:
    import pandas
    import polars
    from matplotlib.axes import Axes

Column = NDArray[np.float64]


class Record(dict[str, Any]):
    """An object of a report: its entries are attributes as well."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no entry {name!r}: there are {', '.join(self)}") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(k for k in self if k.isidentifier())]


class Answer:
    """What a command answers; ``str(answer)`` is what the command prints.

    ``summary`` is the command's ``--json``; its entries are attributes of the answer as well.
    """

    def __init__(self, core: _lynkeus.Answer) -> None:
        self._core = core

    @cached_property
    def summary(self) -> Record:
        """The answer for programs, as the command's ``--json`` prints it."""
        found: Record = json.loads(self._core.json(), object_hook=Record)
        return found

    def to_json(self) -> str:
        """The same as text."""
        return self._core.json()

    @cached_property
    def notes(self) -> list[str]:
        """What the user should know."""
        return self._core.notes()

    @cached_property
    def refusal(self) -> LynkeusError | None:
        """What speaks against the result although there is one, as an exception to be raised."""
        return self._core.refusal()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        summary = self.summary
        if name in summary:
            return summary[name]
        kind = type(self).__name__
        raise AttributeError(f"{kind!r} has no attribute {name!r}; its summary has {', '.join(summary)}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(k for k in self.summary if k.isidentifier())]

    def __str__(self) -> str:
        return self._core.text().rstrip("\n")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}\n{self}>"

    def to_svg(self) -> str | None:
        """The command's picture, where it draws one."""
        return self._core.svg()

    def _repr_html_(self) -> str:
        text = f"<pre>{html.escape(str(self))}</pre>"
        try:
            picture = self.to_svg()
        except LynkeusError:
            picture = None
        return text + (picture or "")


class Check(Answer):
    """Which states, inputs and parameters can be known, and by which observer."""


class Design(Answer):
    """The observer that the study asks for, with the numbers that led to it."""


class Certificate(Answer):
    """What is proved of the observer on the declared box."""

    @property
    def verdict(self) -> str:
        """``proved``, ``refuted`` or ``undecided``."""
        return str(self.summary["certificate"]["verdict"])


class Table(Answer):
    """An answer with columns: ``result["x_hat"]`` is a NumPy array."""

    @cached_property
    def columns(self) -> list[str]:
        """Headers of the columns, in order."""
        return self._core.headers()

    @cached_property
    def _columns(self) -> dict[str, Column]:
        return {}

    def __getitem__(self, name: str) -> Column:
        known = self._columns.get(name)
        if known is not None:
            return known
        try:
            place = self.columns.index(name)
        except ValueError:
            raise KeyError(f"{name!r}: expected one of {', '.join(self.columns)}") from None
        column = self._core.column(place)
        assert column is not None  # a header has a column
        column.flags.writeable = False
        self._columns[name] = column
        return column

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self[self.columns[0]]) if self.columns else 0

    def keys(self) -> list[str]:
        """Headers of the columns: ``dict(result)`` has them all."""
        return self.columns

    def to_dict(self) -> dict[str, Column]:
        """All columns by their headers."""
        return {name: self[name] for name in self.columns}

    def to_pandas(self) -> pandas.DataFrame:
        """As a data frame of pandas."""
        import pandas

        return pandas.DataFrame(self.to_dict())

    def to_polars(self) -> polars.DataFrame:
        """As a data frame of polars."""
        import polars

        return polars.DataFrame(self.to_dict())


class Run(Table):
    """Columns over time: of a simulation, of a replay, of many runs."""

    @property
    def t(self) -> Column:
        """The times of the rows."""
        return self[self.columns[0]]

    @property
    def is_credible(self) -> bool:
        """Whether nothing speaks against the estimates; else :attr:`refusal` tells what does."""
        return self.refusal is None

    def plot(self, ax: Axes | None = None, names: list[str] | None = None) -> Axes:
        """Draws columns over time with matplotlib: those of ``names``, or every estimate with its
        true value where there is one."""
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.figure().add_subplot()
        shown = names if names is not None else self._shown()
        for name in shown:
            is_estimate = name not in shown or name in self._estimates().values()
            ax.plot(self.t, self[name], label=name, linestyle="-" if is_estimate else "--")
        ax.set_xlabel(self.columns[0])
        ax.legend()
        return ax

    def _estimates(self) -> dict[str, str]:
        return dict(self.summary.get("estimates", {}))

    def _shown(self) -> list[str]:
        shown: list[str] = []
        for name, header in self._estimates().items():
            shown += [name, header] if name in self.columns else [header]
        return shown or self.columns[1:]


class Simulation(Run):
    """The plant with its observer."""

    @cached_property
    def log(self) -> dict[str, Column]:
        """What a logger would have seen: to be given to ``estimate``."""
        return dict(self._core.log())


class Estimation(Run):
    """A log through the observer."""


class MonteCarlo(Run):
    """Many runs: mean, quantile bands and the worst."""


class Sweep(Table):
    """A tuning over its values."""


class HowWell(Run):
    """Standard errors over the horizon."""


class Comparison(Answer):
    """Observer families side by side."""

    def __getitem__(self, family: str) -> Record:
        for row in self.summary["families"]:
            if row["family"] == family:
                found: Record = row
                return found
        names = ", ".join(row["family"] for row in self.summary["families"])
        raise KeyError(f"{family!r}: expected one of {names}")


def figures(run: Run) -> dict[str, Any]:
    """What is kept of a run where nothing else is asked for: whether it is ``credible``, what speaks
    against it (``refusal``, else ``None``), and of a simulation the root mean square error over the
    last half of its rows by estimated quantity, ``rms_NAME``."""
    refusal: LynkeusError | None = run.refusal
    errors = run.summary["rms_error_last_half"] or {}
    rms = {f"rms_{name}": error for name, error in errors.items()}
    return {"credible": refusal is None, "refusal": None if refusal is None else str(refusal), **rms}
