"""What commands answer."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from . import _lynkeus, _plot, reports
from ._kept import Kept
from ._logs import log_of
from ._optional import needed
from ._records import Record as Record, made
from .errors import InputError, LogWarning, LynkeusError, NotCredible, near
from .filtered import Filtered

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow
    from matplotlib.axes import Axes

    from ._types import LogLike, Names
    from .study import Study

Column: TypeAlias = NDArray[np.float64]
_Report = TypeVar("_Report", bound=Record)


class Answer:
    """What a command answers; ``str(answer)`` is what the command prints.

    ``summary`` is the command's ``--json``; its entries are attributes of the answer as well, of the types
    that :mod:`lynkeus.reports` declares.
    """

    def __init__(self, core: _lynkeus.Answer | Kept) -> None:
        self._core = core

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (Kept.of(self._core),)

    @cached_property
    def summary(self) -> Record:
        """The answer for programs, as the command's ``--json`` prints it."""
        return self._made(Record)

    def _made(self, report: type[_Report]) -> _Report:
        found: _Report = made(report, json.loads(self._core.json()))
        return found

    def to_json(self) -> str:
        """The summary as text.

        Returns
        -------
        str
            A JSON object on one line, as the command prints it with ``--json``.
        """
        return self._core.json()

    @cached_property
    def notes(self) -> list[str]:
        """What the user should know."""
        certificate = self.summary.get("certificate") or {}
        return [*self.summary.get("notes", ()), *certificate.get("notes", ())]

    @cached_property
    def refusal(self) -> LynkeusError | None:
        """What speaks against the result although there is one, as an exception to be raised."""
        return self._core.refusal()

    if not TYPE_CHECKING:  # type checkers see what the answers below declare

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):
                raise AttributeError(name)
            summary = self.summary
            if name in summary:
                return summary[name]
            kind = type(self).__name__
            hint = near(name, dir(self))
            raise AttributeError(f"{kind!r} has no attribute {name!r}{hint}; its summary has {', '.join(summary)}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(k for k in self.summary if k.isidentifier())]

    def __str__(self) -> str:
        return self._core.text().rstrip("\n")

    def __repr__(self) -> str:
        return f"<{type(self).__name__}\n{self}>"

    def to_svg(self) -> str | None:
        """The command's picture.

        Returns
        -------
        str or None
            An SVG document; ``None`` where the command draws none.

        Raises
        ------
        RefusedError
            There is nothing to be drawn.
        """
        return self._core.svg()

    def _repr_html_(self) -> str:
        return f"<div>{self._core.html()}{self._picture()}</div>"

    def _picture(self) -> str:
        try:
            return self.to_svg() or ""
        except LynkeusError:
            return ""  # nothing that can be drawn


class Check(reports.CheckEntries, Answer):
    """Which states, inputs and parameters can be known, and by which observer."""

    @cached_property
    def summary(self) -> reports.CheckReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.CheckReport)


class Design(reports.DesignEntries, Answer):
    """The observer that the study asks for, with the numbers that led to it."""

    @cached_property
    def summary(self) -> reports.DesignReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.DesignReport)


class Certificate(reports.CertificateEntries, Answer):
    """What is proved of the observer on the declared box."""

    @cached_property
    def summary(self) -> reports.CertificateReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.CertificateReport)

    @property
    def verdict(self) -> reports.Verdict:
        """``proved``, ``refuted`` or ``undecided``."""
        return self.certificate.verdict


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
        if not isinstance(name, str) or name not in self.columns:
            raise KeyError(f"{name!r}: expected one of {', '.join(self.columns)}")
        known = self._columns.get(name)
        if known is not None:
            return known
        place = self.columns.index(name)
        column = self._core.column(place)
        assert column is not None  # a header has a column
        column.flags.writeable = False
        self._columns[name] = column
        return column

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    @cached_property
    def _rows(self) -> int:
        return self._core.rows()

    def __len__(self) -> int:
        return self._rows

    def __bool__(self) -> bool:
        return True

    def keys(self) -> list[str]:
        """Headers of the columns, so that ``dict(result)`` has them all.

        Returns
        -------
        list of str
            The same as :attr:`columns`.
        """
        return self.columns

    def to_dict(self) -> dict[str, Column]:
        """All columns by their headers.

        Returns
        -------
        dict of str to numpy.ndarray
            Arrays of shape (rows,), read-only, in the units of the model; NaN where there is no value.
        """
        return {name: self[name] for name in self.columns}

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The numbers of a data frame: a row for each time, a column for each header."""
        if copy is False:
            raise ValueError("the columns lie apart: an array of them is a copy")
        found = np.empty((len(self), len(self.columns)), dtype or np.float64)
        for place in range(len(self.columns)):
            found[:, place] = self._core.column(place)
        return found

    def __arrow_c_schema__(self) -> object:
        """Headers and kinds of the columns, for Arrow."""
        return self._core.arrow_schema()

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The columns for Arrow, in batches that are made as they are asked for: whoever reads
        one after the other takes little memory however long the result is. A NaN is a null;
        ``requested_schema`` is not followed, numbers are of 64 bits."""
        return self._core.arrow_stream()

    def _instants(self) -> tuple[NDArray[np.datetime64], bool] | None:
        """Dates of the rows, where they have some, and whether these are UTC."""
        return None

    def _stamp(self) -> str:
        """What a column of dates is called."""
        return next(name for name in ("time", "timestamp", "instant", "_time") if name not in self.columns)

    def to_pandas(self) -> pandas.DataFrame:
        """As a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each row, a column for each header; the index is :attr:`Run.time` where a log had dates,
            named ``time`` and in UTC where these had a zone.

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        found = needed("pandas", "to_pandas")
        columns = {name: self._core.column(place) for place, name in enumerate(self.columns)}
        index, dates = None, self._instants()
        if dates is not None:
            index = found.DatetimeIndex(dates[0], name=self._stamp(), tz="UTC" if dates[1] else None)
        frame: pandas.DataFrame = found.DataFrame(columns, index=index, copy=False)
        return frame

    def to_polars(self) -> polars.DataFrame:
        """As a data frame of polars.

        Returns
        -------
        polars.DataFrame
            A row for each row, a column for each header; a NaN is a null. Where a log had dates a first
            column ``time`` has :attr:`Run.time`, in UTC where these had a zone.

        Raises
        ------
        ImportError
            polars is not installed.
        """
        found = needed("polars", "to_polars")
        frame: polars.DataFrame = found.DataFrame(self)
        dates = self._instants()
        if dates is not None:
            time = found.Series(self._stamp(), dates[0])
            frame.insert_column(0, time.dt.replace_time_zone("UTC") if dates[1] else time)
        return frame

    def to_arrow(self) -> pyarrow.Table:
        """As a table of pyarrow. Without the whole in memory:
        ``pyarrow.RecordBatchReader.from_stream(result)``.

        Returns
        -------
        pyarrow.Table
            A row for each row, a column for each header; a NaN is a null. Where a log had dates a first
            column ``time`` has :attr:`Run.time`, in UTC where these had a zone; the stream itself has numbers
            only.

        Raises
        ------
        ImportError
            pyarrow is not installed.
        """
        found = needed("pyarrow", "to_arrow")
        table: pyarrow.Table = found.table(self)
        dates = self._instants()
        if dates is not None:
            kind = found.timestamp("us", tz="UTC" if dates[1] else None)
            table = table.add_column(0, self._stamp(), found.array(dates[0], type=kind))
        return table


class Run(Table):
    """Columns over time: of a simulation, of a replay, of many runs."""

    @property
    def t(self) -> Column:
        """The times of the rows, shape (rows,), in the model's unit of time."""
        return self[self.columns[0]]

    @cached_property
    def time(self) -> NDArray[np.datetime64] | None:
        """The times of the rows as dates, ``datetime64[us]`` of shape (rows,), in UTC where the log's had a zone;
        ``None`` where the log's times are numbers. :attr:`t` counts from the log's first date, in seconds or in ``time_unit`` of
        ``[log]``."""
        dates = self._instants()
        return None if dates is None else dates[0]

    def _instants(self) -> tuple[NDArray[np.datetime64], bool] | None:
        origin = self._core.origin()
        if origin is None:
            return None
        nanoseconds, zoned, unit = origin
        # a date that is exact to the microsecond comes back exactly: what is nearest to it in seconds is nearer to it
        # than to its neighbours
        whole, rest = divmod(nanoseconds, 1000)
        since = np.rint(self.t * unit * 1e6 + rest / 1000).astype(np.int64)
        found = (whole + since).astype("datetime64[us]")
        found.flags.writeable = False
        return found, zoned

    @property
    def is_credible(self) -> bool:
        """Whether nothing speaks against the estimates; else :attr:`refusal` tells what does."""
        return self.refusal is None

    def plot(
        self,
        ax: Axes | Sequence[Axes] | None = None,
        names: Names | str | None = None,
        truth: LogLike | None = None,
    ) -> list[Axes]:
        """Draws the run with matplotlib, a panel for each quantity: true values dashed, estimates solid with
        a band of two standard deviations where the run has them.

        Parameters
        ----------
        ax : Axes or list of Axes, optional
            One for all panels or one for each; a new figure where it is left out.
        names : list of str, optional
            Quantities, or columns; those that the study's ``[plot] show`` names where it is left out.
        truth : path, mapping of columns, data frame or table, optional
            A log with true values in columns by the quantities' names, one for each row of the run.

        Returns
        -------
        list of Axes
            The axes that were drawn into.

        Raises
        ------
        KeyError
            A name is neither a quantity nor a column.
        InputError
            There are not as many axes as panels, or the truth has another number of rows.
        ImportError
            matplotlib is not installed.
        """
        panels, time = self._panels(_plot.asked(names), {} if truth is None else self._truth(truth))
        axes = _plot.draw(panels, self.t, time, ax)
        for each in axes if self._is_logarithmic else ():
            each.set_xscale("log")
            each.set_yscale("log")
        return axes

    #: whether both axes of its picture are
    _is_logarithmic = False

    def _panels(self, names: Sequence[str] | None, truth: dict[str, Column]) -> tuple[list[_plot.Panel], str]:
        return _plot.of_run(self, names, truth)

    def _truth(self, data: Any) -> dict[str, Column]:
        log = log_of(data, "truth")
        if len(log) != len(self):
            raise InputError(f"truth: expected {len(self)} rows, as the run has, found {len(log)}")
        read = {name: log.values(name) for name in log.headers()}
        columns = {name: values for name, values in read.items() if values is not None}
        time = columns.get(self.columns[0])
        if time is None or np.isnan(time).any():
            return columns
        order = np.argsort(time, kind="stable")  # a run's rows are
        return {name: values[order] for name, values in columns.items()}


class Simulation(reports.RunEntries, Run):
    """The plant with its observer."""

    @cached_property
    def summary(self) -> reports.RunReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.RunReport)

    @cached_property
    def log(self) -> dict[str, Column]:
        """What a logger would have seen, arrays of shape (samples,) by header: to be given to ``estimate``."""
        return dict(self._core.log())


class OpenRun(reports.OpenRunEntries, Run):
    """The plant alone under the inputs of a log: states, inputs and outputs, and what of the log's readings they
    miss. ``run.errors["y"].fit_percent`` says how much of the readings of y the plant alone explains."""

    @cached_property
    def summary(self) -> reports.OpenRunReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.OpenRunReport)

    def _panels(self, names: Sequence[str] | None, truth: dict[str, Column]) -> tuple[list[_plot.Panel], str]:
        return _plot.of_open_run(self, names, truth)


class Estimation(reports.RunEntries, Run):
    """A log through the observer."""

    @cached_property
    def summary(self) -> reports.RunReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.RunReport)

    @cached_property
    def filter(self) -> Filtered:
        """What a filter (``ekf``, ``ukf``, ``mhe``) made of each row: innovations with their covariances, predicted
        outputs, gains, covariances and the likelihood. There where ``estimate(log, record=True)`` asked for it;
        else an :class:`lynkeus.InputError` says so."""
        kept = self._core.corrections()
        if kept is None:
            filters = [name for name, is_filter in _lynkeus.families() if is_filter]
            hint = "ask for it: estimate(log, record=True)"
            if self.family not in filters:
                hint = f"the {self.family} observer is no filter; those are {', '.join(filters)}"
            raise InputError(f"filter: nothing was recorded of this run; {hint}")
        return Filtered._of(kept)


class MonteCarlo(reports.MonteCarloEntries, Run):
    """Many runs: mean, quantile bands and the worst."""

    @cached_property
    def summary(self) -> reports.MonteCarloReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.MonteCarloReport)

    def _panels(self, names: Sequence[str] | None, truth: dict[str, Column]) -> tuple[list[_plot.Panel], str]:
        return _plot.of_many(self, names)


class Sweep(reports.SweepEntries, Table):
    """A tuning over its values."""

    @cached_property
    def summary(self) -> reports.SweepReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.SweepReport)


class Fit(reports.FitEntries, Table):
    """Values that were fitted to logs: ``fit.parameters["k"].value``, ``.sd``, ``.interval``. Its columns are the
    innovations of every row, ``fit["y_innovation"]``, with their deviations and the errors of the plant alone."""

    def __init__(self, core: _lynkeus.Answer | Kept, fitted: Study | None = None) -> None:
        super().__init__(core)
        self._fitted = fitted

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (Kept.of(self._core), self._fitted)

    @cached_property
    def summary(self) -> reports.FitReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.FitReport)

    @property
    def is_credible(self) -> bool:
        """Whether the search converged, the logs determine every value and no reading contradicts them; else
        :attr:`refusal` says why not."""
        return self.refusal is None

    @cached_property
    def values(self) -> dict[str, float]:
        """All values by what the table and ``correlation`` call them: ``k``, ``noise.y``, ``process_noise.x``,
        ``initial.x[1]``, of the first log."""
        found = {name: one.value for name, one in self.parameters.items()}
        for kind, group in (("noise", self.noise), ("process_noise", self.process_noise)):
            found |= {f"{kind}.{name}": one.value for name, one in group.items()}
        for name, each in self.initial.items():
            found |= {f"initial.{name}[{place}]": one.value for place, one in enumerate(each, 1)}
        return found

    def study(self) -> Study:
        """The study with the values found, as ``lynkeus fit --write`` leaves it; the starts of several logs stay out
        of it.

        Returns
        -------
        Study
            Another study; that which was fitted stays as it is.

        Raises
        ------
        RefusedError, LimitError
            The values are none of the plant's: :attr:`refusal` says why.
        """
        if self._fitted is None:
            raise self.refusal or InputError("study: this fit goes without its study")
        return self._fitted


class HowWell(reports.HowWellEntries, Run):
    """Standard errors over the horizon; drawn with both axes logarithmic."""

    _is_logarithmic = True

    @cached_property
    def summary(self) -> reports.HowWellReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.HowWellReport)

    def _panels(self, names: Sequence[str] | None, truth: dict[str, Column]) -> tuple[list[_plot.Panel], str]:
        return _plot.of_how_well(self, names)


class Comparison(reports.ComparisonEntries, Answer):
    """Observer families side by side."""

    @cached_property
    def summary(self) -> reports.ComparisonReport:
        """The answer for programs, as the command\'s ``--json`` prints it."""
        return self._made(reports.ComparisonReport)

    def __getitem__(self, family: str) -> reports.Compared:
        for row in self.families:
            if isinstance(family, str) and row.family == family:
                return row
        names = ", ".join(row.family for row in self.families)
        raise KeyError(f"{family!r}: expected one of {names}")


_Judged = TypeVar("_Judged", bound=Run | Fit)
_Answer = TypeVar("_Answer", bound=Answer)

#: where the method of the study is called, which its checks of arguments wrap
_CALLER = 4


def judged(run: _Judged) -> _Judged:
    """A run or a fit, with a warning where it is not credible, or its log is not whole."""
    if run.refusal is not None:
        warnings.warn(str(run.refusal), NotCredible, stacklevel=_CALLER)
    for text in run._core.warnings():
        warnings.warn(text, LogWarning, stacklevel=_CALLER)
    return run


def warned(answer: _Answer) -> _Answer:
    """An answer, with a warning where its log is not whole."""
    for text in answer._core.warnings():
        warnings.warn(text, LogWarning, stacklevel=_CALLER)
    return answer


def figures(run: Run) -> dict[str, Any]:
    """What is kept of a run where nothing else is asked for.

    Parameters
    ----------
    run : Run
        A simulation or an estimation.

    Returns
    -------
    dict
        ``credible``, whether nothing speaks against it; ``refusal``, what does, or ``None``; and of a simulation
        ``rms_NAME`` of each estimated quantity, the root mean square error over the last half of its
        rows in the quantity's unit.
    """
    refusal: LynkeusError | None = run.refusal
    rms = {f"rms_{name}": error for name, error in run.summary["rms_error_last_half"].items()}
    return {"credible": refusal is None, "refusal": None if refusal is None else str(refusal), **rms}
