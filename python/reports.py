"""Writes ``lynkeus/reports.py`` from the JSON Schema of answers: what an entry holds is said once, in Rust.

    python python/reports.py

``python/tests/test_reports.py`` fails where the file is not what this makes.
"""

from __future__ import annotations

import json
import keyword
import re
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
FILE = HERE / "lynkeus" / "reports.py"
SCHEMA = HERE.parent / "docs" / "answers.schema.json"
WIDE = 110

HEAD = '''"""What reports hold: the entries of ``answer.summary`` and their types.

Every object is a dictionary whose entries are attributes as well: ``run.errors.level.peak`` and
``run.summary["errors"]["level"]["peak"]`` are the same number. Type checkers see the attributes. Numbers are
in the units of the model, times in its unit of time, from the same origin as the log's or simulation's;
what is not known is ``None``. Written by ``python/reports.py`` from the JSON Schema of answers.
"""

from __future__ import annotations

from typing import ClassVar, Literal, TypeAlias

from ._health import Health, Innovation, Revised, SensorHealth
from ._records import Named, Record

'''
RANGE = """#: a range, ``[smallest, largest]``; an end that is not declared is ``None``
Range: TypeAlias = list[float | None]
"""
#: what is imported
OTHERS = ("Health", "Innovation", "Named", "Range", "Record", "Revised", "SensorHealth")

#: what answers each report, and the class that has it as its summary
ANSWERS = {
    "CheckReport": ("Study.check`", "Check"),
    "HowWellReport": ("Study.how_well`", "HowWell"),
    "DesignReport": ("Study.design`", "Design"),
    "CertificateReport": ("Study.certify`", "Certificate"),
    "RunReport": ("Study.simulate` and :meth:`lynkeus.Study.estimate`", "Simulation` or :class:`lynkeus.Estimation"),
    "MonteCarloReport": ("Study.simulate` with ``runs``", "MonteCarlo"),
    "OpenRunReport": ("Study.simulate` with a log as ``inputs``", "OpenRun"),
    "SweepReport": ("Study.tune`", "Sweep"),
    "FitReport": ("Study.fit`", "Fit"),
    "ComparisonReport": ("Study.compare`", "Comparison"),
}
#: entries of which the answer itself makes more
APART = ("columns", "notes")
#: properties for entries whose names no attribute can have
PROPERTIES = {"from": "since", "keys": "values_of_keys"}
#: words that have a name
ALIASES = ("Verdict",)

Schema = dict[str, Any]


def text(schema: Schema) -> str:
    """The whole file."""
    return Writer(schema["$defs"]).text()


class Writer:
    """A file that grows by its classes, each below those that it names."""

    def __init__(self, schemas: dict[str, Schema]) -> None:
        self._schemas = schemas
        #: what stands for each schema; a class that is under way is known already, since it may hold itself
        self._kinds: dict[str, str] = {}
        self._parts: dict[str, str] = {"Range": RANGE}

    def text(self) -> str:
        """See :func:`text`."""
        for name in ANSWERS:
            self._named(name)
        names = "".join(f'    "{name}",\n' for name in sorted({*self._parts, *OTHERS}))
        parts = [part.rstrip() + "\n" for part in self._parts.values()]
        return HEAD + f"__all__ = [\n{names}]\n\n" + "\n\n".join(parts)

    def _named(self, name: str) -> str:
        """What stands for a schema that has a name."""
        if name in self._kinds:
            return self._kinds[name]
        schema = merged(self._schemas[name])
        if "properties" in schema:
            self._kinds[name] = name
            self._add(name, schema)
        else:
            self._kinds[name] = name if name in ALIASES else self._kind(schema)
        if name in ALIASES:
            note = f"#: {told(schema['description'])}\n"
            self._parts[name] = f"{note}{name}: TypeAlias = {self._kind(schema)}\n"
        return self._kinds[name]

    def _add(self, name: str, schema: Schema) -> None:
        keys = schema["properties"].items()
        fields = {key: (self._kind(each), told(each.get("description", ""))) for key, each in keys}
        if name not in ANSWERS:
            self._parts[name] = written(name, "Record", told(schema["description"]), fields)
            return
        study, answer = ANSWERS[name]
        entries = name.replace("Report", "Entries")
        own = {key: field for key, field in fields.items() if key in APART or is_item(key)}
        rest = {key: field for key, field in fields.items() if key not in own}
        self._parts[entries] = written(entries, "", f"What :meth:`lynkeus.{study} answers.", rest)
        about = f"The summary of a :class:`lynkeus.{answer}`."
        self._parts[name] = written(name, f"{entries}, Record", about, own, is_answer=True)

    def _kind(self, schema: Schema) -> str:
        """The type of a value."""
        if "$ref" in schema:
            return self._named(schema["$ref"].rpartition("/")[2])
        words = ["const" in one or "enum" in one for one in schema.get("oneOf", (schema,))]
        if all(words):
            return literal(
                word for one in schema.get("oneOf", (schema,)) for word in one.get("enum", [one.get("const")])
            )
        if "anyOf" in schema:
            return union(self._kind(one) for one in schema["anyOf"])
        if isinstance(schema["type"], list):
            return union(self._kind({**schema, "type": one}) for one in schema["type"])
        match schema["type"]:
            case "array":
                found = self._kind(schema["items"])
                return "Range" if (found, schema.get("maxItems")) == ("float | None", 2) else f"list[{found}]"
            case "object":
                return f"Named[{self._kind(schema['additionalProperties'])}]"
            case plain:
                return {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}[plain]


def merged(schema: Schema) -> Schema:
    """Alternatives of objects as one object, whose first entry says which of them it is."""
    variants = schema.get("oneOf", ())
    if not variants or not all("properties" in one for one in variants):
        return schema
    properties: dict[str, Schema] = {}
    for one in variants:
        for name, entry in one["properties"].items():
            known = properties.setdefault(name, {**entry, "enum": []} if "const" in entry else entry)
            if "const" in entry:
                known["enum"].append(entry["const"])
    for name, entry in properties.items():
        if not all(name in one["required"] for one in variants):
            properties[name] = {"anyOf": [entry, {"type": "null"}], "description": entry.get("description", "")}
    return {**schema, "properties": properties}


def is_item(name: str) -> bool:
    """Whether no attribute can have the name."""
    return keyword.iskeyword(name) or hasattr(dict, name)


def union(kinds: Iterable[str]) -> str:
    """Alternatives, none the last."""
    each = list(kinds)
    some = dict.fromkeys(kind.removesuffix(" | None") for kind in each if kind != "None")
    return " | ".join([*some, *(["None"] if any(kind.endswith("None") for kind in each) else [])])


def literal(words: Iterable[str]) -> str:
    return f"Literal[{', '.join(json.dumps(word) for word in words)}]"


def told(words: str) -> str:
    """Words of Rust's documentation as Python's."""
    words = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", words.replace("\n", " "))
    return re.sub(r"\b(none|null)(?= (where|in|of)\b)", "``None``", words)


def docstring(words: str, indent: str) -> str:
    lines = textwrap.wrap(words, WIDE - len(indent) - 3, break_long_words=False, break_on_hyphens=False)
    return f'{indent}"""' + f"\n{indent}".join(lines) + '"""\n'


def written(
    name: str, base: str, about: str, fields: dict[str, tuple[str, str]], is_answer: bool = False
) -> str:
    """A class."""
    lines = [f"class {name}{f'({base})' if base else ''}:\n", docstring(about, "    ")]
    plain = {key: field for key, field in fields.items() if not is_item(key)}
    items = {key: field for key, field in fields.items() if is_item(key)}
    if fields:
        lines.append("\n")
    for key, (kind, words) in plain.items():
        lines += [entry(key, kind), docstring(words, "    ") if words else ""]
    if items:
        kinds = ", ".join(f'"{key}": {kind}' for key, (kind, _) in items.items())
        lines.append(f"    _ITEMS: ClassVar = {{{kinds}}}\n")
    for key, (kind, words) in items.items():
        if not is_answer:
            lines += [f"\n    @property\n    def {PROPERTIES[key]}(self) -> {kind}:\n"]
            lines += [docstring(f"The entry ``{key}``: {words}.", "        ")]
            lines += [f'        found: {kind} = self["{key}"]\n        return found\n']
    return "".join(lines)


def entry(name: str, kind: str) -> str:
    """An annotation, over several lines where it is long."""
    line = f"    {name}: {kind}\n"
    if len(line) <= WIDE + 1:
        return line
    before, words, after = re.fullmatch(r"(.*Literal\[)(.*)(\].*)", kind).groups()  # type: ignore[union-attr]
    each = "".join(f"        {word},\n" for word in words.split(", "))
    return f"    {name}: {before}\n{each}    {after}\n"


if __name__ == "__main__":
    FILE.write_text(text(json.loads(SCHEMA.read_text(encoding="utf-8"))), encoding="utf-8")
