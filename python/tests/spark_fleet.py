"""A fleet of tanks on a local cluster of Spark."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lynkeus
import lynkeus.spark

pytest.importorskip("pyspark", reason="skipped: pyspark is not installed")
pytest.importorskip("pyarrow")
pandas = pytest.importorskip("pandas")
if shutil.which("java") is None:
    pytest.skip("skipped: Spark needs Java, and there is none", allow_module_level=True)

Logs = dict[str, dict[str, Any]]


def session(master: str) -> Any:
    """A session, to be stopped by who asked for it."""
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    build = SparkSession.builder.master(master).appName("lynkeus")
    known = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    settings = {
        "spark.executorEnv.PYTHONPATH": os.pathsep.join(known),  # what tests send refers to their modules
        "spark.ui.enabled": "false",
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.sql.shuffle.partitions": "2",
        "spark.sql.streaming.stateStore.providerClass": "org.apache.spark.sql.execution.streaming.state."
        "RocksDBStateStoreProvider",
    }
    for name, value in settings.items():
        build = build.config(name, value)
    made = build.getOrCreate()
    made.sparkContext.setLogLevel("ERROR")
    return made


def logged(study: lynkeus.Study, assets: int) -> Logs:
    """What loggers of tanks ``a0``, ``a1``, … would have seen."""
    changes = [{"simulate": {"seed": seed}} for seed in range(assets)]
    made = study.sweep(changes, keep=lambda run: run.log)
    return {f"a{place}": log for place, log in enumerate(made)}


def rows(logs: Logs) -> Any:
    """All assets' rows, shuffled."""
    parts = [pandas.DataFrame({**log, "asset": asset}) for asset, log in logs.items()]
    return pandas.concat(parts).sample(frac=1, random_state=3)


def write_batches(logs: Logs, folder: Path, size: int, late: dict[str, Any] | None = None) -> None:
    """Two batches of so many rows per asset, a file each; ``late`` comes with the second."""
    folder.mkdir()
    for batch in range(2):  # by their times in order
        part = slice(size * batch, size * (batch + 1))
        of_batch = {asset: {name: x[part] for name, x in log.items()} for asset, log in logs.items()}
        lines = [json.dumps(row) for row in rows(of_batch).to_dict("records")]
        if batch == 1 and late is not None:
            lines.append(json.dumps(late))
        file = folder / f"{batch}.json"
        file.write_text("\n".join(lines))
        os.utime(file, (batch + 1.0, batch + 1.0))


def followed(spark: Any, study: lynkeus.Study, folder: Path, checkpoint: Path) -> Any:
    """What :func:`lynkeus.spark.follow` gives for these batches, one after the other."""
    source = spark.readStream.schema("asset string, t double, y double").option("maxFilesPerTrigger", 1)
    stream = lynkeus.spark.follow(study, source.json(str(folder)), by="asset")
    to = stream.writeStream.format("memory").queryName("followed").outputMode("append")
    to = to.option("checkpointLocation", str(checkpoint))
    to.trigger(availableNow=True).start().awaitTermination()
    return spark.sql("select * from followed").toPandas()


def same_as_estimators(found: Any, study: lynkeus.Study, logs: Logs, count: int) -> None:
    """Each asset has the estimates of an estimator of its own after each of its first rows, to the bit."""
    assert set(found["asset"]) == set(logs)
    for asset, given in found.groupby("asset"):
        estimator = study.estimator()
        expected = []
        for t, y in zip(logs[asset]["t"][:count], logs[asset]["y"][:count], strict=True):
            estimator.update(t, {"y": y})
            expected.append(estimator.to_numpy())
        given = given.sort_values("t")
        np.testing.assert_array_equal(given[["level_hat", "inflow_hat"]].to_numpy(), expected)


def same_as_runs(found: Any, runs: dict[Any, lynkeus.Estimation]) -> None:
    """Each asset has its run's rows, to the bit."""
    assert set(found["asset"]) == set(runs)
    for asset, given in found.groupby("asset"):
        given = given.sort_values("t")
        for name in ("t", "level_hat", "inflow_hat"):
            np.testing.assert_array_equal(given[name], runs[asset][name])
        assert given["credible"].all() and given["error"].isna().all()
