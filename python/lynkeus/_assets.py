"""What a worker does with one asset of a fleet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from . import _lynkeus
from ._logs import log_of
from ._optional import needed
from .errors import LynkeusError
from .results import Estimation
from .study import Study


@dataclass(frozen=True)
class Signals:
    """Columns of a fleet: of its assets and time, what the observer reads, and what it gives."""

    by: str
    time: str
    read: tuple[str, ...]
    names: tuple[str, ...]

    @classmethod
    def live(cls, study: Study, by: str, time: str | None) -> Signals:
        """Of the estimator of samples that come one by one."""
        estimator = study.estimator()
        read = estimator.signals
        return cls(by, time or _time(study._core.sections(), read), tuple(read), tuple(estimator.names))

    @classmethod
    def recorded(cls, study: Study, by: str, time: str | None) -> Signals:
        """Of logs, for which a study may ask for what no estimator of single samples gives."""
        observer, known = study.observer(), study.plant().inputs
        read = [*observer.sensors, *(name for name in observer.signals if name in known)]
        told = study._core.sections()
        columns = told.get("estimate", {}).get("columns", {})
        read = list(dict.fromkeys(columns.get(name, name) for name in read))
        names = (header.removesuffix("_hat") for header in observer.outputs)
        return cls(by, time or _time(told, read), tuple(read), tuple(names))

    @property
    def needed(self) -> tuple[str, ...]:
        return (self.by, self.time, *self.read)

    @property
    def headers(self) -> tuple[str, ...]:
        return tuple(f"{name}_hat" for name in self.names)


def _time(study: dict[str, Any], read: list[str]) -> str:
    """The header of the log's time column."""
    named = study.get("log", {}).get("time") or study.get("estimate", {}).get("time")
    return str(named or ("time" if "t" in read else "t"))


class Replay:
    """An asset's rows through the observer."""

    def __init__(self, study: Study, signals: Signals) -> None:
        self.study = study.replace(log={"time": signals.time}, estimate={"time": None})
        self.signals = signals

    def asset(self, table: Any) -> Any:
        """The estimates of one asset, from a table of Arrow that holds its rows."""
        signals = self.signals
        # rows of one time in an order of their own: they come in any
        ordered = table.sort_by([(name, "ascending") for name in (signals.time, *signals.read)])
        asset = table.column(signals.by)[0].as_py()
        log = {name: ordered.column(name) for name in (signals.time, *signals.read)}
        try:
            run = Estimation(self.study._core.estimate(log_of(log)))
        except LynkeusError as error:
            nothing = [np.array([np.nan])] * (1 + len(signals.names))
            return self._table(table, asset, nothing, None, str(error))
        estimates = run.summary["estimates"]
        columns = [run.t, *(run[estimates[name]] for name in signals.names)]
        return self._table(table, asset, columns, run.is_credible, None)

    def _table(
        self, table: Any, asset: Any, columns: list[Any], credible: bool | None, error: str | None
    ) -> Any:
        arrow = needed("pyarrow", "lynkeus.spark")
        rows, signals = len(columns[0]), self.signals
        numbers = [arrow.array(column, from_pandas=error is not None) for column in columns]
        made = {signals.by: arrow.array([asset] * rows, table.schema.field(signals.by).type)}
        made |= dict(zip((signals.time, *signals.headers), numbers, strict=True))
        made["credible"] = arrow.array([credible] * rows, arrow.bool_())
        made["error"] = arrow.array([error] * rows, arrow.string())
        return arrow.table(made)

    def partition(self, batches: Iterable[Any]) -> Iterator[Any]:
        """The estimates of all assets of a partition, in the order in which they come first."""
        arrow = needed("pyarrow", "lynkeus.spark")
        gathered = list(batches)
        if not gathered:
            return
        table = arrow.Table.from_batches(gathered)
        column = table.column(self.signals.by)
        places: dict[Any, list[int]] = {}
        for row, asset in enumerate(column.to_pylist()):
            places.setdefault(asset, []).append(row)
        for rows in places.values():
            yield from self.asset(table.take(rows)).to_batches()


class Follower:
    """An asset's rows as they come; its state between them is a snapshot."""

    def __init__(self, study: Study, signals: Signals) -> None:
        self.study = study
        self.signals = signals

    def init(self, handle: Any) -> None:
        self.state = handle.getValueState("snapshot", "snapshot BINARY")

    @cached_property
    def _estimator(self) -> tuple[_lynkeus.Estimator, bytes]:
        """One for all assets of a worker, and where each of them begins."""
        estimator = self.study.estimator()
        return estimator, estimator.snapshot()

    def __getstate__(self) -> dict[str, Any]:
        return {"study": self.study, "signals": self.signals}

    def handleInputRows(self, key: Any, rows: Iterator[Any], timerValues: Any) -> Iterator[Any]:
        estimator, start = self._estimator
        known = self.state.get() if self.state.exists() else None
        estimator.restore(start if known is None else bytes(known[0]))
        pandas = needed("pandas", "lynkeus.spark")
        table = pandas.concat(list(rows), ignore_index=True)
        # rows of one time in an order of their own: they come in any
        ordered = table.sort_values([self.signals.time, *self.signals.read], kind="stable")
        yield self._followed(estimator, key[0], ordered)
        self.state.update((estimator.snapshot(),))

    def _followed(self, estimator: _lynkeus.Estimator, asset: Any, table: Any) -> Any:
        signals = self.signals
        times = table[signals.time].to_numpy(np.float64)
        readings = table[list(signals.read)].to_numpy(np.float64)
        estimates = np.full((len(times), len(signals.names)), np.nan)
        errors: list[str | None] = [None] * len(times)
        for row, time in enumerate(times):
            try:
                estimator.push(time, readings[row])
                estimates[row] = estimator.to_numpy()
            except LynkeusError as error:
                errors[row] = str(error)
        made = {signals.by: [asset] * len(times), signals.time: times}
        made |= {header: estimates[:, place] for place, header in enumerate(signals.headers)}
        return needed("pandas", "lynkeus.spark").DataFrame({**made, "error": errors})

    def close(self) -> None:
        pass
