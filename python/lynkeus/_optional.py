"""Packages that are asked for only where they are used."""

from __future__ import annotations

import importlib
from typing import Any

#: what is installed where a package's name is not enough
_EXTRA = {"ray": "'ray[data]'", "libsbml": "'lynkeus[petab]'", "petab": "'lynkeus[petab]'"}


def needed(module: str, what: str) -> Any:
    """The module that something needs; where it is missing, an error that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        install = _EXTRA.get(package, package)
        raise ImportError(f"{what} needs the package {package}: pip install {install}", name=package) from error
