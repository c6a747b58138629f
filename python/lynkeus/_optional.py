"""Packages that are asked for only where they are used."""

from __future__ import annotations

import importlib
from typing import Any


def needed(module: str, extra: str) -> Any:
    """The module; where it is missing, an error that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"lynkeus.{extra} needs {module.partition('.')[0]}: pip install 'lynkeus[{extra}]'"
        ) from error
