"""Formulas of SBML and PEtab, and the same in Modelica."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ._optional import needed
from .errors import InputError

#: words that Modelica has for itself, and names that Lynkeus' subset reads as functions
TAKEN = frozenset(
    """algorithm and annotation assert block break class connect connector constant constrainedby der discrete each
    else elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for
    function if import impure in initial inner input loop model not operator or outer output package parameter
    partial protected public pure record redeclare replaceable return stream then true type when while within time
    Real Integer Boolean String sqrt exp log log10 sin cos tan asin acos atan atan2 sinh cosh tanh abs sign min max
    floor ceil integer mod rem div noEvent smooth sum product size ndims zeros ones fill linspace identity diagonal
    transpose cat scalar vector matrix array pre edge change reinit sample terminal delay cardinality homotopy
    semiLinear cross skew symmetric outerProduct String pi""".split()
)

#: names of functions of MathML that Modelica has under the same or another name
_SAME = {
    "ln": "log", "exp": "exp", "sin": "sin", "cos": "cos", "tan": "tan", "arcsin": "asin", "arccos": "acos",
    "arctan": "atan", "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "abs": "abs", "floor": "floor",
    "ceiling": "ceil", "ceil": "ceil", "sqrt": "sqrt", "log10": "log10", "asin": "asin", "acos": "acos",
    "atan": "atan", "sign": "sign", "min": "min", "max": "max", "rem": "mod",
}
#: those that are one over another
_INVERSE = {"sec": "cos", "csc": "sin", "cot": "tan", "sech": "cosh", "csch": "sinh", "coth": "tanh"}
_RELATIONS = {"lt": "<", "leq": "<=", "gt": ">", "geq": ">=", "eq": "==", "neq": "<>"}


@dataclass(frozen=True)
class Expr:
    """An operation on others, a number or a name."""

    #: "number", "symbol", "time", "call", "if", an operator or a relation
    op: str
    args: tuple[Expr, ...] = ()
    #: of a number, a symbol or a call
    value: Any = None

    def symbols(self) -> Iterator[str]:
        """The names in it, each as often as it is there."""
        if self.op == "symbol":
            yield self.value
        for arg in self.args:
            yield from arg.symbols()

    def has_time(self) -> bool:
        """Whether time is in it."""
        return self.op == "time" or any(arg.has_time() for arg in self.args)

    def changed(self, change: Callable[[Expr], Expr | None]) -> Expr:
        """The same with what ``change`` has another one for, from the outside inwards."""
        other = change(self)
        if other is not None:
            return other
        if not self.args:
            return self
        return Expr(self.op, tuple(arg.changed(change) for arg in self.args), self.value)

    def put(self, values: Mapping[str, Expr]) -> Expr:
        """The same with others in the place of names."""
        return self.changed(lambda e: values.get(e.value) if e.op == "symbol" else None) if values else self


def number(value: float) -> Expr:
    """A number."""
    return Expr("number", (), float(value))


def symbol(name: str) -> Expr:
    """A name."""
    return Expr("symbol", (), name)


def call(function: str, *args: Expr) -> Expr:
    """A function of others, by its name in Modelica."""
    return Expr("call", args, function)


def total(terms: list[Expr]) -> Expr:
    """A sum."""
    if not terms:
        return number(0.0)
    found = terms[0]
    for term in terms[1:]:
        found = Expr("+", (found, term))
    return found


def times(a: Expr, b: Expr) -> Expr:
    """A product, without factors of 1."""
    for one, other in ((a, b), (b, a)):
        if one.op == "number" and one.value == 1.0:
            return other
    return Expr("*", (a, b))


def over(a: Expr, b: Expr) -> Expr:
    """A quotient, without a divisor of 1."""
    return a if b.op == "number" and b.value == 1.0 else Expr("/", (a, b))


class Reader:
    """Reads syntax trees of libSBML. ``place`` is what messages call the formula."""

    def __init__(self, place: str, functions: Mapping[str, tuple[list[str], Expr]] | None = None) -> None:
        self.place = place
        self.functions = functions or {}
        self.sbml = needed("libsbml", "lynkeus.petab")

    def refused(self, what: str) -> InputError:
        return InputError(f"{self.place}: {what}")

    def read(self, node: Any) -> Expr:
        """The tree as an expression.

        Raises
        ------
        InputError
            Something that Lynkeus has no equations for.
        """
        if node is None:
            raise self.refused("expected a formula, found none")
        if node.isNumber():
            return number(node.getValue())
        kind, sbml = node.getType(), self.sbml
        if kind in (sbml.AST_CONSTANT_E, sbml.AST_CONSTANT_PI):
            return number(math.e if kind == sbml.AST_CONSTANT_E else math.pi)
        if kind == sbml.AST_NAME_AVOGADRO:
            return number(6.02214179e23)
        if kind == sbml.AST_NAME_TIME:
            return Expr("time")
        if kind in (sbml.AST_CONSTANT_TRUE, sbml.AST_CONSTANT_FALSE):
            return Expr("true" if kind == sbml.AST_CONSTANT_TRUE else "false")
        if kind == sbml.AST_NAME:
            return symbol(node.getName())
        args = [self.read(node.getChild(i)) for i in range(node.getNumChildren())]
        return self.operation(node, args)

    def operation(self, node: Any, args: list[Expr]) -> Expr:
        kind, sbml = node.getType(), self.sbml
        if kind == sbml.AST_PLUS:
            return total(args)
        if kind == sbml.AST_MINUS:
            return Expr("neg", (args[0],)) if len(args) == 1 else Expr("-", tuple(args))
        if kind == sbml.AST_TIMES:
            found = args[0] if args else number(1.0)
            for arg in args[1:]:
                found = Expr("*", (found, arg))
            return found
        if kind == sbml.AST_DIVIDE:
            return Expr("/", tuple(args))
        if kind in (sbml.AST_POWER, sbml.AST_FUNCTION_POWER):
            return Expr("^", tuple(args))
        if kind == sbml.AST_FUNCTION_PIECEWISE:
            return self.pieces(args)
        if kind == sbml.AST_FUNCTION_DELAY:
            raise self.refused("a delay, which no equation of a plant has")
        name = node.getName() or ""
        if kind == sbml.AST_FUNCTION:
            return self.defined(name, args)
        return self.named(name, args)

    def pieces(self, args: list[Expr]) -> Expr:
        pairs = list(zip(args[0::2], args[1::2], strict=False))
        if len(args) % 2:
            found = args[-1]
        else:
            # nothing is said of what is otherwise
            found, pairs = pairs[-1][0], pairs[:-1]
        for value, condition in reversed(pairs):
            found = Expr("if", (truth(condition), value, found))
        return found

    def defined(self, name: str, args: list[Expr]) -> Expr:
        """A function that the model defines, written out."""
        if name not in self.functions:
            return self.named(name, args)
        names, body = self.functions[name]
        if len(names) != len(args):
            raise self.refused(f"the function {name} takes {len(names)} arguments, found {len(args)}")
        return body.put(dict(zip(names, args, strict=True)))

    def named(self, name: str, args: list[Expr]) -> Expr:
        if name in _RELATIONS and len(args) == 2:
            return Expr(_RELATIONS[name], tuple(args))
        if name in ("and", "or"):
            found = truth(args[0])
            for arg in args[1:]:
                found = Expr(name, (found, truth(arg)))
            return found
        if name == "not":
            return Expr("not", (truth(args[0]),))
        if name == "xor" and len(args) == 2:
            a, b = truth(args[0]), truth(args[1])
            return Expr("or", (Expr("and", (a, Expr("not", (b,)))), Expr("and", (Expr("not", (a,)), b))))
        if name == "log":
            # MathML: by base 10 unless a base is given before it
            if len(args) == 1:
                return call("log10", args[0])
            if args[0].op == "number" and args[0].value == 10:
                return call("log10", args[1])
            return Expr("/", (call("log", args[1]), call("log", args[0])))
        if name == "log2":
            return Expr("/", (call("log", args[0]), number(math.log(2.0))))
        if name == "root":
            degree, of = args if len(args) == 2 else (number(2.0), args[0])
            if degree.op == "number" and degree.value == 2:
                return call("sqrt", of)
            return Expr("^", (of, Expr("/", (number(1.0), degree))))
        if name in _INVERSE:
            return Expr("/", (number(1.0), call(_INVERSE[name], *args)))
        if name in ("min", "max"):
            found = args[0]
            for arg in args[1:]:
                found = call(name, found, arg)
            return found
        if name in _SAME:
            return call(_SAME[name], *args)
        raise self.refused(f'the function "{name}", which Lynkeus\' equations do not have')


def truth(e: Expr) -> Expr:
    """What is read as a condition: a number is true where it is not 0."""
    return e if is_truth(e) else Expr("<>", (e, number(0.0)))


def is_truth(e: Expr) -> bool:
    """Whether it is true or false rather than a number."""
    return e.op in ("<", "<=", ">", ">=", "==", "<>", "and", "or", "not", "true", "false")


def parsed(text: str | float, place: str) -> Expr:
    """A formula of PEtab, in which ``log`` is the natural logarithm.

    Raises
    ------
    InputError
        It is no formula, or has what Lynkeus' equations do not have.
    """
    sbml = needed("libsbml", "lynkeus.petab")
    settings = sbml.L3ParserSettings()
    settings.setParseLog(sbml.L3P_PARSE_LOG_AS_LN)
    settings.setParseUnits(False)
    settings.setParseAvogadroCsymbol(False)
    settings.setComparisonCaseSensitivity(sbml.L3P_COMPARE_BUILTINS_CASE_SENSITIVE)
    node = sbml.parseL3FormulaWithSettings(str(text), settings)
    if node is None:
        why = (sbml.getLastParseL3Error() or "").strip()
        raise InputError(f'{place}: expected a formula, found "{text}"\n{why}')
    return Reader(place).read(node)


_RANK = {"or": 1, "and": 2, "+": 5, "-": 5, "*": 6, "/": 6, "^": 8}


def modelica(e: Expr, quoted: Callable[[str], str]) -> str:
    """The same in Modelica; ``quoted`` gives a name as Modelica writes it."""
    return _written(e, quoted, 0)


def _written(e: Expr, quoted: Callable[[str], str], around: int) -> str:
    def inner(arg: Expr, rank: int) -> str:
        # a truth among numbers is 0 or 1
        if is_truth(arg) and e.op not in ("and", "or", "not", "if"):
            arg = Expr("if", (arg, number(1.0), number(0.0)))
        return _written(arg, quoted, rank)

    match e.op:
        case "number":
            text = spelled(e.value)
            return f"({text})" if text.startswith("-") and around > 0 else text
        case "symbol":
            return quoted(e.value)
        case "time" | "true" | "false":
            return e.op
        case "call":
            return f"{e.value}({', '.join(inner(arg, 0) for arg in e.args)})"
        case "if":
            condition, then, other = e.args
            text = f"if {inner(condition, 0)} then {_numeric(then, quoted)} else {_numeric(other, quoted)}"
            return f"({text})" if around > 0 else text
        case "neg":
            return f"(-{inner(e.args[0], 7)})"
        case "not":
            return f"(not ({inner(e.args[0], 0)}))"
        case "<" | "<=" | ">" | ">=" | "==" | "<>":
            text = f"{inner(e.args[0], 5)} {e.op} {inner(e.args[1], 5)}"
            return f"({text})" if around > 0 else text
    rank = _RANK[e.op]
    # what stands to the right of - and / keeps its parentheses, and so does everything beside ^
    left = inner(e.args[0], rank + 1 if e.op == "^" else rank)
    right = inner(e.args[1], rank if e.op in ("and", "or") else rank + 1)
    text = f"{left} {e.op} {right}" if rank < 6 else f"{left}{e.op}{right}"
    return f"({text})" if rank < around else text


def _numeric(e: Expr, quoted: Callable[[str], str]) -> str:
    if is_truth(e):
        e = Expr("if", (e, number(1.0), number(0.0)))
    return _written(e, quoted, 1)


def spelled(value: float) -> str:
    """A number as Modelica and TOML write it, without loss."""
    if not math.isfinite(value):
        raise InputError(f"expected a finite number in a formula, found {value}")
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


_RELATED: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "<>": lambda a, b: a != b,
}
_COMPUTED: dict[str, Callable[..., float]] = {
    "log": math.log, "log10": math.log10, "exp": math.exp, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos,
    "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan, "sinh": math.sinh,
    "cosh": math.cosh, "tanh": math.tanh, "abs": math.fabs, "floor": math.floor, "ceil": math.ceil, "min": min,
    "max": max, "mod": lambda a, b: a - math.floor(a / b) * b, "sign": lambda a: float((a > 0) - (a < 0)),
}


def computed(e: Expr, values: Mapping[str, float], t: float = 0.0) -> float:
    """The value of an expression of known names.

    Raises
    ------
    KeyError
        A name that is not known.
    ArithmeticError, ValueError
        There is no value.
    """
    match e.op:
        case "number":
            return float(e.value)
        case "symbol":
            return values[e.value]
        case "time":
            return t
        case "true" | "false":
            return float(e.op == "true")
        case "if":
            return computed(e.args[1] if computed(e.args[0], values, t) else e.args[2], values, t)
    args = [computed(arg, values, t) for arg in e.args]
    if e.op in _RELATED:
        return float(_RELATED[e.op](*args))
    match e.op:
        case "call":
            return float(_COMPUTED[e.value](*args))
        case "+":
            return args[0] + args[1]
        case "-":
            return args[0] - args[1]
        case "*":
            return args[0] * args[1]
        case "/":
            return args[0] / args[1]
        case "^":
            return float(args[0] ** args[1])
        case "neg":
            return -args[0]
        case "and":
            return float(bool(args[0]) and bool(args[1]))
        case "or":
            return float(bool(args[0]) or bool(args[1]))
    return float(not args[0])
