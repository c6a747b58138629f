"""A plant that is two Python functions, as a Modelica text."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

import numpy as np

from . import modelica
from ._arrays import Named, TracedArray
from ._declare import Entry, check_distinct, entries, literal
from ._place import defined, raised, refusal, tables
from .errors import InputError, TraceError
from .trace import Expr, Graph, Value, number_of

_Function = Callable[..., Any]
_Scalar = Value | float
_SIGNATURES = "(t, x), (t, x, u) or (t, x, u, p)"


@dataclass(frozen=True)
class Declared:
    """What the functions are given."""

    states: list[Entry]
    inputs: list[Entry]
    params: list[Entry]

    def all(self) -> list[Entry]:
        return [*self.states, *self.inputs, *self.params]


@dataclass(frozen=True)
class Output:
    """An output with the expressions of its elements."""

    entry: Entry
    values: list[_Scalar]


class Tracing:
    """The variables of a plant as symbols, for functions to be called with."""

    def __init__(self, declared: Declared) -> None:
        self.graph = Graph()
        self.time = self.graph.symbol("time")
        self.symbols = {entry.name: self._symbols(entry) for entry in declared.all()}
        self._vectors = [
            Named(role, {entry.name: self.symbols[entry.name] for entry in entries})
            for role, entries in (
                ("state", declared.states),
                ("input", declared.inputs),
                ("parameter", declared.params),
            )
        ]

    def elements(self, name: str) -> list[_Scalar]:
        """The symbols of a variable, row by row."""
        symbols = self.symbols[name]
        return [symbols] if isinstance(symbols, Value) else list(np.asarray(symbols).ravel())

    def _symbols(self, entry: Entry) -> Any:
        symbols = [self.graph.symbol(name) for name in entry.elements()]
        if not entry.shape:
            return symbols[0]
        array = np.empty(entry.size, dtype=object)
        array[:] = symbols
        array.flags.writeable = False
        return array.reshape(entry.shape).view(TracedArray)

    def call(self, function: _Function, role: str) -> Any:
        """What a function gives for the symbols."""
        arguments = (self.time, *self._vectors)[: _arity(function, role)]
        try:
            return function(*arguments)
        except TraceError:
            raise
        except Exception as error:
            message = f"{role} raised {type(error).__name__}: {error}"
            raise refusal(message, raised(error) or defined(function), tables(error)) from error


def _arity(function: Any, role: str) -> int:
    """How many of t, x, u and p a function takes."""
    if not callable(function):
        raise InputError(f"{role}: expected a function {_SIGNATURES}, found {function!r}")
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # one that is not written in Python
        return 4
    by_place = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    if any(p.kind is inspect.Parameter.VAR_POSITIONAL for p in parameters):
        return 4
    taken = [p for p in parameters if p.kind in by_place]
    required = [p for p in taken if p.default is inspect.Parameter.empty]
    named = [p for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY and p.default is p.empty]
    if len(taken) < 2 or len(required) > 4 or named:
        found = f"({', '.join(map(str, parameters))})"
        raise refusal(f"{role}: expected arguments {_SIGNATURES}, found {found}", defined(function))
    # one with a default of its own is the function's, None waits for what is given
    given = [*taken[:2], *takewhile(lambda p: p.default in (p.empty, None), taken[2:4])]
    return len(given)


class Result:
    """What a function returned, in order: lists, tuples, arrays, or a dictionary by name."""

    def __init__(self, graph: Graph, function: _Function, role: str, what: str) -> None:
        self._graph = graph
        self._place = defined(function)
        self._role = role
        self._what = what

    def matched(self, returned: Any, declared: Sequence[Entry]) -> list[list[_Scalar]]:
        """The elements of each variable that is declared."""
        if isinstance(returned, Mapping):
            return self._by_name(returned, declared)
        found = [self._element(x, place) for place, x in enumerate(self._flat(returned))]
        size = sum(entry.size for entry in declared)
        names = ", ".join(entry.name for entry in declared)
        if len(found) != size:
            plural = "" if len(found) == 1 else "s"
            message = f"{self._role} returns {len(found)} {self._what}{plural}, expected {size}: {names}"
            raise self._wrong(message)
        rest = iter(found)
        return [[next(rest) for _ in range(entry.size)] for entry in declared]

    def names(self, returned: Any) -> list[str]:
        """Names for what was returned, where the caller declares none."""
        if isinstance(returned, Mapping):
            return list(returned)
        size = len(list(self._flat(returned)))
        return ["y"] if size == 1 else [f"y{i + 1}" for i in range(size)]

    def _by_name(self, returned: Mapping[Any, Any], declared: Sequence[Entry]) -> list[list[_Scalar]]:
        known = {entry.name: entry for entry in declared}
        names = ", ".join(known)
        for name in returned:
            if name not in known:
                raise self._wrong(f"{self._role} returns a {self._what} of {name!r}: there is {names}")
        for name in known:
            if name not in returned:
                raise self._wrong(f"{self._role} returns no {self._what} of `{name}`")
        found = []
        for name, entry in known.items():
            elements = [self._element(x, name) for x in self._flat(returned[name])]
            if len(elements) != entry.size:
                message = f"{self._role} returns {len(elements)} numbers for `{name}`, expected {entry.size}"
                raise self._wrong(message)
            found.append(elements)
        return found

    def _flat(self, returned: Any) -> Iterator[Any]:
        if isinstance(returned, (list, tuple)):
            for part in returned:
                yield from self._flat(part)
        elif isinstance(returned, Value) or not hasattr(returned, "__array__"):
            yield returned
        else:
            yield from np.asarray(returned, dtype=object).ravel()

    def _element(self, given: Any, place: int | str) -> _Scalar:
        which = f"{self._what} {place + 1}" if isinstance(place, int) else f"{self._what} of `{place}`"
        if isinstance(given, Value):
            # a condition counts as 1 and 0, and a value of another call is refused
            is_ours = given.graph is self._graph and isinstance(given, Expr)
            return given if is_ours else self._graph.node("+", given, -0.0)
        if given is None:
            raise self._wrong(f"{self._role} returns None as {which}: is a `return` missing?")
        try:
            number = number_of(given)
        except TypeError:
            expected = "expected a traced value or a number; return a list, a tuple, an array or a dictionary"
            raise self._wrong(f"{self._role} returns {type(given).__name__} as {which}: {expected}") from None
        if not np.isfinite(number):
            raise self._wrong(f"{self._role} returns {number} as {which}: expected a finite number")
        return number

    def _wrong(self, message: str) -> TraceError:
        return refusal(message, self._place)


def text(
    f: _Function,
    h: _Function | None,
    *,
    states: Any,
    inputs: Any,
    outputs: Any,
    params: Any,
    name: str,
    description: str | None,
) -> str:
    """The plant x' = f(t, x, u, p), y = h(t, x, u, p) in Modelica."""
    declared = Declared(entries("states", states), entries("inputs", inputs), entries("params", params))
    check_distinct(declared.all())
    if not declared.states:
        raise InputError("states: expected at least one name")
    tracing = Tracing(declared)
    reader = Result(tracing.graph, f, "f", "derivative")
    derivatives = reader.matched(tracing.call(f, "f"), declared.states)
    _check_order(f, tracing, declared.states, derivatives)
    wanted = None if outputs is None else entries("outputs", outputs)
    found = _outputs(tracing, h, wanted, declared.states)
    check_distinct(output.entry for output in found)
    visible = {o.entry.name for o in found if _is_state(tracing, o, declared.states)}
    other = [output for output in found if output.entry.name not in visible]
    check_distinct([*declared.all(), *(output.entry for output in other)])
    return _Printer(declared, derivatives, other, visible).text(name, description)


def _check_order(f: _Function, tracing: Tracing, states: list[Entry], derivatives: list[list[_Scalar]]) -> None:
    """Refuses a function that was given the time where it expects the state."""
    used: set[Value] = set()
    rest = [x for values in derivatives for x in values if isinstance(x, Value)]
    while rest:
        value = rest.pop()
        if value not in used:
            used.add(value)
            rest += value.arguments
    own = {x for state in states for x in tracing.elements(state.name)}
    if tracing.time not in used or own & used:
        return
    message = "f uses the time and no state: expected arguments in the order " + _SIGNATURES
    hint = "write `lambda t, x: f(x, t)` around a function with another order"
    given = _names(f)
    if given[0].lower().startswith(("t", "_")):  # what is meant, then
        return
    raise refusal(f"{message}, found ({', '.join(given)})", defined(f), hint)


def _names(function: _Function) -> list[str]:
    try:
        return list(inspect.signature(function).parameters)
    except (TypeError, ValueError):  # one that is not written in Python
        return ["t"]


def _outputs(
    tracing: Tracing, h: _Function | None, declared: list[Entry] | None, states: list[Entry]
) -> list[Output]:
    """The outputs with their expressions; without ``h`` they are states."""
    if h is None:
        chosen = declared if declared is not None else [Entry("outputs", state.name) for state in states]
        for entry in chosen:
            if entry.name not in {state.name for state in states}:
                raise InputError(f"outputs: without h each is a state, and there is no state `{entry.name}`")
        return [Output(entry, tracing.elements(entry.name)) for entry in chosen]
    returned = tracing.call(h, "h")
    reader = Result(tracing.graph, h, "h", "output")
    if declared is None:
        declared = entries("outputs", reader.names(returned))
    matched = reader.matched(returned, declared)
    return [Output(entry, values) for entry, values in zip(declared, matched, strict=True)]


def _is_state(tracing: Tracing, output: Output, states: list[Entry]) -> bool:
    """True for a state that is an output under its own name."""
    name, attributes = output.entry.name, output.entry.attributes
    if name not in {state.name for state in states}:
        return False
    itself = tracing.elements(name)
    if len(output.values) != len(itself) or any(
        a is not b for a, b in zip(output.values, itself, strict=True)
    ):
        raise InputError(f"outputs: `{name}` is a state, and h returns something else under its name")
    if attributes:
        raise InputError(f"outputs: `{name}` is a state: `{next(iter(attributes))}` is said in states")
    return True


class _Printer:
    """The parts of the text. ``visible`` are states that are outputs as well."""

    def __init__(
        self,
        declared: Declared,
        derivatives: list[list[_Scalar]],
        outputs: list[Output],
        visible: set[str],
    ) -> None:
        self._declared = declared
        self._outputs = outputs
        self._visible = visible
        self._taken = {entry.name for entry in (*declared.all(), *(output.entry for output in outputs))}
        roots = [x for values in derivatives for x in values] + [
            x for output in outputs for x in output.values
        ]
        self._texts, self._shared = modelica.expressions(roots, self._taken)

    def text(self, name: str, description: str | None) -> str:
        while name in self._taken:
            name += "_"
        heading = f"model {modelica.name(name)}"
        lines = [heading if description is None else f"{heading} {modelica.text(description)}"]
        plant = self._declared
        lines += [e.written("parameter ", literal(e.attributes["value"])) for e in plant.params]
        lines += [e.written("input ") for e in plant.inputs]
        lines += [e.written("output " if e.name in self._visible else "") for e in plant.states]
        rest = iter(self._texts)
        names = [element for state in plant.states for element in state.elements()]
        equations = [f"  der({element}) = {next(rest)};" for element in names]
        for output in self._outputs:
            lines.append(output.entry.written("output ", _nested(output.entry.shape, rest)))
        lines += [f"  {shared};" for shared in self._shared]
        return "\n".join([*lines, "equation", *equations, f"end {modelica.name(name)};"]) + "\n"


def _nested(shape: tuple[int, ...], texts: Iterator[str]) -> str:
    """Texts as an array of a shape."""
    if not shape:
        return next(texts)
    return "{" + ", ".join(_nested(shape[1:], texts) for _ in range(shape[0])) + "}"


def model_name(f: _Function, given: str | None) -> str:
    """A name for the model: that of the function, where none is given."""
    name = given if given is not None else getattr(f, "__name__", "Model")
    if given is None and not name.isidentifier():
        return "Model"
    if not name or not name.isprintable() or set("'\\[].") & set(name):
        raise InputError(f"name: expected a name of letters, digits and `_`, found {name!r}")
    return name
