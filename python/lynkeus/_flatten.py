"""Object-oriented Modelica through the compiler rumoca, where that is installed."""

from __future__ import annotations

import warnings

from . import _lynkeus
from .errors import LynkeusError

RENDERINGS = ("base-modelica", "flat-modelica", "dae-modelica")


def is_read(text: str, name: str, choose: str | None) -> bool:
    """Whether our own front end reads a text; the judge of what has to be flattened."""
    try:
        _lynkeus.Study.parse("", name, (name, text), choose).functions()
    except LynkeusError:
        return False
    return True


def flattened(path: str, choose: str | None) -> tuple[str, str] | None:
    """The text of a file without connectors and libraries, with the name that messages call it by;
    None where rumoca is absent or refuses it (a warning says why), or where that text is not read either."""
    try:
        import rumoca
    except ImportError:
        return None
    name = f"{path} (flattened by rumoca)"
    try:
        model = rumoca.Session().load(path, model=choose)
        texts = [model.render(rendering) for rendering in RENDERINGS]
    except rumoca.RumocaError as error:
        warnings.warn(f"{path}: rumoca does not flatten it: {error}", stacklevel=3)
        return None
    return next(((text, name) for text in texts if is_read(text, name, None)), None)
