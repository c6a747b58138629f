"""Every operation of traced values, against Python's and NumPy's own."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import lynkeus as ly
import numpy as np
import pytest
from plants import derivatives, traced

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
    "what is known of conditions": lambda x, y: (
        ly.where(~((x > 0) | np.True_), 1, 2) + ly.where(~((x > 0) & (1 < 0)), 3, 4)
    ),
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


def _drawn(draw: random.Random, leaves: list[Any], depth: int) -> Any:
    """A random expression of operations that Python and the engine round alike."""
    if depth == 0 or draw.random() < 0.1:
        return draw.choice(leaves)
    a, b, c, d = (_drawn(draw, leaves, depth - 1 - draw.randrange(2) * (depth > 1)) for _ in range(4))
    kind = draw.randrange(12)
    match kind:
        case 0 | 1:
            return a + b
        case 2 | 3:
            return a - b
        case 4 | 5:
            return a * b
        case 6:
            return a / ly.maximum(ly.abs(b), 0.125)
        case 7:
            return -a
        case 8:
            return ly.minimum(a, b) - ly.abs(c)
        case 9:
            return a * a if isinstance(a, float) else a**2
        case 10:
            return ly.where(~((a < b) & (c >= d) | (b > d)), a, c)
        case _:
            return (a >= b) * c


def test_random_expressions_are_equal_to_the_last_bit() -> None:
    count = 400

    def h(t: Any, x: Any) -> Any:
        draw = random.Random(1)
        return [_drawn(draw, [x[0], x[1], t, -2.5, 3.0, 0.1, x[0]], 4) for _ in range(count)]

    model = traced(lambda t, x: [0, 0], ["a", "b"], h=h, outputs={"z": {"size": count}})
    functions = model.functions()
    for t, a, b in [(0.3, 1.7, -0.6), (2.0, -1.25, -3.5), (1.0, 0.0, 1e-3)]:
        wanted = np.array(h(np.float64(t), np.array([a, b])), dtype=float)
        np.testing.assert_array_equal(functions.h(t, [a, b]), wanted)


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
    "tables": lambda x: (
        np.interp(x, [0, 1, 2.5], [0, 3, 1])
        + ly.interp(x, np.array([0.0, 2]), x[:2])
        + ly.interp([x[0], 1, 9], [0, 2], [5, 3])
    ),
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
