"""Changes of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from . import _lynkeus
from ._toml import document
from .model import Model

#: keys of ``[sensors]`` that stand for themselves in Python
SENSORS = ("measured", "unknown", "disturbances", "noise", "limits")


def spelled(changes: Mapping[str, Any]) -> dict[str, Any]:
    """What Python may say briefly as a study's sections: a family, families, keys of sensors."""
    found = dict(changes)
    sensors = {name: found.pop(name) for name in SENSORS if name in found}
    if sensors:
        found["sensors"] = {**(found.get("sensors") or {}), **sensors}
    families = found.get("compare")
    if isinstance(families, Sequence) and not isinstance(families, str):
        found["compare"] = {"families": families}
    return found


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
            model = asked.pop("plant")
            model = model if isinstance(model, Model) else Model.load(model)
            plant, choice = (model.name, model.text), model.choose
            study |= {"plant": model.name, "model": model.choose}
        if "model" in asked:
            choice = study["model"] = asked.pop("model")
        for name, change in asked.items():
            old = study.get(name)
            if name == "observer" and isinstance(change, str):
                change = {"family": change}  # whose tuning is its own
            elif isinstance(old, dict) and isinstance(change, Mapping):
                change = {**old, **change}
            study[name] = change
        return _lynkeus.Study.parse(document(study), self._core.file, plant, choice, self._core)
