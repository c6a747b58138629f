"""What a worker does with one asset, without a cluster."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tank_study import log, tank

import lynkeus
from lynkeus._assets import Follower, Replay, Signals

pyarrow = pytest.importorskip("pyarrow")


def at_rest(study: lynkeus.Study, data: dict[str, Any], time: str | None = None) -> Any:
    signals = Signals.recorded(study, "asset", time)
    table = pyarrow.table({**data, "asset": ["a"] * len(data["y"])}).select(list(signals.needed))
    return Replay(study, signals).asset(table)


STUDIES: dict[str, dict[str, Any]] = {
    "plain": {},
    "lines between samples": {"estimate": {"between_samples": "linear"}},
    "a filter without noise": {"observer": "ekf"},
    "smoothed": {"observer": "ekf", "noise": {"y": 0.1}, "estimate": {"smooth": True}},
}


@pytest.mark.parametrize("name", STUDIES)
def test_an_asset_gives_what_its_log_gives(name: str) -> None:
    study, data = tank(**STUDIES[name]), log()
    run, found = study.estimate(data), at_rest(study, data)
    assert found["error"].to_pylist() == [None] * len(run)
    assert found.column_names == ["asset", "t", "level_hat", "inflow_hat", "credible", "error"]
    for column in ("t", "level_hat", "inflow_hat"):
        np.testing.assert_array_equal(found[column], run[column])


def test_an_asset_whose_log_is_refused_tells_why() -> None:
    for y in (["a"] * 50, [None] * 50):
        data = {**log(), "y": y}
        with pytest.raises(lynkeus.LynkeusError) as error:
            tank().estimate(pyarrow.table(data))
        assert at_rest(tank(), data)["error"].to_pylist() == [str(error.value)]


def test_columns_have_the_names_of_the_study() -> None:
    study, data = tank(estimate={"columns": {"y": "LT-101"}, "time": "at"}), log()
    run = study.estimate({"at": data["t"], "LT-101": data["y"]})
    signals = Signals.recorded(study, "asset", None)
    assert signals.needed == ("asset", "at", "LT-101")
    table = pyarrow.table({"at": data["t"], "LT-101": data["y"], "asset": [7] * 50})
    found = Replay(study, signals).asset(table)
    np.testing.assert_array_equal(found["inflow_hat"], run["inflow_hat"])
    assert found["asset"].to_pylist() == [7] * 50


def test_rows_of_one_time_in_whatever_order() -> None:
    data = log()
    data["t"][7] = data["t"][6]
    order = np.random.default_rng(2).permutation(50)
    found = [at_rest(tank(), {name: x[rows] for name, x in data.items()}) for rows in (order, order[::-1])]
    assert found[0].equals(found[1])


class Kept:
    """A value of Spark's state."""

    value: tuple[bytes] | None = None

    def exists(self) -> bool:
        return self.value is not None

    def get(self) -> tuple[bytes] | None:
        return self.value

    def update(self, value: tuple[bytes]) -> None:
        self.value = value


def test_rows_in_motion_of_one_time_in_whatever_order() -> None:
    pandas = pytest.importorskip("pandas")
    data = {**log(rows=8), "asset": ["a"] * 8}
    data["t"][5] = data["t"][4]
    found = []
    for rows in ([0, 4, 5, 2, 3, 1], [5, 4, 3, 2, 1, 0]):
        follower = Follower(tank(), Signals.live(tank(), "asset", None))
        kept = Kept()
        follower.init(SimpleNamespace(getValueState=lambda *_: kept))  # noqa: B023
        frame = pandas.DataFrame(data)
        batches = [follower.handleInputRows(("a",), iter([frame.iloc[part]]), None) for part in (rows, [7, 6])]
        found.append(pandas.concat([table for batch in batches for table in batch], ignore_index=True))
    pandas.testing.assert_frame_equal(found[0], found[1])
    assert found[0]["error"].isna().all() and found[0]["t"].is_monotonic_increasing
