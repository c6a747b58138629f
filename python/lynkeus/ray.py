"""Campaigns on a cluster of Ray: what threads give on one machine, on many.

    dataset = lynkeus.ray.campaign(study, range(1, 10_001))
    dataset.to_pandas().sort_values("seed")

Ray cuts, schedules and repeats; here stands only what a worker does with its rows. A study travels
with its texts and is prepared where it runs, each row is a run by itself: its result depends neither
on how the rows are cut nor on which worker computes them, and what a lost worker had begun is
computed again by another. Blocks come in no particular order, rows are known by their first column.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from . import _lynkeus
from ._arguments import function, instance, optional, section, several, takes, whole, word
from ._base import Base
from ._columns import Given
from ._each import Errors, chosen
from ._logs import columns_of, log_of
from ._optional import needed
from .errors import ArgumentError, InputError, LynkeusError
from .results import Estimation, Run, Simulation, figures
from .study import Study

if TYPE_CHECKING:
    from ray.data import Dataset

    from ._types import LogLike
    from .sections import Changes

Keep: TypeAlias = Callable[[Any], Mapping[str, Any]]
_CHECKS = {"study": instance(Study, "a Study"), "keep": function, "errors": word, "blocks": optional(whole)}


@takes(seeds=several("whole numbers"), **_CHECKS)
def campaign(
    study: Study,
    seeds: Iterable[int],
    *,
    keep: Keep = figures,
    errors: Errors = "return",
    blocks: int | None = None,
    **options: Any,
) -> Dataset:
    """One row per seed: the study simulated with that seed of noise and starts.

    Parameters
    ----------
    study : Study
        With ``[simulate]``.
    seeds : list of int
        At least one.
    keep : function
        Makes a dictionary of each run, the row's further columns; columns of the run where they are asked
        for: ``keep=lambda run: {"Zf_hat": run["Zf_hat"]}``.
    errors : str
        ``"return"``, or ``"raise"``: a run that fails then ends the campaign.
    blocks : int, optional
        Number of pieces, 200 where it is left out.
    **options
        Those of ``Dataset.map_batches`` (``num_cpus``, ``concurrency``, …).

    Returns
    -------
    ray.data.Dataset
        Columns ``seed``, ``error`` (why a run failed, else null) and what ``keep`` makes of a run: by default
        :func:`lynkeus.results.figures`, that is ``credible``, ``refusal`` and ``rms_NAME``. Of a run that
        failed these are null; a block in which every run failed runs the study as it is to know them.

    Raises
    ------
    InputError
        There is nothing to run.
    ImportError
        Ray is not installed.
    """
    chosen(errors)
    asked = [_seed(seed) for seed in seeds]
    data = needed("ray.data", "lynkeus.ray")
    items = [{"seed": seed} for seed in asked]
    work = _Work(study, "seed", _seeded, keep, errors, None)
    return _mapped(data, items, work, blocks, options)


@takes(changes=several("dictionaries as of Study.replace"), **_CHECKS)
def sweep(
    study: Study,
    changes: Iterable[Changes],
    log: LogLike | None = None,
    *,
    keep: Keep = figures,
    errors: Errors = "return",
    blocks: int | None = None,
    **options: Any,
) -> Dataset:
    """One row per change of the study, simulated or estimating from a log: thousands of tunings, or values of
    parameters.

    Parameters
    ----------
    study : Study
        What is changed.
    changes : list of dict
        What :meth:`Study.replace` takes.
    log : path, mapping of columns, data frame, table or run, optional
        What :meth:`Study.estimate` takes; simulated where it is left out.
    keep, errors, blocks, **options
        As of :func:`campaign`.

    Returns
    -------
    ray.data.Dataset
        Columns ``place`` (of the change in the list), ``error`` and what ``keep`` makes of a run.

    Raises
    ------
    InputError
        There is nothing to run, or the log cannot be read.
    ImportError
        Ray is not installed.
    """
    chosen(errors)
    data = needed("ray.data", "lynkeus.ray")
    asked = [section(f"changes[{place}]", change) for place, change in enumerate(changes)]
    items = [{"place": place, "change": pickle.dumps(dict(change))} for place, change in enumerate(asked)]
    columns = None if log is None else columns_of(log_of(log, study=study._core))
    work = _Work(study, "place", _changed, keep, errors, columns)
    return _mapped(data, items, work, blocks, options)


def _mapped(
    data: Any, items: list[dict[str, Any]], work: _Work, blocks: int | None, options: dict[str, Any]
) -> Dataset:
    if not items:
        raise InputError("nothing to run: expected at least one seed or change")
    if blocks is not None and blocks < 1:
        raise InputError(f"blocks: expected at least 1, found {blocks}")
    given: Any = data.from_items(items, override_num_blocks=min(blocks or _BLOCKS, len(items)))
    mapped: Dataset = given.map_batches(work, batch_format="pyarrow", batch_size=None, **options)
    return mapped


#: Ray's own number of pieces where nothing else speaks: few enough that a piece outweighs its
#: overhead, enough that cores end together.
_BLOCKS = 200


def _seed(seed: Any) -> int:
    return whole("seeds", seed)


def _seeded(row: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"simulate": {"seed": row["seed"]}}


def _changed(row: Mapping[str, Any]) -> Mapping[str, Any]:
    change: Mapping[str, Any] = pickle.loads(row["change"])
    return change


@dataclass(frozen=True, eq=False)
class _Work:
    """What a worker does with its rows."""

    study: Study
    #: the first column, by which rows are known
    key: str
    #: of the study, from a row
    change: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    keep: Keep
    errors: Errors
    #: of the log, where there is one
    columns: list[tuple[str, Given]] | None

    def __call__(self, batch: Any) -> Any:
        base = Base(self.study._core)
        log = None if self.columns is None else _lynkeus.Log.from_columns(self.columns)
        rows = [self._row(base, log, row) for row in batch.to_pylist()]
        has_run = any(row["error"] is None for row in rows)
        return _table(rows, {} if has_run else self._example(log))

    def _row(self, base: Base, log: _lynkeus.Log | None, row: Mapping[str, Any]) -> dict[str, Any]:
        told = {self.key: row[self.key], "error": None}
        try:
            return {**told, **self._kept(base.changed(self.change(row)), log)}
        except LynkeusError as error:
            if self.errors == "raise":
                raise
            return {**told, "error": str(error)}

    def _kept(self, study: _lynkeus.Study, log: _lynkeus.Log | None) -> Mapping[str, Any]:
        kept = self.keep(_run(study, log))
        if not isinstance(kept, Mapping):
            raise ArgumentError.of("keep", "a dictionary, the row's columns by name", kept)
        return kept

    def _example(self, log: _lynkeus.Log | None) -> Mapping[str, Any]:
        """What is kept of the study as it is: blocks in which every run failed have its columns, as
        the others do."""
        try:
            return self._kept(self.study._core, log)
        except LynkeusError:
            return {}


def _run(study: _lynkeus.Study, log: _lynkeus.Log | None) -> Run:
    return Simulation(study.simulate()) if log is None else Estimation(study.estimate(log))


def _table(rows: list[dict[str, Any]], example: Mapping[str, Any]) -> Any:
    """Rows as a table of Arrow in which texts are texts even where all are null, and in which what a
    failed run lacks is null, of the kind that it has in ``example``."""
    arrow = needed("pyarrow", "lynkeus.ray")
    names = list(dict.fromkeys(name for row in [*rows, example] for name in row))
    kinds = {name: arrow.array([value]).type for name, value in example.items()}
    kinds |= {"error": arrow.string(), "refusal": arrow.string()}
    return arrow.table(
        {name: arrow.array([row.get(name) for row in rows], kinds.get(name)) for name in names}
    )
