"""Plants and observers in python-control, SciPy, CasADi, JAX and do-mpc."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import lynkeus
from lynkeus import Functions, InputError, Model, RefusedError, Study

os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("JAX_ENABLE_X64", "1")

EXAMPLES = Path(__file__).parents[2] / "examples"
STUDIES = sorted(str(path.relative_to(EXAMPLES)) for path in EXAMPLES.glob("*/*.toml"))
POINTS = 5
LINEAR = {"between_samples": "linear", "method": "adaptive", "rtol": 1e-12}


@cache
def systems(name: str) -> tuple[Functions, Functions]:
    """The plant and the observer of an example."""
    study = Study.load(EXAMPLES / name)
    return study.plant(), study.observer()


def points(system: Functions) -> list[tuple[float, Any, Any]]:
    """Random points around the start."""
    random = np.random.default_rng(7)
    centre = np.nan_to_num(system.start, nan=1.0)
    return [
        (
            random.uniform(0, 2),
            centre * random.uniform(0.9, 1.1, centre.size) + random.uniform(0, 0.1, centre.size),
            random.uniform(0.5, 1.5, len(system.inputs)),
        )
        for _ in range(POINTS)
    ]


def deviation(found: Any, expected: Any) -> float:
    """Largest error against the size of its entry or, where terms cancel, of the largest one."""
    found, expected = np.asarray(found, float).ravel(), np.asarray(expected, float).ravel()
    assert found.shape == expected.shape
    assert np.array_equal(np.isfinite(found), np.isfinite(expected))
    use = np.isfinite(expected)
    size = np.max(np.abs(expected[use]), initial=1e-300)
    return float(np.max(np.abs(found[use] - expected[use]), initial=0.0) / size)


@pytest.mark.parametrize("name", STUDIES)
def test_casadi_evaluates_the_same(name: str) -> None:
    pytest.importorskip("casadi")
    for system in systems(name):
        theirs = system.to_casadi()
        for t, x, u in points(system):
            assert deviation(theirs.f(t, x, u), system.f(t, x, u)) < 1e-13
            assert deviation(theirs.h(t, x, u), system.h(t, x, u)) < 1e-13


@pytest.mark.parametrize("name", STUDIES)
def test_the_text_evaluates_the_same_over_numpy(name: str) -> None:
    for system in systems(name):
        module: dict[str, Any] = {}
        exec(system.source("python"), module)
        for t, x, u in points(system):
            with np.errstate(all="ignore"):
                assert deviation(module["f"](np, t, x, u), system.f(t, x, u)) < 1e-13
                assert deviation(module["h"](np, t, x, u), system.h(t, x, u)) < 1e-13


@pytest.mark.parametrize("z", [(0, 0, 0), (1, 0, 0), (0, 1.2, 0), (0, np.pi / 3, 0.5)])
def test_a_singular_gain_is_passed_within_bounds_as_the_tool_does(z: tuple[float, ...]) -> None:
    observer = systems("germani-manes/theoretical.toml")[1]
    module: dict[str, Any] = {}
    exec(observer.source("python"), module)
    w = np.array([1.0, 1.0, 0.0])
    ours = observer.f(0.0, z, w)
    assert np.isfinite(ours).all()
    assert deviation(module["f"](np, 0.0, z, w), ours) < 1e-13
    pytest.importorskip("casadi")
    assert deviation(observer.to_casadi().f(0.0, z, w), ours) < 1e-13


@pytest.mark.parametrize("name", STUDIES)
def test_jax_evaluates_and_differentiates_the_same(name: str) -> None:
    jax = pytest.importorskip("jax")
    for system in systems(name):
        theirs = system.to_jax()
        # along one direction: a whole Jacobian is one compilation per operation and example
        direction = np.random.default_rng(8).normal(size=len(system.states))
        for t, x, u in points(system)[:2]:
            assert deviation(theirs.h(t, x, u), system.h(t, x, u)) < 1e-13
            value, slope = jax.jvp(lambda x, t=t, u=u, f=theirs.f: f(t, x, u), (x,), (direction,))
            assert deviation(value, system.f(t, x, u)) < 1e-13
            assert deviation(slope, system.jacobian_x(t, x, u) @ direction) < 1e-12


@pytest.mark.parametrize("name", ["lee/classical.toml", "two-tanks/study.toml", "van-der-pol-pair/study.toml"])
def test_python_control_simulates_the_same_observer(name: str) -> None:
    control = pytest.importorskip("control")
    study = Study.load(EXAMPLES / name).replace(estimate=LINEAR, simulate={"until": 2.0, "output_step": 0.05})
    log = study.simulate().log
    ours = study.estimate(log)
    observer = study.observer()
    system = observer.to_nlsys("observer")
    assert system.input_labels == observer.signals
    assert system.output_labels == observer.outputs
    signals = np.array([log[name] for name in observer.signals])
    theirs = control.input_output_response(
        system,
        ours.t,
        signals,
        observer.start,
        # lines between samples have corners, and its solver does not know where
        solve_ivp_kwargs={"method": "DOP853", "rtol": 1e-12, "atol": 1e-12, "max_step": 0.005},
    )
    for row, name in zip(theirs.outputs.reshape(len(observer.outputs), -1), observer.outputs, strict=True):
        assert deviation(row, ours[name]) < 1e-9


def test_solve_ivp_runs_the_plant_as_simulate_does() -> None:
    integrate = pytest.importorskip("scipy.integrate")
    study = Study.load(EXAMPLES / "lee/classical.toml").replace(
        simulate={"method": "adaptive", "rtol": 1e-11, "atol": 1e-12}
    )
    ours = study.simulate()
    plant = study.plant().driven({"u": lambda t: 2 * np.sin(3 * t)})
    for method, options in [("DOP853", {}), ("Radau", {"jac": plant.jac})]:
        theirs = integrate.solve_ivp(
            plant.rhs, (0, 10), plant.start, method, ours.t, rtol=1e-10, atol=1e-12, **options
        )
        for row, name in zip(theirs.y, plant.system.states, strict=True):
            assert deviation(row, ours[name]) < 1e-7


def test_what_is_missing_or_unknown_is_named() -> None:
    plant = Study.load(EXAMPLES / "lee/classical.toml").plant()
    with pytest.raises(InputError, match="the input 'u' is missing"):
        plant.driven()
    with pytest.raises(InputError, match="no input is called 'v': expected u"):
        plant.driven({"u": 1.0, "v": 2.0})
    with pytest.raises(InputError, match=r"x: expected 4 values .* found 1"):
        plant.f(0.0, [1.0], [0.0])
    with pytest.raises(ValueError, match="language: expected"):
        plant.source("fortran")


def test_a_filter_is_no_flow() -> None:
    observer = Study(EXAMPLES / "lee/lee.mo", measured=["y1", "y2"], observer="ekf").observer()
    assert observer.is_filter
    for refused in (observer.to_nlsys, observer.driven):
        with pytest.raises(RefusedError, match=r"'ekf'.*expected one of .*block-triangular.*estimator\(\)"):
            refused()


def test_a_loop_is_refused_with_its_unknowns() -> None:
    model = Model.from_modelica("""
        model Loop
          Real x(start = 1, min = 0, max = 2);
          Real a(start = 0);
          output Real y = x;
        equation
          der(x) = -a;
          a + exp(a) = x;
        end Loop;""")
    plant = model.functions()
    assert np.isfinite(plant.f(0.0, [1.0])).all()
    with pytest.raises(RefusedError, match="algebraic loop for a cannot be printed"):
        plant.source()


def entries(found: Any, expected: Any) -> float:
    """Largest error of an entry against its own size."""
    found, expected = np.asarray(found, float).ravel(), np.asarray(expected, float).ravel()
    return max(deviation([one], [other]) for one, other in zip(found, expected, strict=True))


WORDS = """
    model Words
      Real lambda(start = 1);
      Real x(start = 2);
      Real t(start = 3);
      Real xp[2](each start = 0.5);
      Real 'import os; os.abort()'(start = 1);
      Real v1(start = 0.3);
      output Real y = if x < lambda or t > 2 then sign(x) else 1;
      output Real z = 'import os; os.abort()';
    equation
      der(lambda) = -2.5e-300*x^3/lambda^2;
      der(x) = (-x)^2 - (lambda - (x - t)) - (-(lambda*t));
      der(t) = atan2(x, t) + min(x, 1) - max(t, floor(x)) + abs(x)^0.5;
      der(xp) = {-xp[1], tanh(xp[2]) + asin(xp[1]) + 1e22 + time};
      der(v1) = exp(sin(x)) + log(x^2 + 1) - cos(t)*tan(t/9) + acos(xp[1])/atan(x)
        - sinh(t/9)*cosh(t/9)*sqrt(x^2 + v1) + (if x <= 2 then 1e-7 else -v1)^(-3) + sqrt(x^2 + v1);
      der('import os; os.abort()') = if not x > 1 and t > 0 then 1 else 1/'import os; os.abort()';
    end Words;"""


def test_every_name_and_operation_is_printed() -> None:
    plant = Model.from_modelica(WORDS).functions()
    jax = pytest.importorskip("jax")
    namespaces = [("python", np), ("python", jax.numpy), ("casadi", pytest.importorskip("casadi"))]
    for language, xp in namespaces:
        module: dict[str, Any] = {}
        exec(plant.source(language), module)
        for t, x, u in points(plant):
            assert entries(module["f"](xp, t, x, u), plant.f(t, x, u)) < 1e-14
            assert entries(module["h"](xp, t, x, u), plant.h(t, x, u)) < 1e-14


def test_jax_transforms_what_is_printed() -> None:
    jax = pytest.importorskip("jax")
    plant = Study.load(EXAMPLES / "two-tanks/study.toml").plant()
    f = plant.to_jax().f
    many = np.linspace(1, 3, 8).reshape(4, 2)
    batched = jax.jit(jax.vmap(f, in_axes=(None, 0, None)))(0.0, many, np.array([3.0]))
    for row, x in zip(batched, many, strict=True):
        assert deviation(row, plant.f(0.0, x, [3.0])) < 1e-14
    slope = jax.grad(lambda x: f(0.0, x, np.array([3.0]))[0])(many[0])
    assert deviation(slope, plant.jacobian_x(0.0, many[0], [3.0])[0]) < 1e-14


CIRCUIT = """
connector Pin
  Real v;
  flow Real i;
end Pin;
model Resistor
  Pin p; Pin n; parameter Real R = 2;
equation
  p.v - n.v = R*p.i; p.i + n.i = 0;
end Resistor;
model Capacitor
  Pin p; Pin n; parameter Real C = 0.5;
  Real v(start = 1, fixed = true, min = -5, max = 5);
equation
  v = p.v - n.v; C*der(v) = p.i; p.i + n.i = 0;
end Capacitor;
model Ground
  Pin p;
equation
  p.v = 0;
end Ground;
model Source
  Pin p; Pin n; Real e;
equation
  p.v - n.v = e; p.i + n.i = 0;
end Source;
model Circuit
  input Real u;
  output Real y = c.v;
  Source s; Resistor r; Capacitor c; Ground g;
equation
  s.e = u;
  connect(s.p, r.p); connect(r.n, c.p); connect(c.n, g.p); connect(s.n, g.p);
end Circuit;
"""


def test_connectors_are_flattened_where_rumoca_is_installed(tmp_path: Path) -> None:
    pytest.importorskip("rumoca")
    path = tmp_path / "circuit.mo"
    path.write_text(CIRCUIT)
    model = Model.load(path, "Circuit")
    assert model.name.endswith("(flattened by rumoca)")
    plant = model.functions()
    assert plant.states == ["c.v"]
    # C v' = (u - v)/R
    assert deviation(plant.f(0.0, [1.0], [3.0]), [2.0]) < 1e-15
    control = pytest.importorskip("control")
    assert plant.to_nlsys("circuit").state_labels == ["c_v"]
    assert isinstance(control.linearize(plant.to_nlsys("circuit"), [0.0], [0.0]), control.StateSpace)


def test_a_text_that_no_one_reads_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "wrong.mo"
    path.write_text("model Wrong\n  Real x;\nequation\n  der(x) = y;\nend Wrong;\n")
    pytest.importorskip("rumoca")
    with pytest.warns(UserWarning, match="wrong.mo: rumoca does not flatten it"):
        model = Model.load(path)
    with pytest.raises(InputError, match="wrong.mo:4"):
        model.functions()


def test_a_text_of_our_own_is_left_alone() -> None:
    path = EXAMPLES / "lee/lee.mo"
    assert Model.load(path).text == path.read_text()


TANK = """
    model Tank
      input Real inflow(min = 0, max = 5);
      input Real leak(min = 0, max = 1);
      Real level(start = 3, min = 0.1, max = 10);
      output Real y = level;
    equation
      der(level) = inflow - 0.5*sqrt(level) - leak;
    end Tank;"""


class Structure(dict[str, Any]):
    """Names of a structure of do-mpc."""

    def __init__(self, *names: str) -> None:
        super().__init__({name: np.zeros(1) for name in names})

    def __getitem__(self, name: str) -> Any:
        return SimpleNamespace(numel=lambda: 1)


def in_a_loop(study: Study, levels: Sequence[float], inflows: Sequence[float]) -> list[list[float]]:
    """States after each call; an inflow is applied from its level to the next."""
    from lynkeus.mpc import Estimator

    names = SimpleNamespace(y=Structure("y"), u=Structure("inflow"), x=Structure("level", "leak"))
    estimator = Estimator(study, names, 0.5)
    before = [inflows[0], *inflows]  # what had been applied before the first call is of no use
    return [estimator.make_step([y], [u]).ravel().tolist() for y, u in zip(levels, before)]


@pytest.mark.parametrize("observer", [{"theta": 0.5}, "ekf"])
def test_an_input_counts_from_the_sample_before(observer: Any) -> None:
    noise = {"noise": {"y": 0.1}, "process_noise": {"leak": 1e-3}}
    study = Study(Model.from_modelica(TANK), unknown=["leak"], observer=observer, **noise)
    levels = 3 + 0.3 * np.sin(0.7 * np.arange(12))
    inflows = np.where(np.arange(12) % 3 == 0, 4.0, 0.2)  # switches
    run = study.estimate({"t": 0.5 * np.arange(12), "y": levels, "inflow": inflows})
    found = np.array(in_a_loop(study, levels.tolist(), inflows.tolist()))
    assert deviation(found[:, 0], run["level_hat"]) < 1e-9
    assert deviation(found[:, 1], run["leak_hat"]) < 1e-9


def test_time_goes_on_after_a_sample_that_is_refused() -> None:
    from lynkeus.mpc import Estimator

    study = Study(Model.from_modelica(TANK), unknown=["leak"], observer={"theta": 3.0})
    names = SimpleNamespace(y=Structure("y"), u=Structure("inflow"), x=Structure("level", "leak"))
    estimator = Estimator(study, names, 0.5)
    estimator.make_step([3.0], [1.0])
    before = estimator.x0
    with pytest.raises(InputError, match="y0: expected a value for each of y, found 2 values"):
        estimator.make_step([3.0, 4.0], [1.0])
    assert estimator.x0.tolist() == before.tolist()
    estimator.make_step([3.1], [1.0])
    assert estimator._estimator.time == 1.0


def test_a_loop_of_do_mpc_takes_the_estimates() -> None:
    do_mpc = pytest.importorskip("do_mpc")
    casadi = pytest.importorskip("casadi")
    from lynkeus.mpc import Estimator

    model = do_mpc.model.Model("continuous")
    height = model.set_variable("_x", "height")
    leak = model.set_variable("_x", "leak")
    inflow = model.set_variable("_u", "inflow")
    model.set_rhs("height", inflow - 0.5 * casadi.sqrt(height) - leak)
    model.set_rhs("leak", casadi.SX(0))
    model.set_meas("y", height)
    model.setup()
    plant = do_mpc.simulator.Simulator(model)
    plant.set_param(t_step=0.05)
    plant.setup()
    plant.x0 = np.array([4.0, 0.3])
    study = Study(Model.from_modelica(TANK), unknown=["leak"], observer={"theta": 3.0})
    with pytest.raises(InputError, match="the state 'height' has no counterpart"):
        Estimator(study, model, 0.05)
    estimator = Estimator(study, model, 0.05, names={"height": "level"})
    level = 4.0
    for _ in range(200):
        x = estimator.make_step(level, [1.4])
        level = plant.make_step(np.array([[1.4]])).item()
    assert x.shape == (2, 1)
    # the last step of a level at rest changes it by less
    assert deviation(x, [level, 0.3]) < 1e-3
