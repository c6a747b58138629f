"""Fleets on a local cluster of Spark give what each asset gives alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spark_fleet import Logs, followed, logged, rows, same_as_estimators, same_as_runs, session, write_batches

import lynkeus
import lynkeus.spark

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def spark() -> Iterator[Any]:
    made = session("local[2]")
    yield made
    made.stop()


@pytest.fixture(scope="module")
def logs(study: lynkeus.Study) -> Logs:
    return logged(study, 4)


@pytest.mark.parametrize("partitions", [1, 3])
@pytest.mark.parametrize("is_partitioned", [False, True])
def test_at_rest_whatever_the_partitioning(
    spark: Any, study: lynkeus.Study, logs: Logs, partitions: int, is_partitioned: bool
) -> None:
    broken = {**logs, "broken": {"t": np.array([0.0, 1.0]), "y": np.array([np.nan, np.nan])}}
    frame = spark.createDataFrame(rows(broken)).repartition(partitions, "asset")
    found = lynkeus.spark.estimate(study, frame, by="asset", is_partitioned=is_partitioned).toPandas()
    runs = study.estimate_each(broken, errors="return")
    error = found[found["asset"] == "broken"]
    assert error["error"].tolist() == [str(runs.pop("broken"))] and error["inflow_hat"].isna().all()
    same_as_runs(found[found["asset"] != "broken"], runs)


def test_in_motion_the_state_is_the_snapshot(
    spark: Any, study: lynkeus.Study, logs: Logs, tmp_path: Path
) -> None:
    write_batches(logs, tmp_path / "in", 11, late={"asset": "a0", "t": 1.0, "y": 9.0})
    found = followed(spark, study, tmp_path / "in", tmp_path / "checkpoint")
    late = found[found["error"].notna()]
    assert late[["asset", "t"]].to_numpy().tolist() == [["a0", 1.0]] and "does not come after" in late["error"].iloc[0]
    same_as_estimators(found[found["error"].isna()], study, logs, 22)


def test_what_is_missing_is_told(spark: Any, study: lynkeus.Study) -> None:
    frame = spark.createDataFrame([("a", 0.0)], "asset string, t double")
    with pytest.raises(lynkeus.InputError, match="no column y: there are asset, t"):
        lynkeus.spark.estimate(study, frame, by="asset")
    frame = spark.sql("select 'a' as asset, now() as t, 4.0 as y")
    with pytest.raises(lynkeus.InputError, match='column "t": expected numbers, found timestamp'):
        lynkeus.spark.follow(study, frame, by="asset")
