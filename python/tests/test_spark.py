"""Fleets on a local cluster of Spark give what each asset gives alone."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator
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

pytestmark = pytest.mark.filterwarnings("ignore")

ASSETS = 4


@pytest.fixture(scope="module")
def spark() -> Iterator[Any]:
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    build = SparkSession.builder.master("local[2]").appName("lynkeus")
    settings = {
        "spark.ui.enabled": "false",
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.sql.shuffle.partitions": "2",
        "spark.sql.streaming.stateStore.providerClass": "org.apache.spark.sql.execution.streaming.state."
        "RocksDBStateStoreProvider",
    }
    for name, value in settings.items():
        build = build.config(name, value)
    session = build.getOrCreate()
    session.sparkContext.setLogLevel("ERROR")
    yield session
    session.stop()


@pytest.fixture(scope="module")
def logs(study: lynkeus.Study) -> dict[str, Any]:
    changes = [{"simulate": {"seed": seed}} for seed in range(ASSETS)]
    made = study.sweep(changes, keep=lambda run: run.log)
    return {f"a{place}": log for place, log in enumerate(made)}


def rows(logs: dict[str, Any]) -> Any:
    """All assets' rows, shuffled."""
    parts = [pandas.DataFrame({**log, "asset": asset}) for asset, log in logs.items()]
    return pandas.concat(parts).sample(frac=1, random_state=3)


@pytest.mark.parametrize("partitions", [1, 3])
@pytest.mark.parametrize("is_partitioned", [False, True])
def test_at_rest_whatever_the_partitioning(
    spark: Any, study: lynkeus.Study, logs: dict[str, Any], partitions: int, is_partitioned: bool
) -> None:
    broken = {**logs, "broken": {"t": np.array([0.0, 1.0]), "y": np.array([np.nan, np.nan])}}
    frame = spark.createDataFrame(rows(broken)).repartition(partitions, "asset")
    found = lynkeus.spark.estimate(study, frame, by="asset", is_partitioned=is_partitioned).toPandas()
    alone = study.estimate_each(broken, errors="return")
    assert set(found["asset"]) == set(broken)
    for asset, given in found.groupby("asset"):
        run = alone[asset]
        if asset == "broken":
            assert given["error"].tolist() == [str(run)] and given["inflow_hat"].isna().all()
            continue
        given = given.sort_values("t")
        for name in ("t", "level_hat", "inflow_hat"):
            np.testing.assert_array_equal(given[name], run[name])
        assert given["credible"].all() and given["error"].isna().all()


def test_in_motion_the_state_is_the_snapshot(
    spark: Any, study: lynkeus.Study, logs: dict[str, Any], tmp_path: Path
) -> None:
    for batch in range(2):  # by their names in order, a batch each
        early = {a: {k: v[11 * batch : 11 * batch + 11] for k, v in log.items()} for a, log in logs.items()}
        lines = [json.dumps(row) for row in rows(early).to_dict("records")]
        if batch == 1:
            lines.append(json.dumps({"asset": "a0", "t": 1.0, "y": 9.0}))  # late
        (tmp_path / f"{batch}.json").write_text("\n".join(lines))
        os.utime(tmp_path / f"{batch}.json", (batch + 1.0, batch + 1.0))
    source = spark.readStream.schema("asset string, t double, y double").option("maxFilesPerTrigger", 1)
    followed = lynkeus.spark.follow(study, source.json(str(tmp_path)), by="asset")
    to = followed.writeStream.format("memory").queryName("followed").outputMode("append")
    to.trigger(availableNow=True).start().awaitTermination()
    found = spark.sql("select * from followed").toPandas()
    late = found[found["error"].notna()]
    assert late[["asset", "t"]].to_numpy().tolist() == [["a0", 1.0]] and "does not come after" in late["error"].iloc[0]
    for asset, given in found[found["error"].isna()].groupby("asset"):
        estimator = study.estimator()
        expected = []
        for t, y in zip(logs[asset]["t"], logs[asset]["y"], strict=True):
            estimator.update(t, {"y": y})
            expected.append(estimator.to_numpy())
        given = given.sort_values("t")
        np.testing.assert_array_equal(given[["level_hat", "inflow_hat"]].to_numpy(), expected)


def test_what_is_missing_is_told(spark: Any, study: lynkeus.Study) -> None:
    frame = spark.createDataFrame([("a", 0.0)], "asset string, t double")
    with pytest.raises(lynkeus.InputError, match="no column y: there are asset, t"):
        lynkeus.spark.estimate(study, frame, by="asset")
    frame = spark.sql("select 'a' as asset, now() as t, 4.0 as y")
    with pytest.raises(lynkeus.InputError, match='column "t": expected numbers, found timestamp'):
        lynkeus.spark.follow(study, frame, by="asset")
