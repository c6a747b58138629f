"""Traced expressions as Modelica."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from .trace import RELATIONS, Condition, Value

# how tightly operators bind, loosest first
_IF, _OR, _AND, _NOT, _RELATION, _SUM, _PRODUCT, _POWER, _OPERAND = range(-1, 8)
_LEVEL = {
    "or": _OR,
    "and": _AND,
    **dict.fromkeys(RELATIONS, _RELATION),
    **dict.fromkeys("+-", _SUM),
    **dict.fromkeys("*/", _PRODUCT),
    "^": _POWER,
}
#: A shared expression that is no longer than this is repeated.
_SHORT = 16
#: An expression that is longer than this, or nested more deeply, gets a variable of its own.
_LONG = 1000
_DEEP = 20

_RESERVED = frozenset(
    """algorithm and annotation block break class connect connector constant constrainedby der discrete each
    else elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for
    function if import impure in initial inner input loop model not operator or outer output package parameter
    partial protected public pure record redeclare replaceable return stream then true type when while within
    Real Integer Boolean String Modelica sqrt exp log log10 sin cos tan asin acos atan atan2 sinh cosh tanh abs
    sign min max floor ceil integer mod rem div sum product size ndims zeros ones fill linspace identity
    diagonal transpose cat scalar vector matrix array cross semiLinear homotopy noEvent smooth pre edge change
    sample terminal reinit delay spatialDistribution assert""".split()
)
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


def name(given: str) -> str:
    """A name as Modelica writes it: in quotes unless it is letters, digits and `_`, and no word of the
    language."""
    return given if _PLAIN.match(given) and given not in _RESERVED else f"'{given}'"


def text(given: str) -> str:
    """A string."""
    quoted = given.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{quoted}"'


def number(value: float) -> str:
    """A number to the last bit."""
    if value == int(value) and abs(value) < 2**53 and repr(value) != "-0.0":
        return str(int(value))
    return repr(value)


@dataclass(frozen=True)
class _Piece:
    """A printed expression: how tightly it binds, and how deeply it is nested. Behind the sign of one
    that is ``negative`` stands a product."""

    text: str
    level: int = _OPERAND
    depth: int = 0
    negative: bool = False

    def within(self, least: int) -> str:
        return self.text if self.level >= least else f"({self.text})"


@dataclass(frozen=True)
class Auxiliary:
    """A variable for what several equations share."""

    name: str
    is_condition: bool
    value: str

    def __str__(self) -> str:
        kind = "Boolean" if self.is_condition else "Real"
        return f"{kind} {self.name} = {self.value}"


def expressions(roots: Sequence[Value | float], taken: Iterable[str]) -> tuple[list[str], list[Auxiliary]]:
    """The texts of expressions, and the variables for what they share, each behind those it needs.
    Their names meet none of those that are ``taken``."""
    fresh = _namer(taken)
    uses = _uses(roots)
    at_top = {root.place for root in roots if isinstance(root, Value)}
    pieces: dict[int, _Piece] = {}
    auxiliaries: list[Auxiliary] = []
    for value, count in sorted(uses.items(), key=lambda item: item[0].place):
        piece = _printed(value, [pieces[a.place] for a in value.arguments])
        shared = count > 1 and len(piece.text) > _SHORT
        large = len(piece.text) > _LONG or piece.depth > _DEEP
        if value.arguments and (shared or (large and (count > 1 or value.place not in at_top))):
            auxiliaries.append(Auxiliary(fresh(), isinstance(value, Condition), piece.text))
            piece = _Piece(auxiliaries[-1].name)
        pieces[value.place] = piece
    texts = [pieces[root.place].text if isinstance(root, Value) else number(root) for root in roots]
    return texts, auxiliaries


def whole(root: Value) -> str:
    """An expression as one text, in which what it shares is repeated."""
    pieces: dict[int, _Piece] = {}
    for value in sorted(_uses([root]), key=lambda value: value.place):
        pieces[value.place] = _printed(value, [pieces[a.place] for a in value.arguments])
    return pieces[root.place].text


def shown(value: Value) -> str:
    """An expression for messages: short."""
    texts, auxiliaries = expressions([value], ())
    return texts[0] if len(texts[0]) <= 60 and not auxiliaries else f"{texts[0][:60]}…"


def _namer(taken: Iterable[str]) -> Callable[[], str]:
    stem, known, count = "aux", set(taken), 0
    while any(name.startswith(stem) for name in known):
        stem += "_"

    def fresh() -> str:
        nonlocal count
        count += 1
        return f"{stem}{count}"

    return fresh


def _uses(roots: Sequence[Value | float]) -> dict[Value, int]:
    """How often each expression is written where nothing is shared twice."""
    uses: dict[Value, int] = {}
    pending = [root for root in roots if isinstance(root, Value)]
    while pending:
        value = pending.pop()
        uses[value] = uses.get(value, 0) + 1
        if uses[value] == 1:
            pending.extend(value.arguments)
    return uses


def _printed(value: Value, pieces: list[_Piece]) -> _Piece:
    op = value.op
    inside = 1 + max((piece.depth for piece in pieces), default=-1)
    if op == "symbol":
        return _Piece(value.data)
    if op == "number":
        printed = number(float.fromhex(value.data))
        negative = printed.startswith("-")
        return _Piece(printed, _SUM if negative else _OPERAND, negative=negative)
    if op == "neg":
        return _Piece(f"-{pieces[0].within(_PRODUCT)}", _SUM, inside, negative=True)
    if op == "not":
        return _Piece(f"not {pieces[0].within(_OPERAND)}", _NOT, inside)
    if op == "if":
        condition, a, b = (piece.within(_OR) for piece in pieces)
        return _Piece(f"if {condition} then {a} else {b}", _IF, inside)
    if op in _LEVEL:
        return _infix(op, pieces[0], pieces[1])
    if op == "interpolate":
        half = (len(pieces) + 1) // 2
        points, values = (", ".join(p.text for p in part) for part in (pieces[1:half], pieces[half:]))
        call = f"Modelica.Math.Vectors.interpolate({{{points}}}, {{{values}}}, {pieces[0].text})"
        return _Piece(call, depth=inside)
    return _Piece(f"{op}({', '.join(piece.text for piece in pieces)})", depth=inside)


def _infix(op: str, left: _Piece, right: _Piece) -> _Piece:
    """Chains of one level are read from the left; powers and comparisons have no order of their own."""
    level = _LEVEL[op]
    if level == _PRODUCT and left.negative:
        # (-a)*b is -(a*b) to the last bit
        product = _infix(op, _Piece(left.text[1:], _PRODUCT, left.depth), right)
        return _Piece(f"-{product.text}", _SUM, product.depth, negative=True)
    if level == _SUM and right.negative:
        # a + (-b) is a - b to the last bit
        op = "-" if op == "+" else "+"
        right = _Piece(right.text[1:], _PRODUCT, right.depth)
    chained = op not in RELATIONS and op != "^"
    texts = (left.within(level if chained else level + 1), right.within(level + 1))
    # a chain is no deeper than its first operand
    depth = max(left.depth + (left.level < level or not chained), right.depth + 1)
    return _Piece((f" {op} " if level < _PRODUCT else op).join(texts), level, depth)
