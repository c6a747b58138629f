"""Changes of a study."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

from . import _lynkeus
from ._toml import document


class Base:
    """A study whose parts are read once, however many changes are made to it."""

    def __init__(self, core: _lynkeus.Study) -> None:
        self._core = core
        self._plant = core.plant
        self._sections = tomllib.loads(core.text)

    def changed(self, changes: Mapping[str, Any]) -> _lynkeus.Study:
        """See :meth:`Study.replace`."""
        sections = dict(self._sections)
        for name, change in changes.items():
            old = sections.get(name)
            if isinstance(old, dict) and isinstance(change, Mapping):
                change = {**old, **change}
            sections[name] = change
        return _lynkeus.Study.parse(document(sections), self._core.file, self._plant, self._core.model)
