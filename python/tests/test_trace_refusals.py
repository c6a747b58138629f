"""What plants that are Python functions refuse: each refusal names the line and what to do."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lynkeus as ly
import numpy as np
import pytest
from plants import traced


def _if(t: Any, x: Any) -> Any:
    return 1 if x[0] > 0 else 2  # refused


def _chained(t: Any, x: Any) -> Any:
    return ly.where(0 < x[0] < 1, 1, 2)  # refused


def _not(t: Any, x: Any) -> Any:
    return ly.where(not x[0] > 1, 1, 2)  # refused


def _max(t: Any, x: Any) -> Any:
    return max(x[0], 0)  # refused


def _array_compared(t: Any, x: Any) -> Any:
    return ly.where(np.array([x[0]]) > 1, 1, 2)  # refused


def _truth(t: Any, x: Any) -> Any:
    while x[0]:  # refused
        pass


def _float(t: Any, x: Any) -> Any:
    return float(x[0])  # refused


def _int(t: Any, x: Any) -> Any:
    return int(x[0])  # refused


def _complex(t: Any, x: Any) -> Any:
    return complex(x[0])  # refused


def _range(t: Any, x: Any) -> Any:
    return [i for i in range(x[0])]  # refused


def _index(t: Any, x: Any) -> Any:
    return [1, 2, 3][x[0]]  # refused


def _math(t: Any, x: Any) -> Any:
    return math.sin(x[0])  # refused


def _array_of_numbers(t: Any, x: Any) -> Any:
    d = np.zeros(1)
    d[0] = x[0]  # refused
    return d


def _in_place_of_numbers(t: Any, x: Any) -> Any:
    d = np.zeros(1)
    d += x  # refused
    return d


def _rest(t: Any, x: Any) -> Any:
    return x[0] % 2  # refused


def _quotient(t: Any, x: Any) -> Any:
    return x[0] // 2  # refused


def _round(t: Any, x: Any) -> Any:
    return round(x[0])  # refused


def _nan(t: Any, x: Any) -> Any:
    return x[0] * math.nan  # refused


def _infinite(t: Any, x: Any) -> Any:
    return ly.minimum(x[0], math.inf)  # refused


def _by_zero(t: Any, x: Any) -> Any:
    return x[0] / 0.0  # refused


def _unknown_ufunc(t: Any, x: Any) -> Any:
    return np.cbrt(x[0])  # refused


def _join(t: Any, x: Any) -> Any:
    return ly.where(x[0] & True, 1, 2)  # refused


def _pickled(t: Any, x: Any) -> Any:
    import pickle

    return pickle.dumps(x[0])  # refused


def _table(t: Any, x: Any) -> Any:
    return ly.interp(x[0], [0, 0, 1], [1, 2, 3])  # refused


def _short_table(t: Any, x: Any) -> Any:
    return ly.interp(x[0], [0, 1], [1, 2, 3])  # refused


def _no_such_name(t: Any, x: Any) -> Any:
    return x["y"]  # refused


def _no_such_attribute(t: Any, x: Any) -> Any:
    return x.y  # refused


def _no_such_place(t: Any, x: Any) -> Any:
    return x[1]  # refused


def _written_to(t: Any, x: Any) -> Any:
    x[0:1][0] = 3  # refused


def _assigned(t: Any, x: Any) -> Any:
    x[0] = 3  # refused


def _raises(t: Any, x: Any) -> Any:
    return 1 / 0  # refused


def _complex_number(t: Any, x: Any) -> Any:
    return x[0] * 1j  # refused


def _text(t: Any, x: Any) -> Any:
    return x[0] + "1"  # refused


def _solve(t: Any, x: Any) -> Any:
    return np.linalg.solve(np.eye(1), x)  # refused


def _too_large(t: Any, x: Any) -> Any:
    return x[0] * 10**400  # refused


REFUSED: dict[Callable[..., Any], str] = {
    _if: "lynkeus.where(condition, a, b)",
    _chained: "`&`",
    _not: "`~`",
    _max: "lynkeus.maximum",
    _array_compared: "`np.stack`",
    _truth: "lynkeus.where",
    _float: "no number",
    _int: "no number",
    _complex: "no number",
    _range: "no number",
    _index: "no number",
    _math: "`lynkeus.sin` in place of `math.sin`",
    _array_of_numbers: "dtype=object",
    _in_place_of_numbers: "dtype=object",
    _rest: "lynkeus.floor",
    _quotient: "lynkeus.floor",
    _round: "lynkeus.floor",
    _nan: "nan in an equation: expected a finite number",
    _infinite: "inf in an equation",
    _by_zero: "divided by zero",
    _unknown_ufunc: "`cbrt` of a traced value",
    _join: "join conditions",
    _pickled: "cannot leave its function",
    _table: "points that increase",
    _short_table: "as many values as points",
    _no_such_name: "no state is called `y`: there is `x`",
    _no_such_attribute: "no state is called `y`: there is `x`",
    _no_such_place: "IndexError",
    _written_to: "read-only",
    _assigned: "TypeError",
    _raises: "f raised ZeroDivisionError: division by zero",
    _complex_number: "TypeError",
    _text: "TypeError",
    _solve: "TypeError",
    _too_large: "OverflowError",
}


@pytest.mark.parametrize("f", REFUSED, ids=lambda f: f.__name__.strip("_"))
def test_a_refusal_names_the_line_and_the_remedy(f: Callable[..., Any]) -> None:
    source = Path(__file__).read_text().splitlines()
    first = f.__code__.co_firstlineno
    line = next(i for i in range(first, len(source)) if "# refused" in source[i - 1])
    with pytest.raises(ly.TraceError) as caught:
        traced(f)
    assert REFUSED[f] in str(caught.value)
    assert caught.value.place == f"{__file__}:{line}"
    assert source[line - 1].strip() in str(caught.value)
    with pytest.raises(ly.TraceError) as caught:
        traced(lambda t, x: 1, h=f)
    assert caught.value.place == f"{__file__}:{line}"


RETURNED: dict[str, tuple[Callable[[Any], Any], str]] = {
    "too few": (lambda x: [x[0]], "f returns 1 derivative, expected 2: a, b"),
    "too many": (lambda x: [*x, 1], "f returns 3 derivatives, expected 2: a, b"),
    "None": (lambda x: None, "`return` missing"),
    "None inside": (lambda x: [x[0], None], "f returns None as derivative 2"),
    "a generator": (lambda x: (v for v in x), "f returns generator as derivative 1"),
    "a set": (lambda x: {1, 2}, "f returns set"),
    "a text": (lambda x: "ab", "f returns str"),
    "nan": (lambda x: [x[0], math.nan], "f returns nan as derivative 2"),
    "inf in an array": (lambda x: np.array([math.inf, 1]), "f returns inf as derivative 1"),
    "complex": (lambda x: [1j, 2], "f returns complex as derivative 1"),
    "one missing": (lambda x: {"a": 1}, "f returns no derivative of `b`"),
    "one unknown": (lambda x: {"a": 1, "c": 1}, "f returns a derivative of 'c': there is a, b"),
    "two for one": (lambda x: {"a": [1, 2], "b": 1}, "f returns 2 numbers for `a`, expected 1"),
}


@pytest.mark.parametrize("name", RETURNED)
def test_what_is_returned_is_checked(name: str) -> None:
    function, message = RETURNED[name]
    with pytest.raises(ly.TraceError) as caught:
        traced(lambda t, x: function(x), ["a", "b"])
    assert message in str(caught.value)
    assert __file__ in str(caught.value.place)


def test_a_traced_value_does_not_outlive_its_call() -> None:
    kept: list[Any] = []

    def keeps(t: Any, x: Any) -> Any:
        kept.append(x[0])
        return x

    traced(keeps)
    with pytest.raises(ly.TraceError, match="another call"):
        traced(lambda t, x: x[0] + kept[0])
    with pytest.raises(ly.TraceError, match="another call"):
        traced(lambda t, x: kept[0])


def test_what_ends_python_is_let_through() -> None:
    def f(t: Any, x: Any) -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        traced(f)


def test_the_cause_of_an_error_is_kept() -> None:
    with pytest.raises(ly.TraceError) as caught:
        traced(_raises)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def _constant(t: Any, x: Any) -> Any:
    return 1


DECLARED: dict[str, tuple[dict[str, Any], str]] = {
    "no states": ({"states": []}, "states: expected at least one name"),
    "a text for names": ({"states": "ab"}, "states: expected a list of names"),
    "a number for names": ({"states": 3}, "states: expected a list of names"),
    "a number among names": ({"states": ["a", 3]}, "states: expected names, found 3"),
    "an empty name": ({"states": [""]}, "is no name"),
    "an element": ({"states": ["x[1]"]}, "with `size`"),
    "a quote": ({"states": ["x'"]}, "is no name"),
    "a line break": ({"states": ["x\n"]}, "is no name"),
    "time": ({"states": ["time"]}, "word of the language"),
    "a long name": ({"states": ["x" * 251]}, "longer than 250"),
    "twice": ({"inputs": ["x"]}, "inputs: `x` is declared already, in states"),
    "twice in states": ({"states": ["x", "x"]}, "states: `x` is declared already"),
    "twice in outputs": (
        {"inputs": ["u"], "outputs": ["u"], "h": _constant},
        "outputs: `u` is declared already",
    ),
    "an unknown key": ({"states": {"x": {"strat": 1}}}, "did you mean `start`?"),
    "a value of a state": ({"states": {"x": {"value": 1}}}, "found `value`"),
    "nan": ({"states": {"x": math.nan}}, "expected a finite number, found nan"),
    "nan as a bound": ({"states": {"x": {"min": math.nan}}}, "states: `x`.min: expected a finite number"),
    "a text for a number": ({"states": {"x": "1"}}, "expected a number"),
    "an array with a gap": ({"states": {"x": [1, math.nan]}}, "expected finite numbers"),
    "no elements": ({"states": {"x": []}}, "expected finite numbers"),
    "unequal rows": ({"params": {"A": [[1, 2], [3]]}}, "expected a number or an array"),
    "a size of none": ({"states": {"x": {"size": 0}}}, "expected a whole number"),
    "a size and another": ({"states": {"x": {"size": 2, "start": [1, 2, 3]}}}, "expected 2 numbers, found 3"),
    "fixed": ({"states": {"x": {"fixed": 1}}}, "expected True or False"),
    "a unit": ({"states": {"x": {"unit": 1}}}, "expected a text"),
    "parameters without value": ({"params": ["k"]}, "'k' has no value"),
    "a parameter without value": ({"params": {"k": {"unit": "s"}}}, "expected a value"),
    "an output that is no state": ({"outputs": ["z"]}, "there is no state `z`"),
    "a number for an output": ({"outputs": {"z": 1}, "h": _constant}, "expected a dictionary"),
    "a state as another output": (
        {"outputs": ["x"], "h": _constant},
        "returns something else under its name",
    ),
    "a unit for a state": ({"outputs": {"x": {"unit": "s"}}}, "is said in states"),
    "a name with a dot": ({"name": "a.b"}, "name: expected"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_declarations_are_checked(name: str) -> None:
    given, message = DECLARED[name]
    with pytest.raises(ly.InputError) as caught:
        traced(_constant, **{"states": ["x"], **given})
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "f", [3, None, "f", lambda: 1, lambda t: 1, lambda t, x, *, k: 1, lambda a, b, c, d, e: 1]
)
def test_what_is_no_plant(f: Any) -> None:
    with pytest.raises(ly.InputError, match="expected"):
        traced(f)
