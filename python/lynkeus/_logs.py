"""Recorded signals, from whatever holds columns."""

from __future__ import annotations

import copyreg
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from . import _lynkeus
from ._columns import Given, column, why
from ._kept import log_again
from .errors import ArgumentError, InputError

_Named = Iterable[tuple[Any, Any]]


def log_of(data: Any, what: str = "the log", study: _lynkeus.Study | None = None) -> _lynkeus.Log:
    """The log in a file (CSV, Parquet), a mapping of columns, a data frame of pandas or polars, a
    table of Arrow or whatever else has ``__arrow_c_stream__``, a structured array, or the result of
    a simulation; ``what`` is what messages call it, ``study`` says how a file
    is written. A column that cannot be read is refused where the study asks for it, not before."""
    if isinstance(data, _lynkeus.Log):
        return data
    if isinstance(data, (str, os.PathLike)):
        path = os.fspath(data)
        return _lynkeus.Log.load(path) if study is None else study.log(path)
    data = collected(data)
    if isinstance(data, Mapping):
        return _gathered(_items(data))
    if isinstance(data, np.ndarray):
        return _gathered(fields(data, what))
    pandas = sys.modules.get("pandas")
    if pandas is not None and isinstance(data, pandas.DataFrame):
        return _gathered(frame(data, what))
    recorded = getattr(type(data), "log", None)
    if recorded is not None and isinstance(data.log, Mapping):  # what a simulation's logger saw
        return log_of(data.log, what)
    has_names = hasattr(type(data), "__getitem__") and _names(data) is not None
    if hasattr(data, "__arrow_c_stream__") or hasattr(data, "__arrow_c_array__"):
        try:
            return _lynkeus.Log.from_arrow(data)
        except (InputError, KeyboardInterrupt, SystemExit, GeneratorExit):
            raise
        except BaseException as error:  # polars panics at columns of objects
            if not has_names:
                raise InputError(f"{what}: {why(error)}") from error
    if has_names:
        return _gathered((name, lambda name=name: _taken(data, name)) for name in _names(data) or ())
    raise ArgumentError.of(what, "a path, a mapping of columns, a data frame or an Arrow table", data)


def collected(data: Any) -> Any:
    """What a lazy frame of polars computes; anything else as it is."""
    polars = sys.modules.get("polars")
    return data.collect() if polars is not None and isinstance(data, polars.LazyFrame) else data


def given(data: Any, what: str = "the log") -> _lynkeus.Log | str:
    """The same for a call with limits, which reads the file of a path itself."""
    if isinstance(data, (str, os.PathLike)):
        path = os.fspath(data)
        if isinstance(path, str):
            return path
    return log_of(data, what)


def given_each(data: Any) -> list[_lynkeus.Log | str]:
    """The same of one log, or of a list of them."""
    if isinstance(data, (list, tuple)):
        return [given(log, f"logs[{place}]") for place, log in enumerate(data)]
    return [given(data, "logs")]


def _gathered(columns: _Named) -> _lynkeus.Log:
    """Of headers, and functions that give their columns."""
    return _lynkeus.Log.from_columns([(str(name), _read(values)) for name, values in columns])


def _read(values: Any) -> Given:
    try:
        return column(values())
    except Exception as error:
        return f"it cannot be read: {why(error)}"


def _items(data: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
    for name in data:
        yield name, lambda name=name: data[name]


def fields(data: np.ndarray[Any, Any], what: str = "the log") -> Iterator[tuple[Any, Any]]:
    """Columns of a structured array."""
    if data.dtype.names is None or data.ndim != 1:
        raise InputError(
            f"{what}: expected named columns, found an array "
            f"of {data.dtype} of shape {data.shape}; give a mapping: {{'t': a[:, 0], 'y': a[:, 1]}}"
        )
    for name in data.dtype.names:
        yield name, lambda name=name: data[name]


def frame(data: Any, what: str = "the log") -> Iterator[tuple[Any, Any]]:
    """Columns of a frame of pandas, and what its index is called by name."""
    if data.columns.nlevels > 1:
        raise InputError(
            f"{what}: expected one header for each column, found {data.columns.nlevels} levels of them; "
            "join them: frame.columns = ['_'.join(levels) for levels in frame.columns]"
        )
    times = _unnamed_times(data)
    if times is not None:
        yield times, lambda: data.index.to_series()
    for level, name in enumerate(data.index.names):
        if name is not None and name not in data.columns:
            yield name, lambda level=level: data.index.get_level_values(level).to_series()
    for place, name in enumerate(data.columns):
        yield name, lambda place=place: data.iloc[:, place]


def _unnamed_times(data: Any) -> str | None:
    """The header of an index of instants without a name, which is the time of the rows; so is one of numbers or
    durations, where there is no other time. Whole numbers count rows."""
    kind = getattr(data.index, "inferred_type", "")
    if data.index.nlevels > 1 or data.index.name is not None:
        return None
    free = [name for name in ("t", "time") if name not in data.columns]
    if kind.startswith("datetime"):
        return next(iter(free), None)
    return "t" if kind in ("floating", "timedelta", "timedelta64") and len(free) == 2 else None


def _names(data: Any) -> list[str] | None:
    """Headers of a frame of another library."""
    try:
        names = getattr(data, "column_names", None) or getattr(data, "columns", None)
        return None if names is None or isinstance(names, str) else [name for name in names]
    except Exception:
        return None


def _taken(data: Any, name: str) -> Any:
    return data.column(name) if hasattr(data, "column") else data[name]


def columns_of(log: _lynkeus.Log) -> list[tuple[str, Given]]:
    """A log's columns in the engine's forms: what of it travels to other processes."""
    return [(name, _given(log, name)) for name in log.headers()]


def _given(log: _lynkeus.Log, name: str) -> Given:
    values, origin = log.values(name), log.origin(name)
    if values is None:
        return log.refusal(name)
    return values if origin is None else (values, origin)


def _reduced(log: _lynkeus.Log) -> tuple[Any, ...]:
    return log_again, (columns_of(log),)


copyreg.pickle(_lynkeus.Log, _reduced)
