"""A study over many logs, and over many changes of itself."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from . import _lynkeus
from ._base import Base
from ._each import Errors, Tell, each
from ._fleet import is_one, split
from ._logs import collected, given, log_of
from ._progress import Progress, Terms
from .errors import InputError, LogWarning, NotCredible
from .results import Estimation, Run, Simulation

Keep = Callable[[Any], Any] | None
Many = list[Any] | dict[Hashable, Any]


@dataclass(frozen=True)
class Options:
    """In what way a batch is run; see :meth:`Study.estimate_each`."""

    keep: Keep
    workers: int | None
    errors: Errors
    progress: Progress
    time_limit: float | None
    memory_limit: float


def estimate_each(study: _lynkeus.Study, logs: Any, by: str | None, options: Options) -> Many:
    """See :meth:`Study.estimate_each`."""
    logs = collected(logs)
    if by is None and not isinstance(logs, Mapping) and is_one(logs):
        raise InputError('the logs: found one table: by="asset" names the column that tells them apart')
    named = split(logs, by) if by is not None else logs
    if isinstance(named, (str, bytes)) or not isinstance(named, (Mapping, Iterable)):
        raise InputError(
            f"the logs: expected a list or a mapping of logs, or a table and `by`, found {type(named).__name__}"
        )
    logs = list(named.values() if isinstance(named, Mapping) else named)
    keys = list(named) if isinstance(named, Mapping) else None
    names = [f"the log of {key!r}" for key in keys] if keys is not None else _places("log", logs)

    def run(log: Any, tell: Tell) -> Run:
        terms = Terms(options.time_limit, options.memory_limit, tell)
        found = study.estimate(given(log), terms)
        return Estimation(found)

    found = _all(run, logs, names, "estimating", options)
    return found if keys is None else dict(zip(keys, found, strict=True))


def sweep(study: _lynkeus.Study, changes: Iterable[Mapping[str, Any]], log: Any, options: Options) -> list[Any]:
    """See :meth:`Study.sweep`."""
    asked = list(changes)
    for place, change in enumerate(asked):
        if not isinstance(change, Mapping):
            raise InputError(
                f"change {place}: expected a dictionary as of replace, {{\"observer\": {{\"theta\": 2.0}}}}, "
                f"found {type(change).__name__}"
            )
    recorded = None if log is None else log_of(log)
    base = Base(study)

    def run(change: Mapping[str, Any], tell: Tell) -> Run:
        core, terms = base.changed(change), Terms(options.time_limit, options.memory_limit, tell)
        if recorded is None:
            return Simulation(core.simulate(terms))
        return Estimation(core.estimate(recorded, terms))

    return _all(run, asked, _places("change", asked), "sweeping", options)


def _places(what: str, items: Sequence[Any]) -> list[str]:
    return [f"{what} {place}" for place in range(len(items))]


def _all(
    run: Callable[[Any, Tell], Run], items: Sequence[Any], names: Sequence[str], what: str, options: Options
) -> list[Any]:
    """What is kept of the run of each item, in their order; one warning for all that are not credible."""
    doubted: dict[int, str] = {}
    lossy: dict[int, str] = {}

    def work(place: int, tell: Tell) -> Any:
        found = run(items[place], tell)
        if found.refusal is not None:
            doubted[place] = str(found.refusal)
        if warnings_of := found._core.warnings():
            lossy[place] = warnings_of[0]
        return found if options.keep is None else options.keep(found)

    found = each(
        work,
        range(len(items)),
        names,
        workers=options.workers,
        errors=options.errors,
        progress=options.progress,
        what=what,
    )
    _warn(doubted, names, "results are not credible", NotCredible)
    _warn(lossy, names, "logs contradict themselves or lose values", LogWarning)
    return found


def _warn(told: dict[int, str], names: Sequence[str], what: str, kind: type[Warning]) -> None:
    """One warning for all: thousands of logs would bury everything else."""
    if not told:
        return
    first = min(told)
    text = f"{len(told)} of {len(names)} {what}, first {names[first]}: {told[first]}"
    warnings.warn(text, kind, stacklevel=6)  # where the method of the study is called
