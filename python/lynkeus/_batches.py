"""A study over many logs, and over many changes of itself."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from . import _lynkeus
from ._base import Base
from ._each import Errors, Tell, Work, each
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

    def terms(tell: Tell) -> Terms:
        return Terms(options.time_limit, options.memory_limit, tell)

    def alone(log: Any, tell: Tell) -> Run:
        return Estimation(study.estimate(given(log), terms(tell)))

    def run(logs: Sequence[Any], tell: Tell) -> Sequence[Callable[[], Run]]:
        if len(logs) > 1:
            # what is wrong with the study, or with what is no log, each says for itself
            with suppress(Exception):
                found = study.estimate_together([given(log) for log in logs], terms(tell))
                return [partial(_estimation, one) for one in found]
        return [partial(alone, log, tell) for log in logs]

    # a limit is one of each log
    together = study.side_by_side() if options.time_limit is None else 1
    found = _all(run, logs, names, "estimating", options, together)
    return found if keys is None else dict(zip(keys, found, strict=True))


def _estimation(found: _lynkeus.Answer | BaseException) -> Run:
    if isinstance(found, BaseException):
        raise found
    return Estimation(found)


def sweep(study: _lynkeus.Study, changes: Iterable[Mapping[str, Any]], log: Any, options: Options) -> list[Any]:
    """See :meth:`Study.sweep`."""
    asked = list(changes)
    for place, change in enumerate(asked):
        if not isinstance(change, Mapping):
            raise InputError(
                f"change {place}: expected a dictionary as of replace, {{\"observer\": {{\"theta\": 2.0}}}}, "
                f"found {type(change).__name__}"
            )
    recorded = None if log is None else log_of(log, study=study)
    base = Base(study)

    def run(change: Mapping[str, Any], tell: Tell) -> Run:
        core, terms = base.changed(change), Terms(options.time_limit, options.memory_limit, tell)
        if recorded is None:
            return Simulation(core.simulate(terms))
        return Estimation(core.estimate(recorded, terms))

    def each_alone(changes: Sequence[Mapping[str, Any]], tell: Tell) -> Sequence[Callable[[], Run]]:
        return [partial(run, change, tell) for change in changes]

    return _all(each_alone, asked, _places("change", asked), "sweeping", options)


def _places(what: str, items: Sequence[Any]) -> list[str]:
    return [f"{what} {place}" for place in range(len(items))]


def _all(
    run: Work[Any, Run],
    items: Sequence[Any],
    names: Sequence[str],
    what: str,
    options: Options,
    together: int = 1,
) -> list[Any]:
    """What is kept of the run of each item, in their order; one warning for all that are not credible."""
    doubted: dict[int, str] = {}
    lossy: dict[int, str] = {}

    def work(places: Sequence[int], tell: Tell) -> Sequence[Callable[[], Any]]:
        runs = run([items[place] for place in places], tell)
        return [partial(kept, place, one) for place, one in zip(places, runs, strict=True)]

    def kept(place: int, run: Callable[[], Run]) -> Any:
        found = run()
        if found.refusal is not None:
            doubted[place] = str(found.refusal)
        if warnings_of := found._core.warnings():
            lossy[place] = warnings_of[0]
        return found if options.keep is None else options.keep(found)

    found = each(
        work,
        range(len(items)),
        names,
        together=together,
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
