"""Public functions and methods say what they take, give and raise, in NumPy's style."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from typing import Any

import pytest

import lynkeus

MODULES = ["ray", "spark", "mpc"]


def documented() -> Iterator[tuple[str, Any]]:
    """Functions, methods and constructors of the public names."""
    places = [(name, getattr(lynkeus, name)) for name in (*lynkeus.__all__, "abs")]
    for module in MODULES:
        loaded = importlib.import_module(f"lynkeus.{module}")
        found = inspect.getmembers(loaded, lambda each: getattr(each, "__module__", "") == f"lynkeus.{module}")
        places += [(f"{module}.{name}", each) for name, each in found if not name.startswith("_")]
    for name, found in places:
        if inspect.isfunction(found):
            yield name, found
        elif isinstance(found, type) and found.__module__.startswith("lynkeus.") and not issubclass(found, BaseException | dict):
            for method, each in inspect.getmembers(found, callable):
                if not method.startswith("_") and (inspect.isfunction(each) or inspect.ismethod(each)):
                    yield f"{name}.{method}", each


ALL = dict(documented())


@pytest.mark.parametrize("name", ALL)
def test_docstrings_have_their_parts(name: str) -> None:
    function = ALL[name]
    told = inspect.getdoc(function) or ""
    signature = inspect.signature(function)
    taken = [each for each in signature.parameters if each not in ("self", "cls")]
    missing = [each for each in taken if each not in told]
    assert not missing
    if taken:
        assert "\nParameters\n----------\n" in told
    if signature.return_annotation not in ("None", None):
        assert "\nReturns\n-------\n" in told
