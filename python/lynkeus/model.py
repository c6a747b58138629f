"""Plants: Modelica texts, files, and Python functions."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from . import _from_function, _lynkeus
from ._arguments import optional, path as path_of, real, section, takes, word
from ._columns import why
from ._flatten import flattened, is_read
from ._toml import key, number, valid
from .errors import InputError, near
from .systems import Functions


class Model:
    """A plant's equations, as a text that is Modelica or in the notation of ``@ODEmodel``.

    Parameters
    ----------
    text : str
        The equations.
    name : str
        What messages call the text; one that ends in ``.jl`` is in the notation of ``@ODEmodel``.
    choose : str, optional
        The model to take where the text holds several.

    Raises
    ------
    InputError
        The text cannot be read so far that its models are known, or holds none that is called so.
    """

    @takes(text=word, name=word, choose=optional(word))
    def __init__(self, text: str, name: str = "model.mo", choose: str | None = None) -> None:
        self.text: str = valid(text)
        self.name: str = name
        self.choose: str | None = choose
        self._refuse_faults()

    def _refuse_faults(self) -> None:
        names = _lynkeus.model_names(self.text, self.name)
        if self.choose is not None and self.choose not in names:
            known = ", ".join(names)
            raise InputError(f"{self.name}: no model is called {self.choose!r}{near(self.choose, names)}: it has {known}")

    @classmethod
    def _unread(cls, text: str, name: str, choose: str | None) -> Model:
        """Of a text that is taken as it is."""
        model = cls.__new__(cls)
        model.text, model.name, model.choose = text, name, choose
        return model

    @classmethod
    @takes(path=path_of, choose=optional(word))
    def load(cls, path: str | os.PathLike[str], choose: str | None = None) -> Model:
        """A file. Where connectors or libraries keep it from being read and the compiler ``rumoca`` is installed
        (``pip install '.[modelica]'`` from a clone), what that makes of it: names come out dotted, ``r1.p.v``.

        Parameters
        ----------
        path : path
            A file of Modelica (``.mo``) or in the notation of ``@ODEmodel`` (``.jl``).
        choose : str, optional
            The model to take where the file holds several.

        Returns
        -------
        Model
            The text of the file.

        Raises
        ------
        InputError
            The file cannot be read.
        """
        name = os.fspath(path)
        try:
            text = Path(name).read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"the model {name} cannot be read: {why(error)}") from error
        if not name.endswith(".mo") or is_read(text, name, choose):
            return cls(text, name, choose)
        flat = flattened(name, choose)
        return cls(text, name, choose) if flat is None else cls(*flat)

    @classmethod
    @takes(text=word, choose=optional(word))
    def from_modelica(cls, text: str, choose: str | None = None) -> Model:
        """A text in Modelica.

        Parameters
        ----------
        text : str
            One model, or several.
        choose : str, optional
            The model to take where the text holds several.

        Returns
        -------
        Model
            The text; what its equations mean is found where something is asked of it.

        Raises
        ------
        InputError
            Its syntax is wrong.
        """
        return cls(text, choose=choose)

    @classmethod
    @takes(name=optional(word), description=optional(word))
    def from_function(
        cls,
        f: Callable[..., Any],
        h: Callable[..., Any] | None = None,
        *,
        states: Any,
        inputs: Any = (),
        outputs: Any = None,
        params: Any = (),
        name: str | None = None,
        description: str | None = None,
    ) -> Model:
        """Python functions, each called once, with values that record what is done with them: operators, the
        functions of this package (``lynkeus.sin``…), NumPy's functions and ``@``; ``lynkeus.where`` in place
        of ``if``.

        Parameters
        ----------
        f : function
            ``f(t, x, u, p)`` returns the derivatives of the states, as a list, a tuple, an array or a
            dictionary by name, in the units of the states per unit of time. States are ``x[0]``, ``x["T"]``,
            ``x.T`` or ``a, b = x``; inputs and parameters alike. It may leave out ``p``, or ``u`` and ``p``.
        h : function, optional
            ``h(t, x, u, p)`` returns the outputs likewise; states are the outputs where it is left out.
        states, inputs, outputs, params : list of str or dict
            Names, or a dictionary of them: a number (start or value), an array, or a dictionary of ``start``,
            ``fixed``, ``min``, ``max``, ``unit``, ``description``, ``size`` (of a parameter: ``value``).
        name : str, optional
            The name of the model; that of ``f`` where it is left out.
        description : str, optional
            What it is.

        Returns
        -------
        Model
            What was recorded, as a text in Modelica.

        Raises
        ------
        TraceError
            A function does what no equation can say; the line is told, and what to write instead.
        InputError
            What is declared contradicts itself.

        Examples
        --------
        >>> import lynkeus
        >>> def tank(t, x, u, p):
        ...     return [u.inflow - p.k * lynkeus.sqrt(x.level)]
        >>> model = lynkeus.Model.from_function(
        ...     tank, states={"level": {"start": 4, "min": 0.1, "max": 10}},
        ...     inputs={"inflow": {"min": 0, "max": 5}}, params={"k": 0.5})
        >>> print(model.text)
        model tank
          parameter Real k = 0.5;
          input Real inflow(min = 0, max = 5);
          output Real level(start = 4, min = 0.1, max = 10);
        equation
          der(level) = inflow - k*sqrt(level);
        end tank;
        <BLANKLINE>
        """
        called = _from_function.model_name(f, name)
        text = _from_function.text(
            f,
            h,
            states=states,
            inputs=inputs,
            outputs=outputs,
            params=params,
            name=called,
            description=description,
        )
        return cls(text, f"{called}.mo")

    @takes(parameters=optional(section))
    def functions(self, parameters: Mapping[str, float] | None = None) -> Functions:
        """The equations as functions of numbers, x' = f(t, x, u) and y = h(t, x, u).

        Parameters
        ----------
        parameters : mapping of str to float, optional
            Values that replace those of the model, in its units.

        Returns
        -------
        Functions
            ``f``, ``h`` and ``jacobian_x``.

        Raises
        ------
        InputError
            The model cannot be read, a parameter has no value, or there is none of a name.
        """
        values = ((k, real()(f"parameters.{k}", v)) for k, v in (parameters or {}).items())
        given = "".join(f"{key(str(k))} = {number(v)}\n" for k, v in values)
        text = f"[parameters]\n{given}"
        core = _lynkeus.Study.parse(text, self.name, (self.name, self.text), self.choose)
        return Functions(core.functions(), (Model.functions, (self, parameters)))

    def __repr__(self) -> str:
        return f"Model({self.name!r})"
