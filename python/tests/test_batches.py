"""Many logs and many changes on all cores: what each gives by itself, in order."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import time
import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
from tank_study import MODEL

import lynkeus
from lynkeus._each import each
from lynkeus.results import figures

@pytest.fixture
def logs(study: lynkeus.Study) -> list[dict[str, Any]]:
    return study.sweep(seeds(7), keep=lambda run: run.log)


def seeds(count: int) -> list[dict[str, Any]]:
    return [{"simulate": {"seed": seed}} for seed in range(1, count + 1)]


def same(run: lynkeus.Run, other: lynkeus.Run) -> None:
    assert run.columns == other.columns and run.summary == other.summary
    for name in run:
        np.testing.assert_array_equal(run[name], other[name])


@pytest.mark.parametrize("workers", [1, 2, 5, None])
def test_each_log_gives_what_it_gives_alone(
    study: lynkeus.Study, logs: list[dict[str, Any]], workers: int | None
) -> None:
    runs = study.estimate_each(logs, workers=workers)
    assert len(runs) == len(logs)
    for run, log in zip(runs, logs, strict=True):
        same(run, study.estimate(log))
    # and they differ: a list of one run seven times would not pass
    assert len({run["inflow_hat"][-1] for run in runs}) == len(logs)


def test_names_stay_with_their_logs(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    named = study.estimate_each({f"tank {k}": log for k, log in enumerate(logs)})
    assert list(named) == [f"tank {k}" for k in range(len(logs))]
    same(named["tank 4"], study.estimate(logs[4]))


@pytest.mark.parametrize("kind", ["mapping", "pandas", "polars", "arrow"])
def test_a_table_with_a_column_of_assets(
    study: lynkeus.Study, logs: list[dict[str, Any]], kind: str
) -> None:
    # interleaved: row by row, asset by asset
    table: dict[str, Any] = {
        name: np.stack([log[name] for log in logs]).T.ravel() for name in logs[0]
    }
    table["asset"] = [f"a{k}" for _ in logs[0]["t"] for k in range(len(logs))]
    if kind == "pandas":
        table = pytest.importorskip("pandas").DataFrame(table)
    elif kind == "polars":
        table = pytest.importorskip("polars").DataFrame(table)
    elif kind == "arrow":
        table = pytest.importorskip("pyarrow").table(table)
    runs = study.estimate_each(table, by="asset")
    assert list(runs) == [f"a{k}" for k in range(len(logs))]
    for run, log in zip(runs.values(), logs, strict=True):
        same(run, study.estimate(log))


def test_a_log_that_fails_has_its_exception_in_its_place(
    study: lynkeus.Study, logs: list[dict[str, Any]]
) -> None:
    logs[3] = {"t": [0.0, 1.0], "z": [4.0, 4.0]}
    runs = study.estimate_each(logs, errors="return")
    assert [isinstance(run, lynkeus.InputError) for run in runs] == [k == 3 for k in range(7)]
    with pytest.raises(lynkeus.InputError) as alone:
        study.estimate(logs[3])
    assert str(runs[3]) == str(alone.value) and runs[3].place == alone.value.place
    with pytest.raises(lynkeus.InputError) as raised:
        study.estimate_each(dict(zip("abcdefg", logs, strict=True)))
    assert str(raised.value) == str(alone.value) and raised.value.__notes__ == ["in the log of 'd'"]


def test_a_sweep_is_a_loop_over_changes(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    changes = [{"observer": {"theta": theta}} for theta in (0.5, 1.0, 2.0)]
    for change, run in zip(changes, study.sweep(changes), strict=True):
        same(run, study.replace(**change).simulate())
    for change, run in zip(changes, study.sweep(changes, logs[0]), strict=True):
        same(run, study.replace(**change).estimate(logs[0]))
    kept = study.sweep(seeds(3), keep=lambda run: run["inflow_hat"][-1])
    assert kept == [study.replace(**change).simulate()["inflow_hat"][-1] for change in seeds(3)]
    with pytest.raises(lynkeus.InputError, match="nix"):
        study.sweep([{"observer": {"nix": 1}}])


def test_what_is_prepared_once_gives_what_each_gives_alone(study: lynkeus.Study) -> None:
    """A copy by pickle has prepared nothing."""
    changes: list[dict[str, Any]] = [*seeds(3), {"noise": {"y": 0.05}}, {"simulate": {"initial": {"level": 5}}}]
    changes += [{"simulate": {"spread": {"level": 1.0}, "seed": 3}}, {"observer": {"theta": 3.0}}]
    changes += [{"observer": {"family": "ekf", "theta": None}, "process_noise": {"inflow": 0.01, "level": 1e-6}}]
    alone = [pickle.loads(pickle.dumps(study.replace(**change))) for change in changes]
    for other, run in zip(alone, study.sweep(changes, workers=1), strict=True):
        same(run, other.simulate())
    log = study.simulate().log
    for other, run in zip(alone, study.sweep(changes, log, workers=1), strict=True):
        same(run, other.estimate(log))


def test_an_exception_of_keep_names_its_log(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    with pytest.raises(ZeroDivisionError) as raised:
        study.estimate_each({"a": logs[0]}, keep=lambda run: 1 / 0)
    assert raised.value.__notes__ == ["in the log of 'a'"]


def test_one_table_of_many_assets_as_it_comes(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    pandas, pyarrow = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    expected = study.estimate(logs[0])
    frame = pandas.DataFrame({**logs[0], "asset": "a"})
    same(study.estimate_each(frame.set_index("t"), by="asset")["a"], expected)
    gaps = [None, *frame["y"][1:]]
    batch = pyarrow.record_batch({"t": frame["t"], "y": pyarrow.array(gaps), "asset": frame["asset"]})
    run = study.estimate_each(batch, by="asset")["a"]
    same(run, study.estimate({"t": logs[0]["t"], "y": np.array(gaps, float)}))
    frame["asset"] = pandas.array(["a", None, *["a"] * (len(frame) - 2)], dtype="string")
    with pytest.raises(lynkeus.InputError, match="row 2 names no asset"):
        study.estimate_each(frame, by="asset")
    with pytest.raises(lynkeus.InputError, match='column "y": expected one value per row, found float'):
        study.estimate_each({"asset": ["a"], "t": [0.0], "y": 4.0}, by="asset")
    for table in (frame, batch):
        with pytest.raises(lynkeus.InputError, match="found one table: by="):
            study.estimate_each(table)


def test_figures_are_those_of_the_summary(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    run = study.simulate()
    rms = {f"rms_{name}": error for name, error in run.summary["rms_error_last_half"].items()}
    assert len(rms) == 2
    assert figures(run) == {"credible": run.is_credible, "refusal": None, **rms}
    assert list(figures(study.estimate({name: logs[0][name] for name in "ty"}))) == ["credible", "refusal"]


def test_what_is_asked_for_wrongly(study: lynkeus.Study, logs: list[dict[str, Any]]) -> None:
    for wrong in ("log.csv", 3, None):
        with pytest.raises(lynkeus.InputError, match="expected a list or a mapping of logs"):
            study.estimate_each(wrong)  # type: ignore[call-overload]
    with pytest.raises(lynkeus.InputError, match='no column "asset": there are t, y'):
        study.estimate_each(logs[0], by="asset")
    with pytest.raises(lynkeus.InputError, match="row 2 names no asset"):
        study.estimate_each({"asset": ["a", None], "t": [0.0, 1.0], "y": [4.0, 4.0]}, by="asset")
    with pytest.raises(lynkeus.InputError, match='column "y": expected as many rows'):
        study.estimate_each({"asset": ["a", "a"], "t": [0.0, 1.0], "y": [4.0]}, by="asset")
    with pytest.raises(lynkeus.InputError, match='expected "raise" or "return"'):
        study.estimate_each(logs, errors="ignore")  # type: ignore[call-overload]
    with pytest.raises(lynkeus.InputError, match="workers: expected at least 1"):
        study.estimate_each(logs, workers=0)
    assert study.estimate_each([]) == [] and study.estimate_each({}) == {}


def test_doubts_are_told_once() -> None:
    filtered = lynkeus.Study(
        MODEL,
        unknown=["inflow"],
        noise={"y": 1e-3},
        process_noise={"inflow": 1e-6, "level": 1e-9},
        observer="ekf",
    )
    noisy = 4.0 + np.random.default_rng(1).normal(size=200)
    good = np.full(200, 4.0)
    logs = [{"t": np.arange(200.0), "y": y} for y in (good, noisy, noisy)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        doubts = [not filtered.estimate(log).is_credible for log in logs]
    with pytest.warns(lynkeus.NotCredible) as caught:
        runs = filtered.estimate_each(logs)
    assert len(caught) == 1 and caught[0].filename == __file__
    assert str(caught[0].message).startswith(f"{sum(doubts)} of 3 results are not credible")
    assert [not run.is_credible for run in runs] == doubts


@pytest.mark.parametrize("further", [{}, {"gate": 2.0}, {"bounds": "project"}])
def test_filters_side_by_side_give_what_each_gives_alone(further: dict[str, Any]) -> None:
    """Logs of different lengths, with gaps and times of their own; one that ends early, and one that is none."""
    filtered = lynkeus.Study(
        MODEL,
        unknown=["inflow"],
        noise={"y": 0.02},
        process_noise={"inflow": 1e-3, "level": 1e-9},
        observer={"family": "ekf", **further},
        estimate={"method": "rk4", "step": 0.4, "sd": True, "innovations": True},
    )
    random = np.random.default_rng(5)
    logs: list[Any] = []
    for rows in range(150, 290, 10):
        t = np.cumsum(random.uniform(0.1, 1.0, rows))
        y = 4.0 + np.sin(0.1 * t) + random.normal(0.0, 0.02, rows)
        y[random.uniform(size=rows) < 0.2] = np.nan
        logs.append({"t": t, "y": y})
    logs[3]["y"][50:] = 1e300
    logs[5] = {"t": [0.0, 1.0], "z": [4.0, 4.0]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        runs = filtered.estimate_each(logs, errors="return", workers=1)
        for place, (run, log) in enumerate(zip(runs, logs, strict=True)):
            try:
                alone = filtered.estimate(log)
            except lynkeus.LynkeusError as error:
                assert str(run) == str(error) and run.__notes__ == [f"in log {place}"]
                continue
            same(run, alone)
            assert str(run) == str(alone) and run.is_credible == alone.is_credible


def test_progress_rises_to_the_end(study: lynkeus.Study) -> None:
    seen: list[float] = []
    study.sweep(seeds(30), progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == 1.0


def test_what_is_left_of_many_is_not_looked_at_again_and_again() -> None:
    """By the calls that whoever waits makes, in Python and in C: their number grows with the items' alone."""

    def looks(count: int) -> int:
        made = 0

        def counted(_frame: object, event: str, _what: object) -> None:
            nonlocal made
            made += event in ("call", "c_call")

        nothing: dict[str, Any] = {"workers": 2, "errors": "raise", "progress": False, "what": ""}
        work = lambda items, _: [partial(int, item) for item in items]  # noqa: E731
        before = sys.getprofile()
        sys.setprofile(counted)
        try:
            found = each(work, range(count), [""] * count, **nothing)
        finally:
            sys.setprofile(before)
        assert found == list(range(count))
        return made

    assert looks(8000) < 12 * looks(1000)


def test_what_progress_raises_ends_it(study: lynkeus.Study) -> None:
    class Stopped(Exception):
        pass

    def stop(_: float) -> None:
        raise Stopped

    before = time.monotonic()
    with pytest.raises(Stopped):
        study.replace(simulate={"until": 1e7}).sweep(seeds(4), progress=stop)
    assert time.monotonic() - before < 60 and no_threads_left()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_control_c_ends_it(study: lynkeus.Study) -> None:
    # a job in the background ignores it
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            study.replace(simulate={"until": 1e8}).sweep(seeds(4))
    finally:
        timer.join()
        signal.signal(signal.SIGINT, before)
    assert no_threads_left()


def no_threads_left() -> bool:
    return not any(thread.name.startswith("lynkeus") for thread in threading.enumerate())
