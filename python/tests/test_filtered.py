"""What a filter made of each row, beside a Kalman filter written out here."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from tank_study import estimated, log, tank

import lynkeus

#: a car on a line: its place p, its speed v; accelerated by u
MODEL = lynkeus.Model.from_function(
    lambda t, x, u: {"p": x.v, "v": u.a},
    lambda t, x: {"gps": x.p, "radar": x.v + 0.3 * x.p},
    states={"p": {"start": 1.0, "min": -1e3, "max": 1e3}, "v": {"start": 0.5, "min": -1e2, "max": 1e2}},
    inputs=["a"],
    name="Car",
)
C = np.array([[1.0, 0.0], [0.3, 1.0]])
R = np.array([0.04, 0.01])
Q = np.diag([0.02, 0.3])
P0 = np.diag([2.0, 0.5])
GATE = 4.0


def study(family: str = "ekf", **more: Any) -> lynkeus.Study:
    observer = {"family": family, "initial_variance": {"p": 2.0, "v": 0.5}, **more.pop("observer", {})}
    return lynkeus.Study(
        MODEL,
        noise={"gps": 0.2, "radar": 0.1},
        process_noise={"p": 0.02, "v": 0.3},
        observer=observer,
        **more,
    )


def rows(count: int = 120) -> dict[str, Any]:
    """Uneven times, a slow sensor, gaps of both, readings that are far off."""
    random = np.random.default_rng(5)
    t = np.cumsum(random.choice([0.1, 0.2, 0.7], count))
    a = np.sin(t)
    x, truth = np.array([1.4, 0.2]), []
    for k in range(count):
        if k:
            dt = t[k] - t[k - 1]
            x = moved(x, a[k - 1], dt) + np.linalg.cholesky(spread(dt)) @ random.normal(size=2)
        truth.append(C @ x)
    y = np.array(truth) + random.normal(size=(count, 2)) * np.sqrt(R)
    y[np.arange(count) % 4 != 1, 1] = np.nan
    y[30:37, 0] = np.nan
    y[[20, 61, 90], 0] += [5.0, -6.0, 9.0]
    y[61, 1] += 4.0
    return {"t": t, "gps": y[:, 0], "radar": y[:, 1], "a": a}


def transition(dt: float) -> Any:
    return np.array([[1.0, dt], [0.0, 1.0]])


def moved(x: Any, a: float, dt: float) -> Any:
    return transition(dt) @ x + a * np.array([dt * dt / 2, dt])


def spread(dt: float) -> Any:
    """What white noise of the densities Q comes to in a time: ∫ΦQΦᵀ."""
    p, v = np.diag(Q)
    return np.array([[p * dt + v * dt**3 / 3, v * dt**2 / 2], [v * dt**2 / 2, v * dt]])


def kalman(data: dict[str, Any], gate: float = math.inf) -> dict[str, Any]:
    """The textbook's filter, which a linear plant has whatever the family."""
    x, p = np.array([1.0, 0.5]), P0.copy()
    names = ("x", "predicted", "innovation", "innovation_covariance", "gain", "covariance", "log_likelihood")
    found: dict[str, Any] = {name: [] for name in names}
    t, rejected = data["t"], 0
    for k in range(len(t)):
        if k:
            dt = t[k] - t[k - 1]
            x, p = moved(x, data["a"][k - 1], dt), transition(dt) @ p @ transition(dt).T + spread(dt)
        y = np.array([data["gps"][k], data["radar"][k]])
        predicted = C @ x
        nu, s = y - predicted, C @ p @ C.T + np.diag(R)
        there = np.isfinite(y)
        taken = there & ~(np.abs(nu) > gate * np.sqrt(np.diag(s)))
        rejected += int((there & ~taken).sum())
        c, sub = C[taken], s[np.ix_(taken, taken)]
        gain = np.zeros((2, 2))
        gain[:, taken] = p @ c.T @ np.linalg.inv(sub)
        x = x + gain @ np.where(taken, nu, 0.0)
        p = p - gain[:, taken] @ sub @ gain[:, taken].T
        logdet = np.linalg.slogdet(2 * np.pi * sub)[1] if taken.any() else 0.0
        told = (
            x,
            predicted,
            nu,
            np.where(np.outer(there, there), s, np.nan),
            gain,
            p,
            -0.5 * (logdet + nu[taken] @ np.linalg.solve(sub, nu[taken])),
        )
        for name, value in zip(names, told, strict=True):
            found[name].append(value)
    return {**{name: np.array(values) for name, values in found.items()}, "rejected": rejected}


def compare(found: lynkeus.Filtered, expected: dict[str, Any], *, rtol: float = 1e-9, but: tuple[str, ...] = ()) -> None:
    for name in ("predicted", "innovation", "innovation_covariance", "gain", "covariance", "log_likelihood"):
        if name not in but:
            size = np.nanmax(np.abs(expected[name]))
            np.testing.assert_allclose(getattr(found, name), expected[name], rtol=rtol, atol=rtol * size, err_msg=name)


@pytest.mark.parametrize("family", ["ekf", "ukf"])
def test_a_filter_is_the_textbook_s(family: str) -> None:
    data = rows()
    run = study(family).estimate(data, record=True)
    expected = kalman(data)
    assert run.filter.sensors == ["gps", "radar"] and run.filter.states == ["p", "v"]
    compare(run.filter, expected)
    np.testing.assert_allclose(run["p_hat"], expected["x"][:, 0], rtol=1e-9)
    assert run.filter.nll == pytest.approx(-expected["log_likelihood"].sum(), rel=1e-9)
    assert np.isnan(run.filter.innovation).sum() == np.isnan(data["gps"]).sum() + np.isnan(data["radar"]).sum()


@pytest.mark.parametrize("family", ["ekf", "ukf"])
def test_readings_that_the_gate_rejects_do_not_count(family: str) -> None:
    data = rows()
    run = study(family, observer={"gate": GATE}).estimate(data, record=True)
    expected = kalman(data, GATE)
    assert expected["rejected"] >= 3
    compare(run.filter, expected)
    assert run.filter.nll < study(family).estimate(data, record=True).filter.nll


def test_a_window_has_all_but_a_gain() -> None:
    data = rows()
    run = study("mhe", observer={"horizon": 4}).estimate(data, record=True)
    compare(run.filter, kalman(data), rtol=1e-6, but=("gain",))
    assert np.isnan(run.filter.gain).all()


def test_a_reading_at_a_limit_counts_by_how_likely_it_is() -> None:
    """The output is expected at 1 with the variance 2.04, and the sensor shows no more than 2."""
    data = {"t": [0.0], "gps": [2.0], "a": [0.0]}
    for family in ("ekf", "ukf", "mhe"):
        made = lynkeus.Study(
            MODEL,
            measured=["gps"],
            noise={"gps": 0.2},
            limits={"gps": [-5.0, 2.0]},
            observer={"family": family, "initial_variance": {"p": 2.0, "v": 0.5}},
        )
        run = made.estimate(data, record=True)
        beyond = 0.5 * math.erfc(1.0 / math.sqrt(2.04) / math.sqrt(2.0))
        assert run.filter.nll == pytest.approx(-math.log(beyond), rel=1e-9)
        if family != "mhe":
            moved = run.filter.gain[0, :, 0] * run.filter.innovation[0, 0]
            np.testing.assert_allclose(moved, [run["p_hat"][0] - 1.0, run["v_hat"][0] - 0.5], atol=1e-12)


def test_the_record_does_not_change_the_run() -> None:
    plain, kept = (study().estimate(rows(), record=record) for record in (False, True))
    assert plain.columns == kept.columns and plain.to_json() == kept.to_json()
    assert all(np.array_equal(plain[name], kept[name]) for name in plain.columns)
    assert np.array_equal(lynkeus.estimate(study(), rows(), record=True).filter.gain, kept.filter.gain)


def test_a_record_travels_and_is_not_written() -> None:
    run = study().estimate(rows(), record=True)
    again = pickle.loads(pickle.dumps(run))
    assert np.array_equal(again.filter.covariance, run.filter.covariance)
    assert repr(again.filter) == "<Filtered: 120 rows, sensors gps, radar, states p, v>"
    with pytest.raises(ValueError, match="read-only"):
        run.filter.gain[0, 0, 0] = 1.0


def test_who_has_none_says_so() -> None:
    with pytest.raises(lynkeus.InputError, match="nothing was recorded.*record=True"):
        _ = study().estimate(rows()).filter
    with pytest.raises(lynkeus.InputError, match="the triangular observer is no filter"):
        _ = estimated(log()).filter
    with pytest.raises(lynkeus.InputError, match="record: expected a filter.*found the triangular observer"):
        tank().estimate(log(), record=True)
    with pytest.raises(lynkeus.ArgumentError, match="record: expected True or False"):
        study().estimate(rows(), record=3)  # type: ignore[arg-type]
