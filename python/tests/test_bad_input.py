"""What is wrong raises a Python exception that names the place; nothing crashes."""

from __future__ import annotations

import datetime
import pickle
import sys
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
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


def test_durations_are_seconds_however_they_are_held() -> None:
    held = np.timedelta64(5, "ms")
    for column in ([held, None], np.array([held, "NaT"], dtype="timedelta64[ms]")):
        assert np.array_equal(log_of({"x": column}).column("x"), [0.005, np.nan], equal_nan=True)
    found = log_of({"x": [datetime.timedelta(minutes=2), np.timedelta64(1, "h"), 7.0]}).column("x")
    assert found.tolist() == [120.0, 3600.0, 7.0]


def test_whole_numbers_of_any_size_come_in() -> None:
    for numbers in ([2**53 + 1, 1], [10**30, -(10**300)], [True, False], [Decimal("1.5"), 2]):
        found = log_of({"x": numbers}).column("x")
        assert found.tolist() == [float(x) for x in numbers]


# --- models ----------------------------------------------------------------------------------


def test_a_model_that_is_no_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(lynkeus.InputError, match="nix.mo cannot be read"):
        lynkeus.Model.load(tmp_path / "nix.mo")
    (tmp_path / "bytes.mo").write_bytes(b"\xff\xff")
    with pytest.raises(lynkeus.InputError, match="bytes.mo cannot be read"):
        lynkeus.Model.load(tmp_path / "bytes.mo")


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
    assert any("that have no time and are left out: 1" in note for note in estimated(data).notes)
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


# --- readings -------------------------------------------------------------------------------


def test_any_mapping_has_readings() -> None:
    estimator, other = tank().estimator(), tank().estimator()
    estimator.update(0.0, MappingProxyType({"y": 4.1}))
    other.update(0.0, {"y": 4.1})
    assert estimator.estimate == other.estimate


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
        (0.1, {"y": 10**400}, lynkeus.ArgumentError),
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
