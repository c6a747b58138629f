"""Data in and out: Arrow in both directions, frames, instants."""

from __future__ import annotations

import datetime
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import estimated, log, same, tank

import lynkeus
from lynkeus._logs import columns_of, log_of

FIRST = datetime.datetime(2026, 11, 22, 1, 2, 3, 250_000, tzinfo=datetime.timezone.utc)


def headers(found: Any) -> list[str]:
    return [str(name) for name in found]


@pytest.fixture(scope="module")
def run() -> lynkeus.Simulation:
    return tank(simulate={"until": 20, "output_step": 0.5, "inputs": {"inflow": 1.2}}).simulate()


# --- out -------------------------------------------------------------------------------------


def test_pyarrow_reads_a_result(run: lynkeus.Simulation) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    table = run.to_arrow()
    assert table.column_names == run.columns
    assert {str(kind) for kind in table.schema.types} == {"double"}
    assert pyarrow.schema(run).equals(table.schema)
    for name in run.columns:
        assert np.array_equal(table[name].to_numpy(), run[name], equal_nan=True)
    reader = pyarrow.RecordBatchReader.from_stream(run)
    assert sum(batch.num_rows for batch in reader) == len(run)
    table.validate(full=True)


def test_frames_hold_what_the_result_holds(run: lynkeus.Simulation) -> None:
    pandas = pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    frame: Any = run.to_pandas()
    other: Any = run.to_polars()
    assert headers(frame) == headers(other.columns) == run.columns
    for name in run.columns:
        assert np.array_equal(frame[name].to_numpy(), run[name])
        assert np.array_equal(other[name].to_numpy(), run[name])
    assert isinstance(frame, pandas.DataFrame) and isinstance(other, polars.DataFrame)
    assert np.array_equal(np.asarray(run), frame.to_numpy())
    assert (len(run), len(frame), len(other)) == (41, 41, 41)
    assert run.t is run["t"]
    assert "t" in run
    assert list(run) == run.columns


def test_a_long_result_goes_out_in_batches() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    found = estimated(log(rows=300_000, step=0.01), estimate={"method": "rk4", "step": 0.01})
    batches = list(pyarrow.RecordBatchReader.from_stream(found))
    assert len(batches) > 1 and max(batch.num_rows for batch in batches) <= 1 << 17
    table = pyarrow.Table.from_batches(batches)
    table.validate(full=True)
    for name in found.columns:
        assert np.array_equal(table[name].to_numpy(), found[name])
    with pytest.raises(ValueError, match="read-only"):
        found["level_hat"][0] = 0.0


def test_a_nan_goes_out_as_a_null() -> None:
    pytest.importorskip("pyarrow")
    keys = {"theta": [1.0, 1e160, 2.0, *np.linspace(1.0, 2.0, 7), 1e160]}  # two of them diverge
    section = {"until": 20, "output_step": 0.5, "inputs": {"inflow": 1.2}}
    sweep = tank(simulate=section, tune={"keys": keys}).tune()
    table = sweep.to_arrow()
    table.validate(full=True)
    assert table["theta"].null_count == 0 and table["mean_error"].null_count == 2
    for name in sweep.columns:
        expected = [None if np.isnan(x) else x for x in sweep[name]]
        assert table[name].to_pylist() == expected
    frame = sweep.to_pandas()
    assert np.isnan(frame["mean_error"].to_numpy()).sum() == 2


def test_a_stream_outlives_its_result_and_may_be_left_half_read(run: lynkeus.Simulation) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    study = tank(simulate={"until": 20, "output_step": 0.5, "inputs": {"inflow": 1.2}})
    fresh = study.simulate()
    reader = pyarrow.RecordBatchReader.from_stream(fresh)
    capsule, unread = fresh.__arrow_c_schema__(), fresh.__arrow_c_stream__()
    del fresh, unread, capsule
    batch = reader.read_next_batch()
    del reader
    assert batch.column(0).to_numpy().tolist() == run.t.tolist()
    twice = run.__arrow_c_stream__()
    lynkeus._lynkeus.Log.from_arrow(_Capsule(twice))
    with pytest.raises(ValueError, match="read before"):
        lynkeus._lynkeus.Log.from_arrow(_Capsule(twice))


class _Capsule:
    def __init__(self, capsule: Any) -> None:
        self._capsule = capsule

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        return self._capsule


# --- in --------------------------------------------------------------------------------------


def frames() -> dict[str, Any]:
    """The same log in whatever holds columns."""
    data = log()
    found: dict[str, Any] = {
        "lists": {name: x.tolist() for name, x in data.items()},
        "structured": np.array(list(zip(*data.values())), dtype=[(name, float) for name in data]),
    }
    try:
        import pyarrow

        table = pyarrow.table(data)
        found["pyarrow"] = table
        found["batch"] = table.to_batches()[0]
        found["reader"] = table.to_reader(7)
        found["chunks"] = pyarrow.concat_tables([table[:13], table[13:13], table[13:]])
        found["arrow columns"] = {name: table[name] for name in data}
        found["a slice"] = pyarrow.concat_tables([table[:5], table]).combine_chunks()[5:]
    except ImportError:
        pass
    try:
        import pandas

        found["pandas"] = pandas.DataFrame(data)
        found["an index"] = pandas.DataFrame(data).set_index("t")
        found["nullable"] = pandas.DataFrame(data).convert_dtypes()
        found["series"] = dict(pandas.DataFrame(data).items())
    except ImportError:
        pass
    try:
        import polars

        found["polars"] = polars.DataFrame(data)
        found["polars columns"] = {name: polars.Series(name, x) for name, x in data.items()}
        found["rechunked"] = polars.concat([polars.DataFrame(data)[:9], polars.DataFrame(data)[9:]])
    except ImportError:
        pass
    try:
        import duckdb

        recorded = found["pyarrow"]  # noqa: F841  duckdb finds it by its name
        found["duckdb"] = duckdb.sql("select * from recorded")
    except ImportError:
        pass
    return found


def test_every_holder_of_columns_gives_the_same_estimates() -> None:
    expected = estimated(log())
    for name, data in frames().items():
        assert same(estimated(data), expected), name


def test_every_kind_of_number_comes_in() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    numbers = [0, 3, None, 7, 100]
    kinds = ["int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"]
    kinds += ["float16", "float32", "float64", "duration('ms')"]
    for kind in kinds:
        if kind.startswith("duration"):
            array = pyarrow.array([None if x is None else 1000 * x for x in numbers], pyarrow.duration("ms"))
        elif kind == "float16":
            array = pyarrow.array([None if x is None else np.float16(x) for x in numbers], pyarrow.float16())
        else:
            array = pyarrow.array(numbers, kind)
        for at in range(4):  # bitmaps of slices start within a byte
            table = pyarrow.table({"x": array[at:]})
            found = lynkeus.Log.from_arrow(table).column("x")
            expected = [np.nan if x is None else float(x) for x in numbers[at:]]
            assert np.array_equal(found, expected, equal_nan=True), (kind, at)
    on = pyarrow.array([True, None, False, True, True, False, False, True, True, None, True])
    for at in range(9):
        found = lynkeus.Log.from_arrow(pyarrow.table({"x": on[at:]})).column("x")
        expected = [np.nan if x is None else float(x) for x in on[at:].to_pylist()]
        assert np.array_equal(found, expected, equal_nan=True), at


def test_half_precision_is_exact() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    found = lynkeus.Log.from_arrow(pyarrow.table({"x": pyarrow.array(every)})).column("x")
    expected = np.where(np.isfinite(every), every.astype(np.float64), np.nan)
    assert np.array_equal(found, expected, equal_nan=True)


def test_a_row_that_is_no_row_is_missing_in_every_column() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    rows = pyarrow.array([{"x": 1.0, "k": 1}, None, {"x": None, "k": 3}, {"x": 4.0, "k": 4}])
    for at in range(3):
        table = lynkeus.Log.from_arrow(rows[at:])
        present = [True, False, True, True][at:]
        expected = np.where(present, [1.0, 2.0, 3.0, 4.0][at:], np.nan)
        assert np.array_equal(table.column("k"), expected, equal_nan=True)
        expected = np.where(present, [1.0, 2.0, np.nan, 4.0][at:], np.nan)
        assert np.array_equal(table.column("x"), expected, equal_nan=True)


def test_what_is_no_number_is_refused_only_where_it_is_asked_for() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from decimal import Decimal

    rows = len(log()["t"])
    others = {
        "texts": pyarrow.array(["a"] * rows),
        "decimals": pyarrow.array([Decimal("1.5")] * rows),
        "lists": pyarrow.array([[1.0]] * rows),
        "categories": pyarrow.array(["a"] * rows).dictionary_encode(),
        "bytes": pyarrow.array([b"a"] * rows),
        "times of a day": pyarrow.array([datetime.time(1)] * rows),
    }
    table = pyarrow.table({**log(), **others})
    assert same(estimated(table), estimated(log()))
    read = lynkeus.Log.from_arrow(table)
    for name in others:
        with pytest.raises(lynkeus.InputError, match=f"expected numbers or instants, found .*{name}") as refused:
            read.column(name)
        assert refused.value.place == "log" and refused.value.hint
    with pytest.raises(lynkeus.InputError, match="found texts"):
        estimated(table.drop_columns("y").rename_columns({"texts": "y"}))


def test_a_column_with_objects_does_not_hide_the_others() -> None:
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame(log())
    frame = frame.with_columns(polars.Series("junk", [object()] * len(frame), dtype=polars.Object))
    assert same(estimated(frame), estimated(log()))
    pandas = pytest.importorskip("pandas")
    mixed = pandas.DataFrame(log()).assign(junk=[object(), "a", 1] + [None] * 47)
    assert same(estimated(mixed), estimated(log()))


def test_a_stream_that_fails_says_why() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    batch = pyarrow.table(log()).to_batches()[0]

    def batches() -> Any:
        yield batch
        raise RuntimeError("the disk is gone")

    reader = pyarrow.RecordBatchReader.from_batches(batch.schema, batches())
    with pytest.raises(lynkeus.InputError, match="the disk is gone"):
        estimated(reader)


# --- instants --------------------------------------------------------------------------------


def instants(zoned: bool) -> list[datetime.datetime]:
    first = FIRST if zoned else FIRST.replace(tzinfo=None)
    return [first + datetime.timedelta(seconds=s) for s in log()["t"]]


def dated(zoned: bool) -> dict[str, Any]:
    """The same instants in whatever holds them."""
    times = instants(zoned)
    found: dict[str, Any] = {"objects": times}
    if not zoned:
        found["numpy"] = np.array(times, dtype="datetime64[us]")
        found["swapped"] = found["numpy"].astype(">M8[ns]")
    zone = "Europe/Athens" if zoned else None
    try:
        import pyarrow

        for unit in ("ms", "us", "ns"):
            found[f"pyarrow {unit}"] = pyarrow.array(times, pyarrow.timestamp(unit, zone))
    except ImportError:
        pass
    try:
        import pandas

        found["pandas"] = pandas.Series(times)
        found["pandas index"] = pandas.Index(times)
        found["timestamps"] = [pandas.Timestamp(t) for t in times]
        if "pyarrow ns" in found:
            kind = pandas.ArrowDtype(found["pyarrow ns"].type)
            found["arrow in pandas"] = pandas.Series(times).astype(kind)
    except ImportError:
        pass
    try:
        import polars

        series = polars.Series(times, dtype=polars.Datetime("us"))
        found["polars"] = series.dt.replace_time_zone("UTC") if zoned else series
    except ImportError:
        pass
    return found


@pytest.mark.parametrize("zoned", [True, False])
def test_instants_do_what_they_do_in_a_file(tmp_path: Path, zoned: bool) -> None:
    levels = log()["y"]
    written = [t.isoformat().replace("+00:00", "Z") for t in instants(zoned)]
    file = tmp_path / "log.csv"
    file.write_text("t,y\n" + "".join(f"{t},{float(y)!r}\n" for t, y in zip(written, levels)))
    expected = estimated(file)
    origin = "2026-11-22T01:02:03.25" + ("Z" if zoned else "")
    assert f"times are seconds since {origin}" in " ".join(expected.notes).replace("250000", "25")
    for name, times in dated(zoned).items():
        found = estimated({"t": times, "y": levels})
        assert same(found, expected), name
        assert f"times are seconds since {origin}" in found.notes, name
        with pytest.raises(lynkeus.InputError, match="`time_unit`|time_unit"):
            estimated({"t": times, "y": levels}, plot={"time_unit": "h"})


def test_dates_of_any_unit_and_gaps_among_them() -> None:
    for unit in "YMWDhms":
        times = np.array(["1999-12-31", "NaT", "2001-01-02"], dtype=f"datetime64[{unit}]")
        found = log_of({"t": times}).column("t")
        seconds = (times[2] - times[0]) if unit not in "YM" else (
            times[2].astype("datetime64[D]") - times[0].astype("datetime64[D]")
        )
        expected = [0.0, np.nan, seconds / np.timedelta64(1, "s")]
        assert np.array_equal(found, expected, equal_nan=True), unit
    dates = [datetime.date(2026, 11, 22), None, datetime.date(2026, 11, 23)]
    read = log_of({"t": dates})
    assert read.origin("t") == "2026-11-22T00:00:00"
    assert np.array_equal(read.column("t"), [0, np.nan, 86400], equal_nan=True)


def test_a_mixture_of_dates_is_refused_with_its_row() -> None:
    zoned, local = FIRST, FIRST.replace(tzinfo=None) + datetime.timedelta(hours=1)
    with pytest.raises(lynkeus.InputError, match="log:2: .*a zone in all times or in none"):
        estimated({"t": [zoned, local], "y": [4.0, 4.0]})
    with pytest.raises(lynkeus.InputError, match='log:2: .*expected a date like "2026-11-22T01'):
        estimated({"t": [zoned, 7.0], "y": [4.0, 4.0]})
    with pytest.raises(lynkeus.InputError, match="log:2: .*expected a number, found the date"):
        estimated({"t": [7.0, zoned], "y": [4.0, 4.0]})


@pytest.mark.parametrize("times", [[0, 1, 1, 2], [0, 2, 1, 3], [0, 1, np.nan, 2]])
def test_a_text_column_beside_times_out_of_order(times: list[float]) -> None:
    data: dict[str, Any] = {"t": times, "y": [4.0, 4.1, 4.0, 4.2]}
    assert same(estimated({**data, "note": ["a", "b", "c", "d"]}), estimated(data))


def test_a_log_travels_by_its_columns() -> None:
    """Dates keep their origin, texts their refusal."""
    data = {"t": instants(zoned=True), "y": log()["y"], "note": ["a"] * len(log()["t"])}
    given = log_of(data)
    again = lynkeus.Log.from_columns(pickle.loads(pickle.dumps(columns_of(given))))
    assert again.headers() == given.headers() and again.origin("t") == given.origin("t") is not None
    assert same(estimated(again), estimated(data))
    told = []
    for recorded in (given, again):
        with pytest.raises(lynkeus.InputError) as error:
            recorded.column("note")
        told.append(str(error.value))
    assert told[0] == told[1] and "texts" in told[0]


# --- memory ----------------------------------------------------------------------------------

_LONG = """
import resource
import numpy as np, lynkeus
from tank_study import estimated
import pyarrow
rows = 1_500_000
t = np.arange(rows) * 0.01
found = estimated({"t": t, "y": 4 + 0.1 * np.sin(t)}, estimate={"method": "rk4", "step": 0.01})
del t
whole = 8 * len(found) * len(found.columns)
def now():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
start, most = now(), 0
for batch in pyarrow.RecordBatchReader.from_stream(found):
    most = max(most, now() - start)
print(whole, most)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_long_result_is_read_without_being_in_memory() -> None:
    pytest.importorskip("pyarrow")
    here = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", _LONG], cwd=here, capture_output=True, text=True, check=True
    )
    whole, most = map(int, done.stdout.split())
    assert most < whole / 3, f"{most} bytes of {whole}"
