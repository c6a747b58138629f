"""A study over many logs, and over many changes of itself, with the types of what that gives."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Any, Literal, TypeVar, overload

from . import _batches, _lynkeus
from ._arguments import LIMITS, function, optional, progress as told_of, several, takes, whole, word
from ._batches import Options
from ._each import Errors
from ._lynkeus import MEMORY
from ._progress import Progress
from ._types import LogLike
from .results import Estimation, Simulation
from .sections import Changes

#: what is kept of a run
_Kept = TypeVar("_Kept")
#: what runs in batches takes
_BATCH = {"keep": optional(function), "workers": optional(whole), "errors": word, "progress": told_of, **LIMITS}


class Batched:
    """What a study does in batches."""

    _core: _lynkeus.Study

    @overload
    def estimate_each(
        self,
        logs: LogLike,
        *,
        by: str,
        keep: None = ...,
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Estimation]: ...
    @overload
    def estimate_each(
        self,
        logs: LogLike,
        *,
        by: str,
        keep: Callable[[Estimation], _Kept],
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, _Kept]: ...
    @overload
    def estimate_each(
        self,
        logs: LogLike,
        *,
        by: str,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Any]: ...
    @overload
    def estimate_each(
        self,
        logs: Mapping[Any, LogLike],
        *,
        keep: None = ...,
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Estimation]: ...
    @overload
    def estimate_each(
        self,
        logs: Mapping[Any, LogLike],
        *,
        keep: Callable[[Estimation], _Kept],
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, _Kept]: ...
    @overload
    def estimate_each(
        self,
        logs: Mapping[Any, LogLike],
        *,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> dict[Hashable, Any]: ...
    @overload
    def estimate_each(
        self,
        logs: Iterable[LogLike],
        *,
        keep: None = ...,
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Estimation]: ...
    @overload
    def estimate_each(
        self,
        logs: Iterable[LogLike],
        *,
        keep: Callable[[Estimation], _Kept],
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[_Kept]: ...
    @overload
    def estimate_each(
        self,
        logs: Iterable[LogLike],
        *,
        keep: Callable[[Estimation], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Any]: ...
    @takes(by=optional(word), **_BATCH)
    def estimate_each(
        self,
        logs: Any,
        *,
        by: str | None = None,
        keep: Callable[[Estimation], Any] | None = None,
        workers: int | None = None,
        errors: Errors = "raise",
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> list[Any] | dict[Hashable, Any]:
        """Many logs through the observer, on all cores.

        Parameters
        ----------
        logs : list, mapping or table
            What :meth:`estimate` takes, in a list or in a mapping by name; with ``by`` one table of all.
        by : str, optional
            The column of the table that names the asset of each row.
        keep : function, optional
            Makes of each result what is kept of it: so thousands of them need no memory.
        workers : int, optional
            Number of threads, at least 1; as many as there are cores where it is left out.
        errors : str
            ``"raise"``, or ``"return"``: the exception of a log that fails then stands in its place, instead
            of ending the rest.
        progress : bool or function
            Shows how far it is, or calls the function with the share that is done, from 0 to 1.
        time_limit : float, optional
            What one log may take, in seconds.
        memory_limit : float
            What all that run together may take, in MiB.

        Returns
        -------
        list or dict
            What :meth:`estimate` gives for each, in their order; of a mapping or a table by name.

        Raises
        ------
        InputError, RefusedError, LimitError
            As of :meth:`estimate`; a note says of which log.
        """
        options = Options(keep, workers, errors, progress, time_limit, memory_limit)
        return _batches.estimate_each(self._core, logs, by, options)

    @overload
    def sweep(
        self,
        changes: Iterable[Changes],
        log: None = ...,
        *,
        keep: None = ...,
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Simulation]: ...
    @overload
    def sweep(
        self,
        changes: Iterable[Changes],
        log: None = ...,
        *,
        keep: Callable[[Simulation], _Kept],
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[_Kept]: ...
    @overload
    def sweep(
        self,
        changes: Iterable[Changes],
        log: LogLike,
        *,
        keep: None = ...,
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Estimation]: ...
    @overload
    def sweep(
        self,
        changes: Iterable[Changes],
        log: LogLike,
        *,
        keep: Callable[[Estimation], _Kept],
        workers: int | None = ...,
        errors: Literal["raise"] = ...,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[_Kept]: ...
    @overload
    def sweep(
        self,
        changes: Iterable[Changes],
        log: LogLike | None = ...,
        *,
        keep: Callable[[Any], Any] | None = ...,
        workers: int | None = ...,
        errors: Errors,
        progress: Progress = ...,
        time_limit: float | None = ...,
        memory_limit: float = ...,
    ) -> list[Any]: ...
    @takes(changes=several("dictionaries as of replace"), **_BATCH)
    def sweep(
        self,
        changes: Iterable[Changes],
        log: LogLike | None = None,
        *,
        keep: Callable[[Any], Any] | None = None,
        workers: int | None = None,
        errors: Errors = "raise",
        progress: Progress = False,
        time_limit: float | None = None,
        memory_limit: float = MEMORY,
    ) -> list[Any]:
        """The study with each of the changes, simulated, or estimating from a log, on all cores.

        Parameters
        ----------
        changes : list of dict
            What :meth:`replace` takes: ``{"observer": {"theta": 2.0}, "simulate": {"seed": 7}}``.
        log : path, mapping of columns, data frame, table or run, optional
            What :meth:`estimate` takes; simulated where it is left out.
        keep, workers, errors, progress, time_limit, memory_limit
            As of :meth:`estimate_each`.

        Returns
        -------
        list
            A :class:`Simulation` or :class:`Estimation` for each change, or what is kept of it, in their order.

        Raises
        ------
        InputError, RefusedError, LimitError
            As of :meth:`replace`, :meth:`simulate` and :meth:`estimate`; a note says of which change.
        """
        options = Options(keep, workers, errors, progress, time_limit, memory_limit)
        return _batches.sweep(self._core, changes, log, options)
