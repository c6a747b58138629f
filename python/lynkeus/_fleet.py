"""One table of many assets, as one log for each."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ._columns import is_missing, why
from ._logs import fields, frame
from .errors import InputError


def split(table: Any, by: str) -> dict[Any, dict[str, Any]]:
    """The rows of each asset that column ``by`` names, in the order in which assets and rows come:
    a mapping of columns, a data frame, a table of Arrow or a structured array."""
    columns = {name: _array(name, values) for name, values in _columns(table)}
    if by not in columns:
        raise InputError(f'by: the table has no column "{by}": there are {", ".join(columns)}')
    rows = _rows(columns.pop(by), by)
    lengths = {name: len(values) for name, values in columns.items()}
    for name, length in lengths.items():
        if length != sum(map(len, rows.values())):
            raise InputError(f'column "{name}": expected as many rows as "{by}" has, found {length}')
    return {
        asset: {name: values[places] for name, values in columns.items()} for asset, places in rows.items()
    }


def is_one(logs: Any) -> bool:
    """Whether it is a single table, not several."""
    if isinstance(logs, np.ndarray):
        return logs.dtype.names is not None
    return hasattr(type(logs), "__arrow_c_stream__") or hasattr(logs, "columns") or hasattr(logs, "column_names")


def _columns(table: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(table, Mapping):
        return ((str(name), values) for name, values in table.items())
    if isinstance(table, np.ndarray):
        return ((str(name), values()) for name, values in fields(table))
    pandas = sys.modules.get("pandas")
    if pandas is not None and isinstance(table, pandas.DataFrame):
        return ((str(name), values()) for name, values in frame(table))
    if hasattr(table, "column_names"):  # Arrow
        return ((name, table.column(name)) for name in table.column_names)
    if hasattr(table, "columns") and hasattr(table, "__getitem__"):
        return ((str(name), table[name]) for name in table.columns)
    if hasattr(table, "schema") and hasattr(table, "column"):  # a batch of older Arrow
        return ((name, table.column(name)) for name in table.schema.names)
    raise InputError(
        "the logs: expected, with `by`, a mapping of columns, a data frame, a table of Arrow or a structured "
        f"array, found {type(table).__name__}"
    )


def _array(name: str, values: Any) -> np.ndarray[Any, np.dtype[Any]]:
    try:
        array = np.asarray(_numpy(values))
    except Exception as error:
        raise InputError(f'column "{name}": it cannot be read: {why(error)}') from error
    if array.ndim != 1:
        found = f"an array of shape {array.shape}" if array.ndim else type(values).__name__
        raise InputError(f'column "{name}": expected one value per row, found {found}')
    return array


def _numpy(values: Any) -> Any:
    if not hasattr(values, "to_numpy"):
        return values
    try:
        return values.to_numpy(zero_copy_only=False)  # of Arrow, which else refuses nulls
    except TypeError:
        return values.to_numpy()


def _rows(assets: np.ndarray[Any, np.dtype[Any]], by: str) -> dict[Any, np.ndarray[Any, Any]]:
    places: dict[Any, list[int]] = {}
    for row, asset in enumerate(assets.tolist()):
        try:
            hash(asset)
            names_none = bool(is_missing(asset) or asset != asset)
        except Exception as error:
            found = type(asset).__name__
            raise InputError(f'column "{by}": row {row + 1}: expected a name or a number, found {found}') from error
        if names_none:
            raise InputError(f'column "{by}": row {row + 1} names no asset')
        places.setdefault(asset, []).append(row)
    return {asset: np.array(rows) for asset, rows in places.items()}
