"""Writes ``lynkeus/sections.py`` from the JSON Schema of study files: keys are declared once, in Rust.

    python python/sections.py

``python/tests/test_sections.py`` fails where the file is not what this makes.
"""

from __future__ import annotations

import json
import keyword
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from lynkeus import _lynkeus

FILE = Path(__file__).parent / "lynkeus" / "sections.py"
WIDE = 110

HEAD = '''"""Sections of studies and their keys, for type checkers: what :class:`lynkeus.Study` and its ``replace`` take.

A dictionary that is written in the call is checked by itself. One that is made beforehand says what it is::

    from lynkeus.sections import ObserverSection

    observer: ObserverSection = {"family": "triangular", "theta": 2.0}

A key that is ``None`` is left out. Written by ``python/sections.py`` from the JSON Schema of study files.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Literal, NotRequired, TypeAlias, TypedDict

from ._types import Matrix, Names, Nested, Number, Numbers, Whole
from .model import Model
'''

#: in which order `Study` takes its sections, and what stands for itself beside them
SENSORS = ("measured", "unknown", "disturbances", "noise", "limits")
SECTIONS = ("sensors", "process_noise", "parameters", "manifold", "observer", "box", "certify", "simulate")
SECTIONS += ("log", "estimate", "tune", "fit", "compare", "serve", "plot", "tables", "delay_states")
#: what may be said briefly
BRIEFLY = {"observer": "Family", "compare": "Names"}
PLANT = {
    "plant": ("Model | str | os.PathLike[str]", "the model, or the path of one"),
    "model": ("str | None", "which model, where the text of the plant holds several"),
}
CHANGES = "What :meth:`lynkeus.Study.replace` takes, and each change of :meth:`lynkeus.Study.sweep`."

Schema = dict[str, Any]


def text(schema: Schema) -> str:
    """The whole file."""
    return Writer(schema).text()


class Writer:
    """A file that grows by its classes, each below those that it names."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema["properties"]
        self._classes: dict[str, str] = {}

    def text(self) -> str:
        """See :func:`text`."""
        observer = self._schema["observer"]["properties"]["family"]
        names = "".join(f'    "{name}",\n' for name in observer["enum"])
        parts = [f"#: names of observer families\nFamily: TypeAlias = Literal[\n{names}]"]
        kinds = {name: self._section(name) for name in SECTIONS}
        fields = {}
        for name in SENSORS:
            key = self._schema["sensors"]["properties"][name]
            fields[name] = (f"{kind(key, f'sensors.{name}', self)} | None", described(key))
        for name, found in kinds.items():
            brief = f" | {BRIEFLY[name]}" if name in BRIEFLY else ""
            fields[name] = (f"{found}{brief} | None", described(self._schema[name]))
        parts += self._classes.values()
        parts.append(written("Sections", "What :class:`lynkeus.Study` takes beside its model.", fields))
        parts.append(written("Changes", CHANGES, PLANT, base="Sections"))
        return HEAD + "\n" + "\n\n".join(part.rstrip() + "\n" for part in parts)

    def _section(self, name: str) -> str:
        """What a section is called; its class, or what stands for it, is added."""
        schema, title = self._schema[name], f"{camel(name)}Section"
        if "properties" in schema:
            self._add(title, name, schema, is_section=True)
        elif "additionalProperties" in schema:
            found = kind(schema["additionalProperties"], name, self)
            note = "".join(f"#: {line}\n" for line in wrapped(described(schema), WIDE - 3))
            self._classes[title] = f"{note}{title}: TypeAlias = Mapping[str, {found} | None]\n"
        else:
            return kind(schema, name, self)
        return title

    def inner(self, path: str, schema: Schema) -> str:
        """What a table within a section is called; its class is added."""
        title = "".join(camel(part) for part in path.split("."))
        self._add(title, path, schema, is_section=False)
        return title

    def _add(self, title: str, path: str, schema: Schema, is_section: bool) -> None:
        required = set() if is_section else set(schema.get("required", ()))
        fields = {}
        for name, key in schema["properties"].items():
            found = kind(key, f"{path}.{name}", self)
            if is_section:
                found += " | None"
            elif required and name not in required:
                found = f"NotRequired[{found}]"
            fields[name] = (found, described(key))
        told = described(schema) or f"A value of ``{path.partition('.')[2]}`` in ``[{path.partition('.')[0]}]``."
        self._classes[title] = written(title, told, fields, is_total=bool(required))


def kind(schema: Schema, path: str, writer: Writer) -> str:
    """The type of a value; ``path`` names the classes of tables in it."""
    if "anyOf" in schema:
        each = list(alternatives(schema))
        if all("enum" in one for one in each):
            return literal(dict.fromkeys(word for one in each for word in one["enum"]))
        found = list(dict.fromkeys(kind(one, path, writer) for one in each))
        # of which list a literal is one, type checkers may not find out
        deep = sum(one.startswith("Sequence[") for one in found) > 1 and all(is_numeric(one) for one in found)
        return "Nested" if deep else " | ".join(found)
    if "enum" in schema:
        found = literal(schema["enum"])
        return "Family" if path == "observer.family" else found
    match schema["type"]:
        case "number":
            return "Number"
        case "integer":
            return "Whole"
        case "string":
            return "str"
        case "boolean":
            return "bool"
        case "array":
            found = kind(schema["items"], path, writer)
            return {"str": "Names", "Number": "Numbers", "Numbers": "Matrix"}.get(found, f"Sequence[{found}]")
        case "object" if "properties" in schema:
            return writer.inner(path, schema)
        case "object":
            return f"Mapping[str, {kind(schema['additionalProperties'], path, writer)}]"
    raise ValueError(f"{path}: no type for {schema}")


def is_numeric(name: str) -> bool:
    """Whether a type has nothing but numbers and lists of them."""
    parts = name.replace("Sequence[", "").replace("]", "").split(" | ")
    return all(part in ("Number", "Numbers", "Matrix") for part in parts)


def literal(words: Iterable[str]) -> str:
    return f"Literal[{', '.join(json.dumps(word) for word in words)}]"


def alternatives(schema: Schema) -> Iterator[Schema]:
    """What a value may be, alternatives of alternatives included."""
    for each in schema.get("anyOf", ()):
        yield from alternatives(each) if "anyOf" in each else (each,)


def camel(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def described(schema: Schema) -> str:
    """The description, or those of its alternatives."""
    told = [schema.get("description", ""), *(described(each) for each in schema.get("anyOf", ()))]
    return "; or ".join(each for each in dict.fromkeys(told) if each)


def wrapped(words: str, wide: int) -> list[str]:
    return textwrap.wrap(words, wide, break_long_words=False, break_on_hyphens=False)


def docstring(words: str, indent: str) -> str:
    words = words.replace("\\", "\\\\").replace('"""', "'''")
    lines = wrapped(words, WIDE - len(indent) - 3)
    end = " " if lines[-1].endswith('"') else ""
    return f'{indent}"""' + f"\n{indent}".join(lines) + f'{end}"""\n'


def written(
    title: str, told: str, fields: dict[str, tuple[str, str]], base: str = "TypedDict", is_total: bool = False
) -> str:
    """A class."""
    if not any(keyword.iskeyword(name) for name in fields):
        head = f"class {title}({base}{'' if is_total else ', total=False'}):\n{docstring(told, '    ')}"
        return head + "".join(
            f"\n    {name}: {found}\n{docstring(words, '    ') if words else ''}"
            for name, (found, words) in fields.items()
        )
    # a key that is a word of Python's
    notes = "".join(
        f"    # {line}\n" if place == 0 else f"    #   {line}\n"
        for name, (_, words) in fields.items()
        for place, line in enumerate(wrapped(f"{name}: {words}", WIDE - 8))
    )
    pairs = "".join(f"        {json.dumps(name)}: {found},\n" for name, (found, _) in fields.items())
    about = "".join(f"#: {line}\n" for line in wrapped(told, WIDE - 3))
    return f"{about}{title} = TypedDict(\n    {json.dumps(title)},\n{notes}    {{\n{pairs}    }},\n    total={is_total},\n)\n"


if __name__ == "__main__":
    FILE.write_text(text(json.loads(_lynkeus.schema())), encoding="utf-8")
