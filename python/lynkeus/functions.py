"""Functions of numbers, arrays, and traced values alike.

Of a number each gives a ``float`` (NumPy's ``float64``, which is one), of an array or a list an array, and
of what is recorded while a plant's equations are traced (:meth:`lynkeus.Model.from_function`) a traced value.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, Protocol, TypeAlias, cast, overload

import numpy as np
from numpy.typing import NDArray

from ._arrays import Named
from ._arrays import interp as _interp
from ._arrays import traced
from ._arrays import where as _where
from ._types import ListOf, Number
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


_Given = ParamSpec("_Given")
#: a traced vector, an array, a list of numbers or of traced values
_Array: TypeAlias = NDArray[Any] | ListOf[Any] | Named
_Scalar: TypeAlias = Number | Value
_Points: TypeAlias = NDArray[Any] | ListOf[Number]
_Any: TypeAlias = _Scalar | _Array


# Numbers come first wherever a wider case follows, which type checkers call an overlap.


class _OfOne(Protocol):
    """A function of one argument, element by element."""

    @overload
    def __call__(self, x: Number) -> float: ...
    @overload
    def __call__(self, x: Value) -> Value: ...
    @overload
    def __call__(self, x: _Array) -> NDArray[Any]: ...


class _OfTwo(Protocol):
    """A function of two arguments, element by element; shapes broadcast."""

    @overload
    def __call__(self, a: Number, b: Number) -> float: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, a: _Scalar, b: _Scalar) -> Value: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, a: _Any, b: _Any) -> NDArray[Any]: ...


class _OfPoint(Protocol):
    """The same of a point."""

    @overload
    def __call__(self, y: Number, x: Number) -> float: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, y: _Scalar, x: _Scalar) -> Value: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, y: _Any, x: _Any) -> NDArray[Any]: ...


class _Where(Protocol):
    """A choice."""

    @overload
    def __call__(self, condition: Number | np.bool_, a: Number, b: Number) -> float: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, condition: _Scalar | np.bool_, a: _Scalar, b: _Scalar) -> Value: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, condition: _Any | np.bool_, a: _Any, b: _Any) -> NDArray[Any]: ...


class _Interp(Protocol):
    """A curve through points."""

    @overload
    def __call__(self, x: Number, xp: _Points, fp: _Points) -> float: ...  # type: ignore[overload-overlap]
    @overload
    def __call__(self, x: _Scalar, xp: _Array, fp: _Array) -> Value: ...
    @overload
    def __call__(self, x: _Array, xp: _Array, fp: _Array) -> NDArray[Any]: ...


def _told(function: Callable[_Given, Any]) -> Callable[_Given, Any]:
    """The same function; a number that it gives is a ``float``, where NumPy's keep the kind of whole and of
    short numbers."""

    @wraps(function)
    def told(*args: _Given.args, **kwargs: _Given.kwargs) -> Any:
        found = function(*args, **kwargs)
        is_number = isinstance(found, (np.generic, np.ndarray)) and found.ndim == 0 and found.dtype.kind in "fiub"
        return np.float64(found) if is_number else found

    return told


def _of_one(function: Callable[[Any], Any]) -> _OfOne:
    return cast(_OfOne, _told(function))


def _of_two(function: Callable[[Any, Any], Any]) -> _OfTwo:
    return cast(_OfTwo, _told(function))


def _of_point(function: Callable[[Any, Any], Any]) -> _OfPoint:
    return cast(_OfPoint, _told(function))


def _choice(function: Callable[[Any, Any, Any], Any]) -> _Where:
    return cast(_Where, _told(function))


def _curve(function: Callable[[Any, Any, Any], Any]) -> _Interp:
    return cast(_Interp, _told(function))


@_of_one
def sin(x: Any) -> Any:
    """Sine.

    Parameters
    ----------
    x : float, array_like or traced value
        The angle, in radians.

    Returns
    -------
    float, numpy.ndarray or traced value
        Between -1 and 1.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.sin(_numbers("x", x))


@_of_one
def cos(x: Any) -> Any:
    """Cosine.

    Parameters
    ----------
    x : float, array_like or traced value
        The angle, in radians.

    Returns
    -------
    float, numpy.ndarray or traced value
        Between -1 and 1.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.cos(_numbers("x", x))


@_of_one
def tan(x: Any) -> Any:
    """Tangent.

    Parameters
    ----------
    x : float, array_like or traced value
        The angle, in radians.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its tangent.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.tan(_numbers("x", x))


@_of_one
def asin(x: Any) -> Any:
    """Arcsine.

    Parameters
    ----------
    x : float, array_like or traced value
        From -1 to 1.

    Returns
    -------
    float, numpy.ndarray or traced value
        The angle, in radians from -π/2 to π/2.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.arcsin(_numbers("x", x))


@_of_one
def acos(x: Any) -> Any:
    """Arccosine.

    Parameters
    ----------
    x : float, array_like or traced value
        From -1 to 1.

    Returns
    -------
    float, numpy.ndarray or traced value
        The angle, in radians from 0 to π.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.arccos(_numbers("x", x))


@_of_one
def atan(x: Any) -> Any:
    """Arctangent.

    Parameters
    ----------
    x : float, array_like or traced value
        The tangent.

    Returns
    -------
    float, numpy.ndarray or traced value
        The angle, in radians from -π/2 to π/2.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.arctan(_numbers("x", x))


@_of_point
def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y).

    Parameters
    ----------
    y, x : float, array_like or traced value
        The point.

    Returns
    -------
    float, numpy.ndarray or traced value
        The angle, in radians from -π to π.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.arctan2(_numbers("y", y), _numbers("x", x))


@_of_one
def sinh(x: Any) -> Any:
    """Hyperbolic sine.

    Parameters
    ----------
    x : float, array_like or traced value
        Its argument.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its value.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.sinh(_numbers("x", x))


@_of_one
def cosh(x: Any) -> Any:
    """Hyperbolic cosine.

    Parameters
    ----------
    x : float, array_like or traced value
        Its argument.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its value.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.cosh(_numbers("x", x))


@_of_one
def tanh(x: Any) -> Any:
    """Hyperbolic tangent.

    Parameters
    ----------
    x : float, array_like or traced value
        Its argument.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its value.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.tanh(_numbers("x", x))


@_of_one
def exp(x: Any) -> Any:
    """Exponential.

    Parameters
    ----------
    x : float, array_like or traced value
        The exponent.

    Returns
    -------
    float, numpy.ndarray or traced value
        e to the power of it.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.exp(_numbers("x", x))


@_of_one
def log(x: Any) -> Any:
    """Natural logarithm.

    Parameters
    ----------
    x : float, array_like or traced value
        Above 0.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its logarithm.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.log(_numbers("x", x))


@_of_one
def log10(x: Any) -> Any:
    """Decimal logarithm.

    Parameters
    ----------
    x : float, array_like or traced value
        Above 0.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its logarithm.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.log10(_numbers("x", x))


@_of_one
def sqrt(x: Any) -> Any:
    """Square root.

    Parameters
    ----------
    x : float, array_like or traced value
        At least 0.

    Returns
    -------
    float, numpy.ndarray or traced value
        Its root.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.sqrt(_numbers("x", x))


@_of_one
def abs(x: Any) -> Any:
    """Magnitude.

    Parameters
    ----------
    x : float, array_like or traced value
        Of either sign.

    Returns
    -------
    float, numpy.ndarray or traced value
        The same without its sign.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.absolute(_numbers("x", x))


@_of_one
def sign(x: Any) -> Any:
    """Sign.

    Parameters
    ----------
    x : float, array_like or traced value
        Of either sign.

    Returns
    -------
    float, numpy.ndarray or traced value
        -1, 0 or 1.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.sign(_numbers("x", x))


@_of_two
def minimum(a: Any, b: Any) -> Any:
    """The smaller of two, element by element.

    Parameters
    ----------
    a, b : float, array_like or traced value
        What is compared; shapes broadcast.

    Returns
    -------
    float, numpy.ndarray or traced value
        The smaller.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.minimum(_numbers("a", a), _numbers("b", b))


@_of_two
def maximum(a: Any, b: Any) -> Any:
    """The larger of two, element by element.

    Parameters
    ----------
    a, b : float, array_like or traced value
        What is compared; shapes broadcast.

    Returns
    -------
    float, numpy.ndarray or traced value
        The larger.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.maximum(_numbers("a", a), _numbers("b", b))


@_of_one
def floor(x: Any) -> Any:
    """The next whole number below.

    Parameters
    ----------
    x : float, array_like or traced value
        Any number.

    Returns
    -------
    float, numpy.ndarray or traced value
        A whole number, as a float.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.floor(_numbers("x", x))


@_of_one
def ceil(x: Any) -> Any:
    """The next whole number above.

    Parameters
    ----------
    x : float, array_like or traced value
        Any number.

    Returns
    -------
    float, numpy.ndarray or traced value
        A whole number, as a float.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return np.ceil(_numbers("x", x))


@_choice
def where(condition: Any, a: Any, b: Any) -> Any:
    """A choice, element by element: ``if`` for traced values.

    Parameters
    ----------
    condition : bool, array_like or traced condition
        What is asked; a number counts as true unless it is 0.
    a, b : float, array_like or traced value
        What is taken where it holds, and where it does not; shapes broadcast.

    Returns
    -------
    float, numpy.ndarray or traced value
        ``a`` where the condition holds, else ``b``.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    """
    return _where(_numbers("condition", condition, "fiub"), _numbers("a", a), _numbers("b", b))


@_curve
def interp(x: Any, xp: Any, fp: Any) -> Any:
    """Straight lines through points, level outside of them, as :func:`numpy.interp`.

    Parameters
    ----------
    x : float, array_like or traced value
        Where to read.
    xp, fp : array_like
        The points, shape (n,): places that increase, and values.

    Returns
    -------
    float, numpy.ndarray or traced value
        The value there.

    Raises
    ------
    ArgumentError
        It is neither a number, nor an array of them, nor traced.
    InputError
        There are not as many values as places.
    """
    x, points, values = _numbers("x", x), _numbers("xp", xp), _numbers("fp", fp)
    if all(isinstance(each, np.ndarray) and each.dtype.kind != "O" for each in (x, points, values)):
        for name, given in (("xp", points), ("fp", values)):
            if given.ndim != 1 or not given.size:
                raise ArgumentError.of(name, "a list of at least one number", xp if name == "xp" else fp)
        if len(points) != len(values):
            raise InputError(f"fp: expected as many values as xp has points, {len(points)}, found {len(values)}")
    return _interp(x, points, values)
