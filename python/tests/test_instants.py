"""Logs with dates give runs with dates."""

from __future__ import annotations

import datetime
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import SIMULATE, estimated, log, tank

import lynkeus

FIRST = np.datetime64("2026-03-29T01:59:59.123457", "us")


def dates(count: int = 50) -> Any:
    return FIRST + np.arange(count) * np.timedelta64(250_001, "us")


def test_dates_come_back_to_the_microsecond() -> None:
    run = estimated({**log(), "t": dates()})
    assert run.time is not None and run.time.dtype == np.dtype("datetime64[us]")
    assert np.array_equal(run.time, dates())
    assert run.t[0] == 0.0 and run.columns[0] == "t"
    assert np.array_equal(pickle.loads(pickle.dumps(run)).time, run.time)
    # years on, and dates that are finer than a second by less than a nanosecond's share
    late = np.array([FIRST, FIRST + np.timedelta64(3 * 365 * 86_400 * 10**6 + 1, "us")])
    assert np.array_equal(estimated({"t": late, "y": [4.0, 4.0]}, observer="ekf").time, late)


def test_numbers_have_no_dates() -> None:
    assert estimated(log()).time is None
    assert tank(simulate=SIMULATE).simulate().time is None


def test_a_zone_is_utc(tmp_path: Path) -> None:
    east = datetime.timezone(datetime.timedelta(hours=2))
    start = datetime.datetime(2026, 6, 1, 12, 0, tzinfo=east)
    zoned = [start + datetime.timedelta(seconds=k) for k in range(50)]
    expected = np.datetime64("2026-06-01T10:00:00") + np.arange(50) * np.timedelta64(1, "s")
    assert np.array_equal(estimated({**log(), "t": zoned}).time, expected)
    path = tmp_path / "log.csv"
    lines = (f"{when.isoformat()},{y}" for when, y in zip(zoned, log()["y"], strict=True))
    path.write_text("t,y\n" + "\n".join(lines) + "\n")
    assert np.array_equal(estimated(path).time, expected)


@pytest.mark.parametrize("zone", [None, "UTC"])
def test_frames_have_them_beside_the_numbers(zone: str | None) -> None:
    pandas = pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    pyarrow = pytest.importorskip("pyarrow")
    index = pandas.DatetimeIndex(dates(), tz=zone)
    run = estimated(pandas.DataFrame({"y": log()["y"]}, index=index))
    frame = run.to_pandas()
    assert frame.index.name == "time" and frame.index.equals(index) and list(frame) == run.columns
    assert np.array_equal(frame["t"], run.t)
    for table in (run.to_polars(), run.to_arrow()):
        names = table.columns if isinstance(table, polars.DataFrame) else table.column_names
        assert names == ["time", *run.columns]
    assert run.to_polars()["time"].dtype == polars.Datetime("us", zone)
    assert run.to_polars()["time"].dt.replace_time_zone(None).to_numpy().tolist() == dates().tolist()
    assert run.to_arrow().schema.field("time").type == pyarrow.timestamp("us", tz=zone)
    # what comes back is a log with the same times
    again = run.to_arrow().select(["time"]).append_column("y", [log()["y"]])
    assert np.array_equal(estimated(again, estimate={"time": "time"}).time, dates())


def test_a_plain_run_has_a_plain_index() -> None:
    pandas = pytest.importorskip("pandas")
    assert isinstance(estimated(log()).to_pandas().index, pandas.RangeIndex)
    assert "time" not in estimated(log()).to_polars().columns
