"""A study over many logs, and over many changes of itself."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ._each import Errors, Tell, each
from ._fleet import split
from ._logs import log_of
from ._progress import Progress
from .errors import InputError, NotCredible
from .results import Estimation, Run, Simulation

if TYPE_CHECKING:
    from .study import Study

Keep = Callable[[Any], Any] | None
Many = list[Any] | dict[Hashable, Any]


def estimate_each(
    study: Study,
    logs: Any,
    *,
    by: str | None,
    keep: Keep,
    workers: int | None,
    errors: Errors,
    progress: Progress,
    time_limit: float | None,
) -> Many:
    """See :meth:`Study.estimate_each`."""
    named = split(logs, by) if by is not None else logs
    if isinstance(named, (str, bytes)) or not isinstance(named, (Mapping, Iterable)):
        raise InputError(
            f"the logs: expected a list or a mapping of logs, or a table and `by`, found {type(named).__name__}"
        )
    logs = list(named.values() if isinstance(named, Mapping) else named)
    keys = list(named) if isinstance(named, Mapping) else None
    names = [f"the log of {key!r}" for key in keys] if keys is not None else _places("log", logs)
    doubted: dict[int, str] = {}

    def work(item: tuple[int, Any], tell: Tell) -> Any:
        place, log = item
        run = Estimation(study._core.estimate(log_of(log), tell, time_limit))
        return _kept(run, keep, place, doubted)

    found = each(
        work,
        list(enumerate(logs)),
        names,
        workers=workers,
        errors=errors,
        progress=progress,
        what="estimating",
    )
    _warn(doubted, names)
    return found if keys is None else dict(zip(keys, found, strict=True))


def sweep(
    study: Study,
    changes: Iterable[Mapping[str, Any]],
    log: Any,
    *,
    keep: Keep,
    workers: int | None,
    errors: Errors,
    progress: Progress,
    time_limit: float | None,
) -> list[Any]:
    """See :meth:`Study.sweep`."""
    asked = list(changes)
    names = _places("change", asked)
    recorded = None if log is None else log_of(log)
    doubted: dict[int, str] = {}

    def work(item: tuple[int, Mapping[str, Any]], tell: Tell) -> Any:
        place, change = item
        core = study.replace(**change)._core
        run: Run
        if recorded is None:
            run = Simulation(core.simulate(tell, time_limit))
        else:
            run = Estimation(core.estimate(recorded, tell, time_limit))
        return _kept(run, keep, place, doubted)

    found = each(
        work,
        list(enumerate(asked)),
        names,
        workers=workers,
        errors=errors,
        progress=progress,
        what="sweeping",
    )
    _warn(doubted, names)
    return found


def _places(what: str, items: Sequence[Any]) -> list[str]:
    return [f"{what} {place}" for place in range(len(items))]


def _kept(run: Run, keep: Keep, place: int, doubted: dict[int, str]) -> Any:
    if run.refusal is not None:
        doubted[place] = str(run.refusal)
    return run if keep is None else keep(run)


def _warn(doubted: dict[int, str], names: Sequence[str]) -> None:
    """One warning for all: thousands of logs would bury everything else."""
    if not doubted:
        return
    first = min(doubted)
    text = f"{len(doubted)} of {len(names)} results are not credible, first {names[first]}: {doubted[first]}"
    warnings.warn(text, NotCredible, stacklevel=4)
