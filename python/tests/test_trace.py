"""Plants that are Python functions: equal to the Modelica ones, of linear size, and what they declare."""

from __future__ import annotations

import doctest
import importlib
import math
import re
import time
import tomllib
from pathlib import Path
from typing import Any

import lynkeus as ly
import numpy as np
import pytest
from plants import PLANTS, derivatives, traced

EXAMPLES = Path(__file__).parents[2] / "examples"


def from_examples(name: str) -> ly.Model:
    title = "".join(word.capitalize() for word in name.split("/")[1].split("_"))
    return ly.Model.from_function(**PLANTS[name], name=title)


# equal to the Modelica plants


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_of_the_examples_is_that_of_its_modelica_text(name: str) -> None:
    plant = PLANTS[name]
    ours, text = from_examples(name).functions(), ly.Model.load(EXAMPLES / f"{name}.mo").functions()
    assert (ours.states, ours.inputs) == (text.states, text.inputs)
    np.testing.assert_array_equal(ours.start, text.start)
    bounds = [_bounds(plant["states"], ours.states), _bounds(plant.get("inputs", {}), ours.inputs)]
    draw = np.random.default_rng(len(name))
    for _ in range(300):
        t = draw.uniform(0, 10)
        x, u = (low + (high - low) * draw.random(len(low)) for low, high in bounds)
        _agree(ours.f(t, x, u), text.f(t, x, u))
        _agree(ours.h(t, x, u), text.h(t, x, u))


def _bounds(declared: dict[str, Any], names: list[str]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    found = [declared[name.split("[")[0]] for name in names]
    return np.array([d["min"] for d in found]), np.array([d["max"] for d in found])


def _agree(ours: np.ndarray[Any, Any], text: np.ndarray[Any, Any]) -> None:
    # relative to the vector: where terms cancel, another order of them rounds differently
    assert ours.shape == text.shape
    assert np.abs(ours - text).max() <= 1e-13 * np.abs(text).max()


STUDIES = {
    "two-tanks/two_tanks": "two-tanks/study.toml",
    "column/column": "column/study.toml",
    "cstr/cstr": "cstr/study.toml",
    "quadrotor/quadrotor": "quadrotor/study.toml",
    "lee/lee": "lee/study.toml",
}


@pytest.mark.parametrize(("name", "study"), STUDIES.items())
def test_a_traced_study_runs_as_that_of_the_text(name: str, study: str) -> None:
    path = EXAMPLES / study
    text = ly.Study.load(path)
    sections = {key: part for key, part in tomllib.loads(path.read_text()).items() if key != "plant"}
    ours = ly.Study(from_examples(name), **sections)
    ours_run, text_run = ours.simulate(), text.simulate()
    for column in (f"{state}_hat" for state in text.model.functions().states):
        np.testing.assert_allclose(ours_run[column], text_run[column], rtol=1e-12, atol=0)
    assert _verdicts(ours.check()) == _verdicts(text.check())


def _verdicts(check: ly.Check) -> str:
    """What was decided, without the commands that come next, which name the study's file."""
    return str(check).split("\nnext:")[0]


# size


def test_ten_thousand_shared_values_are_printed_once_each() -> None:
    def repeated(count: int) -> tuple[int, float]:
        def f(t: Any, x: Any) -> Any:
            (a,) = x
            for _ in range(count):
                a = 0.25 * a * a + 0.5
            return a

        before = time.process_time()
        model = traced(f)
        return len(model.text), time.process_time() - before

    (small, _), (large, spent) = repeated(1_000), repeated(10_000)
    assert large < 11.5 * small
    assert large < 10_000 * 60
    assert spent < 5


def test_what_is_shared_and_deep_is_computed_right() -> None:
    def f(t: Any, x: Any) -> Any:
        (a,) = x
        for _ in range(300):
            a = ly.sin(1 + a * (2 - a))
        return a

    expected = 0.3
    for _ in range(300):
        expected = math.sin(1 + expected * (2 - expected))
    assert derivatives(traced(f), [0.3])[0] == pytest.approx(expected, rel=1e-12)


def test_a_long_sum_is_cut_into_parts() -> None:
    model = traced(lambda t, x: sum(x[0] * (i + 0.1) for i in range(5000)))
    assert max(map(len, model.text.splitlines())) < 2500
    assert derivatives(model, [2.0])[0] == pytest.approx(2 * sum(i + 0.1 for i in range(5000)), rel=1e-13)


# names, shapes, declarations


def test_vectors_are_read_by_place_name_and_unpacking() -> None:
    def f(t: Any, x: Any, u: Any, p: Any) -> Any:
        T, *rest = x
        assert x.T is x["T"] is x[0] is T
        assert len(x) == 4 and len(rest) == 3
        assert all(a is b for a, b in zip(x[1:], x.tray, strict=True))
        assert x.shape == (4,)
        (gain,), (a, *_) = u, p
        assert a is p.A[0, 0] and p.A.shape == (2, 2)
        return {"tray": p.A[0, 1] * x.tray, "T": gain * t + p["b 2"] * T}

    model = traced(
        f,
        {"T": 1.0, "tray": {"start": [1, 2, 3], "min": [0, -1, 0], "fixed": True}},
        inputs=["gain"],
        params={"A": [[1, 2], [3, 4.0]], "b 2": 0.5},
    )
    functions = model.functions()
    assert functions.states == ["T", "tray[1]", "tray[2]", "tray[3]"]
    np.testing.assert_array_equal(functions.f(3, [1, 1, 2, 3], [10]), [30.5, 2, 4, 6])
    np.testing.assert_array_equal(
        model.functions({"A[1,2]": 5, "b 2": 1}).f(3, [1, 1, 2, 3], [10]), [31, 5, 10, 15]
    )


def test_declarations_reach_the_text() -> None:
    said = {
        "start": 2,
        "min": 0,
        "max": math.inf,
        "unit": "K",
        "fixed": True,
        "description": 'a "hot" one \\ two',
    }
    model = traced(lambda t, x: -x[0], {"T": said}, name="Plant", description="of one state")
    assert model.name == "Plant.mo"
    assert model.text.startswith('model Plant "of one state"\n')
    wanted = r'output Real T(start = 2, fixed = true, unit = "K", min = 0) "a \"hot\" one \\ two";'
    assert wanted in model.text
    assert derivatives(model, [3.0])[0] == -3


@pytest.mark.parametrize(
    "name", ["end", "sin", "θ", "two words", "Real", "aux1", "aux", "f", "x.y", "min", "pi"]
)
def test_any_name_will_do(name: str) -> None:
    def f(t: Any, x: Any) -> Any:
        shared = ly.sin(x[name] + 2 * t) * ly.minimum(x[name], 3)
        return [shared + shared**2]

    model = traced(f, {name: 0.5}, h=lambda t, x: x[name] + 1)
    v = math.sin(0.5 + 2 * 0.25) * 0.5
    assert model.functions().states == [name]
    assert derivatives(model, [0.5], 0.25)[0] == pytest.approx(v + v**2, rel=1e-14)
    study = ly.Study(
        model,
        measured=["y"],
        observer={"family": "ekf"},
        noise={"y": 0.1},
        simulate={"until": 0.1, "output_step": 0.05},
    )
    assert len(study.simulate()[f"{name}_hat"]) == 3


def test_outputs() -> None:
    def f(t: Any, x: Any) -> Any:
        return -x

    named = ["a", "b"]
    assert traced(f, named).functions().outputs == named
    assert traced(f, named, outputs=["b"]).functions().outputs == ["b"]
    assert traced(f, named, h=lambda t, x: x[0] * 2).functions().outputs == ["y"]
    assert traced(f, named, h=lambda t, x: (x[0] * 2, 1)).functions().outputs == ["y1", "y2"]
    assert traced(f, named, h=lambda t, x: {"z": x.b, "b": x.b}).functions().outputs == ["b", "z"]
    array = traced(
        f, named, h=lambda t, x: np.array([[x.a, 1], [2, x.b]]), outputs={"z": {"size": (2, 2), "unit": "m"}}
    )
    assert array.functions().outputs == ["z[1,1]", "z[1,2]", "z[2,1]", "z[2,2]"]
    np.testing.assert_array_equal(array.functions().h(0, [3, 4]), [3, 1, 2, 4])


class Plant:
    """A function with parameters of its own."""

    def __init__(self, gain: float) -> None:
        self.gain = gain

    def __call__(self, t: Any, x: Any, u: Any = None, p: Any = None) -> Any:
        return self.gain * x

    def method(self, *given: Any) -> Any:
        t, x, *_ = given
        assert len(given) == 4
        return self.gain * x + t


def test_what_may_be_a_function() -> None:
    plant = Plant(3)
    assert derivatives(traced(plant), [2.0])[0] == 6
    assert derivatives(traced(plant.method), [2.0], 0.5)[0] == 6.5
    assert derivatives(traced(lambda t, x, u, p, extra=4: extra * x), [2.0])[0] == 8
    assert derivatives(traced(lambda t, x: 1), [2.0])[0] == 1
    assert derivatives(traced(lambda t, x: x[0] > 1), [2.0])[0] == 1


def test_a_traced_study_travels_as_bytes() -> None:
    import pickle

    model = traced(lambda t, x: -x, {"x": {"start": 1, "min": 0, "max": 2}})
    study = ly.Study(model, simulate={"until": 1, "output_step": 0.5})
    again = pickle.loads(pickle.dumps(study))
    np.testing.assert_array_equal(again.simulate()["x_hat"], study.simulate()["x_hat"])


# documentation


def test_the_examples_of_the_documentation() -> None:
    assert doctest.testmod(importlib.import_module("lynkeus.model")).failed == 0
    section = (EXAMPLES.parent / "docs" / "python.md").read_text().split("## Models from functions")[1]
    blocks = dict(reversed(re.findall(r"```(\w+)\n(.*?)```", section, re.DOTALL)))
    names: dict[str, Any] = {}
    exec(blocks["python"], names)
    assert names["tanks"].text == blocks["modelica"]


def test_a_default_is_the_functions_own() -> None:
    def f(t: Any, x: Any, k: Any = 3.0) -> Any:
        return [-k * x[0]]

    def optional(t: Any, x: Any, u: Any = None) -> Any:
        return [x[0] if u is None else u[0]]

    model = ly.Model.from_function(f, states=["x"], inputs=["v"])
    assert "der(x) = -3" in model.text
    model = ly.Model.from_function(optional, states=["x"], inputs=["v"])
    assert "der(x) = v" in model.text
