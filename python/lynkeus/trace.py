"""Values that record what is done with them: the expressions of a plant that is a Python function.

Every distinct expression is there once, in one :class:`Graph` per tracing, so that what a function
computes once is printed once, and equal expressions are the same object.
"""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

import numpy as np

from ._place import here, refusal
from .errors import TraceError

RELATIONS = frozenset({"<", "<=", ">", ">=", "==", "<>"})
_CONDITIONS = RELATIONS | {"and", "or", "not"}

_NO_IF = (
    "write `lynkeus.where(condition, a, b)` in place of `if`, `lynkeus.maximum` and `lynkeus.minimum` in"
    " place of `max` and `min`, `&`, `|` and `~` in place of `and`, `or` and `not`; an array that is compared"
    " is made by `np.stack`, not by `np.array`"
)
_NO_NUMBER = (
    "write `lynkeus.sin` in place of `math.sin`, and so on; what has traced values in it is a list, or an"
    " array with `dtype=object`"
)


class Graph:
    """The expressions of one tracing: arguments stand before what is made of them."""

    def __init__(self) -> None:
        self.size = 0
        self._known: dict[tuple[Any, ...], Value] = {}

    def symbol(self, name: str) -> Expr:
        """The variable that Modelica knows by ``name``."""
        value = self._value("symbol", (), name)
        assert isinstance(value, Expr)
        return value

    def number(self, value: float) -> Value:
        """A constant; numbers that are not finite are refused."""
        if not math.isfinite(value):
            hint = "find the operation that made it, or bound the argument"
            raise refusal(f"{value} in an equation: expected a finite number", here(), hint)
        return self._value("number", (), float(value).hex())

    def node(self, op: str, *given: Any) -> Value:
        """An operation on values and numbers."""
        conditions = len(given) if op in ("and", "or", "not") else op == "if"
        return self._value(op, tuple(self._argument(x, i < conditions) for i, x in enumerate(given)))

    def _argument(self, given: Any, logical: bool) -> Value:
        if not isinstance(given, Value):
            return self.number(number_of(given))
        if given.graph is not self:
            message = "a traced value of another call is used here"
            raise refusal(message, here(), "do not keep traced values outside of the function")
        if logical and isinstance(given, Expr):
            return self.node("<>", given, 0)
        if not logical and isinstance(given, Condition):
            return self.node("if", given, 1, 0)
        return given

    def _value(self, op: str, arguments: tuple[Value, ...], data: str = "") -> Value:
        key = (op, data, *(a.place for a in arguments))
        found = self._known.get(key)
        if found is None:
            kind = Condition if op in _CONDITIONS else Expr
            found = self._known[key] = kind(self, op, arguments, data)
        return found


def number_of(given: Any) -> float:
    """A number as a float. ``TypeError`` where it is none."""
    if isinstance(given, np.ndarray) and given.ndim == 0:
        given = given.item()
    if isinstance(given, (Real, np.bool_)):
        return float(given)
    raise TypeError(f"expected a number or a traced value, found {type(given).__name__}")


def _is_number(given: Any) -> bool:
    return isinstance(given, (Real, np.bool_)) or (isinstance(given, np.ndarray) and given.ndim == 0)


def apply(op: str, *given: Any) -> Value:
    """An operation of which at least one argument is traced."""
    graph = next(x.graph for x in given if isinstance(x, Value))
    return graph.node(op, *given)


def _is(given: Any, number: float) -> bool:
    """True for this very number, sign of zero included."""
    return _is_number(given) and float(given).hex() == float(number).hex()


def _nothing(given: Any) -> bool:
    """An integer zero has no sign: it is a term that is not there, as at the start of ``sum``, or a
    product with 0."""
    return isinstance(given, Integral) and given == 0


def arithmetic(op: str, a: Any, b: Any) -> Any:
    """``+ - * / ^`` of two scalars, one of them traced, without operations that change no value. A
    product with the number 0 is 0: zeros of a matrix are terms that are not there."""
    if op == "+":
        if _nothing(a) or _is(a, -0.0):
            return b
        if _nothing(b) or _is(b, -0.0):
            return a
    elif op == "*":
        if any(_is(x, zero) for x in (a, b) for zero in (0.0, -0.0)):
            return 0
        if _is(a, 1.0):
            return b
        if _is(a, -1.0):
            return -b
    if (op == "-" and _is(b, 0.0)) or (op in ("*", "/", "^") and _is(b, 1.0)):
        return a
    if op in ("*", "/") and _is(b, -1.0):
        return -a
    if op == "/" and _is_number(b) and float(b) == 0.0:
        raise refusal("a traced value is divided by zero", here())
    return apply(op, a, b)


class Value:
    """What expressions and conditions have in common. Equal ones are the same object."""

    __slots__ = ("arguments", "data", "graph", "op", "place")

    def __init__(self, graph: Graph, op: str, arguments: tuple[Value, ...], data: str) -> None:
        self.graph: Graph = graph
        self.op: str = op
        self.arguments: tuple[Value, ...] = arguments
        self.data: str = data
        self.place: int = graph.size
        graph.size += 1

    def __hash__(self) -> int:
        return self.place

    def __repr__(self) -> str:
        from .modelica import shown

        return f"<traced {shown(self)}>"

    def __copy__(self) -> Value:
        return self

    def __deepcopy__(self, memo: Any) -> Value:
        return self

    def __reduce__(self) -> Any:
        raise refusal("a traced value cannot leave its function", here())

    def conjugate(self) -> Value:
        """Itself: every value is real."""
        return self

    # NumPy

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        from ._arrays import carried_out

        return carried_out(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        from ._arrays import called

        return called(function, given, options)

    # arithmetic

    def __add__(self, other: Any) -> Any:
        return _infix("+", self, other)

    def __radd__(self, other: Any) -> Any:
        return _infix("+", other, self)

    def __sub__(self, other: Any) -> Any:
        return _infix("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _infix("-", other, self)

    def __mul__(self, other: Any) -> Any:
        return _infix("*", self, other)

    def __rmul__(self, other: Any) -> Any:
        return _infix("*", other, self)

    def __truediv__(self, other: Any) -> Any:
        return _infix("/", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _infix("/", other, self)

    def __pow__(self, other: Any) -> Any:
        return _infix("^", self, other)

    def __rpow__(self, other: Any) -> Any:
        return _infix("^", other, self)

    def __neg__(self) -> Any:
        return self.arguments[0] if self.op == "neg" else apply("neg", self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return apply("abs", self)

    def __floor__(self) -> Any:
        return apply("floor", self)

    def __ceil__(self) -> Any:
        return apply("ceil", self)

    # comparisons

    def __lt__(self, other: Any) -> Any:
        return _infix("<", self, other)

    def __le__(self, other: Any) -> Any:
        return _infix("<=", self, other)

    def __gt__(self, other: Any) -> Any:
        return _infix(">", self, other)

    def __ge__(self, other: Any) -> Any:
        return _infix(">=", self, other)

    def __eq__(self, other: Any) -> Any:
        return _infix("==", self, other)

    def __ne__(self, other: Any) -> Any:
        return _infix("<>", self, other)

    # what needs a number

    def __bool__(self) -> bool:
        message = "whether a traced value is true is not known while equations are recorded"
        raise refusal(message, here(), _NO_IF)

    def _no_number(self) -> TraceError:
        return refusal("a traced value is no number while equations are recorded", here(), _NO_NUMBER)

    def __float__(self) -> float:
        raise self._no_number()

    def __int__(self) -> int:
        raise self._no_number()

    def __complex__(self) -> complex:
        raise self._no_number()

    def __index__(self) -> int:
        raise self._no_number()

    def _no_rest(self) -> Any:
        hint = "write `lynkeus.floor(a/b)` for the quotient, `a - b*lynkeus.floor(a/b)` for the rest"
        raise refusal("`//`, `%`, `divmod`, `round` and `trunc` of a traced value", here(), hint)

    def __floordiv__(self, other: Any) -> Any:
        return self._no_rest()

    def __rfloordiv__(self, other: Any) -> Any:
        return self._no_rest()

    def __mod__(self, other: Any) -> Any:
        return self._no_rest()

    def __rmod__(self, other: Any) -> Any:
        return self._no_rest()

    def __divmod__(self, other: Any) -> Any:
        return self._no_rest()

    def __rdivmod__(self, other: Any) -> Any:
        return self._no_rest()

    def __round__(self, digits: Any = None) -> Any:
        return self._no_rest()

    def __trunc__(self) -> Any:
        return self._no_rest()


def _infix(op: str, a: Any, b: Any) -> Any:
    if not all(isinstance(x, Value) or _is_number(x) for x in (a, b)):
        return NotImplemented
    if op in RELATIONS:
        return apply(op, a, b)
    return arithmetic(op, a, b)


class Expr(Value):
    """A traced number."""

    __slots__ = ()

    def _no_condition(self) -> Any:
        raise refusal("`&`, `|`, `^` and `~` join conditions", here(), "compare: `x > 0`; a power is `x**2`")

    def __and__(self, other: Any) -> Any:
        return self._no_condition()

    def __rand__(self, other: Any) -> Any:
        return self._no_condition()

    def __or__(self, other: Any) -> Any:
        return self._no_condition()

    def __ror__(self, other: Any) -> Any:
        return self._no_condition()

    def __xor__(self, other: Any) -> Any:
        return self._no_condition()

    def __rxor__(self, other: Any) -> Any:
        return self._no_condition()

    def __invert__(self) -> Any:
        return self._no_condition()


class Condition(Value):
    """A traced comparison, or several of them joined by ``&``, ``|`` and ``~``."""

    __slots__ = ()

    def __and__(self, other: Any) -> Any:
        return both(self, other)

    def __rand__(self, other: Any) -> Any:
        return both(self, other)

    def __or__(self, other: Any) -> Any:
        return either(self, other)

    def __ror__(self, other: Any) -> Any:
        return either(self, other)

    def __invert__(self) -> Any:
        return neither(self)


def both(a: Any, b: Any) -> Any:
    """True where two conditions hold. A known result is a truth of NumPy's: ``~True`` is -2."""
    for x, other in ((a, b), (b, a)):
        if _is_number(x):
            return other if x else np.False_
    return apply("and", a, b)


def either(a: Any, b: Any) -> Any:
    """True where one of two conditions holds."""
    for x, other in ((a, b), (b, a)):
        if _is_number(x):
            return np.True_ if x else other
    return apply("or", a, b)


def neither(a: Any) -> Any:
    """True where a condition does not hold."""
    return apply("not", a)


def select(condition: Any, a: Any, b: Any) -> Any:
    """``a`` where the condition holds, else ``b``."""
    if _is_number(condition):
        return a if condition else b
    return apply("if", condition, a, b)
