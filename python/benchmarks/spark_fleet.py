"""A fleet of tanks at rest: threads beside a local cluster of Spark.

    python python/benchmarks/spark_fleet.py [ASSETS] [ROWS] [WORKERS]
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas

import lynkeus
import lynkeus.spark

TANK = """
model Tank
  input Real inflow(min = 0, max = 5);
  Real level(start = 4, min = 0.1, max = 10);
  output Real y = level;
equation
  der(level) = inflow - 0.5*sqrt(level);
end Tank;
"""


def main(assets: int, rows: int, workers: int) -> None:
    study = lynkeus.Study(
        lynkeus.Model.from_modelica(TANK),
        unknown=["inflow"],
        noise={"y": 0.01},
        observer={"theta": 1.0},
        simulate={"until": 0.5 * (rows - 1), "output_step": 0.5, "inputs": {"inflow": 1.2}},
    )
    log = study.simulate().log
    noise = np.random.default_rng(1).normal(scale=0.01, size=(assets, rows))
    table = pandas.DataFrame(
        {
            "asset": np.repeat(np.arange(assets), rows),
            "t": np.tile(log["t"], assets),
            "y": (log["y"] + noise).ravel(),
        }
    )
    spark = timed("spark, its start", lambda: session(workers))
    frame = spark.createDataFrame(table).repartition(workers, "asset").cache()
    timed("spark, the rows in and its Python processes", lambda: estimated(study, frame.where("asset < 2"), False))
    frame.count()
    expected = timed("threads", lambda: on_threads(study, table, workers))
    for is_partitioned in (False, True):
        how = "mapInArrow" if is_partitioned else "applyInArrow"
        found = timed(f"spark, {how}", lambda: estimated(study, frame, is_partitioned))
        print("  equal to the bit:", np.array_equal(found, expected), flush=True)
    timed("threads again", lambda: on_threads(study, table, workers))


def on_threads(study: lynkeus.Study, table: Any, workers: int) -> Any:
    runs = study.estimate_each(table, by="asset", keep=lambda run: run["inflow_hat"], workers=workers)
    return np.concatenate([runs[asset] for asset in sorted(runs)])


def estimated(study: lynkeus.Study, frame: Any, is_partitioned: bool) -> Any:
    done = lynkeus.spark.estimate(study, frame, by="asset", is_partitioned=is_partitioned)
    return done.toPandas().sort_values(["asset", "t"])["inflow_hat"].to_numpy()


def session(workers: int) -> Any:
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    build = SparkSession.builder.master(f"local[{workers}]")
    settings = {
        "spark.ui.enabled": "false",
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.sql.shuffle.partitions": str(2 * workers),
        "spark.sql.execution.arrow.pyspark.enabled": "true",
    }
    for name, value in settings.items():
        build = build.config(name, value)
    made = build.getOrCreate()
    made.sparkContext.setLogLevel("ERROR")
    return made


def timed(what: str, work: Callable[[], Any]) -> Any:
    begin = time.perf_counter()
    found = work()
    print(f"{what}: {time.perf_counter() - begin:.1f} s", flush=True)
    return found


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:] or ("1000", "200", "2")))
