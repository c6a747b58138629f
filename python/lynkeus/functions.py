"""Functions of numbers, arrays, and traced values alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._arrays import interp as _interp
from ._arrays import traced
from ._arrays import where as _where
from .errors import ArgumentError, InputError
from .trace import Value

__all__ = [
    "abs",
    "acos",
    "asin",
    "atan",
    "atan2",
    "ceil",
    "cos",
    "cosh",
    "exp",
    "floor",
    "interp",
    "log",
    "log10",
    "maximum",
    "minimum",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "where",
]


def _numbers(name: str, given: Any, kinds: str = "fiu") -> Any:
    """Numbers or traced values, which are the same to NumPy's functions; what is not of these
    ``kinds`` of arrays, a truth for example, is made numbers."""
    try:
        found = traced(given)
        if not isinstance(found, np.ndarray) or found.dtype.kind in kinds:
            return found
        if found.dtype.kind == "O":
            if any(isinstance(x, Value) for x in found.flat):
                return found
            is_number = not any(x is None or isinstance(x, (str, bytes)) for x in found.flat)
        else:
            is_number = found.dtype.kind == "b"
        if is_number:
            return np.asarray(found, dtype=float)
    except (TypeError, ValueError, OverflowError):  # rows of unequal length, what is no number
        pass
    raise ArgumentError.of(name, "numbers or traced values", given)


def sin(x: Any) -> Any:
    """Sine."""
    return np.sin(_numbers("x", x))


def cos(x: Any) -> Any:
    """Cosine."""
    return np.cos(_numbers("x", x))


def tan(x: Any) -> Any:
    """Tangent."""
    return np.tan(_numbers("x", x))


def asin(x: Any) -> Any:
    """Arcsine, from -π/2 to π/2."""
    return np.arcsin(_numbers("x", x))


def acos(x: Any) -> Any:
    """Arccosine, from 0 to π."""
    return np.arccos(_numbers("x", x))


def atan(x: Any) -> Any:
    """Arctangent, from -π/2 to π/2."""
    return np.arctan(_numbers("x", x))


def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y), from -π to π."""
    return np.arctan2(_numbers("y", y), _numbers("x", x))


def sinh(x: Any) -> Any:
    """Hyperbolic sine."""
    return np.sinh(_numbers("x", x))


def cosh(x: Any) -> Any:
    """Hyperbolic cosine."""
    return np.cosh(_numbers("x", x))


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return np.tanh(_numbers("x", x))


def exp(x: Any) -> Any:
    """Exponential."""
    return np.exp(_numbers("x", x))


def log(x: Any) -> Any:
    """Natural logarithm."""
    return np.log(_numbers("x", x))


def log10(x: Any) -> Any:
    """Decimal logarithm."""
    return np.log10(_numbers("x", x))


def sqrt(x: Any) -> Any:
    """Square root."""
    return np.sqrt(_numbers("x", x))


def abs(x: Any) -> Any:
    """Magnitude."""
    return np.absolute(_numbers("x", x))


def sign(x: Any) -> Any:
    """-1, 0 or 1."""
    return np.sign(_numbers("x", x))


def minimum(a: Any, b: Any) -> Any:
    """The smaller of two, element by element."""
    return np.minimum(_numbers("a", a), _numbers("b", b))


def maximum(a: Any, b: Any) -> Any:
    """The larger of two, element by element."""
    return np.maximum(_numbers("a", a), _numbers("b", b))


def floor(x: Any) -> Any:
    """The next whole number below."""
    return np.floor(_numbers("x", x))


def ceil(x: Any) -> Any:
    """The next whole number above."""
    return np.ceil(_numbers("x", x))


def where(condition: Any, a: Any, b: Any) -> Any:
    """``a`` where the condition holds, else ``b``; element by element, shapes broadcast."""
    return _where(_numbers("condition", condition, "fiub"), _numbers("a", a), _numbers("b", b))


def interp(x: Any, xp: Any, fp: Any) -> Any:
    """Straight lines through the points ``xp`` (increasing) and ``fp``, outside their first and last
    value, as :func:`numpy.interp`."""
    x, points, values = _numbers("x", x), _numbers("xp", xp), _numbers("fp", fp)
    if all(isinstance(each, np.ndarray) and each.dtype.kind != "O" for each in (x, points, values)):
        for name, given in (("xp", points), ("fp", values)):
            if given.ndim != 1 or not given.size:
                raise ArgumentError.of(name, "a list of at least one number", xp if name == "xp" else fp)
        if len(points) != len(values):
            raise InputError(f"fp: expected as many values as xp has points, {len(points)}, found {len(values)}")
    return _interp(x, points, values)
