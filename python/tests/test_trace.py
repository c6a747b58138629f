"""Plants that are Python functions: equal to the Modelica ones, and what they refuse."""

from __future__ import annotations

import math
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lynkeus as ly
import numpy as np
import pytest
from plants import PLANTS, traced

EXAMPLES = Path(__file__).parents[2] / "examples"


def from_examples(name: str) -> ly.Model:
    title = "".join(word.capitalize() for word in name.split("/")[1].split("_"))
    return ly.Model.from_function(**PLANTS[name], name=title)


def derivatives(model: ly.Model, x: Any, t: float = 0.0, u: Any = ()) -> np.ndarray[Any, Any]:
    return model.functions().f(t, x, u)


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
    "germani-manes/germani_manes": "germani-manes/practical.toml",
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


# every operation, against Python's own


X, Y = 0.4, -1.7
SCALARS: dict[str, Callable[[Any, Any], Any]] = {
    "signs": lambda x, y: -(-x) - -y + (-x) * y - (+x),
    "sums": lambda x, y: x - (y - (x - 2)) - (x + y) + 3,
    "products": lambda x, y: x / (y / x) / (x * y) * (y / 3) * -2,
    "powers": lambda x, y: x**2 - y**3 + x**-2 + (-x) ** 2 - (x**2) ** 1.5 + x ** (2**y) + 2**x,
    "a sign before a power": lambda x, y: -(x**2) + (-x) ** 3 * (-y) ** 2,
    "sign of quotients": lambda x, y: -x / -y / -3 + 1 / -x - -2 / y,
    "numbers": lambda x, y: x * 0.1 + 1e-300 + 1e22 * x - 123456789.123456789 + x / 3e-7 - 1e15,
    "whole numbers": lambda x, y: (2**62) * x + 7 * y - (10**30) * x,
    "reflected": lambda x, y: 2 - x + 2 / x + 2 * x + 2 + x,
    "numbers of NumPy": lambda x, y: (
        np.float64(2) * x + np.int32(3) - x * np.float32(0.5) + np.array(1.5) * y
    ),
    "functions": lambda x, y: (
        ly.sin(x) * ly.cos(y) + ly.tan(x) + ly.exp(y) * ly.log(x) - ly.log10(x) + ly.sqrt(x)
    ),
    "inverse functions": lambda x, y: ly.asin(x) + ly.acos(x) * ly.atan(y) + ly.atan2(x, y) + ly.atan2(y, x),
    "hyperbolic functions": lambda x, y: ly.sinh(x) * ly.cosh(y) - ly.tanh(x * y),
    "corners": lambda x, y: ly.abs(y) + ly.sign(y) * ly.minimum(x, y) - ly.maximum(x, 0) + abs(x * y),
    "whole parts": lambda x, y: ly.floor(10 * x) + ly.ceil(y) * math.floor(y) + math.ceil(x),
    "of NumPy": lambda x, y: np.square(x) + np.hypot(x, y) + np.radians(y) - np.degrees(x) + np.reciprocal(y),
    "more of NumPy": lambda x, y: (
        np.arctan2(y, x) + np.clip(y, -1, x) + np.fmax(x, y) + np.power(x, 2) + np.fabs(y)
    ),
    "where": lambda x, y: ly.where(x > y, x, y) + 2 * ly.where((x < 0) | (y < 0) & ~(x == y), 1, x),
    "all relations": lambda x, y: sum(
        ly.where(c, 2.0**i, 0)
        for i, c in enumerate([x < y, x <= y, x > y, x >= y, x == y, x != y, 0 < x, x >= x, x == 0.4])
    ),
    "conditions as numbers": lambda x, y: (x > y) * 3 + x * (y > x) - (x > 0),
    "conditions with known ones": lambda x, y: (
        ly.where((x > 0) & True, 1, 2) + ly.where((x > 0) | np.True_, 1, 2)
    ),
    "numbers as conditions": lambda x, y: np.where(x, 1, 2) + np.where(0, x, y) + ly.where(True, x, y),
    "logical functions": lambda x, y: ly.where(np.logical_and(x > y, np.logical_not(y > 0)), 3, x),
    "tables": lambda x, y: (
        ly.interp(x, [0, 0.3, 1], [1, 5, 2])
        + np.interp(y, [-1, 2], [3, 4])
        + ly.interp(9 * x, [0, 1], [0, 7])
    ),
    "signed zeros": lambda x, y: np.arctan2(0 * x * -0.0, y) * x + np.arctan2(-0.0, y) + np.arctan2(0.0, y),
}


@pytest.mark.parametrize("name", SCALARS)
def test_scalars_mean_what_python_means(name: str) -> None:
    function = SCALARS[name]
    for a, b in [(X, Y), (1.25, 0.0), (0.4, 0.4)]:
        if name not in ("where", "all relations", "corners") and (a, b) != (X, Y):
            continue
        expected = function(np.float64(a), np.float64(b))
        found = derivatives(traced(lambda t, x: [function(*x), 0], ["a", "b"]), [a, b])[0]
        assert found == pytest.approx(float(expected), rel=1e-14, abs=1e-15)


M = np.array([[0.0, 2, 0], [1, 0, -1], [0.5, 0, 3]])
ARRAYS: dict[str, Callable[[Any], Any]] = {
    "products": lambda x: (
        M @ x + x @ M + np.dot(M, x) + np.matmul(M, x) + np.inner(M, x) + np.tensordot(M, x, 1)
    ),
    "einsum": lambda x: np.einsum("ij,j->i", M, x) + np.outer(x, x) @ [1, 0, 2] + np.cross(x, [1, 2, 3]),
    "sums": lambda x: x * np.sum(x) + np.mean(x) + np.prod(x) + sum(x) + x.sum() + np.cumsum(x) + x.dot(x),
    "shapes": lambda x: (
        np.concatenate([x[1:], x[:1]]) + np.roll(x, 1) + x[[2, 0, 1]] + np.hstack([x[0], x[-2:]])
    ),
    "stacks": lambda x: np.stack([x, 2 * x])[1] + np.vstack([x, x]).T[:, 0] + np.flip(x) + np.tile(x[:1], 3),
    "like": lambda x: np.zeros_like(x) + np.ones_like(x) * x + np.full(3, 2.0) - np.polyval([1, 2, 3], x),
    "extremes": lambda x: (
        x * np.max(x) + np.min(x) + x.max() - np.maximum(x, [0.1, 0.2, 5]) + np.clip(x, 0.0, None)
    ),
    "where": lambda x: (
        np.where(x > 1, x, -x) + ly.where(x < [1, 2, 3], np.sqrt(x), 0) + np.select([x > 2, x > 1], [x, 1.0])
    ),
    "lists": lambda x: ly.sin([x[0], 1.0, x[2]]) + ly.maximum([0, 1, 2], [x[0], x[1], 0.5]) + np.array([*x]),
    "tables": lambda x: np.interp(x, [0, 1, 2.5], [0, 3, 1]) + ly.interp(x, np.array([0.0, 2]), x[:2]),
    "norms": lambda x: x / np.linalg.norm(x) + np.sqrt(x @ x) + np.diff(x).sum() + np.exp(-np.array([*x])),
    "comparisons": lambda x: ly.where(np.stack([x[2], x[0], 1]) > 1, x, np.stack([x[0], 2, 3]) * 2),
    "masks": lambda x: x * (x > 1) + np.any(x > 2) + np.all(x > 0) + np.logical_or.reduce(x > 2),
    "many dimensions": lambda x: (x.reshape(3, 1) * x[None, :]).max(axis=0) + np.sum(np.outer(x, x), axis=1),
    "in place": lambda x: _in_place(x.copy()),
}


def _in_place(x: Any) -> Any:
    x += 1
    x[0] = x[1] * 2
    x *= x
    return x


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_mean_what_numpy_means(name: str) -> None:
    function = ARRAYS[name]
    at = np.array([0.7, 1.1, 2.3])
    found = derivatives(traced(lambda t, x: function(x), {"x": {"size": 3}}), at)
    np.testing.assert_allclose(found, function(at), rtol=1e-14)


def test_functions_of_numbers_are_numpys() -> None:
    assert ly.sin(0.5) == math.sin(0.5)
    np.testing.assert_array_equal(ly.atan2([1, 2], 3), np.arctan2([1, 2], 3))
    np.testing.assert_array_equal(ly.where([True, False], 1, 2), [1, 2])
    assert ly.interp(0.5, [0, 1], [2, 4]) == 3


def test_zeros_of_a_matrix_are_no_terms() -> None:
    matrix = np.array([[0, 1], [-2, 0.0]])
    for f in (
        lambda t, x: matrix @ x,
        lambda t, x: matrix @ np.array([x.a, x.b]),
        lambda t, x: np.dot(matrix, [*x]),
    ):
        model = traced(f, ["a", "b"])
        assert "der(a) = b;" in model.text
        assert "der(b) = -2*a;" in model.text


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
