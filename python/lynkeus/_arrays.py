"""Arrays of traced values, and what NumPy's functions make of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np

from ._place import here, refusal
from .trace import Value, apply, arithmetic, both, either, neither, select

_Scalar = Callable[..., Any]


def _call(name: str) -> _Scalar:
    return lambda *given: apply(name, *given)


def _operator(op: str) -> _Scalar:
    return lambda a, b: arithmetic(op, a, b)


#: What NumPy's functions are for scalars of which one is traced.
_MEANING: dict[str, _Scalar] = {
    **{name: _call(name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{name: _call(name) for name in ("exp", "log", "log10", "sqrt", "sign", "floor", "ceil")},
    **{f"arc{name}": _call(f"a{name}") for name in ("sin", "cos", "tan", "tan2")},
    **dict.fromkeys(("absolute", "fabs"), _call("abs")),
    **dict.fromkeys(("maximum", "fmax"), _call("max")),
    **dict.fromkeys(("minimum", "fmin"), _call("min")),
    "add": _operator("+"),
    "subtract": _operator("-"),
    "multiply": _operator("*"),
    "divide": _operator("/"),
    **dict.fromkeys(("power", "float_power"), _operator("^")),
    "negative": lambda x: -x,
    "positive": lambda x: x,
    "conjugate": lambda x: x,
    "square": lambda x: x**2,
    "reciprocal": lambda x: 1 / x,
    "hypot": lambda a, b: apply("sqrt", a**2 + b**2),
    **dict.fromkeys(("radians", "deg2rad"), lambda x: x * (np.pi / 180)),
    **dict.fromkeys(("degrees", "rad2deg"), lambda x: x * (180 / np.pi)),
    "clip": lambda x, low, high: _least(_most(x, low), high),
    "less": _call("<"),
    "less_equal": _call("<="),
    "greater": _call(">"),
    "greater_equal": _call(">="),
    "equal": _call("=="),
    "not_equal": _call("<>"),
    **dict.fromkeys(("logical_and", "bitwise_and"), both),
    **dict.fromkeys(("logical_or", "bitwise_or"), either),
    **dict.fromkeys(("logical_not", "invert"), neither),
}
_PRODUCTS = frozenset({"matmul", "vecdot", "matvec", "vecmat"})


def _least(a: Any, b: Any) -> Any:
    return _scalar(np.minimum)(a, b)


def _most(a: Any, b: Any) -> Any:
    return _scalar(np.maximum)(a, b)


def _scalar(ufunc: np.ufunc) -> _Scalar:
    """A function of NumPy for scalars, traced ones or numbers."""
    meaning = _MEANING.get(ufunc.__name__)
    if meaning is None:
        known = ", ".join(sorted(_MEANING))
        raise refusal(f"NumPy's `{ufunc.__name__}` of a traced value", here(), f"there are: {known}")

    def scalar(*given: Any) -> Any:
        if any(isinstance(x, Value) for x in given):
            return meaning(*given)
        return ufunc(*given)

    return scalar


class TracedArray(np.ndarray[Any, Any]):
    """An array whose elements are traced values and numbers."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: Any, *inputs: Any, **options: Any) -> Any:
        return carried_out(ufunc, method, inputs, options)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return called(func, args, kwargs)


def traced(given: Any) -> Any:
    """A list, or an array of objects, so that NumPy's functions see the traced values that it holds."""
    if isinstance(given, (Value, TracedArray, Named)):
        return given
    array = np.asarray(given)
    return array.view(TracedArray) if array.dtype == object else array


def _plain(given: Any) -> np.ndarray[Any, Any]:
    if isinstance(given, Value):
        array = np.empty((), dtype=object)
        array[()] = given
        return array
    return np.asarray(given)


def _wrapped(result: Any) -> Any:
    if isinstance(result, np.ndarray) and result.dtype == object:
        return result[()] if result.ndim == 0 else result.view(TracedArray)
    return result


def carried_out(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """A ufunc of which an argument holds traced values."""
    plain = [_plain(x) for x in inputs]
    out = options.pop("out", None)
    # the kind of elements that the caller asks for is that of numbers
    options.pop("dtype", None)
    result = _wrapped(_elementwise(ufunc, method, plain, options))
    target = None if out is None else out[0]
    if target is None:
        return result
    if not isinstance(target, np.ndarray) or target.dtype != object:
        hint = "write `a = a + x` in place of `a += x`, or make the array with `dtype=object`"
        raise refusal("an array of numbers cannot hold traced values", here(), hint)
    target[...] = result
    return target


def _elementwise(
    ufunc: np.ufunc, method: str, plain: list[np.ndarray[Any, Any]], options: dict[str, Any]
) -> Any:
    if ufunc.__name__ in _PRODUCTS:
        return getattr(ufunc, method)(*plain, **options)
    function = np.frompyfunc(_scalar(ufunc), ufunc.nin, 1, identity=None)
    if method == "__call__":
        return function(*plain, **options)
    if method == "reduce" and plain[0].size == 0:
        return ufunc.reduce(plain[0].astype(float), **options)
    return getattr(function, method)(*plain, **options)


def called(function: Any, given: Any, options: Any) -> Any:
    """One of NumPy's functions that are no ufuncs, of which an argument holds traced values."""
    own = _OWN.get(function.__name__)
    if own is not None:
        return own(*given, **options)
    given = tuple(_opened(x) for x in given)
    options = {name: _opened(x) for name, x in options.items()}
    plainly = getattr(function, "_implementation", function)
    return _wrapped(plainly(*given, **options))


def _opened(given: Any) -> Any:
    """An argument of NumPy's functions: vectors with names, and scalars, as arrays."""
    if type(given) in (list, tuple):
        # a list's scalars become elements of an array, which arrays within it would not
        return type(given)(x if isinstance(x, Value) else _opened(x) for x in given)
    return _plain(given).view(TracedArray) if isinstance(given, (Value, Named)) else given


def where(condition: Any, a: Any, b: Any) -> Any:
    """``a`` where the condition holds, else ``b``; element by element, shapes broadcast."""
    condition, a, b = map(traced, (condition, a, b))
    if not _any_traced(condition, a, b):
        return np.where(condition, a, b)
    return _wrapped(np.frompyfunc(select, 3, 1)(_plain(condition), _plain(a), _plain(b)))


def _any_traced(*given: Any) -> bool:
    return any(isinstance(x, (Value, TracedArray, Named)) for x in given)


def _select(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    pairs = reversed(list(zip(condlist, choicelist, strict=True)))
    return reduce(lambda rest, pair: where(pair[0], pair[1], rest), pairs, default)


def interp(x: Any, xp: Any, fp: Any) -> Any:
    """Straight lines through the points ``xp`` (increasing) and ``fp``, outside their first and last
    value, as :func:`numpy.interp`."""
    x, xp, fp = map(traced, (x, xp, fp))
    if not _any_traced(x, xp, fp):
        return np.interp(x, xp, fp)
    points, values = list(_plain(xp).ravel()), list(_plain(fp).ravel())
    if len(points) != len(values) or len(points) < 2:
        found = f"{len(values)} and {len(points)}"
        raise refusal(f"`interp`: expected as many values as points, at least 2, found {found}", here())
    if any(not a < b for a, b in pairwise(points) if not _any_traced(a, b)):
        raise refusal("`interp`: expected points that increase", here())

    def scalar(at: Any) -> Any:
        if not _any_traced(at, *points, *values):
            return np.interp(at, points, values)
        inside = _least(_most(at, points[0]), points[-1])
        return apply("interpolate", inside, *points, *values)

    return _wrapped(np.frompyfunc(scalar, 1, 1)(_plain(x)))


_OWN: dict[str, _Scalar] = {"where": where, "select": _select, "interp": interp}


class Named(np.lib.mixins.NDArrayOperatorsMixin):
    """A vector of traced values whose parts have names: by place (``x[0]``, ``x[2:5]``), by name
    (``x["T"]``, ``x.T``), unpacked (``a, b = x``) and in NumPy's functions. It cannot be written to."""

    # a name of the user's must not meet one of ours
    __slots__ = ("_lynkeus_array", "_lynkeus_parts", "_lynkeus_role")

    def __init__(self, role: str, parts: Mapping[str, Any]) -> None:
        array = np.empty(sum(np.size(_plain(part)) for part in parts.values()), dtype=object)
        array[:] = [element for part in parts.values() for element in _plain(part).ravel()]
        array.flags.writeable = False
        self._lynkeus_array = array.view(TracedArray)
        self._lynkeus_parts = dict(parts)
        self._lynkeus_role = role

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray[Any, Any]:
        return np.array(self._lynkeus_array, dtype=dtype)

    def __array_ufunc__(self, ufunc: np.ufunc, method: Any, *inputs: Any, **options: Any) -> Any:
        return carried_out(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, given: Any, options: Any) -> Any:
        return called(function, given, options)

    def __len__(self) -> int:
        return len(self._lynkeus_array)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._lynkeus_array)

    def __getitem__(self, key: Any) -> Any:
        if not isinstance(key, str):
            return self._lynkeus_array[key]
        if key not in self._lynkeus_parts:
            raise refusal(self._unknown(key), here(), _near(key, self._lynkeus_parts))
        return self._lynkeus_parts[key]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_lynkeus"):
            raise AttributeError(name)
        if name in self._lynkeus_parts:
            return self._lynkeus_parts[name]
        if name.startswith("__") or not hasattr(self._lynkeus_array, name):
            raise AttributeError(self._unknown(name))
        return getattr(self._lynkeus_array, name)

    def __repr__(self) -> str:
        return f"<traced {self._lynkeus_role}: {', '.join(self._lynkeus_parts)}>"

    def _unknown(self, name: str) -> str:
        known = ", ".join(f"`{part}`" for part in self._lynkeus_parts) or "nothing"
        return f"no {self._lynkeus_role} is called `{name}`: there is {known}"


def _near(name: str, known: Mapping[str, Any]) -> str | None:
    close = get_close_matches(name, known, n=1)
    return f"did you mean `{close[0]}`?" if close else None


# NumPy looks for these in the elements of arrays of objects that are not ours
for _name in ("sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh"):
    setattr(Value, _name, _MEANING[_name])
for _name in ("exp", "log", "log10", "sqrt"):
    setattr(Value, _name, _MEANING[_name])
