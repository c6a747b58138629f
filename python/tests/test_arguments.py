"""Arguments that cannot be are refused in words, as what a file says wrongly is."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import MODEL, SIMULATE, TEXT, log, same, tank

import lynkeus

ITSELF: dict[str, Any] = {}
ITSELF["inputs"] = ITSELF


def simulated() -> lynkeus.Study:
    return tank(simulate=SIMULATE)


def by(cells: Any) -> Any:
    return tank().estimate_each({**log(rows=2), "asset": cells}, by="asset")


def objects(*cells: Any) -> Any:
    found = np.empty(len(cells), dtype=object)
    found[:] = cells
    return found


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "a time below zero": (lambda: tank().check(time_limit=-1), "time_limit: expected seconds >= 0, found -1"),
    "no time": (lambda: tank().check(time_limit=math.nan), "time_limit: expected seconds >= 0, found NaN"),
    "no memory": (lambda: tank().check(memory_limit=math.nan), "memory_limit: expected MiB >= 0, found NaN"),
    "other sensors": (lambda: simulated().how_well(sensors="x"), 'sensors: expected "outputs" or "all", found "x"'),
    "another target": (lambda: tank().export("nowhere", to="x"), 'to: expected "c"'),
    "another language": (lambda: tank().plant().source("c"), 'language: expected "python"'),
    "runs below zero": (lambda: simulated().simulate(runs=-1), "runs: expected at least 1, found -1"),
    "no runs": (lambda: simulated().simulate(runs=0), "runs: expected at least 1, found 0"),
    "no workers": (lambda: simulated().sweep([{}], workers=0), "workers: expected at least 1, found 0"),
    "a change that is none": (lambda: simulated().sweep([{}, 3.0]), "change 1: expected a dictionary"),
    "one change alone": (lambda: simulated().sweep({"observer": {"theta": 2.0}}), "change 0: expected a dictionary"),
    "another theta": (lambda: tank(observer={"family": "triangular", "theta": -1.0}).check(), "theta"),
    "None for a state": (lambda: tank().plant().f(0.0, None, [1.0]), "x: expected numbers, found None"),
    "None in a vector": (lambda: tank().plant().h(0.0, [None], [1.0]), "x: expected numbers, found None"),
    "a text for an input": (lambda: tank().plant().jacobian_x(0.0, [1.0], "1"), "u: expected numbers, found <U1"),
    "ragged rows": (lambda: tank().plant().f(0.0, [[1.0], [1.0, 2.0]], [1.0]), "x: expected numbers"),
    "half a character": (lambda: tank(simulate={"inputs": {"inflow": "\ud800"}}), "a lone surrogate"),
    "half a character of a name": (lambda: tank(noise={"\udfff": 0.1}), "a lone surrogate"),
    "half a character of a model": (lambda: lynkeus.Model.from_modelica("model \ud800"), "a lone surrogate"),
    "half a character about": (lambda: tank().check(about=["\ud800"]), "a lone surrogate"),
    "what contains itself": (lambda: tank(simulate=ITSELF), "contains itself"),
    "lists for assets": (lambda: by(objects(["a"], ["b"])), 'column "asset": row 1: expected a name or a number, found list'),
    "arrays for assets": (
        lambda: by(objects("a", np.zeros(2))),
        'column "asset": row 2: expected a name or a number, found ndarray',
    ),
    "ragged assets": (lambda: by([["a"], ["a", "b"]]), 'column "asset": it cannot be read'),
    "an array without names": (lambda: tank().estimate_each(np.zeros((3, 2)), by="asset"), "expected named columns"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_argument_that_cannot_be_is_refused(name: str) -> None:
    call, words = REFUSED[name]
    with pytest.raises(lynkeus.InputError) as error:
        call()
    assert words in str(error.value), str(error.value)
    assert isinstance(error.value, ValueError)


def test_the_example_of_the_page_prints() -> None:
    study = lynkeus.Study(MODEL, unknown=["inflow"], observer={"family": "triangular", "theta": 2.0})
    with pytest.raises(lynkeus.InputError) as error:
        study.replace(observer={"theta": -1.0}).check()
    assert error.value.place is not None and error.value.place.startswith("study:")


def test_no_limit_of_time_is_one_without_end() -> None:
    for limit in (math.inf, 1e30):
        assert tank().check(time_limit=limit).summary == tank().check().summary


def test_one_expression_is_one_expression() -> None:
    assert tank().check(about="level").summary["about"] == {"level": "observable"}
    assert tank().check(about=("level", "2*inflow")).summary["about"].keys() == {"level", "2*inflow"}


def test_numbers_of_every_kind_are_numbers() -> None:
    plant = tank().plant()
    expected = plant.f(0.0, [4.0], [1.5])
    for x, u in ((4, 1.5), (np.float32(4), [np.float16(1.5)]), (np.array([4], dtype=object), (1.5,)), ([True * 4], 1.5)):
        np.testing.assert_array_equal(plant.f(0.0, x, u), expected)
    assert np.isnan(plant.f(0.0, [math.nan], [1.5])).all()


def test_the_name_of_a_file_is_no_folder(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    for force in (False, True):
        with pytest.raises(lynkeus.InputError, match="expected a folder, or a name for one, found a file"):
            tank().export(file, force=force)
    assert file.read_text() == "mine"


def test_a_structured_array_is_a_table_of_many() -> None:
    rows = log(rows=20)
    table = np.zeros(40, dtype=[("t", float), ("y", float), ("asset", "U1")])
    table["t"], table["y"] = np.tile(rows["t"], 2), np.tile(rows["y"], 2)
    table["asset"] = np.repeat(["a", "b"], 20)
    found = tank().estimate_each(table, by="asset")
    assert list(found) == ["a", "b"]
    alone = tank().estimate(rows)
    assert same(found["a"], alone) and same(found["b"], alone)
    with pytest.raises(lynkeus.InputError, match="found one table"):
        tank().estimate_each(table)


def test_a_live_estimator_speaks_of_samples_and_stays_as_it_was() -> None:
    estimator = tank().estimator()
    estimator.update(0.0, {"y": 4.0})
    estimator.update(6.0, {"y": 4.1})
    before = estimator.snapshot()
    for _ in range(3):
        with pytest.raises(lynkeus.InputError) as error:
            estimator.update(5.0, {"y": 4.0})
        assert str(error.value) == (
            "the time 5 is before 6, where the estimator is: expected samples in the order of their times"
        )
        with pytest.raises(lynkeus.InputError, match="t: expected a finite number, found NaN"):
            estimator.predict(math.nan)
    assert estimator.snapshot() == before


def test_what_is_drawn_is_named() -> None:
    pytest.importorskip("matplotlib").use("Agg")
    run = simulated().simulate()
    with pytest.raises(lynkeus.InputError, match="names: expected at least one quantity or column"):
        run.plot(names=[])
    assert len(run.plot(names="level")) == 1


def test_a_text_of_many_planes_stays() -> None:
    assert lynkeus.Model.from_modelica(TEXT + "// θ 😀").text.endswith("😀")
