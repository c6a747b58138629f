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
from typing import TYPE_CHECKING, Any

from . import _lynkeus
from ._base import Base
from ._columns import Given
from ._each import Errors, chosen
from ._logs import columns_of, log_of
from ._optional import needed
from .errors import InputError, LynkeusError
from .results import Estimation, Run, Simulation, figures
from .study import Study

if TYPE_CHECKING:
    from ray.data import Dataset

Keep = Callable[[Any], Mapping[str, Any]]


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

    Columns are ``seed``, ``error`` (why a run failed, else null) and what ``keep`` makes of a run: by
    default :func:`lynkeus.results.figures`, that is ``credible``, ``refusal`` and ``rms_NAME``; columns of
    the run where they are asked for: ``keep=lambda run: {"Zf_hat": run["Zf_hat"]}``. With
    ``errors="raise"`` a run that fails ends the campaign. ``blocks`` is the number of pieces, 200
    where it is left out; ``options`` are those of ``Dataset.map_batches``
    (``num_cpus``, ``concurrency``, …)."""
    chosen(errors)
    asked = [_seed(seed) for seed in seeds]
    data = needed("ray.data", "lynkeus.ray")
    items = [{"seed": seed} for seed in asked]
    work = _Work(study, "seed", _seeded, keep, errors, None)
    return _mapped(data, items, work, blocks, options)


def sweep(
    study: Study,
    changes: Iterable[Mapping[str, Any]],
    log: Any = None,
    *,
    keep: Keep = figures,
    errors: Errors = "return",
    blocks: int | None = None,
    **options: Any,
) -> Dataset:
    """One row per change of the study, which is what :meth:`Study.replace` takes, simulated or, with
    ``log``, estimating from it: thousands of tunings, or values of parameters.

    Columns are ``place`` (of the change in the list), ``error`` and what ``keep`` makes of a run. The
    options are those of :func:`campaign`."""
    chosen(errors)
    data = needed("ray.data", "lynkeus.ray")
    items = [{"place": place, "change": pickle.dumps(dict(change))} for place, change in enumerate(changes)]
    columns = None if log is None else columns_of(log_of(log))
    work = _Work(study, "place", _changed, keep, errors, columns)
    return _mapped(data, items, work, blocks, options)


def _mapped(
    data: Any, items: list[dict[str, Any]], work: _Work, blocks: int | None, options: dict[str, Any]
) -> Dataset:
    if not items:
        raise InputError("nothing to run: expected at least one seed or change")
    given: Any = data.from_items(items, override_num_blocks=min(blocks or _BLOCKS, len(items)))
    mapped: Dataset = given.map_batches(work, batch_format="pyarrow", batch_size=None, **options)
    return mapped


#: Ray's own number of pieces where nothing else speaks: few enough that a piece outweighs its
#: overhead, enough that cores end together.
_BLOCKS = 200


def _seed(seed: Any) -> int:
    try:
        return int(seed.__index__())
    except AttributeError:
        raise InputError(f"seeds: expected whole numbers, found {seed!r}") from None


def _seeded(row: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"simulate": {"seed": row["seed"]}}


def _changed(row: Mapping[str, Any]) -> Mapping[str, Any]:
    change: Mapping[str, Any] = pickle.loads(row["change"])
    return change


class _Work:
    """What a worker does with its rows."""

    def __init__(
        self,
        study: Study,
        key: str,
        change: Callable[[Mapping[str, Any]], Mapping[str, Any]],
        keep: Keep,
        errors: Errors,
        columns: list[tuple[str, Given]] | None,
    ) -> None:
        self.study = study
        self.key = key
        self.change = change
        self.keep = keep
        self.errors = errors
        self.columns = columns

    def __call__(self, batch: Any) -> Any:
        base = Base(self.study._core)
        log = None if self.columns is None else _lynkeus.Log.from_columns(self.columns)
        return _table(self.key, [self._row(base, log, row) for row in batch.to_pylist()])

    def _row(self, base: Base, log: _lynkeus.Log | None, row: Mapping[str, Any]) -> dict[str, Any]:
        told = {self.key: row[self.key], "error": None}
        try:
            kept = self.keep(_run(base.changed(self.change(row)), log))
        except LynkeusError as error:
            if self.errors == "raise":
                raise
            return {**told, "error": str(error)}
        if not isinstance(kept, Mapping):
            raise InputError(f"keep: expected a dictionary, the row's columns by name, found {kept!r}")
        return {**told, **kept}


def _run(study: _lynkeus.Study, log: _lynkeus.Log | None) -> Run:
    return Simulation(study.simulate()) if log is None else Estimation(study.estimate(log))


def _table(key: str, rows: list[dict[str, Any]]) -> Any:
    """Rows as a table of Arrow in which texts are texts even where all are null, and in which what a
    failed run lacks is null."""
    arrow = needed("pyarrow", "lynkeus.ray")
    names = list(dict.fromkeys(name for row in rows for name in row))
    texts = {"error", "refusal"}
    return arrow.table(
        {
            name: arrow.array([row.get(name) for row in rows], arrow.string() if name in texts else None)
            for name in names
        }
    )
