"""The column's noisy study, many seeds: threads beside a local cluster of Ray, and a killed worker.

    python python/benchmarks/ray_column.py [RUNS] [WORKERS]

Figures are told line by line as they come; run it from the repository's root.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import ray
import ray.data

import lynkeus
import lynkeus.ray
from lynkeus.results import figures

Rows = list[dict[str, Any]]


def main(runs: int, workers: int) -> None:
    # Ray runs its workers at niceness 15: on a machine with other work they would starve beside threads
    os.environ["RAY_worker_niceness"] = "0"
    ray.init(
        num_cpus=workers, include_dashboard=False, logging_level="warning", _node_ip_address="127.0.0.1"
    )
    ray.data.DataContext.get_current().enable_progress_bars = False
    study = lynkeus.Study.load("examples/column/study-noise.toml")
    study = study.replace(simulate={"method": "rk4", "step": 0.02})
    timed("ray, first data set (starts the cluster's services)", lambda: on_ray(study, 2, 2))
    reference = timed(f"threads, {runs} runs", lambda: on_threads(study, runs, workers))
    for blocks in (10, 23):
        found = timed(f"ray, {runs} runs in {blocks} blocks", lambda: on_ray(study, runs, blocks))
        print("  equal to the bit:", found == reference, flush=True)
    threading.Timer(3.0, kill_a_worker).start()
    found = timed(f"ray, {runs} runs in 10 blocks, a worker killed", lambda: on_ray(study, runs, 10))
    print("  equal to the bit:", found == reference, flush=True)


def on_threads(study: lynkeus.Study, runs: int, workers: int) -> Rows:
    changes = [{"simulate": {"seed": seed}} for seed in range(1, runs + 1)]
    return study.sweep(changes, keep=figures, workers=workers)


def on_ray(study: lynkeus.Study, runs: int, blocks: int) -> Rows:
    rows = lynkeus.ray.campaign(study, range(1, runs + 1), blocks=blocks).take_all()
    rows.sort(key=lambda row: row["seed"])
    return [{name: row[name] for name in row if name not in ("seed", "error")} for row in rows]


def timed(what: str, work: Callable[[], Rows]) -> Rows:
    begin = time.perf_counter()
    found = work()
    print(f"{what}: {time.perf_counter() - begin:.1f} s", flush=True)
    return found


def kill_a_worker() -> None:
    """The first process of this cluster's that maps batches."""
    for entry in sorted(os.scandir("/proc"), key=lambda entry: entry.name):
        if not entry.name.isdigit():
            continue
        try:
            with open(f"/proc/{entry.name}/cmdline") as file:
                title = file.read()
        except OSError:
            continue
        if title.startswith("ray::MapBatches"):
            os.kill(int(entry.name), signal.SIGKILL)
            print("  killed", title.rstrip("\0"), flush=True)
            return
    print("  no worker was found to be killed", flush=True)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:] or ("10000", "2")))
