"""Kinds of arguments that several modules take."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol, SupportsIndex, TypeAlias, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from ._lynkeus import Log

_Item = TypeVar("_Item", covariant=True)


class ListOf(Protocol[_Item]):
    """A list, a tuple, or another sequence that is no text: the letters of a text are texts as well, so
    that ``Sequence[str]`` would take ``"inflow"`` for a list of six names."""

    def __len__(self) -> int: ...
    # a text's is of texts alone, which keeps it out
    def __contains__(self, value: object, /) -> bool: ...
    def __iter__(self) -> Iterator[_Item]: ...
    def __reversed__(self) -> Iterator[_Item]: ...
    @overload
    def __getitem__(self, index: SupportsIndex, /) -> _Item: ...
    @overload
    def __getitem__(self, index: slice, /) -> Sequence[_Item]: ...
    def index(self, value: Any, start: int = 0, stop: int = ..., /) -> int: ...
    def count(self, value: Any, /) -> int: ...


#: names
Names: TypeAlias = ListOf[str]
#: a number, Python's or NumPy's
Number: TypeAlias = float | np.floating[Any] | np.integer[Any]
#: a whole number, Python's or NumPy's
Whole: TypeAlias = int | np.integer[Any]
#: a list of numbers, or an array of one axis
Numbers: TypeAlias = Sequence[Number] | NDArray[Any]
#: a list of lists of numbers, or an array of two axes
Matrix: TypeAlias = Sequence[Numbers] | NDArray[Any]

#: a number, or lists in lists of them to any depth
Nested: TypeAlias = "Number | Sequence[Nested] | NDArray[Any]"


class Frame(Protocol):
    """A data frame: columns by their headers."""

    @property
    def columns(self) -> Any:
        """Its headers."""

    def __getitem__(self, key: Any, /) -> Any: ...


class LazyFrame(Protocol):
    """A data frame that is yet to be computed, as polars has them."""

    def collect(self, *args: Any, **kwargs: Any) -> Any:
        """The data frame."""


class ArrowStream(Protocol):
    """A table that Arrow can read in batches."""

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any: ...


class ArrowArray(Protocol):
    """A table that Arrow can read in one piece."""

    def __arrow_c_array__(self, requested_schema: Any = None) -> Any: ...


#: what is taken as a log, or as a table of many
LogLike: TypeAlias = (
    str | os.PathLike[str] | Log | Mapping[str, Any] | NDArray[Any] | Frame | LazyFrame | ArrowStream | ArrowArray
)
