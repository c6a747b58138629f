"""Callbacks, signals, threads and forks: nothing hangs, nothing crashes."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import estimated, log, same, tank

import lynkeus

# --- callbacks and signals -------------------------------------------------------------------

SLOW = {
    "simulate": {"until": 1e6, "output_step": 0.01, "inputs": {"inflow": 1.2}},
    "tune": {"keys": {"theta": [1.0, 2.0, 3.0, 4.0]}},
}


def slow() -> lynkeus.Study:
    return tank(**SLOW)


def long_log() -> dict[str, Any]:
    t = np.arange(3_000_000) * 1e-3
    return {"t": t, "y": 4.0 + 0.1 * np.sin(t)}


VERBS: dict[str, Callable[[lynkeus.Study, Any], Any]] = {
    "simulate": lambda study, tell: study.simulate(progress=tell),
    "runs": lambda study, tell: study.simulate(runs=1000, progress=tell, memory_limit=np.inf),
    "estimate": lambda study, tell: study.estimate(long_log(), progress=tell),
    "tune": lambda study, tell: study.tune(progress=tell),
    "compare": lambda study, tell: study.compare(progress=tell),
}


@pytest.mark.parametrize("verb", VERBS)
def test_an_exception_in_a_callback_ends_the_call(verb: str) -> None:
    told: list[float] = []

    def tell(fraction: float) -> None:
        told.append(fraction)
        raise ZeroDivisionError("in the callback")

    began = time.monotonic()
    with pytest.raises(ZeroDivisionError, match="in the callback"):
        VERBS[verb](slow(), tell)
    assert len(told) == 1 and 0.0 <= told[0] <= 1.0
    assert time.monotonic() - began < 20


def test_a_time_limit_ends_the_run_that_a_sweep_is_judged_by() -> None:
    began = time.monotonic()
    with pytest.raises(lynkeus.LimitError):
        slow().tune(time_limit=0.5)
    assert time.monotonic() - began < 20


_INTERRUPTED = """
import _thread, signal, threading
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
from test_threads import VERBS, slow
import lynkeus
lynkeus.check(slow())  # everything is loaded
threading.Timer(1.0, _thread.interrupt_main).start()
try:
    VERBS["{verb}"](slow(), False)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize("verb", VERBS)
def test_an_interrupt_ends_the_call(verb: str) -> None:
    here = Path(__file__).parent
    command = [sys.executable, "-c", _INTERRUPTED.format(verb=verb)]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted\n", "")


# --- threads and processes -------------------------------------------------------------------


def threads(work: Callable[[int], Any], count: int = 8) -> None:
    """The work on so many threads at once; what one raises is raised."""
    raised: list[BaseException] = []

    def one(k: int) -> None:
        try:
            work(k)
        except BaseException as error:
            raised.append(error)

    running = [threading.Thread(target=one, args=(k,)) for k in range(count)]
    for thread in running:
        thread.start()
    for thread in running:
        thread.join()
    if raised:
        raise raised[0]


def test_an_answer_is_read_by_many_threads() -> None:
    run = estimated(log())
    expected = {name: run[name].copy() for name in run.columns}
    fresh = estimated(log())

    def read(_: int) -> None:
        for name in fresh.columns:
            assert np.array_equal(fresh[name], expected[name], equal_nan=True)
        assert str(fresh) == str(run) and fresh.summary == run.summary
        assert fresh.to_svg() == run.to_svg()
        assert fresh.__arrow_c_stream__() is not None

    threads(read)


def test_threads_take_turns_at_an_estimator() -> None:
    estimator = tank().estimator()
    ahead = iter(range(10**9))
    lock = threading.Lock()

    def feed(_: int) -> None:
        for _ in range(200):
            with lock:
                t = next(ahead) * 0.01
                estimator.update(t, {"y": 4.0})
            assert estimator.time is not None and estimator.estimate["level"] > 0
            assert len(estimator.snapshot()) > 0

    threads(feed, 4)
    assert estimator.health["sensors"]["y"]["taken"] == 800


def test_a_reading_may_use_the_estimator_that_reads_it() -> None:
    estimator: Any = tank().estimator()

    class Sly:
        def __float__(self) -> float:
            estimator.update(0.0, {"y": 4.0})
            return 4.1

    estimator.update(0.5, {"y": Sly()})
    assert (estimator.time, estimator.health["sensors"]["y"]["taken"]) == (0.5, 2)


def _in_child(run: lynkeus.Estimation, file: lynkeus.Log, pipe: Any) -> None:
    for _ in range(20):
        again = estimated(file, estimate={"method": "rk4", "step": 0.01})
        assert same(again, run)
    pipe.send("done")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_reads_and_writes_long_columns_of_its_own(tmp_path: Path) -> None:
    """Of a log and a run whose columns lie in temporary files."""
    data = log(rows=70_000, step=0.01)
    data["y"][5] = np.nan
    path = tmp_path / "log.csv"
    lines = (f"{t!r},{'' if np.isnan(y) else repr(y)}" for t, y in zip(data["t"].tolist(), data["y"].tolist()))
    path.write_text("t,y\n" + "\n".join(lines) + "\n")
    file = lynkeus.Log.load(str(path))
    settings = {"method": "rk4", "step": 0.01}
    run, expected = (estimated(file, estimate=settings) for _ in range(2))
    assert same(run, expected)
    fresh = estimated(file, estimate=settings)
    forks = multiprocessing.get_context("fork")
    here, there = forks.Pipe()
    child = forks.Process(target=_in_child, args=(fresh, file, there))
    child.start()
    for _ in range(20):
        assert same(estimated(file, estimate=settings), expected)
    assert here.poll(120) and here.recv() == "done"
    child.join()
    assert child.exitcode == 0


_DEV = """
import gc, threading
import numpy as np, lynkeus
from tank_study import estimated, log, tank
from test_threads import threads
def work(k):
    run = estimated(log())
    estimator = tank().estimator()
    for i in range(50):
        estimator.update(0.1 * i, {"y": 4.0})
    if k % 2:
        try:
            estimated({"t": [0.0], "y": ["a"]})
        except lynkeus.InputError:
            pass
    lynkeus.Log.from_arrow(run)
    run.__arrow_c_stream__(), run.__arrow_c_schema__()
threads(work)
gc.collect()
"""


def test_development_mode_with_threads_is_clean() -> None:
    here = Path(__file__).parent
    command = [sys.executable, "-X", "dev", "-W", "error", "-c", _DEV]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
