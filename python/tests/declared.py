"""What JSON has beyond what is declared of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from lynkeus._records import Named, Record, alternatives, entries_of, may_be_none


def strangers(hint: Any, value: Any, path: str) -> Iterator[str]:
    """Places at which a value is not of its declared type, or has an entry that is not declared."""
    kinds = alternatives(hint)
    if value is None:
        if type(None) not in kinds:
            yield f"{path}: null, declared {hint}"
        return
    if isinstance(value, dict):
        yield from _object(hint, value, path)
    elif isinstance(value, list):
        items = [get_args(kind)[0] for kind in kinds if get_origin(kind) is list]
        if not items:
            yield f"{path}: a list, declared {hint}"
        for place, each in enumerate(value if items else []):
            yield from strangers(items[0], each, f"{path}[{place}]")
    elif not any(_is(kind, value) for kind in kinds):
        yield f"{path}: {value!r}, declared {hint}"


def _object(hint: Any, value: dict[str, Any], path: str) -> Iterator[str]:
    for kind in alternatives(hint):
        if get_origin(kind) is Named:
            for name, each in value.items():
                yield from strangers(get_args(kind)[0], each, f"{path}.{name}")
            return
        if isinstance(kind, type) and issubclass(kind, Record):
            known = entries_of(kind)
            for name, each in value.items():
                if name in known:
                    yield from strangers(known[name], each, f"{path}.{name}")
                else:
                    yield f"{path}.{name}: not declared by {kind.__name__}"
            if "refused" not in value:  # of a comparison: such a row has nothing else
                missing = [n for n in known if n not in value and not may_be_none(known[n])]
                yield from (f"{path}: no {name}, declared by {kind.__name__}" for name in missing)
            return
    yield f"{path}: an object, declared {hint}"


def _is(kind: Any, value: Any) -> bool:
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if kind is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    return type(value) is kind
