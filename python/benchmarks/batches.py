"""Many logs by threads beside a loop over them: processor time, since the clock tells of other work.

    python python/benchmarks/batches.py [LOGS]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import lynkeus


def main(count: int) -> None:
    study = lynkeus.Study.load("examples/column/study-noise.toml")
    changes = [{"simulate": {"seed": seed, "until": 30}} for seed in range(1, count + 1)]
    logs = study.sweep(changes, keep=lambda run: lynkeus.Log.from_columns(list(run.log.items())))
    loop = cost(lambda: [study._core.estimate(log) for log in logs])
    each = cost(lambda: study.estimate_each(logs))
    print(f"{count} logs: one by one in the engine {loop:.2f} s, estimate_each {each:.2f} s, {each / loop:.2f} times")


def cost(work: Callable[[], object]) -> float:
    """Processor time of all threads, in seconds."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:] or ("100",)))
