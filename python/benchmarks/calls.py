"""What a call costs beside the engine's own work: a sample of an estimator, and a million rows in and out
through Arrow.

    python python/benchmarks/calls.py [ROWS]

Least and median times of many; a machine with other work tells more of that than of this.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterator
from statistics import median
from typing import Any

import numpy as np
import pyarrow

import lynkeus

TANK = """
model Tank
  input Real inflow(min = 0, max = 5);
  Real level(start = 4, min = 0.1, max = 10);
  output Real y = level;
equation
  der(level) = inflow - 0.5*sqrt(level);
end Tank;
"""
SAMPLES = 20_000
STEP = 0.01


def main(rows: int) -> None:
    study = lynkeus.Study(
        lynkeus.Model.from_modelica(TANK),
        unknown=["inflow"],
        observer={"theta": 1.0},
        estimate={"method": "rk4", "step": STEP},
    )
    samples(study)
    tables(study, rows)


def samples(study: lynkeus.Study) -> None:
    """A sample at the time of the last one needs no integration: what is left is the call."""
    print(f"Estimator, ns per call ({SAMPLES} calls, least and median of 20 times):")
    loop = per_call(study, 0.0, lambda estimator, t: None)
    print(f"  the loop itself            {told(loop)}")
    for name, call in CALLS.items():
        print(f"  {name:26} {told(per_call(study, 0.0, call))}, with a step of rk4 {told(per_call(study, STEP, call))}")


CALLS: dict[str, Callable[[lynkeus.Estimator, float], object]] = {
    'update(t, {"y": 4.0})': lambda estimator, t: estimator.update(t, {"y": 4.0}),
    "push(t, [4.0])": lambda estimator, t: estimator.push(t, [4.0]),
    "predict(t)": lambda estimator, t: estimator.predict(t),
}


def per_call(
    study: lynkeus.Study, step: float, call: Callable[[lynkeus.Estimator, float], object]
) -> list[float]:
    """In nanoseconds, with the loop and the call of the function around it."""

    def once() -> float:
        estimator, t = study.estimator(), 0.0
        estimator.update(t, {"y": 4.0})
        begin = time.perf_counter_ns()
        for _ in range(SAMPLES):
            t += step
            call(estimator, t)
        return (time.perf_counter_ns() - begin) / SAMPLES

    return [once() for _ in range(20)]


def tables(study: lynkeus.Study, rows: int) -> None:
    """Five columns of numbers in, what the run has out."""
    t = np.arange(rows) * STEP
    columns = {"t": t, "y": 4 + 0.1 * np.sin(t), "a": np.cos(t), "b": np.sin(2 * t), "c": np.cos(2 * t)}
    whole = pyarrow.table(columns)
    batches = pyarrow.Table.from_batches(whole.to_batches(max_chunksize=1 << 16))
    run = study.estimate(whole)
    begin = time.perf_counter()
    study.estimate(whole)
    print(f"{rows} rows, ms (least and median of 20 times), beside a run of {time.perf_counter() - begin:.2f} s:")
    print(f"  in, {len(columns)} columns in one piece {told(timed(lambda: lynkeus.Log.from_arrow(whole)))}")
    print(f"  in, in batches of 65,536   {told(timed(lambda: lynkeus.Log.from_arrow(batches)))}")
    print(f"  out, {len(run.columns)} columns as a table   {told(timed(run.to_arrow))}")
    print(f"  out, batch by batch        {told(timed(lambda: sum(batch.num_rows for batch in stream(run))))}")


def stream(run: lynkeus.Estimation) -> Iterator[Any]:
    return iter(pyarrow.RecordBatchReader.from_stream(run))


def timed(work: Callable[[], object]) -> list[float]:
    """In milliseconds."""
    found = []
    for _ in range(20):
        gc.collect()
        begin = time.perf_counter()
        made = work()
        found.append(1e3 * (time.perf_counter() - begin))
        del made
    return found


def told(times: list[float]) -> str:
    digits = 0 if min(times) >= 100 else 1
    return f"{min(times):.{digits}f} / {median(times):.{digits}f}"


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:] or ("1000000",)))
