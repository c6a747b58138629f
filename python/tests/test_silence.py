"""Nothing is thrown away, misread or cut short without a word."""

from __future__ import annotations

import pickle
import warnings
from typing import Any

import numpy as np
import pytest
from tank_study import log, tank

import lynkeus

MODEL = lynkeus.Model.from_function(
    lambda t, x, u: [u[0] - x[0]],
    states={"x": {"start": 0, "min": -5, "max": 5}},
    inputs=["u"],
    name="M",
)


def study(**more: Any) -> lynkeus.Study:
    return lynkeus.Study(MODEL, noise={"x": 0.1}, observer="ekf", **more)


def rows(count: int = 50) -> dict[str, Any]:
    return {"t": 0.1 * np.arange(count), "x": 0.05 * np.sin(np.arange(count)), "u": np.zeros(count)}


def test_a_run_that_a_limit_ended_is_not_credible() -> None:
    long = rows(1_000_000)
    with pytest.warns(lynkeus.NotCredible, match="not whole"):
        run = study().estimate(long, time_limit=0.2)
    assert not run.is_credible and isinstance(run.refusal, lynkeus.LimitError)
    assert len(run) < 1_000_000 and run.ended.by_limit
    with pytest.warns(lynkeus.NotCredible, match="1 of 1 results are not credible"):
        study().estimate_each([long], time_limit=0.2)


def test_rows_that_contradict_each_other_are_warned_of() -> None:
    one = rows()
    mixed = {name: np.repeat(values, 2) for name, values in one.items()}
    mixed["x"] = mixed["x"] + np.tile([0.0, 0.5], 50)
    with pytest.warns(lynkeus.LogWarning, match="different things at 50 times.*`by`"):
        run = study().estimate(mixed)
    assert len(run.warnings) == 1
    with pytest.warns(lynkeus.LogWarning, match="1 of 2 logs"):
        study().estimate_each([one, mixed])
    with pytest.raises(lynkeus.InputError, match="`by`"):
        study().estimate({name: np.concatenate([values, values]) for name, values in one.items()})
    with warnings.catch_warnings():
        warnings.simplefilter("error", lynkeus.LogWarning)
        study().estimate({name: np.repeat(values, 2) for name, values in one.items()})


def test_a_shuffled_log_is_refused_as_a_reversed_one_is() -> None:
    order = np.random.default_rng(0).permutation(50)
    with pytest.raises(lynkeus.InputError, match="jumps back"):
        study().estimate({name: values[order] for name, values in rows().items()})


def test_readings_are_no_truth_and_no_dates() -> None:
    assert not study().estimate(rows()).errors
    dates = np.datetime64("2026-01-01") + np.arange(50).astype("timedelta64[s]")
    for name in ("x", "u"):
        with pytest.raises(lynkeus.InputError, match="only times may be dates"):
            study().estimate({**rows(), name: dates})
    assert len(study().estimate({**rows(), "t": dates})) == 50


def test_what_was_computed_travels() -> None:
    done = study()
    run = done.estimate(rows())
    again = pickle.loads(pickle.dumps(run))
    assert type(again) is type(run) and again.columns == run.columns and str(again) == str(run)
    assert np.array_equal(again["x_hat"], run["x_hat"]) and again.summary == run.summary
    assert again.to_svg() == run.to_svg() and again.is_credible == run.is_credible
    assert np.array_equal(pickle.loads(pickle.dumps(again)).t, run.t)
    assert str(pickle.loads(pickle.dumps(done.check()))) == str(done.check())
    recorded = lynkeus._logs.log_of(log())
    moved = pickle.loads(pickle.dumps(recorded))
    assert moved.headers() == recorded.headers() and np.array_equal(moved.column("t"), recorded.column("t"))
    for functions in (done.plant(), MODEL.functions()):
        assert pickle.loads(pickle.dumps(functions)).f(0, [1.0], [0.5]) == functions.f(0, [1.0], [0.5])
    observer = pickle.loads(pickle.dumps(tank().observer()))
    assert observer.outputs == tank().observer().outputs


def test_an_index_of_instants_is_the_time() -> None:
    pandas = pytest.importorskip("pandas")
    index = pandas.date_range("2024-01-01", periods=50, freq="s", tz="UTC")
    frame = pandas.DataFrame({"x": rows()["x"], "u": 0.0}, index=index)
    assert np.array_equal(study().estimate(frame).t, np.arange(50.0))
    # a column of that name is there already
    assert study().estimate(frame.assign(t=0.1 * np.arange(50.0))).t[1] == 0.1


def test_a_lazy_frame_is_collected() -> None:
    polars = pytest.importorskip("polars")
    lazy = polars.LazyFrame(rows()).with_columns(asset=polars.lit("a"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = study().estimate(lazy)
        each = study().estimate_each(lazy, by="asset")
    assert np.array_equal(run["x_hat"], each["a"]["x_hat"])


@pytest.mark.parametrize(
    "mistake",
    [
        lambda: lynkeus.Model.from_function(lambda y, t: -y, states=["y"]),
        lambda: lynkeus.Model.from_function(lambda x, u: [-x], states=["x"], inputs=["u"]),
    ],
)
def test_arguments_in_another_order_are_refused(mistake: Any) -> None:
    with pytest.raises(lynkeus.TraceError, match="uses the time and no state"):
        mistake()
    assert lynkeus.Model.from_function(lambda t, x: [lynkeus.sin(t)], states=["x"])
    assert lynkeus.Model.from_function(lambda z, x: [x[0] * z], states=["x"])


def test_a_range_is_looked_at_where_it_is_declared() -> None:
    with pytest.raises(lynkeus.InputError, match="min <= max"):
        lynkeus.Model.from_function(lambda t, x: [-x[0]], states={"x": {"min": 1, "max": 0}})


def test_what_scipy_refuses_is_told_where_it_is_called() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    points = np.linspace(0, 1, 5)
    for look in (interpolate.CubicSpline(points, points**2), interpolate.interp1d(points, points**2)):
        with pytest.raises(lynkeus.TraceError) as error:
            lynkeus.Model.from_function(lambda t, x, look=look: [-look(x[0])], states=["x"])
        assert str(error.value.place).startswith(__file__) and "lynkeus.interp" in str(error.value.hint)


def test_mistakes_are_told_with_what_may_be_meant() -> None:
    run = study().estimate(rows())
    with pytest.raises(AttributeError, match="did you mean 'errors'"):
        run.erors  # noqa: B018
    with pytest.raises(TypeError, match="unknow"):
        study(unknow=["u"])
    for wrong in (
        lambda: lynkeus.Study(MODEL, observer={"famly": 3}),
        lambda: study().replace(obsever=3),
        lambda: study().estimate(1),
    ):
        with pytest.raises(lynkeus.InputError) as error:
            wrong()
        assert any(word in str(error.value) for word in ("family", "observer", "expected a path"))


def test_a_live_estimator_gets_over_an_absurd_sample() -> None:
    model = lynkeus.Model.from_function(
        lambda t, x, u: [np.exp(u[0]) - x[0]],
        states={"x": {"start": 1, "min": -5, "max": 5}},
        inputs=["u"],
        name="M",
    )
    study = lynkeus.Study(model, noise={"x": 0.1}, process_noise={"x": 0.01}, observer="ekf", estimate={"method": "rk4"})
    live = study.estimator()
    refused = 0
    for k in range(100):
        try:
            live.update(0.1 * k, {"x": 1.0, "u": 1e3 if k == 20 else 0.0})
        except lynkeus.LynkeusError:
            refused += 1
    assert 1 <= refused <= 6
    assert live.time == pytest.approx(9.9) and live.estimate["x"] == pytest.approx(1.0, abs=0.1)
