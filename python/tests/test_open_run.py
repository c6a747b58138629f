"""What drives a simulation: a log, columns, functions of time, numbers, expressions."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import SIMULATE, tank

import lynkeus

STUDY = tank(noise={"y": 0.1}, simulate=SIMULATE)
T = np.arange(41) * 0.5


def inflow(t: Any) -> Any:
    return 1.2 + 0.2 * lynkeus.sin(t)


def test_columns_functions_and_numbers_drive_the_plant_alone() -> None:
    columns = {"t": T, "inflow": 1.2 + 0.2 * np.sin(T)}
    expected = STUDY.simulate(inputs=columns)
    assert isinstance(expected, lynkeus.OpenRun)
    assert expected.columns == ["t", "level", "inflow", "y"]
    found = STUDY.simulate(inputs={"t": T, "inflow": lambda t: 1.2 + 0.2 * math.sin(t)})
    np.testing.assert_allclose(found["level"], expected["level"], rtol=1e-14)
    constant = STUDY.simulate(inputs={"t": T, "inflow": 1.0})
    np.testing.assert_allclose(constant["level"], 4.0, atol=1e-9)  # 1 - 0.5*sqrt(4) = 0
    assert lynkeus.simulate(STUDY, inputs=columns)["level"].tolist() == expected["level"].tolist()


def test_errors_are_those_of_the_readings(tmp_path: Path) -> None:
    alone = STUDY.simulate(inputs={"t": T, "inflow": 1.5})
    off = np.where(np.arange(len(T)) % 2 == 0, 0.1, -0.3)
    readings = alone["y"] + off
    readings[7] = np.nan
    log = {"t": T, "inflow": np.full(len(T), 1.5), "y": readings}
    run = STUDY.simulate(inputs=log)
    counted = np.delete(off, 7)
    np.testing.assert_allclose(np.delete(run["y_error"], 7), counted, atol=1e-12)
    assert np.isnan(run["y_error"][7])
    errors = run.errors["y"]
    assert (errors.readings, errors.missing) == (40, 1)
    y = np.delete(readings, 7)
    fit = 100 * (1 - np.linalg.norm(counted) / np.linalg.norm(y - y.mean()))
    np.testing.assert_allclose(errors.fit_percent, fit, rtol=1e-9)
    np.testing.assert_allclose(errors.rms, np.sqrt(np.mean(counted**2)), rtol=1e-9)
    path = tmp_path / "log.csv"
    lines = [f"{t!r},1.5,{'' if np.isnan(y) else repr(float(y))}" for t, y in zip(T.tolist(), readings)]
    path.write_text("\n".join(["t,inflow,y", *lines]) + "\n")
    assert STUDY.simulate(inputs=path)["level"].tolist() == run["level"].tolist()
    assert "the plant alone on 41 rows" in str(run)


def test_without_columns_it_is_what_simulate_says() -> None:
    expected = STUDY.replace(simulate={"inputs": {"inflow": "1.2 + 0.2*sin(time)"}}).simulate()
    for given in ("1.2 + 0.2*sin(time)", inflow):
        found = STUDY.simulate(inputs={"inflow": given})
        assert isinstance(found, lynkeus.Simulation)
        np.testing.assert_allclose(found["level"], expected["level"], rtol=1e-9)
    assert STUDY.simulate(inputs={})["level"].tolist() == STUDY.simulate()["level"].tolist()
    constant = STUDY.simulate(inputs={"inflow": lambda t: 1.0})
    np.testing.assert_allclose(constant["level"], 4.0, atol=1e-9)
    many = STUDY.simulate(inputs={"inflow": 1.0}, runs=2)
    assert isinstance(many, lynkeus.MonteCarlo)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: STUDY.simulate(inputs=3), "inputs: expected a path, a mapping of columns"),
        (lambda: STUDY.simulate(inputs={"inflow": T}), 'no time column "t"'),
        (lambda: STUDY.simulate(inputs={"inflow": lambda t: t, "y": T}), "inputs: expected the times of the rows under 't'"),
        (lambda: STUDY.simulate(inputs={"t": T, "inflow": "time"}), "inputs['inflow']: expected a column, a function"),
        (lambda: STUDY.simulate(inputs={"t": T, "inflow": lambda t: "x"}), "inputs['inflow'](0.0): expected a number, found 'x'"),
        (lambda: STUDY.simulate(inputs={"inflow": lambda t: None}), "inputs['inflow']: expected a function that gives a number"),
        (lambda: STUDY.simulate(inputs={"inflow": math.sin}), "write `lynkeus.sin` in place of `math.sin`"),
        (lambda: STUDY.simulate(inputs={"t": T, "inflow": T}, runs=3), "runs: the plant alone has no noise"),
        (lambda: STUDY.simulate(inputs={"outflow": 1.0}), 'no input named "outflow"'),
        (lambda: tank().simulate(inputs={"t": T, "y": T}), 'nothing says what the unknown input "inflow" does'),
    ],
)
def test_what_drives_nothing_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(lynkeus.InputError) as error:
        call()
    assert words in str(error.value), str(error.value)


def test_it_is_drawn() -> None:
    pytest.importorskip("matplotlib").use("Agg")
    run = STUDY.simulate(inputs={"t": T, "inflow": np.full(len(T), 1.5), "y": np.full(len(T), 4.0)})
    (ax,) = run.plot()
    assert [line.get_label() for line in ax.get_lines()] == ["measured", "plant alone"]
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), 4.0, atol=1e-12)
