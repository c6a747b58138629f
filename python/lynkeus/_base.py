"""Changes of a study."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from . import _lynkeus
from ._arguments import optional, section, word
from ._toml import document
from .errors import ArgumentError, InputError
from .model import Model

#: what messages call the text of a study that is made in Python
FILE = "study"
#: keys of ``[sensors]`` that stand for themselves in Python
SENSORS = ("measured", "unknown", "disturbances", "noise", "limits")


def spelled(changes: Mapping[str, Any]) -> dict[str, Any]:
    """What Python may say briefly as a study's sections: a family, families, keys of sensors."""
    found = dict(changes)
    sensors = {name: found.pop(name) for name in SENSORS if name in found}
    if sensors:
        given = optional(section)("sensors", found.get("sensors"))
        found["sensors"] = {**(given or {}), **sensors}
    families = found.get("compare")
    if isinstance(families, Sequence) and not isinstance(families, str):
        found["compare"] = {"families": families}
    return found


@contextmanager
def spoken() -> Iterator[None]:
    """Errors of a study that is made in Python, whose words do without places in a text that nobody wrote."""
    try:
        yield
    except InputError as error:
        place = error.place or ""
        if place.split(":")[0] != FILE:
            raise
        text = str(error).replace(f"{place}: ", "", 1)
        raise type(error)(text, error.message, error.place, error.hint) from None


def plant_of(name: str, given: Any) -> Model:
    """The model that an argument of that name is, or is the path of."""
    if isinstance(given, Model):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise ArgumentError.of(name, "a Model, or the path of one", given)
    return Model.load(given)


class Base:
    """A study whose parts are read once, however many changes are made to it."""

    def __init__(self, core: _lynkeus.Study) -> None:
        self._core = core
        self._plant = core.plant
        self._sections = core.sections()

    def changed(self, changes: Mapping[str, Any]) -> _lynkeus.Study:
        """See :meth:`Study.replace`."""
        study, asked = dict(self._sections), spelled(changes)
        plant, choice = self._plant, self._core.model
        if "plant" in asked:
            model = plant_of("plant", asked.pop("plant"))
            plant, choice = (model.name, model.text), model.choose
            study |= {"plant": model.name, "model": model.choose}
        if "model" in asked:
            choice = study["model"] = optional(word)("model", asked.pop("model"))
        for name, change in asked.items():
            old = study.get(name)
            if name == "observer" and isinstance(change, str):
                change = {"family": change}  # whose tuning is its own
            elif isinstance(old, dict) and isinstance(change, Mapping):
                change = {**old, **change}
            study[name] = change
        return _lynkeus.Study.parse(document(study), self._core.file, plant, choice, self._core)
