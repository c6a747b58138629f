"""Plants and observers as functions, here and in other packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lynkeus
from ._arguments import optional, real, section, takes, word
from ._optional import needed
from .errors import ArgumentError, InputError, RefusedError

if TYPE_CHECKING:
    import casadi
    import control

Column: TypeAlias = NDArray[np.float64]
Input: TypeAlias = float | Callable[[float], float]


class Pair(NamedTuple):
    """The two functions of a system, called alike: ``f(t, x, u)`` and ``h(t, x, u)``."""

    f: Any
    """the derivatives of the states"""
    h: Any
    """the outputs"""


class Functions:
    """x' = f(t, x, u), y = h(t, x, u): a plant, or an observer (:class:`Observer`).

    ``states``, ``inputs`` and ``outputs`` are names, in the order of the entries of x, u and y;
    ``start`` are the states at the start, NaN where the model gives none. All are in the units of the model.

    Examples
    --------
    >>> import lynkeus
    >>> tank = lynkeus.Model.from_modelica('''
    ...     model Tank
    ...       input Real inflow;
    ...       Real level(start = 4);
    ...       output Real y = level;
    ...     equation
    ...       der(level) = inflow - 0.5*sqrt(level);
    ...     end Tank;''').functions()
    >>> tank.f(0.0, [4.0], [1.5])
    array([0.5])
    >>> tank.jacobian_x(0.0, [4.0], [1.5])
    array([[-0.125]])
    """

    def __init__(self, core: _lynkeus.Functions, origin: tuple[Callable[..., Any], tuple[Any, ...]] | None = None) -> None:
        self._core = core
        self._origin = origin
        self.states: list[str] = core.states
        self.inputs: list[str] = core.inputs
        self.outputs: list[str] = core.outputs

    def __reduce__(self) -> tuple[Any, ...]:
        if self._origin is None:
            raise TypeError(f"{type(self).__name__}: what it was made of is not known, so it cannot be pickled")
        return self._origin

    @property
    def start(self) -> Column:
        """States at the start, shape (n,)."""
        return self._core.start

    def f(self, t: float, x: ArrayLike, u: ArrayLike = ()) -> Column:
        """The derivatives of the states.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).
        u : array_like
            The inputs, shape (m,).

        Returns
        -------
        numpy.ndarray
            x', shape (n,).

        Raises
        ------
        ArgumentError, InputError
            A vector has no numbers, or not as many as there are names.
        """
        return self._core.f(t, vector("x", x), vector("u", u))

    def h(self, t: float, x: ArrayLike, u: ArrayLike = ()) -> Column:
        """The outputs.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).
        u : array_like
            The inputs, shape (m,).

        Returns
        -------
        numpy.ndarray
            y, shape (p,).

        Raises
        ------
        ArgumentError, InputError
            A vector has no numbers, or not as many as there are names.
        """
        return self._core.h(t, vector("x", x), vector("u", u))

    def jacobian_x(self, t: float, x: ArrayLike, u: ArrayLike = ()) -> NDArray[np.float64]:
        """The slopes of f, from the derivatives of the equations.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).
        u : array_like
            The inputs, shape (m,).

        Returns
        -------
        numpy.ndarray
            ∂f/∂x, shape (n, n): a row for each derivative, a column for each state.

        Raises
        ------
        ArgumentError, InputError
            A vector has no numbers, or not as many as there are names.
        """
        return self._core.jacobian_x(t, vector("x", x), vector("u", u))

    @takes(language=word)
    def source(self, language: Literal["python", "casadi"] = "python") -> str:
        """The text of a module with ``f(xp, t, x, u)`` and ``h(xp, t, x, u)``.

        Parameters
        ----------
        language : str
            In ``"python"`` ``xp`` is ``numpy`` or ``jax.numpy``; in ``"casadi"`` it is ``casadi``.

        Returns
        -------
        str
            The module.

        Raises
        ------
        InputError
            There is no such language.
        RefusedError
            An algebraic loop has to be searched for its root.
        """
        return self._core.source(language)[0]

    @takes(inputs=optional(section))
    def driven(self, inputs: Mapping[str, Input] | None = None) -> Driven:
        """The system with every input given, for SciPy's ``solve_ivp``:
        ``d = system.driven({"u": math.sin}); solve_ivp(d.rhs, (0, 9), d.start, jac=d.jac)``.

        Parameters
        ----------
        inputs : mapping of str to float or function, optional
            A number or a function of time for each input.

        Returns
        -------
        Driven
            ``rhs``, ``jac``, ``start``, ``outputs``.

        Raises
        ------
        InputError
            An input is missing, or there is none of a name.
        RefusedError
            It is a filter, whose correction is in updates.
        """
        self._refuse_updates("driven")
        given = dict(inputs or {})
        if strangers := [name for name in given if name not in self.inputs]:
            raise InputError(f"no input is called {strangers[0]!r}: expected {', '.join(self.inputs)}")
        if missing := [name for name in self.inputs if name not in given]:
            raise InputError(f"the input {missing[0]!r} is missing: expected a number or a function of time")
        return Driven(self, tuple(_course(name, given[name]) for name in self.inputs))

    @takes(name=optional(word))
    def to_nlsys(self, name: str | None = None) -> control.NonlinearIOSystem:
        """A system of python-control with named signals. Names hold no dot there: ``r1.v`` becomes
        ``r1_v``.

        Parameters
        ----------
        name : str, optional
            What python-control calls it.

        Returns
        -------
        control.NonlinearIOSystem
            With the states, inputs and outputs of this one.

        Raises
        ------
        ImportError
            python-control is not installed.
        RefusedError
            It is a filter, whose correction is in updates.
        """
        self._refuse_updates("to_nlsys")
        control = needed("control", "to_nlsys")

        def update(t: float, x: Column, u: Column, _: Mapping[str, Any]) -> Column:
            return self.f(t, x, u)

        def output(t: float, x: Column, u: Column, _: Mapping[str, Any]) -> Column:
            return self.h(t, x, u)

        return control.nlsys(
            update,
            output,
            states=_undotted(self.states),
            inputs=_undotted(self.inputs),
            outputs=_undotted(self.outputs),
            name=name,
        )

    def to_casadi(self) -> Pair:
        """The system in CasADi, of scalar operations unless linear systems are solved in it.

        Returns
        -------
        Pair
            ``casadi.Function``s f and h of (t, x, u).

        Raises
        ------
        ImportError
            CasADi is not installed.
        RefusedError
            An algebraic loop has to be searched for its root.
        """
        casadi = needed("casadi", "to_casadi")
        text, has_systems = self._core.source("casadi")
        module = _executed(text)
        # the symbolic solution of a matrix of scalars has no pivots
        symbols: Any = casadi.MX if has_systems else casadi.SX
        vectors = _arguments(self)
        t = symbols.sym("t")
        x, u = symbols.sym(vectors[0], len(self.states)), symbols.sym(vectors[1], len(self.inputs))
        names = ["t", *vectors]

        def function(name: str, result: str) -> Any:
            return casadi.Function(name, [t, x, u], [module[name](casadi, t, x, u)], names, [result])

        return Pair(function("f", "der"), function("h", "y"))

    def to_jax(self) -> Pair:
        """The system over ``jax.numpy``, to be given to ``jit``, ``vmap`` and ``grad``; in double precision where
        ``jax_enable_x64`` is set.

        Returns
        -------
        Pair
            Functions f and h of (t, x, u).

        Raises
        ------
        ImportError
            JAX is not installed.
        RefusedError
            An algebraic loop has to be searched for its root.
        """
        jnp = needed("jax.numpy", "to_jax")
        module = _executed(self._core.source("python")[0])

        def f(t: Any, x: Any, u: Any = ()) -> Any:
            """The derivatives of the states."""
            return module["f"](jnp, t, x, u)

        def h(t: Any, x: Any, u: Any = ()) -> Any:
            """The outputs."""
            return module["h"](jnp, t, x, u)

        return Pair(f, h)

    def _refuse_updates(self, what: str) -> None:
        if self._core.is_filter:
            flows = ", ".join(name for name, is_filter in _lynkeus.families() if not is_filter)
            raise RefusedError(
                f"{what}: the family {self._core.family!r} corrects its estimate in updates when sensors "
                f"report, and a flow alone is no observer: expected one of {flows}; "
                "study.estimator() runs every family"
            )

    def __repr__(self) -> str:
        return f"<{self._core.title}>"


class Observer(Functions):
    """z' = f(t, z, w), estimates h(t, z, w): what ``study.observer()`` gives.

    ``signals`` (the entries of w) are the sensors, the known inputs, and the derivatives of known
    inputs that the family reads (``u'``); ``outputs`` are the estimates, ``<name>_hat``. Of a filter
    f is what happens between samples; its updates are those of ``study.estimator()``.
    """

    @property
    def family(self) -> str:
        """The family of the observer."""
        return str(self._core.family)

    @property
    def is_filter(self) -> bool:
        """Whether its correction is in updates, not in f."""
        return self._core.is_filter

    @property
    def signals(self) -> list[str]:
        """Names of the entries of w."""
        return self.inputs

    @property
    def sensors(self) -> list[str]:
        """Those of them that are measured outputs."""
        return self.inputs[: self._core.sensors]


@dataclass(frozen=True)
class Driven:
    """A system under inputs that are functions of time."""

    system: Functions
    """the system"""
    inputs: tuple[Callable[[float], float], ...]
    """its inputs, in their order"""

    @property
    def start(self) -> Column:
        """States at the start, shape (n,)."""
        return self.system.start

    def u(self, t: float) -> Column:
        """The inputs at a time.

        Parameters
        ----------
        t : float
            The time, in the model's unit.

        Returns
        -------
        numpy.ndarray
            u, shape (m,).

        Raises
        ------
        ArgumentError
            A function of time gives no number.
        """
        at = real()("t", t)
        named = zip(self.system.inputs, self.inputs, strict=True)
        return np.array([real(f"a number at t = {at}")(name, value(at)) for name, value in named])

    def rhs(self, t: float, x: ArrayLike) -> Column:
        """The derivatives of the states under the inputs.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).

        Returns
        -------
        numpy.ndarray
            x' = f(t, x, u(t)), shape (n,).
        """
        return self.system.f(t, x, self.u(t))

    def jac(self, t: float, x: ArrayLike) -> NDArray[np.float64]:
        """Their slopes.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).

        Returns
        -------
        numpy.ndarray
            ∂x'/∂x, shape (n, n).
        """
        return self.system.jacobian_x(t, x, self.u(t))

    def outputs(self, t: float, x: ArrayLike) -> Column:
        """The outputs under the inputs.

        Parameters
        ----------
        t : float
            The time, in the model's unit.
        x : array_like
            The states, shape (n,).

        Returns
        -------
        numpy.ndarray
            y = h(t, x, u(t)), shape (p,).
        """
        return self.system.h(t, x, self.u(t))


def vector(name: str, values: ArrayLike) -> Column:
    """Numbers in one row."""
    try:
        given = np.asarray(values)
        # NumPy would make NaN of None, and numbers of texts
        if given.dtype.kind in "fiub" or (given.dtype.kind == "O" and not any(x is None for x in given.flat)):
            return given.astype(float, copy=False).reshape(-1)
        found = "None" if given.dtype.kind == "O" else str(given.dtype)
    except (TypeError, ValueError, OverflowError) as error:
        found = str(error)
    raise ArgumentError(f"{name}: expected numbers, found {found}")


def _course(name: str, value: Input) -> Callable[[float], float]:
    if callable(value):
        return value
    number: float = real("a number or a function of time")(name, value)
    return lambda _: number


def _arguments(system: Functions) -> list[str]:
    return ["z", "w"] if isinstance(system, Observer) else ["x", "u"]


def _undotted(names: list[str]) -> list[str]:
    found: dict[str, None] = {}
    for name in names:
        name = name.replace(".", "_")
        while name in found:
            name += "_"
        found[name] = None
    return list(found)


def _executed(text: str) -> dict[str, Any]:
    module: dict[str, Any] = {}
    exec(compile(text, "<printed by lynkeus>", "exec"), module)
    return module
