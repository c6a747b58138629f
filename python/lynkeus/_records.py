"""Objects of reports: dictionaries whose entries are attributes as well, of the types that are declared."""

from __future__ import annotations

from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

from .errors import near

if TYPE_CHECKING:
    from _collections_abc import dict_items, dict_values

_Entry = TypeVar("_Entry")


class Record(dict[str, Any]):
    """An object of a report: its entries are attributes as well.

    What a class of :mod:`lynkeus.reports` declares is checked by type checkers where it is read as an
    attribute; an entry that may be ``None`` is ``None`` where the report leaves it out.
    """

    #: entries whose names no attribute can have
    _ITEMS: ClassVar[dict[str, Any]] = {}

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            try:
                return self[name]
            except KeyError:
                pass
            if may_be_none(entries_of(type(self)).get(name)):
                return None
            raise AttributeError(f"no entry {name!r}{near(name, self)}: there are {', '.join(self)}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(k for k in self if k.isidentifier())]


class Named(Record, Generic[_Entry]):
    """Entries of one kind by names of the plant: ``found["level"]``, and ``found.level`` where the name is a
    word of Python's and none of a dictionary's methods."""

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> _Entry: ...
        def __getitem__(self, key: str, /) -> _Entry: ...
        def values(self) -> dict_values[str, _Entry]: ...
        def items(self) -> dict_items[str, _Entry]: ...


@cache
def entries_of(kind: type[Record]) -> dict[str, Any]:
    """What a class declares of its entries: their types by their names."""
    hints = {name: hint for name, hint in get_type_hints(kind).items() if not name.startswith("_")}
    return hints | kind._ITEMS


def alternatives(hint: Any) -> tuple[Any, ...]:
    """What a union has, else the type itself."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def may_be_none(hint: Any) -> bool:
    """Whether a declared type has ``None``."""
    return type(None) in alternatives(hint)


def made(hint: Any, value: Any) -> Any:
    """What was read from JSON, as the classes that are declared for it."""
    if isinstance(value, list):
        items = next((get_args(each)[0] for each in alternatives(hint) if get_origin(each) is list), Any)
        return [made(items, each) for each in value]
    if not isinstance(value, dict):
        return value
    for each in alternatives(hint):
        if get_origin(each) is Named:
            return Named({name: made(get_args(each)[0], entry) for name, entry in value.items()})
        if isinstance(each, type) and issubclass(each, Record):
            known = entries_of(each)
            return each({name: made(known.get(name, Any), entry) for name, entry in value.items()})
    return Record({name: made(Any, entry) for name, entry in value.items()})
