"""Arguments of another kind are refused by name, with what was expected and what was found."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tank_study import MODEL, SIMULATE, TEXT, log, tank

import lynkeus
import lynkeus.mpc
import lynkeus.ray
import lynkeus.spark

#: one of each kind; what an argument takes of them it takes
KINDS: dict[str, Any] = {
    "int": 3,
    "negative": -2,
    "float": 1.5,
    "nan": math.nan,
    "huge": 10**400,
    "bool": True,
    "complex": 1j,
    "text": "x",
    "bytes": b"x",
    "None": None,
    "list": [3],
    "empty list": [],
    "dict": {},
    "array": np.zeros(3),
    "empty array": np.zeros(0),
    "number of NumPy": np.int64(-2),
    "truth of NumPy": np.bool_(True),
    "object": object(),
}

STUDY = tank(simulate=SIMULATE, tune={"keys": {"theta": [1.0, 2.0]}}, compare=["triangular"], noise={"y": 0.1})
RUN = STUDY.simulate()
PLANT = STUDY.plant()
DRIVEN = PLANT.driven({"inflow": 1.0})
LOG = lynkeus.Log.from_columns([("t", np.zeros(2))])
LIMITS: dict[str, Any] = {"time_limit": None, "memory_limit": 2048.0}
BATCH: dict[str, Any] = {"keep": None, "workers": None, "errors": "raise", "progress": False, **LIMITS}
SECTIONS = inspect.signature(lynkeus.Study).parameters
FLEET: dict[str, Any] = {"study": STUDY, "by": "asset", "time": None}
CAMPAIGN: dict[str, Any] = {"study": STUDY, "keep": dict, "errors": "raise", "blocks": None}

#: of each function arguments that it takes
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Study": (lynkeus.Study, {"model": MODEL, **dict.fromkeys(list(SECTIONS)[1:])}),
    "Study.load": (lynkeus.Study.load, {"path": "nowhere.toml", "model": None}),
    "Study.parse": (lynkeus.Study.parse, {"text": "", "model": MODEL, "file": "s"}),
    "Study.replace": (STUDY.replace, {"plant": MODEL, "model": None, "observer": {}, "noise": {}, "sensors": {}}),
    "Study.check": (STUDY.check, {"parameters": False, "about": (), **LIMITS}),
    "Study.design": (STUDY.design, LIMITS),
    "Study.certify": (STUDY.certify, LIMITS),
    "Study.how_well": (STUDY.how_well, {"horizon": None, "sensors": None, **LIMITS}),
    "Study.simulate": (STUDY.simulate, {"inputs": None, "runs": None, "progress": False, **LIMITS}),
    "Study.estimate": (STUDY.estimate, {"log": log(), "record": False, "progress": False, **LIMITS}),
    "Study.estimate_each": (STUDY.estimate_each, {"logs": [log()], "by": None, **BATCH}),
    "Study.sweep": (STUDY.sweep, {"changes": [{}], "log": None, **BATCH}),
    "Study.tune": (STUDY.tune, {"log": None, "progress": False, **LIMITS}),
    "Study.fit": (STUDY.replace(fit={"noise": True}).fit, {"logs": log(), "profiles": False, "next_experiment": False, "progress": False, **LIMITS}),
    "Study.likelihood": (STUDY.replace(fit={"noise": True}).likelihood, {"logs": log(), **LIMITS}),
    "Study.compare": (STUDY.compare, {"log": None, "progress": False, **LIMITS}),
    "Study.plant": (STUDY.plant, {}),
    "Study.observer": (STUDY.observer, LIMITS),
    "Study.estimator": (STUDY.estimator, {"wait": 0.0}),
    "Study.export": (
        STUDY.export,
        {
            "folder": "made",
            "to": "js",
            "precision": "f64",
            "step": None,
            "tunable": False,
            "fmi": "3",
            "system": None,
            "force": True,
            **LIMITS,
        },
    ),
    "Model": (lynkeus.Model, {"text": TEXT, "name": "m.mo", "choose": None}),
    "Model.load": (lynkeus.Model.load, {"path": "nowhere.mo", "choose": None}),
    "Model.from_modelica": (lynkeus.Model.from_modelica, {"text": TEXT, "choose": None}),
    "Model.from_function": (
        lynkeus.Model.from_function,
        {
            "f": lambda t, x: [-x[0]],
            "h": None,
            "states": ["x"],
            "inputs": (),
            "outputs": None,
            "params": (),
            "name": "m",
            "description": None,
        },
    ),
    "Model.functions": (MODEL.functions, {"parameters": None}),
    **{f"Functions.{name}": (getattr(PLANT, name), {"t": 0.0, "x": [1.0], "u": [1.0]}) for name in ("f", "h", "jacobian_x")},
    "Functions.source": (PLANT.source, {"language": "python"}),
    "Functions.driven": (PLANT.driven, {"inputs": {"inflow": 1.0}}),
    "an input": (lambda inflow: PLANT.driven({"inflow": inflow}), {"inflow": 1.0}),
    "what an input gives": (lambda inflow: PLANT.driven({"inflow": lambda t: inflow}).u(0.0), {"inflow": 1.0}),
    "Driven.u": (DRIVEN.u, {"t": 0.0}),
    **{f"Driven.{name}": (getattr(DRIVEN, name), {"t": 0.0, "x": [1.0]}) for name in ("rhs", "jac", "outputs")},
    "Estimator.predict": (lambda t: STUDY.estimator().predict(t), {"t": 0.0}),
    "Estimator.update": (
        lambda t, readings: STUDY.estimator().update(t, readings),
        {"t": 0.0, "readings": {"y": 1.0}},
    ),
    "a reading": (lambda y: STUDY.estimator().update(0.0, {"y": y}), {"y": 1.0}),
    "Estimator.push": (lambda t, signals: STUDY.estimator().push(t, signals), {"t": 0.0, "signals": [1.0]}),
    "Estimator.restore": (
        lambda snapshot: STUDY.estimator().restore(snapshot),
        {"snapshot": STUDY.estimator().snapshot()},
    ),
    "Log.load": (lynkeus.Log.load, {"path": "nowhere.csv"}),
    "Log.from_columns": (lynkeus.Log.from_columns, {"columns": []}),
    "Log.from_arrow": (lynkeus.Log.from_arrow, {"table": None}),
    **{f"Log.{name}": (getattr(LOG, name), {"name": "t"}) for name in ("column", "values", "refusal", "origin")},
    **{name: (getattr(lynkeus, name), {"study": STUDY}) for name in ("check", "design", "certify", "how_well", "simulate")},
    **{name: (getattr(lynkeus, name), {"study": STUDY, "log": log()}) for name in ("estimate", "tune", "compare")},
    "fit": (lynkeus.fit, {"study": STUDY, "logs": log()}),
    **{
        name: (getattr(lynkeus, name), dict.fromkeys(inspect.signature(getattr(lynkeus, name)).parameters, 1.0))
        for name in lynkeus.functions.__all__
        if name != "interp"
    },
    "interp": (lynkeus.interp, {"x": 0.5, "xp": [0.0, 1.0], "fp": [0.0, 1.0]}),
}

#: those that go on to other packages
ELSEWHERE: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "ray.campaign": (lynkeus.ray.campaign, {"seeds": [1], **CAMPAIGN}),
    "ray.sweep": (lynkeus.ray.sweep, {"changes": [{}], **CAMPAIGN}),
    "spark.estimate": (lynkeus.spark.estimate, {"frame": None, "is_partitioned": False, **FLEET}),
    "spark.follow": (lynkeus.spark.follow, {"stream": None, **FLEET}),
    "mpc.Estimator": (lynkeus.mpc.Estimator, {"study": STUDY, "model": None, "t_step": 1.0, "names": None}),
    "Run.plot": (RUN.plot, {"ax": None, "names": None, "truth": None}),
}

#: what is whatever NumPy, matplotlib or Spark make of it
FREE = {("spark.estimate", "frame"), ("spark.follow", "stream"), ("Log.from_columns", "columns")}


def called(function: Callable[..., Any], arguments: dict[str, Any]) -> None:
    try:
        inspect.signature(function).bind(**arguments)
    except TypeError:  # of NumPy's kind: by place
        function(*arguments.values())
    else:
        function(**arguments)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("name", "argument"), [(name, a) for name, (_, given) in CALLS.items() for a in given])
def test_no_kind_is_refused_without_words(name: str, argument: str) -> None:
    function, given = CALLS[name]
    for kind, value in KINDS.items():
        try:
            called(function, {**given, argument: value})
        except lynkeus.LynkeusError as error:
            told = str(error)
            assert not isinstance(error, lynkeus.ArgumentError) or told.count(": expected ") == 1, (kind, told)
            assert "found" in told or kind in ("text", "None", "dict", "list", "empty list", "array", "empty array", "bytes"), (kind, told)
        else:
            assert kind != "object", "what is nothing that anyone takes was taken"


@pytest.mark.parametrize(
    ("name", "argument"),
    [(n, a) for n, (_, given) in {**CALLS, **ELSEWHERE}.items() for a in given if (n, a) not in FREE],
)
def test_what_is_nothing_is_refused_by_name(name: str, argument: str) -> None:
    if name == "Run.plot":
        pytest.importorskip("matplotlib").use("Agg")
    function, given = {**CALLS, **ELSEWHERE}[name]
    with pytest.raises(lynkeus.InputError) as error:
        called(function, {**given, argument: object()})
    told = str(error.value)
    assert argument in told and "expected" in told and "found" in told, told


def test_every_function_is_among_them() -> None:
    for kind in (lynkeus.Study, lynkeus.Model, lynkeus.Functions, lynkeus.Driven):
        public = {name for name, f in inspect.getmembers(kind, callable) if not name.startswith("_")}
        for name in public - {"to_casadi", "to_jax", "to_nlsys"}:
            given = CALLS[f"{kind.__name__}.{name}"][1]
            arguments = inspect.signature(getattr(kind, name)).parameters.values()
            keys = {a.name for a in arguments if a.kind is not a.VAR_KEYWORD} - {"self"}
            assert keys <= given.keys(), (kind, name)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: STUDY.check(about=3), "about: expected a text or a list of texts, found 3"),
        (lambda: STUDY.check(about=["level", 3]), "about[1]: expected a text, found 3"),
        (lambda: STUDY.simulate(runs="3"), "runs: expected a whole number of 64 bits, found '3'"),
        (lambda: STUDY.simulate(runs=True), "runs: expected a whole number of 64 bits, found True"),
        (lambda: STUDY.simulate(progress="yes"), "progress: expected True, False or a function"),
        (lambda: STUDY.design(time_limit="1"), "time_limit: expected seconds >= 0, found '1'"),
        (lambda: STUDY.design(memory_limit=None), "memory_limit: expected MiB >= 0, found None"),
        (lambda: STUDY.export(3), "folder: expected a path, found 3"),
        (lambda: lynkeus.check(3), "study: expected a Study, or the path of one, found 3"),
        (lambda: lynkeus.Study(3), "model: expected a Model, or the path of one, found 3"),
        (lambda: STUDY.replace(plant=3), "plant: expected a Model, or the path of one, found 3"),
        (lambda: PLANT.f("0", [1.0], [1.0]), "t: expected a number, found '0'"),
        (lambda: STUDY.estimator().update(np.zeros(3), {}), "t: expected a number, found ndarray"),
        (lambda: STUDY.estimator().update(0.0, [1.0]), "readings: expected a mapping of names to numbers, found list"),
        (lambda: STUDY.estimator().push(0.0, 1.0), "signals: expected a number for each of y, found 1.0"),
        (lambda: RUN.plot(truth=3), "truth: expected a path, a mapping of columns"),
        (lambda: lynkeus.sin("x"), "x: expected numbers or traced values, found 'x'"),
        (lambda: lynkeus.atan2(1.0, None), "x: expected numbers or traced values, found None"),
    ],
)
def test_the_words(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(lynkeus.ArgumentError) as error:
        call()
    assert str(error.value).startswith(words), str(error.value)
    assert isinstance(error.value, TypeError) and isinstance(error.value, lynkeus.InputError)


def test_a_name_that_a_result_does_not_have() -> None:
    for name in (3, None, [], {}, np.zeros(3), "nix"):
        with pytest.raises(KeyError, match="expected one of t, level"):
            RUN[name]  # type: ignore[index]
        assert name not in RUN
