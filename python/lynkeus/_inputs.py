"""What drives a plant: a log, columns, functions of time, numbers, expressions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, TypeAlias

import numpy as np

from . import _lynkeus, modelica
from ._logs import given, log_of
from ._place import defined, raised, refusal
from .errors import ArgumentError, InputError, TraceError
from .trace import Graph, Value

#: an input as a number, an expression of time in Modelica, or a function of time
Course: TypeAlias = "float | np.floating[Any] | np.integer[Any] | str | Callable[[Any], Any]"
#: by input
Courses: TypeAlias = Mapping[str, Course]


def driven(inputs: Any, time: str | None) -> _lynkeus.Log | str | dict[str, float | str]:
    """The log that drives the plant, or what ``[simulate]`` is to say of its inputs; ``time`` is the header of the
    log's times, where the study says it."""
    if not isinstance(inputs, Mapping):
        return given(inputs, "inputs")
    if any(_is_column(value) for value in inputs.values()):
        return log_of(_sampled(inputs, time), "inputs")
    for name in inputs:
        if not isinstance(name, str):
            raise ArgumentError.of("inputs", "names of inputs", name)
    return {name: _expression(name, value) for name, value in inputs.items()}


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) or (isinstance(value, np.ndarray) and value.ndim == 0)


def _is_column(value: Any) -> bool:
    return not (isinstance(value, str) or callable(value) or _is_number(value))


def _sampled(inputs: Mapping[Any, Any], time: str | None) -> dict[Any, Any]:
    """Columns, with the values of functions at their times."""
    if all(_is_column(value) for value in inputs.values()):
        return dict(inputs)
    header = time or ("time" if "time" in inputs and "t" not in inputs else "t")
    if header not in inputs:
        raise InputError(f"inputs: expected the times of the rows under {header!r} beside columns and functions")
    try:
        times = np.asarray(inputs[header], dtype=np.float64)
    except (TypeError, ValueError):
        times = np.empty((0, 0))
    if times.ndim != 1:
        raise InputError(f"inputs[{header!r}]: functions and numbers beside it need times that are numbers")
    found = {}
    for name, value in inputs.items():
        if isinstance(value, str):
            expected = "a column, a function of time or a number beside other columns"
            raise ArgumentError.of(f"inputs[{name!r}]", expected, value)
        found[name] = value if _is_column(value) else np.array([_at(name, value, t) for t in times.tolist()])
    return found


def _at(name: Any, value: Any, t: float) -> float:
    """An input at a time."""
    found = value(t) if callable(value) else value
    try:
        return float(found)
    except (TypeError, ValueError):
        raise ArgumentError.of(f"inputs[{name!r}]({t})", "a number", found) from None


def _expression(name: str, value: Any) -> float | str:
    """An input as a study has it."""
    if isinstance(value, str):
        return value
    return _traced(name, value) if callable(value) else float(value)


def _traced(name: str, function: Callable[[Any], Any]) -> float | str:
    """A function of time in Modelica."""
    graph = Graph()
    what = f"inputs[{name!r}]"
    try:
        found = function(graph.symbol("time"))
    except TraceError:
        raise
    except Exception as error:
        message = f"{what} raised {type(error).__name__}: {error}"
        raise refusal(message, raised(error) or defined(function)) from error
    if isinstance(found, Value):
        return modelica.whole(graph.node("+", found, -0.0))
    if not _is_number(found):
        raise ArgumentError.of(what, "a function that gives a number", found)
    return float(found)
