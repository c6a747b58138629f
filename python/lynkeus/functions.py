"""Functions of numbers, arrays, and traced values alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._arrays import interp, traced, where

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


def sin(x: Any) -> Any:
    """Sine."""
    return np.sin(traced(x))


def cos(x: Any) -> Any:
    """Cosine."""
    return np.cos(traced(x))


def tan(x: Any) -> Any:
    """Tangent."""
    return np.tan(traced(x))


def asin(x: Any) -> Any:
    """Arcsine, from -π/2 to π/2."""
    return np.arcsin(traced(x))


def acos(x: Any) -> Any:
    """Arccosine, from 0 to π."""
    return np.arccos(traced(x))


def atan(x: Any) -> Any:
    """Arctangent, from -π/2 to π/2."""
    return np.arctan(traced(x))


def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y), from -π to π."""
    return np.arctan2(traced(y), traced(x))


def sinh(x: Any) -> Any:
    """Hyperbolic sine."""
    return np.sinh(traced(x))


def cosh(x: Any) -> Any:
    """Hyperbolic cosine."""
    return np.cosh(traced(x))


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return np.tanh(traced(x))


def exp(x: Any) -> Any:
    """Exponential."""
    return np.exp(traced(x))


def log(x: Any) -> Any:
    """Natural logarithm."""
    return np.log(traced(x))


def log10(x: Any) -> Any:
    """Decimal logarithm."""
    return np.log10(traced(x))


def sqrt(x: Any) -> Any:
    """Square root."""
    return np.sqrt(traced(x))


def abs(x: Any) -> Any:
    """Magnitude."""
    return np.absolute(traced(x))


def sign(x: Any) -> Any:
    """-1, 0 or 1."""
    return np.sign(traced(x))


def minimum(a: Any, b: Any) -> Any:
    """The smaller of two, element by element."""
    return np.minimum(traced(a), traced(b))


def maximum(a: Any, b: Any) -> Any:
    """The larger of two, element by element."""
    return np.maximum(traced(a), traced(b))


def floor(x: Any) -> Any:
    """The next whole number below."""
    return np.floor(traced(x))


def ceil(x: Any) -> Any:
    """The next whole number above."""
    return np.ceil(traced(x))
