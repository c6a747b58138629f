"""Columns of a log: whatever holds one value per row, in the forms that the engine takes."""

from __future__ import annotations

import datetime
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Counts = NDArray[np.int64]
#: numbers; seconds since an instant; counts of so many nanoseconds since 1970, in UTC or not; a kind, a
#: number and nanoseconds for each cell; why it can be no column; an object with ``__arrow_c_stream__``
Given = Numbers | tuple[Numbers, str] | tuple[Counts, int, bool] | tuple[NDArray[np.uint8], Numbers, Counts] | str | Any

_UNITS = {"W": 604_800 * 10**9, "D": 86_400 * 10**9, "h": 3600 * 10**9, "m": 60 * 10**9}
_UNITS |= {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_MISSING, _NUMBER, _LOCAL, _ZONED = range(4)
_SECOND = np.timedelta64(1, "s")
_UTC = datetime.timezone.utc


def column(values: Any) -> Given:
    """A column in one of the engine's forms; one that cannot be read says why."""
    pandas = sys.modules.get("pandas")
    if pandas is not None and isinstance(values, (pandas.Series, pandas.Index)):
        return _of_pandas(values.to_series() if isinstance(values, pandas.Index) else values)
    is_arrow = hasattr(values, "__arrow_c_stream__") or hasattr(values, "__arrow_c_array__")
    return values if is_arrow and not isinstance(values, np.ndarray) else _array(values)


def why(error: BaseException) -> str:
    """An exception in a line."""
    text = str(error).strip()
    return f"{type(error).__name__}: {text.splitlines()[0]}" if text else type(error).__name__


def _of_pandas(values: Any) -> Given:
    dtype = values.dtype
    if isinstance(dtype, np.dtype):
        return _array(values.to_numpy())
    if getattr(dtype, "tz", None) is not None:  # instants with a zone
        return _instants(values.dt.tz_convert("UTC").dt.tz_localize(None).to_numpy(), True)
    if hasattr(dtype, "pyarrow_dtype"):
        return values.array.__arrow_array__()
    if dtype.kind in "iufb":  # with gaps
        return _array(values.to_numpy(dtype=np.float64, na_value=np.nan))
    return _refused(str(dtype))


def _array(values: Any) -> Given:
    masked = isinstance(values, np.ma.MaskedArray)
    array: Any = values if masked else np.asarray(values)
    if array.ndim != 1:
        shape = f"an array of shape {array.shape}" if array.ndim else type(values).__name__
        return f"expected one value per row, found {shape}"
    kind = array.dtype.kind
    if kind == "m":
        array, kind = array / _SECOND, "f"
    if kind in "fiub":
        with np.errstate(over="ignore"):  # what is beyond all numbers is missing
            array = array.astype(np.float64, copy=False)
        return np.require(array.filled(np.nan) if masked else array, requirements=["C", "A"])
    if kind == "M":
        return _instants(array.filled(np.datetime64("NaT")) if masked else array, False)
    if kind == "O":
        return _cells(array.filled(None) if masked else array)
    return _refused({"U": "texts", "T": "texts", "S": "bytes", "c": "complex numbers"}.get(kind, str(array.dtype)))


def _refused(found: str) -> str:
    return f"expected numbers or instants, found {found}"


def _instants(array: NDArray[Any], zoned: bool) -> Given:
    unit, count = np.datetime_data(array.dtype)
    if unit not in _UNITS or count != 1:
        unit = "D" if unit in "YM" else "ns"
        array = array.astype(f"datetime64[{unit}]")
    array = array.astype(array.dtype.newbyteorder("="))
    return np.ascontiguousarray(array).view(np.int64), _UNITS[unit], zoned


def _cells(array: NDArray[Any]) -> Given:
    """Python's objects row by row."""
    rows = len(array)
    kinds = np.zeros(rows, np.uint8)
    numbers, instants = np.zeros(rows), np.zeros(rows, np.int64)
    for row, value in enumerate(array):
        if is_missing(value):
            continue
        if isinstance(value, (datetime.date, np.datetime64)):
            zoned = getattr(value, "tzinfo", None) is not None
            kinds[row] = _ZONED if zoned else _LOCAL
            instants[row] = _nanoseconds(value)
        elif isinstance(value, (datetime.timedelta, np.timedelta64)):
            kinds[row], numbers[row] = _NUMBER, value / _SECOND
        elif isinstance(value, (str, bytes, complex, np.complexfloating)):
            return f"row {row + 1}: {_refused(repr(value))}"
        else:
            try:
                numbers[row] = value
            except OverflowError:  # beyond all numbers
                continue
            except Exception as error:
                return f"row {row + 1}: {_refused(type(value).__name__)} ({why(error)})"
            kinds[row] = _NUMBER
    return kinds, numbers, instants


def is_missing(value: Any) -> bool:
    """Whether an object stands for no value; of a number that is for itself to say."""
    if value is None or value is np.ma.masked:
        return True
    if isinstance(value, (float, int, str, bytes)):
        return False
    if isinstance(value, (np.datetime64, np.timedelta64)):
        return bool(np.isnat(value))
    # NA and NaT of pandas, which cannot be imported where it is not there
    return type(value).__name__ in ("NAType", "NaTType")


def _nanoseconds(value: Any) -> int:
    """From 1970 to a date or a time."""
    exactly = getattr(value, "to_datetime64", None)  # of pandas: to the nanosecond
    if isinstance(value, datetime.datetime) and exactly is None:
        if value.tzinfo is not None:
            value = value.astimezone(_UTC).replace(tzinfo=None)
        microseconds = (value - datetime.datetime(1970, 1, 1)) // datetime.timedelta(microseconds=1)
        return int(microseconds) * 1000
    exact = np.datetime64(value) if exactly is None else exactly()
    unit, count = np.datetime_data(exact.dtype)
    if unit not in _UNITS:
        exact, unit, count = exact.astype("datetime64[ns]"), "ns", 1
    return int(exact.astype(np.int64)) * _UNITS[unit] * count
