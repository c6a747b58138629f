"""One table of many assets, as one log for each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .errors import InputError


def split(table: Any, by: str) -> dict[Any, dict[str, Any]]:
    """The rows of each asset that column ``by`` names, in the order in which assets and rows come:
    a mapping of columns, a data frame or a table of Arrow."""
    columns = {name: _array(values) for name, values in _columns(table)}
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


def _columns(table: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(table, Mapping):
        return ((str(name), values) for name, values in table.items())
    if hasattr(table, "column_names"):  # Arrow
        return ((name, table.column(name)) for name in table.column_names)
    if hasattr(table, "columns") and hasattr(table, "__getitem__"):
        return ((str(name), table[name]) for name in table.columns)
    raise InputError(
        "the logs: expected, with `by`, a mapping of columns, a data frame or a table of Arrow, "
        f"found {type(table).__name__}"
    )


def _array(values: Any) -> np.ndarray[Any, np.dtype[Any]]:
    return np.asarray(values.to_numpy() if hasattr(values, "to_numpy") else values)


def _rows(assets: np.ndarray[Any, np.dtype[Any]], by: str) -> dict[Any, np.ndarray[Any, Any]]:
    places: dict[Any, list[int]] = {}
    for row, asset in enumerate(assets.tolist()):
        if asset is None or asset != asset:
            raise InputError(f'column "{by}": row {row} names no asset')
        places.setdefault(asset, []).append(row)
    return {asset: np.array(rows) for asset, rows in places.items()}
