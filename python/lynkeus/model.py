"""Plants: Modelica texts, files, and Python functions."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from . import _lynkeus
from ._flatten import flattened, is_read
from ._toml import key, number
from .functions import Functions


class Model:
    """A plant's equations, as a text that is Modelica or in the notation of ``@ODEmodel``.

    ``name`` is what messages call the text; one that ends in ``.jl`` is in the notation of
    ``@ODEmodel``. ``choose`` is the model to take where the text holds several.
    """

    def __init__(self, text: str, name: str = "model.mo", choose: str | None = None) -> None:
        self.text = text
        self.name = name
        self.choose = choose

    @classmethod
    def load(cls, path: str | os.PathLike[str], choose: str | None = None) -> Model:
        """A file: ``.mo`` or ``.jl``. Where connectors or libraries keep it from being read and the
        compiler ``rumoca`` is installed (``pip install lynkeus[modelica]``), what that makes of it:
        names come out dotted, ``r1.p.v``."""
        name = os.fspath(path)
        text = Path(path).read_text(encoding="utf-8-sig")
        if not name.endswith(".mo") or is_read(text, name, choose):
            return cls(text, name, choose)
        flat = flattened(name, choose)
        return cls(text, name, choose) if flat is None else cls(*flat)

    @classmethod
    def from_modelica(cls, text: str, choose: str | None = None) -> Model:
        """A text in Modelica."""
        return cls(text, choose=choose)

    def functions(self, parameters: Mapping[str, float] | None = None) -> Functions:
        """The equations as functions of numbers, x' = f(t, x, u) and y = h(t, x, u); ``parameters``
        replace those of the model."""
        given = "".join(f"{key(k)} = {number(v)}\n" for k, v in (parameters or {}).items())
        text = f"[parameters]\n{given}"
        core = _lynkeus.Study.parse(text, self.name, (self.name, self.text), self.choose)
        return Functions(core.functions())

    def __repr__(self) -> str:
        return f"Model({self.name!r})"
