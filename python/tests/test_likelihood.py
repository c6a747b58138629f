"""−log L as a function of θ, beside ``fit``, differences, SciPy, JAX and a sampler."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from test_fit import leaking, recorded

import lynkeus

Array = NDArray[np.float64]

#: two levels, of which a sensor sees each; the one of the second is slow
PAIR = lynkeus.Model.from_modelica("""
model Pair
  parameter Real k(min = 0.05, max = 2) = 0.4;
  input Real inflow(min = 0, max = 5);
  Real a(start = 4, min = 0.01, max = 10);
  Real b(start = 2, min = 0.01, max = 10);
  output Real first = a;
  output Real second = b + 0.1*a;
equation
  der(a) = inflow - k*sqrt(a);
  der(b) = k*sqrt(a) - 0.5*sqrt(b);
end Pair;
""")


@pytest.fixture(scope="module")
def fit() -> lynkeus.Fit:
    return leaking().fit(recorded())


@pytest.fixture(scope="module")
def likelihood() -> lynkeus.Likelihood:
    return leaking().likelihood(recorded())


def found(fit: lynkeus.Fit, likelihood: lynkeus.Likelihood) -> Array:
    return np.array([fit.values[name] for name in likelihood.names])


def differences(function: Any, at: Array, share: float = 1e-3) -> Array:
    """Of fourth order."""
    rows = []
    for i, step in enumerate(share * at):
        near, far = (function(at + k * step * np.eye(len(at))[i]) for k in (1, 2))
        back, fur = (function(at - k * step * np.eye(len(at))[i]) for k in (1, 2))
        rows.append((8 * (near - back) - (far - fur)) / (12 * step))
    return np.array(rows)


def test_it_is_what_a_fit_makes_least(fit: lynkeus.Fit, likelihood: lynkeus.Likelihood) -> None:
    theta = found(fit, likelihood)
    assert likelihood.names == ["k", "noise.y"] and likelihood.outputs == ["y"]
    assert likelihood.nll(theta) == pytest.approx(fit.nll, rel=1e-9)
    assert likelihood.nll(likelihood.start) == pytest.approx(fit.nll_at_start, rel=1e-9)
    np.testing.assert_array_equal(likelihood.start, [0.8, 0.1])
    np.testing.assert_array_equal(likelihood.bounds[0], [0.1, 2.0])
    assert likelihood.bounds[1, 0] < 1e-6 < 1e5 < likelihood.bounds[1, 1]
    assert likelihood.is_log.tolist() == [False, True] and not likelihood.priors
    deviations = np.sqrt(np.diag(np.linalg.inv(likelihood.hessian(theta))))
    sd = np.array([fit.parameters["k"].sd, fit.noise["y"].sd])
    np.testing.assert_allclose(deviations, sd, rtol=1e-6)
    assert np.all(np.abs(likelihood.gradient(theta)) * sd < 1e-5)


def test_derivatives_are_those_of_the_value(likelihood: lynkeus.Likelihood) -> None:
    for theta in (likelihood.start, np.array([0.55, 0.03])):
        gradient = likelihood.gradient(theta)
        np.testing.assert_allclose(gradient, differences(likelihood.nll, theta), rtol=1e-7)
        hessian = likelihood.hessian(theta)
        np.testing.assert_array_equal(hessian, hessian.T)
        np.testing.assert_allclose(hessian, differences(likelihood.gradient, theta), rtol=1e-5)
        value, own = likelihood.value_and_gradient(theta)
        assert value == likelihood.nll(theta)
        np.testing.assert_array_equal(own, gradient)


def test_the_information_is_the_hessian_on_average() -> None:
    study = leaking()
    at = [0.5, 0.02]
    logs = [study.likelihood(recorded(seed=seed)) for seed in range(60)]
    hessian = np.mean([each.hessian(at) for each in logs], axis=0)
    np.testing.assert_allclose(np.diag(logs[0].information(at)), np.diag(hessian), rtol=0.1)


def test_scipy_ends_where_the_fit_does(fit: lynkeus.Fit, likelihood: lynkeus.Likelihood) -> None:
    optimize = pytest.importorskip("scipy.optimize")
    theta = found(fit, likelihood)
    methods: dict[str, dict[str, Any]] = {"L-BFGS-B": {}, "trust-constr": {"hess": likelihood.information}}
    for method, more in methods.items():
        ended = optimize.minimize(
            likelihood.value_and_gradient, likelihood.start, jac=True, bounds=likelihood.bounds, method=method, **more
        )
        np.testing.assert_allclose(ended.x, theta, rtol=1e-5)
        assert ended.fun == pytest.approx(fit.nll, rel=1e-9)


def test_priors_stand_apart() -> None:
    priors: dict[str, Any] = {"k": {"mean": 0.51, "sd": 1e-4}}
    study = leaking(fit={"parameters": ["k"], "noise": True, "priors": priors})
    fit, with_prior = study.fit(recorded()), study.likelihood(recorded())
    without = leaking().likelihood(recorded())
    assert with_prior.priors == {"k": (0.51, 1e-4)}
    at = np.array([0.505, 0.02])
    assert with_prior.nll(at) == without.nll(at)
    assert with_prior.log_prior(at) == pytest.approx(-0.5 * 50.0**2)
    assert with_prior.log_posterior(at) == with_prior.log_prior(at) - with_prior.nll(at)
    assert without.log_prior(at) == 0.0
    value, gradient = with_prior.log_posterior_and_gradient(at)
    assert value == with_prior.log_posterior(at)
    np.testing.assert_allclose(gradient, differences(with_prior.log_posterior, at), rtol=1e-6)
    # the prior moves the fit by more than half of its deviation
    theta = found(fit, with_prior)
    assert abs(theta[0] - leaking().fit(recorded()).values["k"]) > 1e-4
    _, left = with_prior.log_posterior_and_gradient(theta)
    np.testing.assert_allclose(left * [fit.parameters["k"].sd, fit.noise["y"].sd], 0.0, atol=1e-4)


def test_outside_of_the_bounds_nothing_is_raised(likelihood: lynkeus.Likelihood) -> None:
    for theta in ([0.05, 0.1], [2.1, 0.1], [0.5, -1.0], [np.nan, 0.1], [0.5, np.inf]):
        assert likelihood.nll(theta) == np.inf
        assert likelihood.log_prior(theta) == likelihood.log_posterior(theta) == -np.inf
        value, gradient = likelihood.value_and_gradient(theta)
        assert value == np.inf and np.isnan(gradient).all()
        value, gradient = likelihood.log_posterior_and_gradient(theta)
        assert value == -np.inf and np.isnan(gradient).all()
        assert np.isnan(likelihood.hessian(theta)).all() and np.isnan(likelihood.information(theta)).all()
        assert np.isnan(likelihood.innovations(theta)[0].innovation).all()
    assert np.isfinite(likelihood.nll(likelihood.bounds[:, 0]))


def test_where_the_model_has_no_value_nothing_is_raised() -> None:
    model = lynkeus.Model.from_modelica("""
    model Corner
      parameter Real p(min = 0, max = 4) = 2;
      Real x(start = 1, min = 0, max = 2);
      output Real y = sqrt(p - 1)*x;
    equation
      der(x) = -0.1*x;
    end Corner;""")
    study = lynkeus.Study(model, noise={"y": 0.1}, observer="ekf", fit={"parameters": ["p"]})
    t = np.arange(20.0)
    corner = study.likelihood({"t": t, "y": np.exp(-0.1 * t)})
    assert np.isfinite(corner.nll([2.0])) and corner.nll([0.5]) == np.inf
    assert corner.log_posterior([0.5]) == -np.inf and np.isnan(corner.gradient([0.5])).all()
    assert np.isnan(corner.innovations([0.5])[0].innovation).all()


def test_wrong_shapes_are_refused(likelihood: lynkeus.Likelihood) -> None:
    for theta in ([0.5], [0.5, 0.1, 0.1], [[0.5, 0.1]], 0.5, []):
        with pytest.raises(lynkeus.InputError, match=r"theta: expected 2 values \(k, noise.y\), found the shape"):
            likelihood.nll(theta)
    for wrong in (None, "ab", ["a", "b"], [None, 0.1], [[0.5], [0.1, 0.2]]):
        with pytest.raises(lynkeus.ArgumentError, match="theta: expected numbers"):
            likelihood.hessian(wrong)  # type: ignore[arg-type]
    assert likelihood.nll((0.5, np.float32(0.125))) == likelihood.nll(np.array([0.5, 0.125]))


def logged(rows: int = 60) -> dict[str, Any]:
    """Both sensors have gaps, and the second reports every third time."""
    random, t = np.random.default_rng(5), np.arange(rows) * 0.3
    first = 4 * np.exp(-0.05 * t) + random.normal(scale=0.05, size=rows)
    second = 2 + 0.3 * np.sin(0.4 * t) + random.normal(scale=0.05, size=rows)
    first[random.random(rows) < 0.3] = np.nan
    second[np.arange(rows) % 3 > 0] = np.nan
    return {"t": t, "inflow": 0.7 + 0.3 * np.sin(t), "first": first, "second": second}


def pair(**sections: Any) -> lynkeus.Study:
    """With a step of Runge and Kutta for each row: between several, the filter keeps Φ and W, and the likelihood the
    root of P, which are the same up to the error of the steps."""
    given: dict[str, Any] = {
        "noise": {"first": 0.05, "second": 0.04},
        "process_noise": {"a": 0.02, "b": 0.01},
        "observer": {"family": "ekf", "initial_variance": {"default": 0.1}},
        "estimate": {"method": "rk4", "step": 0.3},
        "fit": {"parameters": ["k"], "noise": True, "process_noise": True},
    }
    return lynkeus.Study(PAIR, **{**given, **sections})


@pytest.mark.parametrize("measured", [["first"], ["second"], ["first", "second"]])
def test_innovations_are_those_of_the_filter(measured: list[str]) -> None:
    study = pair(measured=measured, noise={name: 0.05 for name in measured})
    kalman = study.estimate(logged(), record=True).filter
    likelihood = study.likelihood(logged())
    (told,) = likelihood.innovations(likelihood.start)
    assert told.outputs == likelihood.outputs == kalman.sensors == measured
    assert (told.fitted, len(told.t), told.at_limit.any()) == (60, 60, False)
    np.testing.assert_array_equal(told.t, logged()["t"])
    for row, covariance in enumerate(kalman.innovation_covariance):
        # one output after the other: S = LDLᵀ, and L⁻¹ν
        there = ~np.isnan(kalman.innovation[row])
        assert (there == ~np.isnan(told.innovation[row])).all()
        root = np.linalg.cholesky(covariance[np.ix_(there, there)])
        alone = np.linalg.solve(root / np.diag(root), kalman.innovation[row][there])
        np.testing.assert_allclose(told.innovation[row][there], alone, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(told.variance[row][there], np.diag(root) ** 2, rtol=1e-9)
    assert likelihood.nll(likelihood.start) == pytest.approx(kalman.nll, rel=1e-9)
    ν, s = told.innovation, told.variance
    assert 0.5 * np.nansum(np.log(2 * np.pi * s) + ν**2 / s) == pytest.approx(kalman.nll, rel=1e-9)


def test_rows_that_are_held_out_do_not_count() -> None:
    fitted = {"parameters": ["k"], "held_out": 0.25}
    likelihood = pair(fit=fitted).likelihood(logged())
    (told,) = likelihood.innovations(likelihood.start)
    assert told.fitted == 45 and np.isfinite(told.innovation[45:]).any()
    ν, s = told.innovation[:45], told.variance[:45]
    assert 0.5 * np.nansum(np.log(2 * np.pi * s) + ν**2 / s) == pytest.approx(likelihood.nll(likelihood.start), rel=1e-9)


def test_readings_at_a_limit_are_told() -> None:
    log = logged()
    log["first"] = np.minimum(log["first"], 3.0)
    likelihood = pair(limits={"first": [0.0, 3.0]}).likelihood(log)
    (told,) = likelihood.innovations(likelihood.start)
    np.testing.assert_array_equal(told.at_limit[:, 0], log["first"] == 3.0)
    assert told.at_limit[:, 0].any() and not told.at_limit[:, 1].any()
    np.testing.assert_allclose(likelihood.gradient(likelihood.start), differences(likelihood.nll, likelihood.start), rtol=1e-6)


def test_several_logs_have_starts_of_their_own() -> None:
    logs = [recorded(seed=4), recorded(seed=3, start=2.0, rows=50)]
    study = leaking(fit={"parameters": ["k"], "initial": ["level"]})
    both = study.likelihood(logs)
    assert both.names == ["k", "initial.level[1]", "initial.level[2]"]
    at = np.array([0.5, 4.0, 2.0])
    alone = [study.likelihood(log).nll(at[[0, 1 + k]]) for k, log in enumerate(logs)]
    assert both.nll(at) == pytest.approx(sum(alone), rel=1e-9)
    assert [len(each.t) for each in both.innovations(at)] == [120, 50]
    assert repr(both) == "<Likelihood of Tank: k, initial.level[1], initial.level[2]>"


def test_it_travels_without_its_files(likelihood: lynkeus.Likelihood, tmp_path: Path) -> None:
    pd.DataFrame(recorded()).to_csv(tmp_path / "log.csv", index=False)
    from_file = leaking().likelihood(tmp_path / "log.csv")
    assert from_file.innovations(from_file.start)[0].log.endswith("log.csv")
    data = pickle.dumps(from_file)
    (tmp_path / "log.csv").unlink()
    at = np.array([0.5, 0.02])
    for twin in (from_file, pickle.loads(data), copy.copy(likelihood), copy.deepcopy(likelihood)):
        assert twin.names == likelihood.names and twin.nll(at) == likelihood.nll(at)
        np.testing.assert_array_equal(twin.hessian(at), likelihood.hessian(at))


def test_threads_share_it(likelihood: lynkeus.Likelihood) -> None:
    points = [np.array([0.4 + 0.01 * k, 0.02 + 0.001 * k]) for k in range(40)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(likelihood.nll, points)) == [likelihood.nll(point) for point in points]


def test_what_is_wrong_is_refused() -> None:
    with pytest.raises(lynkeus.InputError, match="fit needs a log"):
        leaking().likelihood([])
    with pytest.raises(lynkeus.InputError, match="names nothing to find"):
        leaking(fit={}).likelihood(recorded())
    with pytest.raises(lynkeus.LimitError):
        leaking().likelihood(recorded(), time_limit=0.0)
    assert leaking(observer="mhe").likelihood(recorded()).notes == leaking(observer="mhe").fit(recorded()).notes != []


def test_a_log_that_contradicts_itself_is_warned_of() -> None:
    log = {name: np.repeat(values, 2) for name, values in recorded().items()}
    log["y"] = log["y"] + np.tile([0.0, 0.5], 120)
    with pytest.warns(lynkeus.LogWarning, match="different things") as caught:
        likelihood = leaking().likelihood(log)
    assert caught[0].filename == __file__
    assert np.isfinite(likelihood.nll(likelihood.start))


def test_jax_differentiates_it(likelihood: lynkeus.Likelihood) -> None:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    shapes = (jax.ShapeDtypeStruct((), float), jax.ShapeDtypeStruct((2,), float))

    @jax.custom_vjp
    def nll(theta: Any) -> Any:
        return jax.pure_callback(likelihood.nll, shapes[0], theta)

    def forward(theta: Any) -> Any:
        return jax.pure_callback(likelihood.value_and_gradient, shapes, theta)

    nll.defvjp(forward, lambda gradient, cotangent: (cotangent * gradient,))
    at = np.array([0.5, 0.02])
    value, gradient = jax.jit(jax.value_and_grad(lambda x: nll(jax.numpy.exp(x))))(np.log(at))
    assert float(value) == pytest.approx(likelihood.nll(at), rel=1e-9)
    np.testing.assert_allclose(gradient, at * likelihood.gradient(at), rtol=1e-6)


def test_a_sampler_finds_the_standard_deviations(fit: lynkeus.Fit, likelihood: lynkeus.Likelihood) -> None:
    emcee = pytest.importorskip("emcee")
    theta = found(fit, likelihood)
    sd = np.array([fit.parameters["k"].sd, fit.noise["y"].sd])
    np.random.seed(7)  # the sampler draws from NumPy's own state
    sampler = emcee.EnsembleSampler(10, 2, likelihood.log_posterior)
    sampler.run_mcmc(theta + sd * np.random.standard_normal((10, 2)), 1000)
    sample = sampler.get_chain(discard=100, flat=True)
    np.testing.assert_allclose(sample.std(axis=0), sd, rtol=0.1)
    np.testing.assert_allclose(sample.mean(axis=0), theta, atol=0.3 * sd.max())
