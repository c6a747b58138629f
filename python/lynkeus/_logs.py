"""Recorded signals, from whatever holds columns."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from . import _lynkeus
from .errors import InputError


def log_of(data: Any) -> _lynkeus.Log:
    """The log in a file (CSV, Parquet), a mapping of columns, a data frame of pandas or polars, a
    table of Arrow, a structured array, or the result of a simulation."""
    if isinstance(data, _lynkeus.Log):
        return data
    if isinstance(data, (str, os.PathLike)):
        return _lynkeus.Log.load(os.fspath(data))
    recorded = getattr(data, "log", None)
    if isinstance(recorded, Mapping):
        return log_of(recorded)
    if isinstance(data, Mapping):
        return _gathered((str(name), values) for name, values in data.items())
    if isinstance(data, np.ndarray) and data.dtype.names is not None:
        return _gathered((name, data[name]) for name in data.dtype.names)
    if hasattr(data, "columns") and hasattr(data, "__getitem__"):
        return _gathered((str(name), data[name]) for name in data.columns)
    if hasattr(data, "column_names"):  # Arrow
        return _gathered((name, data.column(name)) for name in data.column_names)
    raise InputError(
        f"the log: expected a path, a mapping of columns or a data frame, found {type(data).__name__}"
    )


def _gathered(columns: Iterable[tuple[str, Any]]) -> _lynkeus.Log:
    return _lynkeus.Log.from_columns([(name, numbers(name, values)) for name, values in columns])


def numbers(name: str, values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A column as numbers: instants become seconds since the first of them, ``None`` a gap."""
    if hasattr(values, "to_numpy"):
        values = values.to_numpy()
    array = np.asarray(values)
    if array.ndim != 1:
        raise InputError(
            f'column "{name}": expected one value per row, found '
            + (f"an array of shape {array.shape}" if array.ndim else type(values).__name__)
        )
    if array.dtype.kind == "M":
        first = array[~np.isnat(array)][:1]
        array = array - first[0] if len(first) else array.astype("timedelta64[s]")
    if array.dtype.kind == "m":
        gaps = np.isnat(array)
        seconds = array.astype("timedelta64[ns]").astype(np.int64) * 1e-9
        return np.where(gaps, np.nan, seconds)
    if array.dtype.kind in "fiub":
        return np.ascontiguousarray(array, dtype=np.float64)
    if array.dtype.kind == "O":
        try:
            return np.array([np.nan if v is None else float(v) for v in array], dtype=np.float64)
        except (TypeError, ValueError):
            pass
    raise InputError(f'column "{name}": expected numbers or instants, found {array.dtype}')


def columns_of(log: _lynkeus.Log) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """A log's columns by name: what of it travels to other processes."""
    return {name: log.column(name) for name in log.headers()}
