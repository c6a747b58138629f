"""Parameters and noises from logs."""

from __future__ import annotations

import copy
import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import lynkeus

#: a tank that is fed and leaks: its rates, and the noise of its gauge
TRUTH = {"k": 0.5, "noise.y": 0.02}
MODEL = lynkeus.Model.from_modelica("""
model Tank
  parameter Real k(min = 0.1, max = 2) = 0.8;
  input Real inflow(min = 0, max = 5);
  Real level(start = 4, min = 0.1, max = 10);
  output Real y = level;
equation
  der(level) = inflow - k*sqrt(level);
end Tank;
""")
#: of two rates only the product is seen
TWINS = lynkeus.Model.from_modelica("""
model Twins
  parameter Real a(min = 0.1, max = 2) = 1;
  parameter Real b(min = 0.1, max = 2) = 0.5;
  Real level(start = 4, min = 0, max = 10);
  output Real y = level;
equation
  der(level) = -a*b*level;
end Twins;
""")


def recorded(seed: int = 2, rows: int = 120, start: float = 4.0) -> dict[str, Any]:
    """Integrated with a hundredth of the step between rows."""
    t, levels, level = np.arange(rows) * 0.25, [], start
    inflow = np.where(t % 10 < 5, 1.4, 0.6)
    for u in inflow:
        levels.append(level)
        for _ in range(100):
            level += 0.0025 * (u - TRUTH["k"] * np.sqrt(level))
    noise = np.random.default_rng(seed).normal(scale=TRUTH["noise.y"], size=rows)
    return {"t": t, "inflow": inflow, "y": np.array(levels) + noise}


def leaking(**sections: Any) -> lynkeus.Study:
    given: dict[str, Any] = {
        "noise": {"y": 0.1},
        "observer": {"family": "ekf", "initial_variance": {"level": 0.01}},
        "fit": {"parameters": ["k"], "noise": True},
    }
    return lynkeus.Study(MODEL, **{**given, **sections})


@pytest.fixture(scope="module")
def fit() -> lynkeus.Fit:
    return leaking().fit(recorded())


def test_the_truth_is_found(fit: lynkeus.Fit) -> None:
    assert fit.converged and fit.is_credible and fit.refusal is None and not fit.undetermined
    assert set(fit.values) == set(TRUTH)
    for name, one in {"k": fit.parameters["k"], "noise.y": fit.noise["y"]}.items():
        assert one.sd is not None and one.interval is not None and not one.at_bound
        assert fit.values[name] == one.value
        assert abs(one.value - TRUTH[name]) < 3 * one.sd < 0.1
        assert one.interval[0] < one.value < one.interval[1]
    assert fit.nll is not None and fit.nll_at_start is not None and fit.nll < fit.nll_at_start
    assert fit.correlation.names == ["k", "noise.y"]


def test_columns_are_innovations(fit: lynkeus.Fit) -> None:
    assert fit.columns == ["t", "y_innovation", "y_innovation_sd", "y_free_run_error"]
    np.testing.assert_array_equal(fit["t"], recorded()["t"])
    one_step = np.sqrt(np.mean(fit["y_innovation"] ** 2))
    assert one_step == pytest.approx(fit.errors["y"].fitted.one_step, rel=1e-12)
    assert np.mean((fit["y_innovation"] / fit["y_innovation_sd"]) ** 2) == pytest.approx(1, abs=0.2)
    assert list(fit.to_pandas().columns) == fit.columns and fit.to_polars().shape == (120, 4)


def test_it_is_told_and_travels(fit: lynkeus.Fit) -> None:
    assert "Tank: 2 values fitted to 120 readings of log" in str(fit)
    assert "noise.y" in fit._repr_html_() and repr(fit).startswith("<Fit\n")
    for other in (pickle.loads(pickle.dumps(fit)), copy.deepcopy(fit)):
        assert other.summary == fit.summary and str(other) == str(fit)
        assert other.study().text == fit.study().text
        np.testing.assert_array_equal(other["y_innovation"], fit["y_innovation"])


def test_the_study_has_the_values_found(fit: lynkeus.Fit) -> None:
    sections = fit.study()._core.sections()
    assert sections["parameters"]["k"] == pytest.approx(fit.values["k"], rel=1e-4)
    assert sections["sensors"]["noise"]["y"] == pytest.approx(fit.values["noise.y"], rel=1e-4)
    again = fit.study().fit(recorded())
    assert again.values == pytest.approx(fit.values, rel=1e-3)
    assert fit.study().estimate(recorded()).is_credible


def test_logs_come_in_all_forms(fit: lynkeus.Fit, tmp_path: Path) -> None:
    pd.DataFrame(recorded()).to_csv(tmp_path / "log.csv", index=False)
    for log in (pd.DataFrame(recorded()), tmp_path / "log.csv", str(tmp_path / "log.csv"), [recorded()]):
        assert lynkeus.fit(leaking(), log).values == pytest.approx(fit.values, rel=1e-9)


def test_several_logs_have_starts_of_their_own() -> None:
    starts = (4.0, 2.0)
    study = leaking(fit={"parameters": ["k"], "initial": ["level"]}, noise={"y": TRUTH["noise.y"]})
    logs = [recorded(seed=4, start=starts[0]), pd.DataFrame(recorded(seed=3, start=starts[1]))]
    found = study.fit(logs)
    for start, one in zip(starts, found.initial["level"], strict=True):
        assert one.sd is not None and abs(one.value - start) < 3 * one.sd
    assert set(found.values) == {"k", "initial.level[1]", "initial.level[2]"}
    assert found.columns[:2] == ["log", "t"] and set(found["log"]) == {1.0, 2.0}
    alone = study.fit(logs[0]).parameters["k"].sd
    shared = found.parameters["k"].sd
    assert alone is not None and shared is not None and shared < alone
    # starts of several logs stay out
    assert "initial" not in found.study()._core.sections()["observer"]


def test_intervals_by_profiles_are_near_the_others(fit: lynkeus.Fit) -> None:
    profiled = leaking().fit(recorded(), profiles=True).noise["y"].interval
    asymptotic = fit.noise["y"].interval
    assert profiled is not None and asymptotic is not None and profiled != asymptotic
    assert profiled == pytest.approx(asymptotic, rel=0.05)


def test_what_the_log_does_not_tell_is_told() -> None:
    study = lynkeus.Study(
        TWINS, noise={"y": 0.02}, observer="ekf", fit={"parameters": ["a", "b"]}
    )
    t = np.arange(50) * 0.1
    log = {"t": t, "y": 4 * np.exp(-0.5 * t) + np.random.default_rng(4).normal(scale=0.02, size=50)}
    with pytest.warns(lynkeus.NotCredible, match="the logs do not determine a, b"):
        found = study.fit(log)
    assert not found.is_credible and found.undetermined == ["a", "b"]
    assert isinstance(found.refusal, lynkeus.RefusedError)
    for one in (found, pickle.loads(pickle.dumps(found))):
        with pytest.raises(lynkeus.RefusedError, match="the logs do not determine a, b"):
            one.study()


def test_a_value_at_its_bound_is_warned_of() -> None:
    with pytest.warns(lynkeus.LogWarning, match="k is at its bound, 0.6"):
        found = leaking(fit={"parameters": ["k"], "bounds": {"k": [0.6, 2.0]}}).fit(recorded())
    assert found.parameters["k"].at_bound and found.parameters["k"].value == pytest.approx(0.6)


def test_the_next_experiment_is_told() -> None:
    fit = {"parameters": ["k"], "noise": True, "candidates": {"long": {"duration": 89.25}}}
    found = leaking(fit=fit).fit(recorded(), next_experiment=True)
    assert found.next_experiment is not None
    long, again = found.next_experiment
    assert (long.name, again.name) == ("long", "the same again")
    assert long.readings == 358 and again.readings == 120
    assert long.worst == "k" and long.factor is not None and again.factor is not None
    # half the variance where the log tells as much again
    assert long.factor < again.factor and abs(again.factor - 0.5**0.5) < 0.02
    assert long.sd["k"] is not None and long.sd["noise.y"] is not None
    # of twins a gauge of the level tells the product only
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lynkeus.NotCredible)
        twins = lynkeus.Study(
            TWINS,
            noise={"y": 0.02},
            observer={"family": "ekf", "initial_variance": {"level": 0.01}},
            fit={"parameters": ["a", "b"]},
        ).fit({"t": [0.0, 1.0, 2.0, 3.0], "y": [4.0, 2.4, 1.5, 0.9]}, next_experiment=True)
    assert twins.next_experiment is not None
    assert all(one.undetermined == ["a", "b"] for one in twins.next_experiment)


def test_what_is_wrong_is_refused() -> None:
    with pytest.raises(lynkeus.InputError, match="no parameter is called \"kk\""):
        leaking(fit={"parameters": ["kk"]}).fit(recorded())
    with pytest.raises(lynkeus.InputError, match="fit needs a log"):
        leaking().fit([])
    with pytest.raises(lynkeus.ArgumentError, match="expected a path, a mapping of columns"):
        leaking().fit([recorded(), 3])  # type: ignore[list-item]
    with pytest.raises(lynkeus.InputError, match="inflow"):
        leaking().fit({"t": [0.0, 1.0], "y": [4.0, 4.1]})


def test_progress_is_told_and_may_end_it() -> None:
    told: list[float] = []
    leaking().fit(recorded(), progress=told.append)
    assert told and all(0 <= share <= 1 for share in told)

    def tell(share: float) -> None:
        raise ZeroDivisionError("in the callback")

    with pytest.raises(ZeroDivisionError, match="in the callback"):
        leaking().fit(recorded(), progress=tell)


def test_a_limit_of_time_ends_it() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(lynkeus.LimitError):
            leaking().fit(recorded(), time_limit=0.0)
