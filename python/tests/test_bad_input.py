"""What is wrong raises a Python exception that names the place; nothing crashes."""

from __future__ import annotations

import multiprocessing
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import estimated, log, same, tank

import lynkeus
from lynkeus._logs import log_of

ROWS = len(log()["t"])


def refused(data: Any, *words: str) -> lynkeus.InputError:
    with pytest.raises(lynkeus.InputError) as error:
        estimated(data)
    for word in words:
        assert word in str(error.value), str(error.value)
    return error.value


def with_y(y: Any) -> dict[str, Any]:
    return {"t": log()["t"], "y": y}


# --- columns ---------------------------------------------------------------------------------

BAD = {
    "texts": (["a"] * ROWS, "texts"),
    "text": ("abc", "found str"),
    "bytes": (np.array([b"a"] * ROWS), "bytes"),
    "complex": (log()["y"] + 1j, "complex numbers"),
    "a complex object": (np.array([1j, *[1.0] * (ROWS - 1)], dtype=object), "row 1: expected numbers or instants, found 1j"),
    "two dimensions": (log()["y"].reshape(-1, 1), f"shape ({ROWS}, 1)"),
    "no dimension": (np.array(4.0), "one value per row"),
    "a number": (4.0, "found float"),
    "None": (None, "found NoneType"),
    "a generator": ((x for x in log()["y"]), "found generator"),
    "a set": ({1.0}, "found set"),
    "ragged rows": ([[1.0], [1.0, 2.0]], "inhomogeneous"),
    "objects": ([object()] * ROWS, "row 1: expected numbers or instants, found object"),
    "records": (np.zeros(ROWS, dtype=[("a", float)]), "[('a', '<f8')]"),
    "lists in rows": (np.array([[1.0], None] * (ROWS // 2), dtype=object), "found list"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_column_that_is_none_is_refused_where_it_is_asked_for(name: str) -> None:
    column, words = BAD[name]
    error = refused(with_y(column), 'column "y"', words)
    assert error.place == "log" and error.hint
    fine = {**log(), "junk": column}
    if name != "a generator":  # is spent
        assert same(estimated(fine), estimated(log()))


class Raises:
    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no such luck")


class Frame:
    """A frame of a library that nobody knows."""

    columns = ["t", "y", "broken"]

    def __getitem__(self, name: str) -> Any:
        if name == "broken":
            raise OSError("the file is closed")
        return log()[name]


def test_a_column_that_raises_is_refused_where_it_is_asked_for() -> None:
    refused(with_y(Raises()), 'column "y"', "RuntimeError: no such luck")
    assert same(estimated(Frame()), estimated(log()))
    study = tank(estimate={"columns": {"y": "broken"}})
    with pytest.raises(lynkeus.InputError, match="OSError: the file is closed"):
        study.estimate(Frame())


def test_numbers_of_every_layout_are_the_same() -> None:
    levels, expected = log()["y"], estimated(log())
    frozen = levels.copy()
    frozen.flags.writeable = False
    wide = np.zeros((ROWS, 3))
    wide[:, 1] = levels
    layouts: dict[str, Any] = {
        "read-only": frozen,
        "a column of a matrix": wide[:, 1],
        "backwards": levels[::-1].copy()[::-1],
        "swapped": levels.astype(">f8"),
        "long": levels.astype(np.longdouble),
        "objects": levels.astype(object),
        "unaligned": np.frombuffer(b"x" + levels.tobytes(), dtype=np.uint8)[1:].view(np.float64),
        "a tuple": tuple(levels),
        "memory": memoryview(levels),
    }
    for name, column in layouts.items():
        assert same(estimated(with_y(column)), expected), name
    rough = estimated(with_y(levels.astype(np.float16)))
    assert same(rough, estimated(with_y(levels.astype(np.float16).astype(float))))


def test_what_is_missing_is_missing_however_it_is_said() -> None:
    gap = log()["y"]
    gap[7] = np.nan
    expected = estimated(with_y(gap))
    at = lambda value: np.array([value if i == 7 else y for i, y in enumerate(gap)], dtype=object)  # noqa: E731
    said: dict[str, Any] = {
        "None": at(None),
        "NaN": at(float("nan")),
        "infinite": np.where(np.arange(ROWS) == 7, -np.inf, gap),
        "masked": np.ma.array(log()["y"], mask=np.arange(ROWS) == 7),
        "NaT": at(np.datetime64("NaT")),
        "beyond all numbers": at(10**400),
        "longdouble beyond": np.where(np.arange(ROWS) == 7, np.longdouble("1e4000"), gap),
    }
    pandas = sys.modules.get("pandas") or pytest.importorskip("pandas")
    said["NA"] = at(pandas.NA)
    said["pandas.NaT"] = at(pandas.NaT)
    for name, column in said.items():
        assert same(estimated(with_y(column)), expected), name


def test_whole_numbers_of_any_size_come_in() -> None:
    for numbers in ([2**53 + 1, 1], [10**30, -(10**300)], [True, False], [Decimal("1.5"), 2]):
        found = log_of({"x": numbers}).column("x")
        assert found.tolist() == [float(x) for x in numbers]


# --- tables ----------------------------------------------------------------------------------


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("t,y\n0,4\n")
    closed = file.open()
    closed.close()
    things = (3, None, b"log.csv", closed, (x for x in "ty"), [1.0, 2.0], np.zeros((3, 2)), np.array(1.0), object())
    for thing in things:
        refused(thing, "the log: expected")
    refused(tmp_path / "none.csv", "none.csv")
    refused({}, "expected columns, found none")
    refused({"t": [], "y": []}, "expected rows, found none")
    refused({"t": [0.0, 1.0], "y": [4.0]}, 'expected 2 rows as in "t", found 1 in "y"')


def test_times_that_are_none_or_run_back_are_told() -> None:
    data = log()
    data["t"][3] = np.nan
    assert any("1 have no time and are left out" in note for note in estimated(data).notes)
    refused({**data, "t": np.full(ROWS, np.nan)}, 'column "t" has no number')
    refused({**data, "t": np.concatenate([data["t"][:25] + 100.0, data["t"][25:]])}, "the clock jumps back")
    refused({"y": data["y"]}, 'no time column "t"')


def test_headers_twice_and_in_levels() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(log())
    twice = pandas.concat([frame, frame["y"]], axis=1)
    refused(twice, 'two columns are called "y"')
    other = pandas.concat([frame, frame["y"].rename("z"), frame["y"].rename("z")], axis=1)
    assert same(estimated(other), estimated(log()))
    levels = frame.copy()
    levels.columns = pandas.MultiIndex.from_tuples([("a", "t"), ("a", "y")])
    refused(levels, "found 2 levels")
    refused(frame.iloc[:0], "expected rows, found none")
    refused(pandas.DataFrame(), "expected columns, found none")
    polars = pytest.importorskip("polars")
    refused(polars.DataFrame(log())[:0], "expected rows, found none")
    refused(polars.DataFrame(), "expected columns, found none")
    refused(polars.Series("y", [1.0]), "expected a table")


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
    "runs": lambda study, tell: study.simulate(runs=1000, progress=tell),
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
import _thread, threading
from test_bad_input import VERBS, slow
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


def test_bad_readings_change_nothing() -> None:
    estimator: Any = tank().estimator()
    estimator.update(0.0, {"y": 4.0})

    def state() -> Any:  # a snapshot counts what was refused as well
        return estimator.time, estimator.estimate, estimator.sd, estimator.health

    before = state()

    class Broken:
        def __float__(self) -> float:
            raise OSError("no sensor")

    for t, readings, error in [
        (0.1, {"y": "4"}, TypeError),
        (0.1, {"y": [4.0]}, TypeError),
        (0.1, {"y": 4j}, TypeError),
        (0.1, {"y": Broken()}, OSError),
        (0.1, {"y": 10**400}, OverflowError),
        (0.1, {"z": 4.0}, lynkeus.InputError),
        (0.1, {1: 4.0}, lynkeus.InputError),
        (0.1, [4.0], TypeError),
        ("now", {"y": 4.0}, TypeError),
        (float("nan"), {"y": 4.0}, lynkeus.InputError),
        (float("inf"), {"y": 4.0}, lynkeus.InputError),
        (-1.0, {"y": 4.0}, lynkeus.InputError),
    ]:
        with pytest.raises(error):
            estimator.update(t, readings)
        assert state() == before, (t, readings)
    for signals in ([], [1.0, 2.0], ["a"], None, np.zeros((1, 1, 1))):
        with pytest.raises((TypeError, ValueError)):
            estimator.push(0.1, signals)
    kept = estimator.snapshot()
    for snapshot in (b"", b"nonsense", kept[:-1], kept + b"x"):
        with pytest.raises(lynkeus.InputError):
            estimator.restore(snapshot)
    assert (estimator.snapshot(), state()) == (kept, before)
    assert pickle.loads(pickle.dumps(estimator)).snapshot() == kept


def _in_child(run: lynkeus.Estimation, file: lynkeus.Log, pipe: Any) -> None:
    for _ in range(20):
        again = estimated(file, estimate={"method": "rk4", "step": 0.01})
        assert same(again, run)
    pipe.send("done")


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="no fork here")
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
from test_bad_input import threads
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
