"""Fleets on Spark: one study, many assets.

At rest, a table of all assets' rows:

    lynkeus.spark.estimate(study, frame, by="asset")

In motion, a stream of them; the state of each asset is its estimator's snapshot:

    lynkeus.spark.follow(study, stream, by="asset")

Spark brings the rows of an asset together, schedules and repeats; here stands only what a worker does
with one asset. So an asset's estimates do not depend on how the rows are partitioned. A study
travels with its texts and is prepared where it runs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._arguments import flag, instance, optional, takes, word
from ._assets import Follower, Replay, Signals
from ._optional import needed
from .errors import InputError
from .study import Study

if TYPE_CHECKING:
    from pyspark.sql import DataFrame


_CHECKS = {"study": instance(Study, "a Study"), "by": word, "time": optional(word)}


@takes(is_partitioned=flag, **_CHECKS)
def estimate(
    study: Study, frame: DataFrame, *, by: str, time: str | None = None, is_partitioned: bool = False
) -> DataFrame:
    """The estimates of each asset over its rows.

    Parameters
    ----------
    study : Study
        What estimates.
    frame : pyspark.sql.DataFrame
        The rows of all assets.
    by : str
        The column that names the asset of each row.
    time : str, optional
        The column of the time, in whose order rows are taken; ``[estimate] time`` of the study where it is
        left out.
    is_partitioned : bool
        Each partition holds all rows of its assets already, as after ``repartition(by)``: then rows are not
        brought together (``mapInArrow`` in place of ``applyInArrow``).

    Returns
    -------
    pyspark.sql.DataFrame
        Columns ``by``, ``time`` in seconds, ``NAME_hat`` for each estimate in its unit, ``credible``,
        ``error``. An asset that fails has one row, with the reason under ``error``.

    Raises
    ------
    InputError
        A column is missing.
    ImportError
        Spark or pyarrow is not installed.
    """
    needed("pyarrow", "lynkeus.spark")
    signals = Signals.recorded(study, by, time)
    taken = _taken(frame, signals)
    schema = _schema(frame, signals, [("credible", "boolean"), ("error", "string")])
    replay = Replay(study, signals)
    if is_partitioned:
        return taken.mapInArrow(replay.partition, schema)
    return taken.groupBy(f"`{by}`").applyInArrow(lambda table: replay.asset(table), schema)  # one argument: a method has two


@takes(**_CHECKS)
def follow(study: Study, stream: DataFrame, *, by: str, time: str | None = None) -> DataFrame:
    """The estimates after each row of a stream, asset by asset, from where the last batch ended.

    The state of an asset is the snapshot of its estimator (``transformWithStateInPandas``; Spark wants its
    RocksDB state store for it, and a checkpoint of the query survives a restart).

    Parameters
    ----------
    study : Study
        What estimates.
    stream : pyspark.sql.DataFrame
        A stream of the rows of all assets.
    by : str
        The column that names the asset of each row.
    time : str, optional
        The column of the time, numbers in the model's unit, in whose order the rows of a batch are taken;
        ``[estimate] time`` of the study where it is left out.

    Returns
    -------
    pyspark.sql.DataFrame
        Columns ``by``, ``time``, ``NAME_hat`` for each estimate in its unit, and ``error``: a row that is
        refused, for example because it comes late, changes nothing and tells why.

    Raises
    ------
    InputError
        A column is missing, or the time is no number.
    ImportError
        Spark is not installed.
    """
    processor = needed("pyspark.sql.streaming", "lynkeus.spark").StatefulProcessor
    signals = Signals.live(study, by, time)
    taken = _taken(stream, signals)
    kind = dict(taken.dtypes)[signals.time]
    if kind not in ("double", "float", "bigint", "int", "smallint", "tinyint") and not kind.startswith("decimal"):
        raise InputError(
            f'column "{signals.time}": expected numbers, found {kind}; a stream has no first instant to '
            f'count from: stream.withColumn("{signals.time}", col("{signals.time}").cast("double"))'
        )
    follower = type("Follower", (Follower, processor), {})(study, signals)
    return taken.groupBy(f"`{by}`").transformWithStateInPandas(
        statefulProcessor=follower,
        outputStructType=_schema(stream, signals, [("error", "string")]),
        outputMode="append",
        timeMode="none",
    )


def _taken(frame: DataFrame, signals: Signals) -> DataFrame:
    """The columns that are needed: the others do not travel."""
    missing = [name for name in signals.needed if name not in frame.columns]
    if missing:
        raise InputError(
            f"the fleet: no column {', '.join(missing)}: there are {', '.join(frame.columns)}"
        )
    return frame.select(*(f"`{name}`" for name in signals.needed))


def _schema(frame: DataFrame, signals: Signals, further: list[tuple[str, str]]) -> Any:
    types = needed("pyspark.sql.types", "lynkeus.spark")
    number = types.DoubleType()
    kinds = {"boolean": types.BooleanType(), "string": types.StringType()}
    fields = [types.StructField(signals.by, frame.schema[signals.by].dataType)]
    fields += [types.StructField(name, number) for name in (signals.time, *signals.headers)]
    fields += [types.StructField(name, kinds[kind]) for name, kind in further]
    return types.StructType(fields)
