"""Sections of studies have the keys that the engine knows, and the constructor takes them all."""

from __future__ import annotations

import importlib.util
import inspect
import json
from types import ModuleType
from typing import Any, get_type_hints

import pytest
from conftest import ROOT
from tank_study import MODEL, SIMULATE

import lynkeus
from lynkeus import _lynkeus, sections, verbs
from lynkeus._batched import Batched

SCHEMA: dict[str, Any] = json.loads(_lynkeus.schema())


def generator() -> ModuleType:
    path = ROOT / "python" / "sections.py"
    spec = importlib.util.spec_from_file_location("sections_generator", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_file_is_what_the_schema_makes() -> None:
    written = (ROOT / "python" / "lynkeus" / "sections.py").read_text(encoding="utf-8")
    assert written == generator().text(SCHEMA), "python python/sections.py writes it again"


def test_every_key_of_the_schema_is_there() -> None:
    for name, section in SCHEMA["properties"].items():
        assert name in sections.Changes.__annotations__
        if "properties" in section:
            declared = getattr(sections, f"{name.capitalize()}Section")
            assert set(declared.__annotations__) == set(section["properties"]), name


def test_the_constructor_takes_the_sections() -> None:
    taken = inspect.signature(lynkeus.Study.__init__).parameters
    kinds = {name: kind.annotation for name, kind in taken.items() if name not in ("self", "model")}
    declared = {name: hint.__forward_arg__ for name, hint in sections.Sections.__annotations__.items()}
    assert kinds == declared


def test_changes_have_what_the_constructor_takes() -> None:
    assert set(sections.Changes.__annotations__) == {*sections.Sections.__annotations__, "plant", "model"}


@pytest.mark.parametrize("name", ["check", "design", "certify", "how_well", "simulate", "estimate", "tune", "fit", "compare"])
def test_verbs_take_what_methods_take(name: str) -> None:
    verb, method = inspect.signature(getattr(verbs, name)), inspect.signature(getattr(lynkeus.Study, name))
    assert list(verb.parameters.values())[1:] == list(method.parameters.values())[1:]
    assert verb.return_annotation == method.return_annotation
    assert list(verb.parameters)[0] == "study"


def test_annotations_can_be_read() -> None:
    for function in (lynkeus.Study.__init__, lynkeus.Study.replace, lynkeus.Study.sweep, lynkeus.estimate, lynkeus.check):
        assert get_type_hints(function)
    assert get_type_hints(sections.Changes)["unknown"]


def test_typed_dictionaries_are_dictionaries() -> None:
    observer: sections.ObserverSection = {"theta": 1.0}
    observer["family"] = "triangular"
    change: sections.Changes = {"observer": {"theta": None}, "unknown": ("inflow",)}
    study = lynkeus.Study(MODEL, unknown=["inflow"], observer=observer, simulate=SIMULATE)
    assert "theta" in study.text and "theta" not in study.replace(**change).text
    assert isinstance(study, Batched)
